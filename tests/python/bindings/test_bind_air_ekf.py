# SPDX-License-Identifier: Apache-2.0
"""AirEkf from Python: what it takes, what only it takes, and that it equals its models."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
import pytest

import locfuse.core as lf

SECOND = 1_000_000_000
BEACONS = lf.LandmarkMap([lf.Landmark(7, [4.0, 3.0], height=5.0)])
START = lf.PoseEstimate(0, lf.Pose2(0.0, 0.0, 0.0), np.diag([0.1, 0.1, 0.1]) ** 2)


def air_ekf(config: lf.AirEkfConfig | None = None) -> lf.AirEkf:
    anchors = lf.AnchorMap([lf.Anchor(1, [3.0, 0.0, 5.0]), lf.Anchor(2, [-4.0, 4.0, 0.0])])
    start = lf.AirEstimate(0, START.pose, 1.0, np.diag([0.1, 0.1, 0.1, 0.2]) ** 2)
    return lf.AirEkf(
        config or lf.AirEkfConfig(),
        lf.World(anchors, [lf.Tag(0, [0.0, 0.0, 0.0])], lf.LandmarkSensor(BEACONS)),
        start,
    )


def test_every_message_is_fused() -> None:
    ekf = air_ekf()
    messages = (
        lf.Range(SECOND, 0, 1, 5.0),
        lf.PositionFix(SECOND, [0.0, 0.0], np.eye(2)),
        lf.Altitude(SECOND, 1.2, 0.5),
        lf.PoseObservation(SECOND, lf.Pose2(0.0, 0.0, 0.0), np.eye(3)),
        lf.RangeBearing(SECOND, 7, range=6.4, bearing=0.64, elevation=0.67, sigma_elevation=0.1),
    )
    assert ekf.on(lf.Velocity(0, 0.1, 0.0), climb_rate=0.2).verdict == lf.Verdict.FUSED
    assert ekf.on(lf.Increment(0, SECOND, lf.Pose2(0.0, 0.0, 0.0)), 0.0).verdict == lf.Verdict.FUSED
    for message in messages:
        assert ekf.on(message).verdict == lf.Verdict.FUSED, message
    assert ekf.estimate().stamp == SECOND
    assert ekf.estimate().covariance.shape == (4, 4)
    assert "elevation=0.67" in repr(messages[-1])


def test_slots_have_names() -> None:
    config = lf.AirEkfConfig()
    assert air_ekf(config).belief.x.tolist() == [0.0, 0.0, 0.0, 1.0]
    config.motion = lf.AirMotion.CONSTANT_VELOCITY
    belief = air_ekf(config).belief
    sizes = [len(belief.mean([belief.slot(name)])) for name in ("height", "velocity", "climb")]
    assert sizes == [1, 2, 1]
    assert belief.x.tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def test_a_copy_is_a_snapshot() -> None:
    ekf = air_ekf()
    before = copy.copy(ekf)
    ekf.on(lf.Altitude(SECOND, 1.5, 0.1))
    assert before.estimate().height == 1.0 != ekf.estimate().height


def test_sightings_from_space_are_of_the_model() -> None:
    in_space = lf.RangeBearingInSpace()
    in_space.sensor_up_m = 1.0
    model = lf.RangeBearingModel(lf.RangeBearingConfig(), lf.Pose2(), in_space)
    expected = model.predict(lf.Pose2(), 4.0, [3.0, 4.0, -7.0])
    assert np.allclose(expected, [13.0, np.arctan2(4.0, 3.0), -np.arctan2(12.0, 5.0)])
    z = lf.RangeBearing(0, range=13.5, elevation=-1.0)
    lin = model.linearize(lf.Pose2(), 4.0, [3.0, 4.0, -7.0], z)
    assert lin is not None
    assert lin.jacobian.shape == (2, 4)
    assert np.allclose(lin.residual, [0.5, -1.0 + np.arctan2(12.0, 5.0)])


def test_only_what_flies_takes_an_elevation() -> None:
    z = lf.RangeBearing(0, 7, range=6.4, bearing=0.6, elevation=0.7)
    sight = lf.LandmarkSensor(lf.LandmarkMap([lf.Landmark(7, [4.0, 3.0])]))
    anchors = lf.AnchorMap([])
    planar: list[Callable[[lf.RangeBearing], object]] = [
        lf.PoseEkf(lf.PoseEkfConfig(), lf.World(anchors, landmarks=sight), START).on,
        lf.LandmarkEkf(lf.LandmarkEkfConfig(), lf.World(), START).on,
        lf.RecoveringEkf(lf.RecoveringEkfConfig(), lf.World(landmarks=sight)).on,
        lf.Initializer(lf.InitializerConfig(), lf.World(anchors)).on,
    ]
    for take in planar:
        with pytest.raises(ValueError, match="elevation"):
            take(z)
    assert air_ekf().on(z).verdict != lf.Verdict.IGNORED
