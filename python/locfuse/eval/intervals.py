# SPDX-License-Identifier: Apache-2.0
"""95 % confidence intervals of a mean, a median and a share, from independent samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from locfuse.eval.consistency import PROBABILITY
from locfuse.types import FloatArray

RESAMPLES = 2000
_CHUNK = 2**22  # numbers of resamples in memory at once


def mean_interval(values: FloatArray, seed: int = 0) -> tuple[float, float]:
    """Return the interval of a mean by the percentile bootstrap.

    The same values give the same interval: resamples are drawn by a seed (B. Efron and R. J.
    Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13).

    `values` have shape (n,), n >= 1.

    Examples
    --------
    >>> low, high = mean_interval(np.arange(100.0))
    >>> round(low), round(high)
    (44, 55)
    """
    n = len(values)
    if n == 0:
        raise ValueError("no values; expected at least one")
    rng = np.random.default_rng(seed)
    rows = max(_CHUNK // n, 1)
    means = [
        values[rng.integers(n, size=(min(rows, RESAMPLES - done), n))].mean(axis=1)
        for done in range(0, RESAMPLES, rows)
    ]
    low, high = np.quantile(np.concatenate(means), [_TAIL, 1.0 - _TAIL])
    return float(low), float(high)


def median_interval(values: FloatArray) -> tuple[float, float] | None:
    """Return the exact interval of a median, whatever the distribution: two of the values.

    None for fewer than six values, the smallest and largest of which hold it with less than 95 %.

    `values` have shape (n,).

    Examples
    --------
    >>> median_interval(np.arange(1.0, 101.0))
    (40.0, 61.0)
    """
    n = len(values)
    below = _binomial_cdf(n, 0.5)
    k = int(np.searchsorted(below, _TAIL, side="right"))  # so many may lie outside at each end
    if k == 0:
        return None
    ordered = np.sort(values)
    return float(ordered[k - 1]), float(ordered[n - k])


def share_interval(count: int, of: int) -> tuple[float, float]:
    """Return the exact interval of a share (C. J. Clopper and E. S. Pearson, 1934).

    Examples
    --------
    >>> low, high = share_interval(0, 100)
    >>> low, round(high, 4)
    (0.0, 0.0362)
    """
    if not 0 <= count <= of or of == 0:
        raise ValueError(f"{count} of {of}; expected 0 <= count <= of and of >= 1")
    low = 0.0 if count == 0 else _where(lambda p: 1.0 - _binomial_cdf(of, p)[count - 1] > _TAIL)
    high = 1.0 if count == of else _where(lambda p: _binomial_cdf(of, p)[count] < _TAIL)
    return low, high


_TAIL = (1.0 - PROBABILITY) / 2.0


def _where(true_from: Callable[[float], bool]) -> float:
    """Return the smallest probability for which a condition holds, to 1e-12."""
    low, high = 0.0, 1.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if true_from(middle) else (middle, high)
    return 0.5 * (low + high)


def _binomial_cdf(n: int, p: float) -> FloatArray:
    """Return P(X <= k) for k = 0 to n."""
    k = np.arange(n + 1)
    factorial = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, n + 1)))])
    choose = factorial[n] - factorial - factorial[::-1]
    with np.errstate(divide="ignore"):
        log = choose + k * np.log(p) + (n - k) * np.log1p(-p)
    return np.asarray(np.minimum(np.cumsum(np.exp(log)), 1.0))
