# SPDX-License-Identifier: Apache-2.0
"""Chi-square bands against tables and against draws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from locfuse.eval.consistency import band, share_in_band


@pytest.mark.parametrize(
    ("dof", "count", "low", "high"),
    [  # table of chi-square quantiles at 2.5 % and 97.5 %, divided by the count
        (1, 1, 0.000982, 5.024),
        (2, 1, 0.0506, 7.378),
        (3, 1, 0.216, 9.348),
        (1, 100, 0.7422, 1.2956),
        (2, 50, 1.4844, 2.5912),
    ],
)
def test_bands_are_those_of_the_tables(dof: int, count: int, low: float, high: float) -> None:
    assert band(dof, count) == pytest.approx((low, high), rel=2e-3)


@pytest.mark.parametrize("dof", [1, 2, 3])
@pytest.mark.parametrize("count", [1, 7, 100, 20_000])
def test_bands_are_the_quantiles_of_an_independent_library(dof: int, count: int) -> None:
    low, high = (float(chi2.ppf(p, dof * count)) / count for p in (0.025, 0.975))
    assert band(dof, count) == pytest.approx((low, high), rel=1e-9)


def test_the_band_holds_the_stated_share_of_consistent_means() -> None:
    rng = np.random.default_rng(12)
    means = rng.chisquare(3, (20_000, 10)).mean(axis=1)
    for probability in (0.5, 0.95):
        low, high = band(3, 10, probability)
        inside = np.mean((means >= low) & (means <= high))
        assert inside == pytest.approx(probability, abs=4.0 * math.sqrt(0.25 / 20_000))


def test_share_in_band_counts_and_tells_over_from_under_confidence() -> None:
    low, high = band(3)
    assert share_in_band(np.array([low, 1.0, high, high + 0.1]), 3) == 0.75
    honest = np.random.default_rng(1).chisquare(3, 5000)
    assert share_in_band(honest, 3) == pytest.approx(0.95, abs=0.015)
    assert share_in_band(9.0 * honest, 3) < 0.5
    assert share_in_band(honest / 100.0, 3) < 0.5
    assert math.isnan(share_in_band(np.empty(0), 3))


@pytest.mark.parametrize(
    ("dof", "count", "probability"), [(0, 1, 0.9), (1, 0, 0.9), (1, 1, 0.0), (1, 1, 1.0)]
)
def test_a_band_of_nothing_is_refused(dof: int, count: int, probability: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        band(dof, count, probability)
