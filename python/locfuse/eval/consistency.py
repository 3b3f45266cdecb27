# SPDX-License-Identifier: Apache-2.0
"""Whether errors are as large as the estimator says: chi-square bands for NEES and NIS."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray

PROBABILITY = 0.95


def band(dof: int, count: int = 1, probability: float = PROBABILITY) -> tuple[float, float]:
    """Return the two-sided band of the mean of `count` independent chi-square values.

    The sum of N values of n degrees of freedom has N n of them (Bar-Shalom, Li and Kirubarajan,
    2001, section 5.4.2).

    Each has `dof` degrees of freedom; `probability` is that a consistent mean lies inside. Raises
    ValueError if `dof` or `count` is below 1, or `probability` not inside (0, 1).

    Examples
    --------
    >>> [round(limit, 2) for limit in band(3, 100)]
    [2.54, 3.5]
    """
    if dof < 1 or count < 1:
        raise ValueError(f"dof is {dof} and count {count}, expected at least 1")
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability is {probability}, expected 0 < probability < 1")
    tail = (1.0 - probability) / 2.0
    low, high = (_core.chi_squared_quantile(dof * count, p) for p in (tail, 1.0 - tail))
    return low / count, high / count


def share_in_band(values: FloatArray, dof: int) -> float:
    """Return the share of single values inside their two-sided band; NaN if there are none."""
    if len(values) == 0:
        return float("nan")
    low, high = band(dof)
    return float(np.mean((values >= low) & (values <= high)))
