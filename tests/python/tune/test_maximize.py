# SPDX-License-Identifier: Apache-2.0
"""Maxima of likelihoods that are known exactly, and their covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from locfuse.tune.maximize import Likelihoods, Variable, covariance, maximize
from locfuse.types import FloatArray

FREE = Variable(0.0, 0.1, 1e-3, 1.0, 1.0, -50.0, 50.0)


def normal(samples: FloatArray) -> Likelihoods:
    """Return the log-likelihood of a mean and the logarithm of a sigma."""

    def at(point: FloatArray) -> FloatArray:
        mean, log_sigma = point.tolist()
        z = (samples - mean) / np.exp(log_sigma)
        return np.asarray(-0.5 * z**2 - log_sigma)

    return lambda points: [at(point) for point in points]


def test_mean_and_sigma_of_a_sample_are_found_with_their_covariance() -> None:
    samples = np.random.default_rng(1).normal(3.0, 0.02, 4000)
    variables = [Variable(1.0, 0.1, 1e-4, 1.0, 5.0, -50.0, 50.0), FREE]
    found = maximize(normal(samples), variables)
    assert found.at == pytest.approx([samples.mean(), np.log(samples.std())], abs=1e-3)
    assert found.value == pytest.approx(normal(samples)([found.at])[0].sum())
    block = np.arange(len(samples)) // 40
    P = covariance(normal(samples), variables, found, block, anew=True)
    exact = np.array([samples.std() ** 2 / len(samples), 0.5 / len(samples)])
    # Not below the exact one, and of 100 independent stretches 1.5 times it at most.
    assert np.all(np.diag(P) > 0.95 * exact)
    assert np.all(np.diag(P) < 1.7 * exact)


def test_errors_that_repeat_widen_the_covariance_as_often_as_they_do() -> None:
    once = np.random.default_rng(2).normal(0.0, 1.0, 500)
    samples = np.repeat(once, 16)
    found = maximize(normal(samples), [FREE, FREE])
    block = np.repeat(np.arange(100), 5 * 16)
    P = covariance(normal(samples), [FREE, FREE], found, block, anew=True)
    assert P[0, 0] == pytest.approx(samples.var() / len(once), rel=0.4)
    assert P[0, 0] > 8.0 * samples.var() / len(samples)


def test_a_crossed_valley_is_climbed() -> None:
    turn = np.array([[1.0, 0.99], [0.0, 0.14]])

    def valley(points: Sequence[FloatArray]) -> list[FloatArray]:
        return [-0.5e4 * (turn @ (point - [2.0, -3.0])) ** 2 for point in points]

    found = maximize(valley, [FREE, FREE])
    assert found.at == pytest.approx([2.0, -3.0], abs=0.05)
    assert found.value > -0.05


def test_bounds_are_kept() -> None:
    def up(points: Sequence[FloatArray]) -> list[FloatArray]:
        return [10.0 * point for point in points]

    found = maximize(up, [Variable(0.0, 0.1, 1e-3, 1.0, 1.0, -2.0, 1.5)])
    assert found.at[0] == 1.5


def test_nothing_to_find_has_a_value() -> None:
    found = maximize(lambda points: [np.array([-1.0, -2.0]) for _ in points], [])
    assert found.value == -3.0
    assert found.at.shape == (0,)
