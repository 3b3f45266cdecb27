# SPDX-License-Identifier: Apache-2.0
"""Common input of the filters: a circle of 2.5 m radius, an increment and five ranges per step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import locfuse as lf
from locfuse.types import FloatArray, StampArray

ANCHORS = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [5.0, 0.5]])
SIGMA_MOTION = np.array([0.02, 0.01, 0.01])  # m, m, rad per step
SIGMA_RANGE = 0.1
SIGMA_START = np.array([0.5, 0.5, 0.2])
START = np.array([5.3, 1.8, 0.1])  # the truth starts at (5, 2, 0)
STEP_M = 0.05
STEP_NS = 100_000_000
SETTLED = 100


@dataclass(frozen=True)
class Circle:
    """`motion` (n, 3), `range_m` (n, 5), `truth` (n, 2), `stamp_ns` (n + 1,): starts of steps."""

    motion: FloatArray
    range_m: FloatArray
    truth: FloatArray
    stamp_ns: StampArray

    def rmse(self, position: FloatArray) -> float:
        """Return the position RMSE after convergence, metres."""
        error = position[SETTLED:] - self.truth[SETTLED : len(position)]
        return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def circle(steps: int, seed: int = 1) -> Circle:
    """Return the drive of `steps` steps."""
    rng = np.random.default_rng(seed)
    heading = 0.02 * np.arange(steps)
    truth = [5.0, 2.0] + np.cumsum(
        STEP_M * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0
    )
    motion = [STEP_M, 0.0, 0.02] + rng.standard_normal((steps, 3)) * SIGMA_MOTION
    distance = np.linalg.norm(truth[:, np.newaxis] - ANCHORS, axis=2)
    range_m = distance + SIGMA_RANGE * rng.standard_normal(distance.shape)
    return Circle(motion, range_m, truth, STEP_NS * np.arange(steps + 1, dtype=np.int64))


def pose_config() -> lf.PoseEkfConfig:
    """Return a configuration with the noise of the input: sigmas per step of 0.05 m."""
    config = lf.PoseEkfConfig()
    per_step = SIGMA_MOTION / np.sqrt(STEP_M)
    config.odometry.sigma_longitudinal_per_sqrt_m = float(per_step[0])
    config.odometry.sigma_lateral_per_sqrt_m = float(per_step[1])
    config.odometry.sigma_heading_per_sqrt_m = float(per_step[2])
    config.odometry.sigma_heading_per_sqrt_rad = 0.0
    config.range.sigma_m = SIGMA_RANGE
    return config


def pose_ekf() -> lf.PoseEkf:
    """Return the estimator."""
    anchors = lf.AnchorMap([lf.Anchor(i, [x, y, 0.0]) for i, (x, y) in enumerate(ANCHORS)])
    start = lf.PoseEstimate(0, lf.Pose2(*START), np.diag(SIGMA_START**2))
    return lf.PoseEkf(pose_config(), lf.World(anchors, [lf.Tag(0, [0.0, 0.0, 0.0])]), start)


@dataclass(frozen=True)
class Columns:
    """A drive as a log's columns: n increments, m ranges of tag 0."""

    begin_ns: StampArray
    stamp_ns: StampArray
    motion: FloatArray
    range_stamp_ns: StampArray
    tag: NDArray[np.int32]
    anchor: NDArray[np.int32]
    range_m: FloatArray


def message_columns(drive: Circle) -> Columns:
    """Return the columns of the drive's messages."""
    steps, anchors = drive.range_m.shape
    return Columns(
        begin_ns=drive.stamp_ns[:-1],
        stamp_ns=drive.stamp_ns[1:],
        motion=drive.motion,
        range_stamp_ns=np.repeat(drive.stamp_ns[1:], anchors),
        tag=np.zeros(drive.range_m.size, dtype=np.int32),
        anchor=np.tile(np.arange(anchors, dtype=np.int32), steps),
        range_m=drive.range_m.ravel(),
    )


def message_log(columns: Columns) -> lf.MessageLog:
    """Return the messages in order of arrival."""
    log = lf.MessageLog()
    log.add_increments(columns.begin_ns, columns.stamp_ns, columns.motion)
    log.add_ranges(columns.range_stamp_ns, columns.tag, columns.anchor, columns.range_m)
    log.sort()
    return log
