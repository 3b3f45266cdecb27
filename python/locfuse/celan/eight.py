# SPDX-License-Identifier: Apache-2.0
"""Eights in the room with the anchors: celan2017, sections IV.B and V.C, Table III."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from locfuse import _core
from locfuse.celan.runs import increments, sigmas, tag_poses
from locfuse.celan.world import UWB_HZ, Floor, floor_of, radios, wheels
from locfuse.claims import Claim, claim_of
from locfuse.config.scenario import Eight
from locfuse.sim import sensors
from locfuse.sim.trajectory import Drive, plan
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray, Trajectory, wrap_angle

DURATION_S, LENGTH_M = 180.0, 55.0
RADIUS_M = 1.4
LATE_S = 3.0  # what a low-pass filter and a wireless link may cost
SIGMA_START = (0.02, 0.02, np.deg2rad(1.0))
# Table III, RMSE [m] along x and y: mean of both runs.
PAPER = {"odometry": (1.00, 3.19), "uwb": (1.10, 0.96), "ekf": (1.05, 0.91)}
MOST_OF_UWB = 0.95  # of the RMSE of UWB alone the paper leaves, by wheels and UWB together


@dataclass(frozen=True)
class Ride:
    """Eights of 55 m in three minutes and what wheels and radios say of them.

    Attributes
    ----------
    floor : Floor
    drive : Drive
    odometry : columns
    fixes : columns
        As in `Lap`; those of a late RTLS carry the stamp at which they are told.
    """

    floor: Floor
    drive: Drive
    odometry: Columns
    fixes: Columns


@cache
def ride(seed: int, late_s: float = 0.0) -> Ride:
    """Return a ride; an RTLS that is late tells where its tags were."""
    floor = floor_of(seed)
    x1, y1, x2, y2 = floor.plan.open_room
    path = Eight(speed_mps=LENGTH_M / DURATION_S, radius_m=RADIUS_M,
                 center_m=(0.5 * (x1 + x2), 0.5 * (y1 + y2)))  # fmt: skip
    for_odometry, for_ranges, for_offsets = np.random.default_rng([seed, 3]).spawn(3)
    drive = plan(path, (0.0, 0.0), DURATION_S, for_odometry)
    late_ns = round(late_s * NANOSECONDS)
    measured_ns = sensors.stamps(UWB_HZ, DURATION_S)
    measured_ns = measured_ns[measured_ns + late_ns <= round(DURATION_S * NANOSECONDS)]
    _, fixes = radios(floor, drive, measured_ns, for_ranges, for_offsets)
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
    return _trajectory([(z.stamp, z.pose.x, z.pose.y, z.pose.heading)
                        for z in tag_poses(of.fixes)])  # fmt: skip


def both(of: Ride) -> Trajectory:
    """Return the `PoseEkf` on wheels and the poses of the tags, at the stamps of the wheels."""
    config = _core.PoseEkfConfig()
    config.odometry = sigmas()
    start = _core.PoseEstimate(0, _core.Pose2(*of.drive.pose_at(0.0)[0].tolist()),
                               np.diag(np.square(SIGMA_START)))  # fmt: skip
    ekf = _core.PoseEkf(config, _core.AnchorMap([]), [], start)
    heard = list(tag_poses(of.fixes))
    rows = []
    for u in increments(of.odometry):
        while heard and heard[0].stamp <= u.begin:
            ekf.on(heard.pop(0))
        ekf.on(u)
        ekf.advance_to(u.stamp)
        pose = ekf.estimate(u.stamp).pose
        rows.append((u.stamp, pose.x, pose.y, pose.heading))
    return _trajectory(rows)


METHODS: Mapping[str, Callable[[Ride], Trajectory]] = {
    "odometry": odometry_alone,
    "uwb": uwb_alone,
    "ekf": both,
}


def errors_of(of: Ride, found: Trajectory) -> FloatArray:
    """Return estimate minus truth, shape (n, 3): x, y [m], heading [rad]."""
    assert found.heading is not None
    truth = of.drive.pose_at(sensors.seconds(found.stamp_ns))
    return np.column_stack([found.position - truth[:, :2], wrap_angle(found.heading - truth[:, 2])])


def eight_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows of Table III."""
    names = {"odometry": "odometry", "uwb": "UWB", "ekf": "PoseEkf on both"}
    for late_s, when in ((0.0, ""), (LATE_S, f", UWB {LATE_S:g} s late")):
        rmse = {}
        for name, method in METHODS.items():
            rides = [ride(seed, late_s) for seed in range(seeds)]
            off = [errors_of(of, method(of)) for of in rides]
            rmse[name] = np.array([np.sqrt(np.mean(one[:, :2] ** 2, axis=0)) for one in off])
            if late_s > 0.0 and name == "odometry":
                continue
            key = f"celan_eight_{name}" + ("_late" if late_s else "")
            for axis, letter in enumerate("xy"):
                yield claim_of(f"{key}_{letter}", f"eights, {names[name]}{when}: RMSE of {letter}",
                               "m", PAPER[name][axis], rmse[name][:, axis], "-",
                               lambda v: True)  # fmt: skip
        if late_s == 0.0:
            gain = np.hypot(*rmse["ekf"].T) / np.hypot(*rmse["uwb"].T)
            yield claim_of("celan_eight_gain", "eights: RMSE of both over that of UWB alone", "1",
                           MOST_OF_UWB, gain, f"<= {MOST_OF_UWB:g}",
                           lambda v: v <= MOST_OF_UWB)  # fmt: skip


def _trajectory(rows: list[tuple[int, float, float, float]]) -> Trajectory:
    stamp: StampArray = np.array([row[0] for row in rows], np.int64)
    pose = np.array([row[1:] for row in rows])
    return Trajectory(stamp, pose[:, :2].copy(), pose[:, 2].copy())
