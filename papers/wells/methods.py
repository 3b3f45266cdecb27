# SPDX-License-Identifier: Apache-2.0
"""Our filter and the paper's, scan by scan."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray
from papers.wells.world import BEAM_RAD, CYLINDERS, RADIUS_M, SIGMA_BEAM_M, detector


class OurEkf:
    """Cylinders fitted, associated jointly, fused in a `PoseEkf` that learns how its gyro drifts.

    Its noise does not follow slip, which it does not know of: 5 cm per root of a metre. That is ten
    times the noise of clean wheels, and a quarter of the excess of a slip: 13 cm over 44 cm.
    """

    def __init__(self, start: FloatArray) -> None:
        self.cylinders = 0  # found in the last scan
        config = _core.PoseEkfConfig()
        config.correlation_s = 0.0  # simulated errors are independent
        config.odometry.sigma_longitudinal_per_sqrt_m = 0.05
        config.odometry.sigma_lateral_per_sqrt_m = 0.01
        config.odometry.sigma_heading_per_sqrt_m = 0.01
        config.odometry.sigma_heading_per_sqrt_rad = 0.01
        config.calibration.sigma_turn_bias_radps = 0.02
        landmarks = [_core.Landmark(i, at, RADIUS_M) for i, at in enumerate(CYLINDERS)]
        self._detector = detector()
        self._ekf = _core.PoseEkf(
            config,
            _core.World(landmarks=_core.LandmarkSensor(_core.LandmarkMap(landmarks))),
            _core.PoseEstimate(0, _core.Pose2(*start), np.diag([0.05, 0.05, 0.05]) ** 2),
        )

    def on(self, begin: int, end: int, measured: FloatArray, scan: _core.LaserScan) -> None:
        self._ekf.on(_core.Increment(begin, end, _core.Pose2(*measured)))
        found = self._detector.detect(scan)
        self.cylinders = len(found)
        self._ekf.on_joint(
            [_core.RangeBearing(end, None, one.range, one.bearing, one.covariance[:2, :2])
             for one in found]
        )  # fmt: skip

    def pose(self) -> FloatArray:
        pose = self._ekf.estimate().pose
        return np.array([pose.x, pose.y, pose.heading])

    def covariance(self) -> FloatArray:
        return self._ekf.estimate().covariance


class PaperEkf:
    """wells eq. 2 to 14: the position by a Kalman filter, the heading of the odometry."""

    def __init__(self, start: FloatArray) -> None:
        self.pose = start.copy()
        self._P = np.diag([0.05, 0.05]) ** 2

    def on(self, measured: FloatArray, heading: float, scan: _core.LaserScan) -> FloatArray:
        """Predict, correct by the closest beam; return where that puts the robot, or NaN."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        moved = self.pose[:2] + [
            c * measured[0] - s * measured[1],
            s * measured[0] + c * measured[1],
        ]
        self.pose = np.array([*moved, heading])
        self._P = self._P + 0.005**2 * float(np.hypot(*measured[:2])) * np.eye(2)
        ranges = np.asarray(scan.ranges)
        if not np.isfinite(ranges).any():
            return np.full(2, np.nan)
        beam = int(np.nanargmin(ranges))
        angle, distance = heading + BEAM_RAD[beam], ranges[beam] + RADIUS_M
        off = distance * np.array([np.cos(angle), np.sin(angle)])
        nearest = CYLINDERS[np.argmin(np.hypot(*(CYLINDERS - (self.pose[:2] + off)).T))]
        seen: FloatArray = nearest - off
        gain = self._P @ np.linalg.inv(self._P + SIGMA_BEAM_M**2 * np.eye(2))
        self.pose[:2] += gain @ (seen - self.pose[:2])
        self._P = (np.eye(2) - gain) @ self._P
        return seen
