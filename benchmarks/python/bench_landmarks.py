# SPDX-License-Identifier: Apache-2.0
"""Known and mapped landmarks from Python, compared to gtsam and Stone Soup."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest

import locfuse as lf
from circle import ANCHORS, SIGMA_MOTION, SIGMA_RANGE, SIGMA_START, START, circle, pose_config
from locfuse.types import FloatArray

STEPS = 500
SIGMA_BEARING = 0.02  # rad
DRIVE = circle(STEPS)
POSTS = ANCHORS[:3]
TURN = 0.4 * np.arange(16)
TREES = [5.0, 4.5] + (6.0 + np.arange(16)[:, None] % 3) * np.column_stack(
    [np.cos(TURN), np.sin(TURN)]
)
ORIGIN, SIGMA_ORIGIN = np.array([5.0, 2.0, 0.0]), np.full(3, 0.01)  # map frame of mapping


def sightings(landmarks: FloatArray) -> tuple[Any, FloatArray]:
    """Return per step the three nearest landmarks (n, 3), and range and bearing (n, 3, 2)."""
    rng = np.random.default_rng(2)
    offset = landmarks - DRIVE.truth[:, None]
    nearest = np.argsort(np.linalg.norm(offset, axis=2), axis=1)[:, :3]
    seen = np.take_along_axis(offset, nearest[..., None], axis=1)
    heading = 0.02 * np.arange(1, STEPS + 1)
    bearing = np.arctan2(seen[..., 1], seen[..., 0]) - heading[:, None]
    z = np.stack([np.linalg.norm(seen, axis=2), bearing], axis=2)
    z += rng.standard_normal(z.shape) * [SIGMA_RANGE, SIGMA_BEARING]
    z[..., 1] = np.mod(z[..., 1] + np.pi, 2 * np.pi) - np.pi
    return nearest, z


OF_POSTS = sightings(POSTS)
OF_TREES = sightings(TREES)


def wrapped(angle: float) -> float:
    return float(np.mod(angle + np.pi, 2 * np.pi) - np.pi)


def judge(last: Any, expected: lf.Pose2 | None = None, within_m: float = 0.01) -> None:
    """Check the last pose (x, y, heading) against the truth and another estimator."""
    x, y, heading = last
    assert np.hypot(*(np.array([x, y]) - DRIVE.truth[-1])) < 0.15
    if expected is not None:
        assert np.hypot(x - expected.x, y - expected.y) < within_m
        assert abs(wrapped(heading - expected.heading)) < within_m


# locfuse --------------------------------------------------------------------------------------


def start(pose: FloatArray, sigma: FloatArray) -> lf.PoseEstimate:
    return lf.PoseEstimate(0, lf.Pose2(*pose), np.diag(sigma**2))


def known_map_ekf() -> lf.PoseEkf:
    config = pose_config()
    config.landmark.sigma_range_m, config.landmark.sigma_bearing_rad = SIGMA_RANGE, SIGMA_BEARING
    config.landmark.gate = 1.0  # the peers have no gate
    posts = lf.LandmarkMap([lf.Landmark(i, post) for i, post in enumerate(POSTS)])
    return lf.PoseEkf(
        config, lf.World(landmarks=lf.LandmarkSensor(posts)), start(START, SIGMA_START)
    )


def mapping_ekf() -> lf.LandmarkEkf:
    config = lf.LandmarkEkfConfig()
    config.odometry = pose_config().odometry
    config.landmark.sigma_range_m, config.landmark.sigma_bearing_rad = SIGMA_RANGE, SIGMA_BEARING
    config.landmark.gate, config.gate_new = 1.0, 1.0
    return lf.LandmarkEkf(config, lf.World(), start(ORIGIN, SIGMA_ORIGIN))


def messages(seen: tuple[Any, FloatArray]) -> list[Any]:
    stamps = DRIVE.stamp_ns.tolist()
    result: list[Any] = []
    for k, motion in enumerate(DRIVE.motion):
        result.append(lf.Increment(stamps[k], stamps[k + 1], lf.Pose2(*motion)))
        for which, (distance, bearing) in zip(seen[0][k], seen[1][k], strict=True):
            result.append(lf.RangeBearing(stamps[k + 1], int(which), distance, bearing))
    return result


def message_log(seen: tuple[Any, FloatArray]) -> lf.MessageLog:
    log = lf.MessageLog()
    log.add_increments(DRIVE.stamp_ns[:-1], DRIVE.stamp_ns[1:], DRIVE.motion)
    log.add_sightings(
        np.repeat(DRIVE.stamp_ns[1:], 3), seen[0].ravel().astype(np.int32),
        seen[1][..., 0].ravel(), seen[1][..., 1].ravel(),
    )  # fmt: skip
    log.sort()
    return log


def drive(ekf: Any, stream: list[Any]) -> Any:
    for message in stream:
        ekf.on(message)
    return ekf


def last_of(ekf: Any, seen: tuple[Any, FloatArray]) -> lf.Pose2:
    pose: lf.Pose2 = drive(ekf, messages(seen)).estimate().pose
    return pose


def test_known_calls(benchmark: Any) -> None:
    stream = messages(OF_POSTS)
    benchmark.extra_info["items"] = STEPS
    pose = benchmark(lambda: drive(known_map_ekf(), stream)).estimate().pose
    judge((pose.x, pose.y, pose.heading))


def test_known_replay(benchmark: Any) -> None:
    ekf = known_map_ekf()
    benchmark.extra_info["items"] = STEPS
    record = benchmark(lambda: lf.replay(ekf, message_log(OF_POSTS), record=False))
    pose = record.last.pose
    judge((pose.x, pose.y, pose.heading), last_of(known_map_ekf(), OF_POSTS))


def test_mapping_calls(benchmark: Any) -> None:
    stream = messages(OF_TREES)
    benchmark.extra_info["items"] = STEPS
    ekf = benchmark(lambda: drive(mapping_ekf(), stream))
    assert len(ekf.landmarks()) == len(np.unique(OF_TREES[0]))
    pose = ekf.estimate().pose
    judge((pose.x, pose.y, pose.heading))


# gtsam ----------------------------------------------------------------------------------------


def smooth(gtsam: Any, seen: tuple[Any, FloatArray], known: FloatArray | None) -> Any:
    """Update ISAM2 once per step; unknown landmarks are added when first observed."""
    pose, sigma = (ORIGIN, SIGMA_ORIGIN) if known is None else (START, SIGMA_START)
    of_start = gtsam.noiseModel.Diagonal.Sigmas(sigma)
    of_motion = gtsam.noiseModel.Diagonal.Sigmas(SIGMA_MOTION)
    of_sighting = gtsam.noiseModel.Diagonal.Sigmas(np.array([SIGMA_BEARING, SIGMA_RANGE]))
    of_known = gtsam.noiseModel.Isotropic.Sigma(2, 1e-6)
    isam, put_up = gtsam.ISAM2(), set[int]()
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    now = gtsam.Pose2(*pose)
    graph.add(gtsam.PriorFactorPose2(0, now, of_start))
    values.insert(0, now)
    for i, post in enumerate([] if known is None else known):
        graph.add(gtsam.PriorFactorPoint2(gtsam.symbol("l", i), post, of_known))
        values.insert(gtsam.symbol("l", i), post)
        put_up.add(i)
    for k, motion in enumerate(DRIVE.motion):
        moved = gtsam.Pose2(*motion)
        graph.add(gtsam.BetweenFactorPose2(k, k + 1, moved, of_motion))
        now = now.compose(moved)
        values.insert(k + 1, now)
        for which, (distance, bearing) in zip(seen[0][k].tolist(), seen[1][k], strict=True):
            key, turn = gtsam.symbol("l", which), gtsam.Rot2(bearing)
            graph.add(gtsam.BearingRangeFactor2D(k + 1, key, turn, distance, of_sighting))
            if which not in put_up:
                place = turn.rotate(np.array([distance, 0.0]))
                values.insert(key, now.transformFrom(place))
                put_up.add(which)
        isam.update(graph, values)
        now = isam.calculateEstimatePose2(k + 1)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    return now.x(), now.y(), now.theta()


def test_known_gtsam(benchmark: Any) -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed")
    benchmark.extra_info["items"] = STEPS
    last = benchmark.pedantic(smooth, (gtsam, OF_POSTS, POSTS), rounds=5)
    judge(last, last_of(known_map_ekf(), OF_POSTS))


def test_mapping_gtsam(benchmark: Any) -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed")
    benchmark.extra_info["items"] = STEPS
    last = benchmark.pedantic(smooth, (gtsam, OF_TREES, None), rounds=5)
    judge(last, last_of(mapping_ekf(), OF_TREES), 0.05)  # it relinearizes the past, we do not


# Stone Soup -----------------------------------------------------------------------------------


def stonesoup(module: str) -> Any:
    return pytest.importorskip(f"stonesoup.{module}", reason="Stone Soup is not installed")


def models() -> tuple[Any, Any]:
    """Return models missing in Stone Soup: odometry, and observations from an estimated pose."""
    Measurement: Any = stonesoup("models.measurement.nonlinear").NonLinearGaussianMeasurement
    Transition: Any = stonesoup("models.transition.nonlinear").GaussianTransitionModel
    Property = stonesoup("base").Property
    Bearing = stonesoup("types.angle").Bearing
    StateVector = stonesoup("types.array").StateVector

    class Odometry(Transition):  # type: ignore[misc]
        ndim_state = 3

        def function(self, state: Any, noise: Any = False, **given: Any) -> Any:
            dx, dy, turn = given["motion"]
            x, y, heading = (float(value) for value in state.state_vector)
            c, s = np.cos(heading), np.sin(heading)
            return StateVector([x + c * dx - s * dy, y + s * dx + c * dy, heading + turn])

        def jacobian(self, state: Any, **given: Any) -> Any:
            dx, dy, _ = given["motion"]
            heading = float(state.state_vector[2, 0])
            c, s = np.cos(heading), np.sin(heading)
            return np.array([[1.0, 0.0, -s * dx - c * dy], [0.0, 1.0, c * dx - s * dy],
                             [0.0, 0.0, 1.0]])  # fmt: skip

        def covar(self, **given: Any) -> Any:
            c, s = np.cos(given["heading"]), np.sin(given["heading"])
            G = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            return (G * SIGMA_MOTION**2) @ G.T

    class Sighting(Measurement):  # type: ignore[misc]
        landmark: FloatArray = Property(doc="Position, metres.")
        ndim_meas = 2

        def function(self, state: Any, noise: Any = False, **given: Any) -> Any:
            x, y, heading = (float(value) for value in state.state_vector)
            dx, dy = self.landmark[0] - x, self.landmark[1] - y
            return StateVector([Bearing(np.arctan2(dy, dx) - heading), np.hypot(dx, dy)])

        def jacobian(self, state: Any, **given: Any) -> Any:
            x, y, _ = (float(value) for value in state.state_vector)
            dx, dy = self.landmark[0] - x, self.landmark[1] - y
            squared = dx * dx + dy * dy
            distance = np.sqrt(squared)
            return np.array([[dy / squared, -dx / squared, -1.0],
                             [-dx / distance, -dy / distance, 0.0]])  # fmt: skip

    return Odometry, Sighting


def test_known_stonesoup(benchmark: Any) -> None:
    kalman = stonesoup("predictor.kalman"), stonesoup("updater.kalman")
    Bearing = stonesoup("types.angle").Bearing
    Detection = stonesoup("types.detection").Detection
    SingleHypothesis = stonesoup("types.hypothesis").SingleHypothesis
    Odometry, Sighting = models()
    benchmark.extra_info["items"] = STEPS
    noise = np.diag([SIGMA_BEARING**2, SIGMA_RANGE**2])
    of = [Sighting(ndim_state=3, mapping=(0, 1), noise_covar=noise, landmark=p) for p in POSTS]
    begin = datetime(2026, 1, 1)
    detections = [
        [
            Detection(
                [[Bearing(bearing)], [distance]],
                timestamp=begin + timedelta(seconds=0.1 * (k + 1)),
                measurement_model=of[which],
            )
            for which, (distance, bearing) in zip(OF_POSTS[0][k], OF_POSTS[1][k], strict=True)
        ]
        for k in range(STEPS)
    ]
    motions = [tuple(motion) for motion in DRIVE.motion.tolist()]

    def run() -> Any:
        predictor = kalman[0].ExtendedKalmanPredictor(Odometry())
        updater = kalman[1].ExtendedKalmanUpdater()
        state = stonesoup("types.state").GaussianState(
            START, np.diag(SIGMA_START**2), timestamp=begin
        )
        for motion, seen in zip(motions, detections, strict=True):
            heading = float(state.state_vector[2, 0])
            state = predictor.predict(
                state, timestamp=seen[0].timestamp, motion=motion, heading=heading
            )
            for detection in seen:
                state = updater.update(SingleHypothesis(state, detection))
        return [float(value) for value in state.state_vector]

    last = benchmark.pedantic(run, rounds=5)
    judge(last, last_of(known_map_ekf(), OF_POSTS))
