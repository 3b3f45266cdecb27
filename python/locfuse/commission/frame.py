# SPDX-License-Identifier: Apache-2.0
"""One frame for a map and anchors: how one drive lies to another of the same robot."""

from __future__ import annotations

import numpy as np

from locfuse.eval.dead_reckoning import align
from locfuse.eval.errors import interpolate
from locfuse.types import NANOSECONDS, Columns, Trajectory, wrap_angle

_LEAST_M = 1.0  # of a drive that shows how it is turned
_RATE_HZ = 2.0  # of the poses of a drive by which something else is found


def pose_at(reference: Trajectory, stamp_ns: int) -> list[float] | None:
    """Return the pose [x, y, heading_deg] of a drive at a stamp; None where it has none."""
    at, inside = interpolate(reference, np.array([stamp_ns], dtype=np.int64))
    if not inside[0] or at.heading is None:
        return None
    return [*map(float, at.position[0, :2]), float(np.rad2deg(at.heading[0]))]


def laid_onto(drive: Trajectory, reference: Trajectory) -> list[float] | None:
    """Return the first pose [x, y, heading_deg] of a drive where a reference has it.

    None where they have no second in common, or do not show how one is turned in the other.
    """
    at, inside = interpolate(reference, drive.stamp_ns)
    mine, theirs = drive.position[inside], at.position[:, :2]
    if len(mine) < 2 or np.ptp(mine, axis=0).max() < _LEAST_M or drive.heading is None:
        return None
    turn = align(mine, theirs).angle
    c, s = np.cos(turn), np.sin(turn)
    first = theirs.mean(axis=0) + np.array([[c, -s], [s, c]]) @ (
        drive.position[0] - mine.mean(axis=0))  # fmt: skip
    heading = float(np.rad2deg(wrap_angle(drive.heading[0] + turn)))
    return [float(first[0]), float(first[1]), heading]


def poses_of(drive: Trajectory) -> Columns:
    """Return a drive as a table of poses, two each second."""
    P, heading = drive.covariance, drive.heading
    assert P is not None
    assert heading is not None
    ticks = (drive.stamp_ns - drive.stamp_ns[0]) * _RATE_HZ // NANOSECONDS
    kept = np.flatnonzero(np.diff(ticks, prepend=-1) > 0)
    return {
        "stamp_ns": drive.stamp_ns[kept],
        "x_m": drive.position[kept, 0].copy(),
        "y_m": drive.position[kept, 1].copy(),
        "heading_rad": heading[kept],
        "sigma_xy_m": np.sqrt(0.5 * (P[kept, 0, 0] + P[kept, 1, 1])),
        "sigma_heading_rad": np.sqrt(P[kept, 2, 2]),
    }
