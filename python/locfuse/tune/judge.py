# SPDX-License-Identifier: Apache-2.0
"""Which of the values found are observed in the recordings, and which are left as they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from locfuse.tune.problem import Found, Problem
from locfuse.tune.quantity import NOTHING, Quantity
from locfuse.tune.systematic import least_sigmas

Word = Literal["found", "fits", "at most", "not observed"]

_VAGUE = math.log(1.65)  # half of an interval of a sigma's logarithm: wider ones tell nothing
_DROP = 1.92  # of the log-likelihood at the ends of a 95 % interval
_DROP_ONE_SIDED = 1.35
_BISECTIONS = 5
# The likelihood of a latency or a scale has ripples of some nats, as noise of wheels and of
# measurements is paired anew: less is no evidence.
_RIPPLE = 6.0


@dataclass(frozen=True)
class Judged:
    """What a recording says of a quantity: `value`, and its 95 % interval from `low` to `high`.

    ``found``; ``fits``: the value of the configuration is in a narrow interval, and stays;
    ``at most``: it may be 0, and the configuration's is too large; ``not observed``: it stays.
    """

    quantity: Quantity
    word: Word
    value: float
    low: float
    high: float

    @property
    def changes(self) -> bool:
        """Whether the configuration gets another value."""
        return self.word in ("found", "at most")


def judged(problem: Problem, found: Found) -> list[Judged]:
    """Judge quantities one after another, those that are known least first; others find anew."""
    answers: dict[str, Judged] = {}
    sure: set[str] = set()  # the configuration's value is refuted
    least: dict[str, float] = {}  # half of the interval by what the configuration's value costs
    is_last = False
    while True:
        half = _half_widths(problem, found, anew=is_last)
        fits = [i for i, q in enumerate(found.quantities) if not q.is_sigma
                and abs(found.maximum.at[i] - q.now) <= half[i]]  # fmt: skip
        half = [math.inf if q.is_sigma and problem.may_vanish(found, i, _DROP) else width
                for i, (q, width) in enumerate(zip(found.quantities, half, strict=True))
                ]  # fmt: skip
        unsure = [i for i, q in enumerate(found.quantities) if not q.is_sigma and i not in fits
                  and q.key not in sure]  # fmt: skip
        vague = [i for i, q in enumerate(found.quantities) if q.is_sigma and half[i] > _VAGUE
                 and q.key not in sure]  # fmt: skip
        if fits:
            for i in fits:
                q = found.quantities[i]
                word: Word = "fits" if half[i] <= q.wide else "not observed"
                answers[q.key] = _answer(found, i, half[i], word)
            found = _without(problem, found, fits, {})
        elif unsure:
            i = unsure[0]
            q = found.quantities[i]
            without = _without(problem, found, [i], {})
            gain = found.value - without.value
            off = abs(float(found.maximum.at[i]) - q.now)
            least[q.key] = problem.student * off / math.sqrt(2.0 * max(gain, 0.1))
            if gain < _RIPPLE:
                half_width = max(half[i], off)
                word = "fits" if half_width <= q.wide else "not observed"
                answers[q.key] = _answer(found, i, half_width, word)
                found = without
                continue
            del problem.fixed[q.key]
            sure.add(q.key)
        elif vague:
            i = max(vague, key=lambda i: half[i])
            q = found.quantities[i]
            without = _without(problem, found, [i], {})
            if found.value - without.value < _DROP:
                answers[q.key] = _answer(found, i, half[i], "not observed")
                found = without
                continue
            del problem.fixed[q.key]
            most = _at_most(problem, found, i)
            if most is None:
                sure.add(q.key)
                continue
            answers[q.key] = Judged(q, "at most", most, 0.0, most)
            # Others are judged with the likeliest value: its end would take their part.
            found = _without(problem, found, [i], found.values)
        elif is_last:
            break
        else:
            is_last = True
    for i, q in enumerate(found.quantities):
        answers[q.key] = _answer(found, i, max(half[i], least.get(q.key, 0.0)), "found")
    return sorted(answers.values(), key=lambda a: a.quantity.key)


def _half_widths(problem: Problem, found: Found, *, anew: bool = False) -> list[float]:
    if not found.quantities:
        return []
    sigma = np.sqrt(np.diag(problem.covariance(found, anew=anew)))
    least = least_sigmas(problem, found)
    return [float(np.hypot(s, least.get(q.key, 0.0))) * problem.student
            for q, s in zip(found.quantities, sigma.tolist(), strict=True)]  # fmt: skip


def _answer(found: Found, i: int, half: float, word: Word) -> Judged:
    q, at = found.quantities[i], float(found.maximum.at[i])
    if math.isinf(half):
        low, high = 0.0, math.inf
    else:
        low, high = q.value(at - half), q.value(at + half)
    value = q.now if word in ("fits", "not observed") and q.is_sigma else q.value(at)
    return Judged(q, word, value, low, high)


def _without(
    problem: Problem, found: Found, left: Sequence[int], values: dict[str, float]
) -> Found:
    """Fix some quantities, at the values given or as they are now, and find the others anew."""
    for i in left:
        q = found.quantities[i]
        problem.fixed[q.key] = values.get(q.key, q.now)
    rest = [i for i in range(len(found.quantities)) if i not in left]
    return problem.find([found.quantities[i] for i in rest], found.values,
                        found.information[np.ix_(rest, rest)])  # fmt: skip


def _at_most(problem: Problem, found: Found, i: int) -> float | None:
    """Return how large a sigma may be that may as well be 0; None where it may not."""
    q = found.quantities[i]
    zero = _without(problem, found, [i], {q.key: NOTHING})
    if found.value - zero.value > _DROP:
        del problem.fixed[q.key]
        return None
    low, high = q.coordinate(max(found.values[q.key], 1e-3 * q.now)), q.coordinate(q.now)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        there = _without(problem, found, [i], {q.key: q.value(middle)})
        if max(found.value, zero.value) - there.value < _DROP_ONE_SIDED:
            low = middle
        else:
            high = middle
    del problem.fixed[q.key]
    return q.value(low)
