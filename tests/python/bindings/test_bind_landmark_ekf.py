# SPDX-License-Identifier: Apache-2.0
"""LandmarkEkf from Python: what goes in and what comes out."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import locfuse.core as lf


def ekf_with(*known: lf.KnownLandmark) -> lf.LandmarkEkf:
    start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), 1e-4 * np.eye(3))
    config = lf.LandmarkEkfConfig()
    config.known = list(known)
    return lf.LandmarkEkf(config, lf.World(), start)


def test_landmarks_come_back_as_arrays() -> None:
    exact = lf.KnownLandmark(1, [3.0, 0.0])
    rough = lf.KnownLandmark(2, [0.0, 3.0], 0.04 * np.eye(2))
    ekf = ekf_with(exact, rough)
    one, two = ekf.landmarks()
    assert (one.id, two.id) == (1, 2)
    assert one.confirmed
    assert two.confirmed
    np.testing.assert_array_equal(one.covariance, np.zeros((2, 2)))
    np.testing.assert_array_equal(two.covariance, 0.04 * np.eye(2))
    np.testing.assert_array_equal(two.position, [0.0, 3.0])
    assert ekf.belief.dimension == 5
    assert rough.covariance is not None
    assert exact.covariance is None


def test_sightings_of_one_instant_have_an_outcome_each() -> None:
    ekf = ekf_with(lf.KnownLandmark(1, [3.0, 0.0]))
    outcomes = ekf.on_joint(
        [lf.RangeBearing(0, None, 3.0, 0.0), lf.RangeBearing(0, None, 2.0, 1.5)]
    )
    assert [outcome.verdict for outcome in outcomes] == [lf.Verdict.FUSED, lf.Verdict.FUSED]
    assert [landmark.id for landmark in ekf.landmarks()] == [1, -1]
    assert ekf.landmarks()[1].sightings == 1


def test_a_copy_is_a_snapshot() -> None:
    ekf = ekf_with()
    snapshot = copy.copy(ekf)
    ekf.on(lf.RangeBearing(0, 5, 2.0, 0.0))
    ekf.on(lf.Velocity(0, 1.0, 0.0))
    assert repr(snapshot) == "LandmarkEkf(at 0 ns, 0 landmarks)"
    assert repr(ekf) == "LandmarkEkf(at 0 ns, 1 landmarks)"
    assert ekf.estimate(500_000_000).pose.x == pytest.approx(0.5)


def test_mistakes_are_value_errors() -> None:
    config = lf.LandmarkEkfConfig()
    config.min_sightings = 0
    start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), np.eye(3))
    with pytest.raises(ValueError, match="min_sightings is 0, expected >= 1"):
        lf.LandmarkEkf(config, lf.World(), start)
    with pytest.raises(ValueError, match="one stamp"):
        ekf_with().on_joint(
            [lf.RangeBearing(0, None, 1.0, 0.0), lf.RangeBearing(1, None, 1.0, 0.0)]
        )
    with pytest.raises(ValueError, match="landmark 4 is given twice"):
        ekf_with(lf.KnownLandmark(4, [0.0, 1.0]), lf.KnownLandmark(4, [0.0, 2.0]))
