# SPDX-License-Identifier: Apache-2.0
"""The maximum of a sum of log-likelihoods, and how well it is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FloatArray

# The log-likelihood of each measurement, shape (n,), at each of several points.
Likelihoods = Callable[[Sequence[FloatArray]], list[FloatArray]]

_ENOUGH = 0.01  # a step that gains less than this many nats is the last
_MAX_STEPS = 60
_HALVINGS = 7
_MIN_CURVATURE = 0.02  # of a direction, in units of the differences: flatter ones are not followed
_DAMPED = 0.2  # a curvature that falls by more falls step by step
_DIFFERENCE = 0.7  # nats by which a difference should change the sum, at most


@dataclass(frozen=True)
class Variable:
    """A number to find, in the coordinate that is maximized: a sigma in its logarithm.

    `step` is how far to look first, within `min_step` and `max_step`; a move of the maximum is at
    most `max_move` at once.
    """

    value: float
    step: float
    min_step: float
    max_step: float
    max_move: float
    low: float
    high: float


@dataclass(frozen=True)
class Maximum:
    """Where the sum is largest: `at` (k,), and minus its second derivatives there, (k, k)."""

    at: FloatArray
    value: float
    information: FloatArray


def maximize(
    likelihoods: Likelihoods, variables: Sequence[Variable], information: FloatArray | None = None
) -> Maximum:
    """Return the maximum near the variables' values, by quasi-Newton steps (BFGS).

    Derivatives are central differences. `information` is where it begins; None: by differences.
    """
    return _Climb(likelihoods, variables).run(information)


def covariance(
    likelihoods: Likelihoods,
    variables: Sequence[Variable],
    maximum: Maximum,
    block: NDArray[np.intp],
    *,
    anew: bool,
) -> FloatArray:
    """Return the covariance of what was found, (k, k): the sandwich, or the inverse if larger.

    `block` says to which stretch of time each measurement belongs, 0 to b - 1, shape (n,):
    derivatives of different stretches are independent, those within one need not be. With `anew`
    second derivatives are found again, else they are those of the steps that led to the maximum.

    Source: Huber, The Behavior of Maximum Likelihood Estimates under Nonstandard Conditions, 1967.
    """
    climb = _Climb(likelihoods, variables)
    climb.x = maximum.at
    climb.fit_steps(maximum.information)
    information = climb.second_derivatives() if anew else maximum.information
    scores = climb.derivatives().scores
    blocks = int(block.max()) + 1
    sums = np.array([np.bincount(block, row, blocks) for row in scores])
    inverse = np.linalg.inv(positive(information, climb.h))
    between = blocks / max(blocks - 1, 1) * inverse @ (sums @ sums.T) @ inverse
    larger = np.maximum(1.0, np.sqrt(np.diag(between) / np.diag(inverse)))
    return np.asarray(inverse * np.outer(larger, larger))


@dataclass(frozen=True)
class _Derivatives:
    gradient: FloatArray  # (k,)
    curvature: FloatArray  # minus the second derivatives, (k,)
    scores: FloatArray  # of each measurement, (k, n)


class _Climb:
    def __init__(self, likelihoods: Likelihoods, variables: Sequence[Variable]) -> None:
        self._likelihoods = likelihoods
        self._variables = variables
        self._low = np.array([v.low for v in variables])
        self._high = np.array([v.high for v in variables])
        self._move = np.array([v.max_move for v in variables])
        self.x = np.clip([v.value for v in variables], self._low, self._high)
        self.h = np.array([v.step for v in variables])
        self._value = -np.inf

    def run(self, information: FloatArray | None) -> Maximum:
        self._value = self._total(self.x)
        if not len(self.x):
            return Maximum(self.x, self._value, np.zeros((0, 0)))
        if information is None:
            information = self.second_derivatives()
        else:
            self.fit_steps(information)
        is_fresh = True
        here = self.derivatives()
        for _ in range(_MAX_STEPS):
            information = positive(information, self.h)
            step = np.asarray(np.linalg.solve(information, here.gradient))
            alone = here.gradient**2 / _curved(here.curvature, self.h)
            if 0.5 * max(float(here.gradient @ step), float(alone.max())) < _ENOUGH:
                break
            before, moved = self.x, self._move_by(step)
            if moved < _ENOUGH and is_fresh:
                break
            is_fresh = moved < _ENOUGH
            if is_fresh:
                information = self.second_derivatives()
            there = self.derivatives()
            if not is_fresh:
                information = _updated(information, self.x - before,
                                       here.gradient - there.gradient)  # fmt: skip
            here = there
        return Maximum(self.x, self._value, information)

    def derivatives(self) -> _Derivatives:
        ends = self._likelihoods([self.x + sign * step for step in np.diag(self.h)
                                  for sign in (1.0, -1.0)])  # fmt: skip
        plus, minus = np.array(ends[::2]), np.array(ends[1::2])
        scores = (plus - minus) / (2.0 * self.h[:, None])
        curvature = (2.0 * self._total(self.x) - plus.sum(axis=1) - minus.sum(axis=1)) / self.h**2
        return _Derivatives(scores.sum(axis=1), curvature, scores)

    def fit_steps(self, information: FloatArray) -> None:
        """Choose differences large enough to be seen, and small enough to be derivatives."""
        curved = np.maximum(np.diag(information), 1e-12)
        least, most = (np.array([getattr(v, name) for v in self._variables])
                       for name in ("min_step", "max_step"))  # fmt: skip
        self.h = np.clip(np.sqrt(2.0 * _DIFFERENCE / curved), least, most)

    def _total(self, x: FloatArray) -> float:
        return float(self._likelihoods([x])[0].sum())

    def second_derivatives(self) -> FloatArray:
        """Return minus their matrix, by differences."""
        self._value = self._total(self.x)
        self.fit_steps(np.diag(self.derivatives().curvature))
        here = self.derivatives()
        count = len(self.x)
        pairs = [(i, j) for i in range(count) for j in range(i)]
        steps = np.diag(self.h)
        points = [self.x + sign * (steps[i] + steps[j]) for i, j in pairs for sign in (1.0, -1.0)]
        totals = [float(one.sum()) for one in self._likelihoods(points)]
        information = np.diag(here.curvature)
        for place, (i, j) in enumerate(pairs):
            along = 2.0 * self._value - totals[2 * place] - totals[2 * place + 1]
            own = here.curvature[i] * self.h[i] ** 2 + here.curvature[j] * self.h[j] ** 2
            information[i, j] = information[j, i] = (along - own) / (2.0 * self.h[i] * self.h[j])
        return information

    def _move_by(self, step: FloatArray) -> float:
        """Move uphill, along a step or a part of it; return by how much the sum has grown."""
        step = step * min(1.0, float(np.min(self._move / np.maximum(np.abs(step), 1e-300))))
        points = [np.clip(self.x + step / 2.0**k, self._low, self._high) for k in range(_HALVINGS)]
        for point in points:
            value = self._total(point)
            if value > self._value:
                gained = value - self._value
                self.x, self._value = point, value
                return gained
        return 0.0


def _curved(curvature: FloatArray, step: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(np.abs(curvature), _MIN_CURVATURE / step**2))


def positive(information: FloatArray, step: FloatArray | None = None) -> FloatArray:
    """Return the matrix without directions that are flat or bend upwards, in units of a step."""
    step = np.ones(len(information)) if step is None else step
    values, vectors = np.linalg.eigh(information * np.outer(step, step))
    raised = (vectors * np.maximum(np.abs(values), _MIN_CURVATURE)) @ vectors.T
    return np.asarray(raised / np.outer(step, step))


def _updated(information: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """Return the update of Broyden, Fletcher, Goldfarb and Shanno, damped as by Powell (1978)."""
    along = information @ step
    expected = float(step @ along)
    if expected <= 1e-12:
        return information
    curved = float(step @ change)
    if curved < _DAMPED * expected:
        share = (1.0 - _DAMPED) * expected / (expected - curved)
        change = share * change + (1.0 - share) * along
        curved = _DAMPED * expected
    return np.asarray(information + np.outer(change, change) / curved
                      - np.outer(along, along) / float(step @ along))  # fmt: skip
