# SPDX-License-Identifier: Apache-2.0
"""A drive by laser and wheels alone: each scan fitted to those before it, without a map."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.eval.dead_reckoning import dead_reckon
from locfuse.eval.errors import interpolate
from locfuse.run.start import scans_of
from locfuse.types import NANOSECONDS, Log, LogError, Trajectory

LONGEST_S = 1e9  # any gap of the odometry is driven through


def scan_odometry(
    log: Log,
    config: _core.ScanOdometryConfig | None = None,
    noise: _core.OdometryConfig | None = None,
) -> Trajectory:
    """Feed the scans of a log to a `ScanOdometry`; between scans the wheels lead on.

    Parameters
    ----------
    log : Log
        With odometry, scans and a laser. Scans before or after the odometry are left out.
    config : ScanOdometryConfig, optional
    noise : OdometryConfig, optional
        Of the wheels.

    Returns
    -------
    Trajectory
        Of the body, from (0, 0, 0) on, at each stamp of the odometry and each scan; every pose from
        what was known by then.

    Raises
    ------
    LogError
        If the log has no odometry or no scans.
    """
    scans = {scan.stamp: scan for scan in scans_of(log)}
    if "odometry" not in log or not scans:
        raise LogError("a drive by scans needs odometry, scans and a laser; the log lacks one")
    wheels = dead_reckon(log["odometry"])
    stamps = np.array(sorted(scans), np.int64)
    inside = (stamps >= wheels.stamp_ns[0]) & (stamps <= wheels.stamp_ns[-1])
    stamps = np.union1d(wheels.stamp_ns, stamps[inside])
    at, _ = interpolate(wheels, stamps, longest_gap_s=LONGEST_S)
    assert at.heading is not None
    rows = np.column_stack([at.position, at.heading]).tolist()

    model = _core.OdometryMotion(noise or _core.OdometryConfig())
    odometry = _core.ScanOdometry(config or _core.ScanOdometryConfig())
    moved, covariance = _core.Pose2(), np.zeros((3, 3))  # since the last scan
    fitted = _core.Pose2()  # there
    last, reported_ns = _core.Pose2(*rows[0]), int(stamps[0])
    poses = []
    for stamp, row in zip(stamps.tolist(), rows, strict=True):
        wheel = _core.Pose2(*row)
        step = model.propagate(moved, last.inverse() * wheel, (stamp - reported_ns) / NANOSECONDS)
        covariance = step.jacobian @ covariance @ step.jacobian.T + step.noise
        moved, last, reported_ns = step.moved, wheel, stamp
        if stamp in scans:
            fitted = odometry.on(scans[stamp], moved, covariance).pose
            moved, covariance = _core.Pose2(), np.zeros((3, 3))
        pose = fitted * moved
        poses.append((pose.x, pose.y, pose.heading))
    path = np.array(poses)
    return Trajectory(stamps, path[:, :2], path[:, 2])
