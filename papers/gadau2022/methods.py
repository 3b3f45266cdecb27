# SPDX-License-Identifier: Apache-2.0
"""Our filter in the worlds of gadau2022, and the paper's recognition and derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Literal

import numpy as np

from locfuse import _core
from locfuse.types import NANOSECONDS, FloatArray
from papers.gadau2022.world import (
    DISC_M,
    SIGMA_BEARING_RAD,
    SIGMA_POSE_M,
    SIGMA_POSE_RAD,
    SIGMA_RANGE_M,
    SIGMA_RAY_M,
    SIGMA_SPEED_MPS,
    SIGMA_TURN_RADPS,
    STEP_NS,
    WRONG_M,
    WRONG_RAD,
    Gps,
    scan_of,
    seen_by,
)


def detector() -> _core.CylinderDetector:
    """Return what finds the discs among the rays."""
    return _core.CylinderDetector(
        _core.CylinderDetectorConfig(radius_m=DISC_M, sigma_range_m=SIGMA_RAY_M, least_beams=4)
    )


def sightings_of(found: list[_core.Cylinder], stamp: int) -> list[_core.RangeBearing]:
    """Return cylinders as sightings without names."""
    return [_core.RangeBearing(stamp, None, one.range, one.bearing, one.covariance[:2, :2])
            for one in found]  # fmt: skip


def filter_config() -> _core.PoseEkfConfig:
    """Return the filter that knows the noise: that of the speed lies along the heading."""
    config = _core.PoseEkfConfig()
    config.correlation_s = 0.0  # simulated errors are independent
    rate = NANOSECONDS / STEP_NS
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.0
    config.odometry.sigma_lateral_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_rad = 0.0
    # In every step, so many a second: noise of the pose, and of the speeds over a step.
    turn = np.hypot(SIGMA_POSE_RAD, SIGMA_TURN_RADPS / rate)
    config.odometry.sigma_longitudinal_per_sqrt_s = float(SIGMA_SPEED_MPS / np.sqrt(rate))
    config.odometry.sigma_xy_per_sqrt_s = float(SIGMA_POSE_M * np.sqrt(rate))
    config.odometry.sigma_heading_per_sqrt_s = float(turn * np.sqrt(rate))
    config.landmark.sigma_range_m = SIGMA_RANGE_M
    config.landmark.sigma_bearing_rad = SIGMA_BEARING_RAD
    config.landmark.gate = 0.9999
    return config


def map_of(marks: FloatArray) -> _core.LandmarkMap:
    """Return landmarks as a map of discs."""
    return _core.LandmarkMap([_core.Landmark(i, at, DISC_M) for i, at in enumerate(marks)])


def known(marks: FloatArray) -> _core.LandmarkSensor:
    """Return landmarks as the filter knows them."""
    return _core.LandmarkSensor(map_of(marks))


Mistake = Literal["derivatives", "range_row", "bearing_row", "surface"]
Correct = Callable[[_core.PoseEkf, int, FloatArray], None]


def fuse_fix(
    ekf: _core.PoseEkf, stamp: int, at: FloatArray, gps: Gps, rng: np.random.Generator
) -> FloatArray:
    fix: FloatArray = at[:2] + gps.sigma_m * rng.standard_normal(2)
    ekf.on(_core.PositionFix(stamp, fix, gps.sigma_m**2 * np.eye(2)))
    return fix


def nees_of(estimate: _core.PoseEstimate, truth: FloatArray) -> float:
    """Return how large an error is by what the estimate says of itself; 3 on average."""
    error = _core.local(estimate.pose, _core.Pose2(*truth))
    return float(error @ np.linalg.solve(estimate.covariance, error))


def pose_ekf(start: FloatArray, marks: FloatArray, wrong: bool = False) -> _core.PoseEkf:
    config = filter_config()
    if wrong:
        config.landmark.gate = config.position.gate = 1.0
    sigma = [WRONG_M, WRONG_M, WRONG_RAD] if wrong else [0.05, 0.05, 0.02]
    return _core.PoseEkf(
        config,
        _core.World(landmarks=known(marks)),
        _core.PoseEstimate(0, _core.Pose2(*start), np.diag(sigma) ** 2),
    )


def fuse_named(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
    for landmark, (distance, bearing) in enumerate(seen.tolist()):
        ekf.on(_core.RangeBearing(stamp, landmark, distance, bearing))


def fitted(marks: FloatArray, rng: np.random.Generator) -> Correct:
    """Fuse the discs that are fitted to the rays."""
    finder = detector()

    def fit_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        found = finder.detect(scan_of(stamp, at, marks, rng))
        if found:
            ekf.on_joint(sightings_of(found, stamp))

    return fit_and_fuse


def by_recognition(
    marks: FloatArray, rng: np.random.Generator, mistakes: Collection[Mistake]
) -> Correct:
    """Fuse the ray that the paper's rule has for each disc; none where it recognizes none."""
    discs = map_of(marks)
    fuse = by_derivatives(marks, mistakes)
    to_centre = 0.0 if "surface" in mistakes else DISC_M

    def recognize_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        scan = scan_of(stamp, at, marks, rng)
        rays = _core.recognize_landmarks(scan, ekf.estimate(stamp).pose, discs)
        fuse(ekf, stamp, np.array([[ray.range + to_centre, ray.bearing] if ray.beam >= 0
                                   else [np.nan, np.nan] for ray in rays]))  # fmt: skip

    return recognize_and_fuse


def by_derivatives(marks: FloatArray, mistakes: Collection[Mistake]) -> Correct:
    """Fuse with H as Fig. 2 prints it, where a mistake asks for that.

    Its range's row has the signs of its negative; its bearing's has dx and dy exchanged, (dx, -dy)
    for (dy, -dx).
    """
    noise = np.diag([SIGMA_RANGE_M, SIGMA_BEARING_RAD]) ** 2
    gate = _core.Gate(1.0)
    both = "derivatives" in mistakes

    def fuse(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
        for at, z in zip(marks, seen, strict=True):
            if np.isnan(z[0]):
                continue
            pose = ekf.estimate(stamp).pose
            dx, dy = at - [pose.x, pose.y]
            d = float(np.hypot(dx, dy))
            off = [z[0] - d, _core.wrap_angle(float(z[1] - np.arctan2(dy, dx) + pose.heading))]
            sign = 1.0 if both or "range_row" in mistakes else -1.0
            turned = [dx, -dy] if both or "bearing_row" in mistakes else [dy, -dx]
            H = [[sign * dx / d, sign * dy / d, 0.0], [turned[0] / d**2, turned[1] / d**2, -1.0]]
            ekf.fuse(stamp, _core.Linearization(off, H, noise), gate)

    return fuse


def ungated_ekf(start: _core.PoseEstimate, marks: FloatArray) -> _core.PoseEkf:
    """Return a filter that believes each sighting."""
    config = filter_config()
    config.landmark.gate = 1.0
    return _core.PoseEkf(config, _core.World(landmarks=known(marks)), start)


def sightings_in(
    world: str, marks: FloatArray, rng: np.random.Generator
) -> Callable[[int, FloatArray], list[_core.RangeBearing]]:
    if world == "discs":
        finder = detector()
        return lambda stamp, at: sightings_of(finder.detect(scan_of(stamp, at, marks, rng)), stamp)
    return lambda stamp, at: [
        _core.RangeBearing(stamp, None, distance, bearing)
        for distance, bearing in seen_by(at, marks, rng).tolist()
    ]
