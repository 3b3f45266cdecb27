# SPDX-License-Identifier: Apache-2.0
"""Figure eights in the room with the anchors: celan2017, sections IV.B and V.C, Table III."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from locfuse import _core
from locfuse.config.scenario import Eight
from locfuse.sim import sensors
from locfuse.sim.trajectory import Drive, plan
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray, Trajectory, wrap_angle
from papers.celan2017.methods import covariance_bounds
from papers.celan2017.world import (
    SIGMA_LONGITUDINAL,
    SIGMA_PER_SQRT_M,
    SIGMA_PER_SQRT_RAD,
    SIGMA_ROTATION,
    SIGMA_SCALE,
    SIGMA_TURN_BIAS_RADPS,
    UWB_HZ,
    Floor,
    floor_of,
    increments,
    radios,
    tag_fixes,
    tag_poses,
    tags_known,
    wheels,
)

DURATION_S, LENGTH_M = 180.0, 55.0
RADIUS_M = 1.4
LATE_S = 3.0  # what a low-pass filter and a wireless link may cost
SIGMA_START = (0.02, 0.02, np.deg2rad(1.0))
# Of the velocity of a tag by wheels, and rad/s of their turn. The paper gives no R: what encoders
# add at random between two of their stamps, and what errs least on seeds 100 to 119.
SIGMA_ENCODERS_MPS, SIGMA_KINDEST_MPS = 0.03, 0.05


@dataclass(frozen=True)
class Ride:
    """Eights of 55 m in three minutes and what wheels and radios say of them.

    Attributes
    ----------
    floor : Floor
    drive : Drive
    odometry : columns
    fixes : columns
        As in `Lap`; those of a late RTLS carry the stamp of their publication.
    """

    floor: Floor
    drive: Drive
    odometry: Columns
    fixes: Columns


@cache
def ride(seed: int, late_s: float = 0.0) -> Ride:
    """Return a ride; an RTLS that is late reports where its tags were.

    Ranges have no offsets: the paper takes the bias of its RTLS off (section III.C).
    """
    floor = floor_of(seed)
    x1, y1, x2, y2 = floor.plan.open_room
    path = Eight(speed_mps=LENGTH_M / DURATION_S, radius_m=RADIUS_M,
                 center_m=(0.5 * (x1 + x2), 0.5 * (y1 + y2)))  # fmt: skip
    for_odometry, for_ranges, for_offsets = np.random.default_rng([seed, 3]).spawn(3)
    drive = plan(path, (0.0, 0.0), DURATION_S, for_odometry)
    late_ns = round(late_s * NANOSECONDS)
    measured_ns = sensors.stamps(UWB_HZ, DURATION_S)
    measured_ns = measured_ns[measured_ns + late_ns <= round(DURATION_S * NANOSECONDS)]
    _, fixes = radios(floor, drive, measured_ns, for_ranges, for_offsets, sigma_offset_m=0.0)
    fixes = {**fixes, "stamp_ns": fixes["stamp_ns"] + late_ns}
    return Ride(floor, drive, wheels(drive, DURATION_S, for_odometry), fixes)


def odometry_alone(of: Ride) -> Trajectory:
    """Return where wheels alone lead from the true start."""
    pose = _core.Pose2(*of.drive.pose_at(0.0)[0].tolist())
    rows = [(0, pose.x, pose.y, pose.heading)]
    for u in increments(of.odometry):
        pose = pose * u.motion
        rows.append((u.stamp, pose.x, pose.y, pose.heading))
    return _trajectory(rows)


def uwb_alone(of: Ride) -> Trajectory:
    """Return the pose of the three tags, epoch by epoch."""
    return _of_poses(tag_poses(of.fixes))


def triangle(
    of: Ride, sigma_mps: float = SIGMA_ENCODERS_MPS, sigma_velocity_per_sqrt_s: float = 0.2
) -> Trajectory:
    """Return the paper's 12 states on wheels and fixes of tags, the heading taken as known.

    R of a tag's velocity by wheels is `sigma_mps` squared, Q that of white acceleration.
    """
    config = _core.TagTriangleEkfConfig()
    config.correlation_s = 0.0  # simulated errors are independent
    config.heading_is_known = True
    config.motion.sigma_velocity_per_sqrt_s = sigma_velocity_per_sqrt_s
    config.velocity.sigma_forward_mps = config.velocity.sigma_lateral_mps = sigma_mps
    config.velocity.sigma_turn_rate_radps = sigma_mps
    config.velocity.sigma_point_mps = sigma_mps
    return _fused(of, _core.TagTriangleEkf(config, _core.World(tags=tags_known()), _start(of)))


def kindest(of: Ride) -> Trajectory:
    """Return the same with wider noise of the wheels, as the heading is not known after all."""
    return triangle(of, SIGMA_KINDEST_MPS)


def rigid(of: Ride) -> Trajectory:
    """Return the `PoseEkf` on the same: tags are three lever arms of one body.

    What wheels get wrong all the time are states.
    """
    config = _core.PoseEkfConfig()
    config.correlation_s = 0.0  # simulated errors are independent
    config.odometry.sigma_longitudinal_per_sqrt_m = SIGMA_LONGITUDINAL
    config.odometry.sigma_lateral_per_sqrt_m = 0.1 * SIGMA_LONGITUDINAL
    config.odometry.sigma_heading_per_sqrt_m = SIGMA_PER_SQRT_M
    config.odometry.sigma_heading_per_sqrt_rad = SIGMA_PER_SQRT_RAD
    config.calibration.sigma_scale = SIGMA_SCALE
    config.calibration.sigma_turn_scale = SIGMA_ROTATION
    config.calibration.sigma_turn_bias_radps = SIGMA_TURN_BIAS_RADPS
    return _fused(of, _core.PoseEkf(config, _core.World(tags=tags_known()), _start(of)))


def _start(of: Ride) -> _core.PoseEstimate:
    return _core.PoseEstimate(0, _core.Pose2(*of.drive.pose_at(0.0)[0].tolist()),
                              np.diag(np.square(SIGMA_START)))  # fmt: skip


def _fused(of: Ride, ekf: _core.TagTriangleEkf | _core.PoseEkf) -> Trajectory:
    """Return what a filter says at the stamps of the wheels.

    An increment takes effect where it begins, so a fix within it comes behind it and before the
    belief is carried to its end.
    """
    waiting = deque(tag_fixes(of.fixes))
    found = []
    for u in increments(of.odometry):
        ekf.on(u)
        while waiting and waiting[0].stamp <= u.stamp:
            ekf.on(waiting.popleft())
        ekf.advance_to(u.stamp)
        found.append(ekf.estimate(u.stamp))
    return _of_poses(found)


METHODS: Mapping[str, Callable[[Ride], Trajectory]] = {
    "odometry": odometry_alone,
    "uwb": uwb_alone,
    "triangle": triangle,
    "kindest": kindest,
    "rigid": rigid,
}
FUSED = ("triangle", "kindest", "rigid")
NAMES = {
    "odometry": "odometry",
    "uwb": "UWB",
    "triangle": "12 states on both",
    "kindest": "12 states on both, noise of least error",
    "rigid": "PoseEkf on both",
}


def errors_of(of: Ride, found: Trajectory) -> FloatArray:
    """Return estimate minus truth, shape (n, 3): x, y [m], heading [rad]."""
    assert found.heading is not None
    truth = of.drive.pose_at(sensors.seconds(found.stamp_ns))
    return np.column_stack([found.position - truth[:, :2], wrap_angle(found.heading - truth[:, 2])])


def bound_of(of: Ride) -> FloatArray:
    """Return the minimum RMSE of x, y [m] and heading [rad] of a ride, shape (3,)."""
    P = covariance_bounds(of.drive, of.odometry["stamp_ns"], of.fixes, SIGMA_START)
    return np.asarray(np.sqrt(np.diagonal(P.mean(axis=0))))


def _of_poses(found: Iterable[_core.PoseEstimate | _core.PoseObservation]) -> Trajectory:
    every = list(found)
    pose = np.array([[e.pose.x, e.pose.y, e.pose.heading] for e in every])
    return Trajectory(np.array([e.stamp for e in every], np.int64), pose[:, :2].copy(),
                      pose[:, 2].copy(), np.array([e.covariance for e in every]))  # fmt: skip


def _trajectory(rows: list[tuple[int, float, float, float]]) -> Trajectory:
    stamp: StampArray = np.array([row[0] for row in rows], np.int64)
    pose = np.array([row[1:] for row in rows])
    return Trajectory(stamp, pose[:, :2].copy(), pose[:, 2].copy())
