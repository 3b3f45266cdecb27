# SPDX-License-Identifier: Apache-2.0
"""Scores of an estimate with its covariance: by hand, and of errors drawn from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from locfuse.eval.errors import errors_against
from locfuse.eval.scores import (
    LEVELS,
    aligned_rmse,
    coverage,
    negative_log_likelihood,
    recovery,
    relative_errors,
)
from locfuse.types import NANOSECONDS, FloatArray, Trajectory

COVARIANCE = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.002], [0.0, 0.002, 0.0025]])


def straight(seconds: int, rate_hz: int = 10) -> Trajectory:
    """Return a drive of 1 m/s to the east."""
    n = seconds * rate_hz + 1
    stamp_ns = np.arange(n) * (NANOSECONDS // rate_hz)
    x = np.arange(n) / rate_hz
    return Trajectory(stamp_ns, np.column_stack([x, np.zeros(n)]), np.zeros(n))


def estimated(truth: Trajectory, error: FloatArray, covariance: FloatArray) -> Trajectory:
    """Return truth with errors of (x, y, heading), shape (n, 3)."""
    assert truth.heading is not None
    return Trajectory(truth.stamp_ns, truth.position + error[:, :2], truth.heading + error[:, 2],
                      np.broadcast_to(covariance, (len(truth), 3, 3)).copy())  # fmt: skip


def drawn(seconds: int, factor: float = 1.0) -> tuple[Trajectory, Trajectory]:
    """Return truth, and an estimate whose covariance is `factor` squared times the true one."""
    truth = straight(seconds)
    error = np.random.default_rng(3).multivariate_normal(np.zeros(3), COVARIANCE, len(truth))
    return truth, estimated(truth, error, factor**2 * COVARIANCE)


def test_the_likelihood_is_that_of_a_gaussian() -> None:
    truth, estimate = drawn(2)
    errors = errors_against(estimate, truth)
    assert errors.heading is not None
    rows = np.column_stack([errors.position, errors.heading])
    expected = -stats.multivariate_normal(cov=COVARIANCE).logpdf(rows)
    assert negative_log_likelihood(estimate, errors) == pytest.approx(expected)


def test_the_likelihood_is_best_where_the_covariance_is_true() -> None:
    means = []
    for factor in (0.5, 1.0, 2.0):
        truth, estimate = drawn(200, factor)
        value = negative_log_likelihood(estimate, errors_against(estimate, truth))
        means.append(float(value.mean()))
    assert means[1] < means[0]
    assert means[1] < means[2]


def test_the_likelihood_needs_a_covariance() -> None:
    truth, estimate = drawn(1)
    bare = replace(estimate, covariance=None)
    with pytest.raises(ValueError, match="no covariance"):
        negative_log_likelihood(bare, errors_against(bare, truth))


def test_errors_drawn_from_the_covariance_are_covered_as_it_says() -> None:
    truth, estimate = drawn(1000)
    found = coverage(errors_against(estimate, truth))
    assert found == pytest.approx(LEVELS, abs=0.02)


@pytest.mark.parametrize(("factor", "too"), [(0.7, -1), (1.4, 1)])
def test_a_covariance_that_is_wrong_is_seen_in_the_coverage(factor: float, too: int) -> None:
    truth, estimate = drawn(1000, factor)
    difference = coverage(errors_against(estimate, truth)) - np.array(LEVELS)
    assert np.all(too * difference[:-1] > 0.02)


def test_what_a_rigid_motion_mends_is_no_absolute_trajectory_error() -> None:
    truth = straight(10)
    turned = np.deg2rad(30.0)
    c, s = np.cos(turned), np.sin(turned)
    moved = Trajectory(truth.stamp_ns, truth.position @ np.array([[c, s], [-s, c]]) + [3.0, -2.0],
                       truth.heading)  # fmt: skip
    assert aligned_rmse(moved, truth) == pytest.approx(0.0, abs=1e-12)
    longer = Trajectory(truth.stamp_ns, 1.1 * truth.position, truth.heading)
    # 0.1 x, less its mean: uniform over 1 m.
    assert aligned_rmse(longer, truth) == pytest.approx(1.0 / np.sqrt(12.0), rel=0.02)


def test_a_robot_that_stands_has_no_absolute_trajectory_error() -> None:
    truth = straight(1)
    standing = Trajectory(truth.stamp_ns, np.zeros_like(truth.position), truth.heading)
    assert aligned_rmse(standing, standing) is None


def test_relative_errors_are_of_one_second() -> None:
    truth = straight(10)
    longer = Trajectory(truth.stamp_ns, 1.1 * truth.position, truth.heading)
    errors = relative_errors(longer, truth)
    assert errors is not None
    assert len(errors) == 10
    assert errors.translation == pytest.approx(0.1)


def test_there_are_no_relative_errors_of_less_than_a_second() -> None:
    short = straight(1)
    part = Trajectory(short.stamp_ns[:5], short.position[:5], np.zeros(5))
    assert relative_errors(part, part) is None


def faulty(off: list[tuple[float, float]], covariance: FloatArray) -> tuple[Trajectory, Trajectory]:
    """Return truth of 20 s, and an estimate that is 1 m off from and until some seconds."""
    truth = straight(20)
    error = np.zeros((len(truth), 3))
    time_s = truth.stamp_ns / NANOSECONDS
    for begin, end in off:
        error[(time_s >= begin) & (time_s < end), 0] = 1.0
    return truth, estimated(truth, error, covariance)


def back(off: list[tuple[float, float]], ends_s: list[float], limit_m: float | None = None,
         sigma_m: float = 0.1) -> tuple[float | None, int]:  # fmt: skip
    truth, estimate = faulty(off, sigma_m**2 * np.eye(3))
    ends = [round(end * NANOSECONDS) for end in ends_s]
    return recovery(estimate, errors_against(estimate, truth), ends, limit_m)


def test_recovery_is_from_the_end_of_a_fault_until_the_error_is_back() -> None:
    assert back([(5.0, 9.0)], [7.0]) == (2.0, 0)
    assert back([(5.0, 6.5)], [7.0]) == (0.0, 0)


def test_a_moment_inside_is_no_recovery() -> None:
    assert back([(5.0, 9.0), (9.5, 12.0)], [7.0]) == (5.0, 0)


def test_the_longest_of_several_recoveries_counts_and_those_that_never_come() -> None:
    assert back([(2.0, 4.0), (8.0, 9.0)], [3.0, 8.5]) == (1.0, 0)
    assert back([(2.0, 4.0), (15.0, 99.0)], [3.0, 16.0]) == (1.0, 1)
    assert back([(15.0, 99.0)], [16.0]) == (None, 1)


def test_an_error_that_the_covariance_admits_needs_no_recovery_but_for_a_limit() -> None:
    assert back([(5.0, 9.0)], [7.0], sigma_m=1.0) == (0.0, 0)
    assert back([(5.0, 9.0)], [7.0], limit_m=0.5, sigma_m=1.0) == (2.0, 0)


def test_a_fault_that_ends_after_the_drive_does_not_count() -> None:
    assert back([(5.0, 9.0)], [30.0]) == (None, 0)
