# SPDX-License-Identifier: Apache-2.0
"""Bounds for sums of squares, for tests of noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

Z = 3.3  # two-sided, about one false alarm in a thousand seeds


def chi_squared_band(dof: int) -> tuple[float, float]:
    """Return the two-sided band of a chi-square variable (Wilson and Hilferty, 1931)."""
    spread = 2.0 / (9.0 * dof)
    low, high = (dof * (1.0 - spread + z * math.sqrt(spread)) ** 3 for z in (-Z, Z))
    return low, high


def assert_standard_normal(values: ArrayLike) -> None:
    """Fail unless mean and mean square of many values fit independent standard normals."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    assert abs(flat.mean()) < Z / math.sqrt(flat.size)
    low, high = chi_squared_band(flat.size)
    assert low < np.sum(flat**2) < high
