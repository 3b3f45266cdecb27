# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals: closed forms, and how often they hold what they should."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from locfuse.eval.intervals import mean_interval, median_interval, share_interval


@pytest.mark.parametrize(("count", "of"), [(0, 1), (1, 1), (0, 20), (3, 20), (20, 20), (417, 1000)])
def test_the_interval_of_a_share_is_that_of_clopper_and_pearson(count: int, of: int) -> None:
    exact = stats.binomtest(count, of).proportion_ci(0.95, method="exact")
    assert share_interval(count, of) == pytest.approx((exact.low, exact.high), abs=1e-9)


def test_a_share_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="1 of 0"):
        share_interval(1, 0)


def test_the_interval_of_a_median_holds_it_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    samples = rng.exponential(size=(2000, 25))
    inside = 0
    for sample in samples:
        interval = median_interval(sample)
        assert interval is not None
        inside += interval[0] <= np.log(2.0) <= interval[1]
    # Of 25 values, the exact interval from the 8th to the 18th holds it with 95.7 %.
    assert 0.945 < inside / len(samples) < 0.97


def test_five_values_are_too_few_for_the_interval_of_a_median_and_six_are_enough() -> None:
    assert median_interval(np.arange(5.0)) is None
    assert median_interval(np.arange(6.0)) == (0.0, 5.0)


def test_the_interval_of_a_mean_holds_it_about_as_often_as_it_says() -> None:
    samples = np.random.default_rng(6).exponential(size=(300, 60))
    found = np.array([mean_interval(sample) for sample in samples])
    inside = np.mean((found[:, 0] <= 1.0) & (found[:, 1] >= 1.0))
    # The percentile bootstrap is a little short on skewed samples: 93 % here.
    assert 0.88 < inside < 0.97


def test_equal_values_give_equal_intervals() -> None:
    values = np.random.default_rng(7).normal(size=50)
    assert mean_interval(values) == mean_interval(values.copy())
    assert mean_interval(values) != mean_interval(values, seed=1)


def test_no_values_have_no_mean() -> None:
    with pytest.raises(ValueError, match="at least one"):
        mean_interval(np.empty(0))
