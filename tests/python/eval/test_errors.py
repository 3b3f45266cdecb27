# SPDX-License-Identifier: Apache-2.0
"""Errors: truth interpolated where it is known and nowhere else, angles along the shorter arc."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from locfuse.eval.errors import errors_against, interpolate
from locfuse.types import NANOSECONDS, Trajectory, wrap_angle
from support_results import EPOCH_NS, make_result


def _track(seconds: list[float], x: list[float]) -> Trajectory:
    stamps = EPOCH_NS + np.round(np.array(seconds) * NANOSECONDS).astype(np.int64)
    return Trajectory(stamps, np.column_stack([x, np.zeros(len(x))]))


def test_truth_is_interpolated_along_the_shorter_arc_across_the_cut() -> None:
    stamps = np.array([0, 10], dtype=np.int64) + EPOCH_NS
    truth = Trajectory(stamps, np.array([[0.0, 0.0], [1.0, -2.0]]), np.radians([170.0, -170.0]))

    at, inside = interpolate(truth, np.array([EPOCH_NS + 4, EPOCH_NS + 5]))

    assert inside.all()
    assert at.position == pytest.approx(np.array([[0.4, -0.8], [0.5, -1.0]]))
    assert at.heading is not None
    assert np.degrees(at.heading) == pytest.approx([178.0, -180.0])


def test_single_nanoseconds_count_in_stamps_since_1970() -> None:
    stamps = np.array([EPOCH_NS, EPOCH_NS + 4])
    at, _ = interpolate(Trajectory(stamps, np.array([[0.0, 0.0], [4.0, 0.0]])), stamps[0] + [1, 3])
    assert at.position[:, 0].tolist() == [1.0, 3.0]


def test_estimates_outside_truth_are_left_out_and_not_extrapolated() -> None:
    result = make_result(n=100)
    assert result.truth is not None
    truth = Trajectory(result.truth.stamp_ns[20:60], result.truth.position[20:60])

    errors = errors_against(result.estimate, truth)

    assert errors.row.tolist() == list(range(20, 60))
    assert np.array_equal(errors.stamp_ns, result.estimate.stamp_ns[20:60])
    assert np.abs(errors.position).max() < 0.081


def test_nothing_is_interpolated_over_a_long_gap_but_its_ends_are_compared() -> None:
    truth = _track([0.0, 1.0, 3.5, 5.5], [0.0, 1.0, 3.5, 5.5])
    stamps = _track([0.5, 1.0, 1.1, 3.4, 3.5, 4.5], [0.0] * 6).stamp_ns

    at, inside = interpolate(truth, stamps)

    assert inside.tolist() == [True, True, False, False, True, True]
    assert at.position[:, 0] == pytest.approx([0.5, 1.0, 3.5, 4.5])
    assert interpolate(truth, stamps, longest_gap_s=2.5)[1].all()


def test_interpolation_of_an_empty_track_is_refused() -> None:
    with pytest.raises(ValueError, match="track is empty"):
        interpolate(_track([], []), np.array([EPOCH_NS]))


def test_error_is_estimate_minus_truth_at_its_stamp() -> None:
    result = make_result(error=(0.05, -0.08, 0.02), sigma=(0.1, 0.2, 0.05))
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)

    assert len(errors) == 200
    assert errors.position == pytest.approx(np.tile([0.05, -0.08], (200, 1)))
    assert errors.heading == pytest.approx(np.full(200, 0.02))
    assert errors.sigma == pytest.approx(np.tile([0.1, 0.2, 0.05], (200, 1)))


def test_nees_weighs_the_error_with_the_whole_covariance() -> None:
    result = make_result(n=1, error=(0.3, -0.1, 0.2))
    assert result.truth is not None
    P = np.array([[0.04, 0.03, 0.01], [0.03, 0.09, -0.02], [0.01, -0.02, 0.05]])
    estimate = replace(result.estimate, covariance=P[np.newaxis])
    errors = errors_against(estimate, result.truth)
    e = np.array([0.3, -0.1, 0.2])

    assert errors.dof == 3
    assert errors.nees == pytest.approx([e @ np.linalg.inv(P) @ e])

    planar = errors_against(estimate, replace(result.truth, heading=None))
    assert planar.dof == 2
    assert planar.heading is None
    assert planar.nees == pytest.approx([e[:2] @ np.linalg.inv(P[:2, :2]) @ e[:2]])


def test_without_covariance_there_is_neither_sigma_nor_nees() -> None:
    result = make_result(n=5)
    assert result.truth is not None
    errors = errors_against(replace(result.estimate, covariance=None), result.truth)
    assert errors.sigma is None
    assert errors.nees is None
    assert len(errors) == 5


def test_without_overlap_in_time_the_errors_are_empty() -> None:
    result = make_result(n=5)
    assert result.truth is not None
    later = replace(result.truth, stamp_ns=result.truth.stamp_ns + 3600 * NANOSECONDS)
    errors = errors_against(result.estimate, later)
    assert len(errors) == 0
    assert errors.nees is not None
    assert len(errors.nees) == 0


def test_heading_errors_are_wrapped() -> None:
    stamps = np.array([EPOCH_NS])
    at = np.zeros((1, 2))
    errors = errors_against(
        Trajectory(stamps, at, np.radians([-179.0])), Trajectory(stamps, at, np.radians([179.0]))
    )
    assert errors.heading is not None
    assert np.degrees(errors.heading) == pytest.approx([2.0])


def test_wrapped_angles_are_never_pi() -> None:
    below = np.nextafter(-np.pi, -4.0)
    angles = wrap_angle(np.array([np.pi, -np.pi, below, 3.0 * np.pi, 7.0, -1e-17]))
    assert (angles >= -np.pi).all()
    assert (angles < np.pi).all()
    assert angles[[0, 1, 4]] == pytest.approx([-np.pi, -np.pi, 7.0 - 2.0 * np.pi])
