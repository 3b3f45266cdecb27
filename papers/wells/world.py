# SPDX-License-Identifier: Apache-2.0
"""Four cylinders, drives among them, and what wheels and laser measure of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from locfuse import _core
from locfuse.sim.obstacles import hidden_by
from locfuse.sim.trajectory import Drive, drive_of
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

RADIUS_M = 1.0
CYLINDERS = np.array([[2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]])
BEAMS = 360
BEAM_RAD = np.deg2rad(np.arange(BEAMS) - 180.0)
RANGE_MAX_M = 3.5  # of the TurtleBot3's LDS-01
SIGMA_BEAM_M = 0.01
SCAN_NS = NANOSECONDS // 5
SPEED_MPS, TURN_RADPS = 0.22, 0.6
LEGS = 24  # of a drive
STEPS = 12  # of odometry per scan
GYRO_BIAS_RADPS = np.deg2rad(0.5)
SLIP = 0.3  # of the way that slipping wheels report too much
SLIPPING_S, EVERY_S = 2.0, 12.0
# Where a driver goes: around the cylinders and between them, and which ways are free.
PLACES = np.array([[0, 0], [4, 0], [0, 4], [-4, 0], [0, -4], [4, 4], [-4, 4], [-4, -4], [4, -4]])
WAYS = {0: (1, 2, 3, 4), 1: (0, 5, 8), 2: (0, 5, 6), 3: (0, 6, 7), 4: (0, 7, 8), 5: (1, 2),
        6: (2, 3), 7: (3, 4), 8: (4, 1)}  # fmt: skip


def random_drive(rng: np.random.Generator) -> Drive:
    """Return a drive from place to place: turns on the spot, straight ways."""
    at, pose, motions = 0, np.array([0.0, 0.0, 0.0]), []
    for _ in range(LEGS):
        at = int(rng.choice(WAYS[at]))
        off = PLACES[at] + rng.uniform(-0.15, 0.15, 2) - pose[:2]
        heading = np.arctan2(off[1], off[0])
        turn = float(wrap_angle(heading - pose[2]))
        if turn != 0.0:
            motions.append((abs(turn) / TURN_RADPS, 0.0, np.copysign(TURN_RADPS, turn)))
        motions.append((float(np.hypot(*off)) / SPEED_MPS, SPEED_MPS, 0.0))
        pose = np.array([*(pose[:2] + off), heading])
    return drive_of((0.0, 0.0, 0.0), motions)


def measured_motion(
    drive: Drive, begin: int, end: int, rng: np.random.Generator, slip: bool
) -> FloatArray:
    """Return the motion that wheels and gyro measure between two scans."""
    time = np.linspace(begin, end, STEPS + 1) / NANOSECONDS
    pose = [_core.Pose2(*row) for row in drive.pose_at(time)]
    total = _core.Pose2()
    for k, (before, after) in enumerate(pairwise(pose)):
        step = before.inverse() * after
        way, turn = np.hypot(step.x, step.y), abs(step.heading)
        along = step.x + 0.005 * np.sqrt(way) * rng.standard_normal()
        heading = step.heading + 0.005 * np.sqrt(way + turn) * rng.standard_normal()
        if slip:
            along *= 1.0 + SLIP * (time[k] % EVERY_S < SLIPPING_S)
            heading += GYRO_BIAS_RADPS * (time[k + 1] - time[k])
        total = total * _core.Pose2(along, step.y, heading)
    return np.array([total.x, total.y, total.heading])


def scan_of(
    pose: FloatArray, stamp: int, rng: np.random.Generator | None, times: int = 1
) -> _core.LaserScan:
    """Return what so many times 360 beams see, NaN without return; exactly, without `rng`."""
    beam_rad = np.deg2rad(np.arange(BEAMS * times) / times - 180.0)
    ranges = hidden_by(CYLINDERS[None], RADIUS_M, pose[None, :2], (pose[2] + beam_rad)[None])[0]
    if rng is not None:
        ranges = ranges + SIGMA_BEAM_M * rng.standard_normal(len(beam_rad))
    laser = _core.LaserGeometry(_core.Pose2(), float(beam_rad[0]), float(np.deg2rad(1.0)) / times,
                                0.12, RANGE_MAX_M)  # fmt: skip
    return _core.LaserScan(stamp, laser, np.where(ranges < RANGE_MAX_M, ranges, np.nan))


def detector() -> _core.CylinderDetector:
    """Return what fits the arcs of cylinders."""
    return _core.CylinderDetector(
        _core.CylinderDetectorConfig(radius_m=RADIUS_M, sigma_range_m=SIGMA_BEAM_M)
    )
