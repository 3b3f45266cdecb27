# SPDX-License-Identifier: Apache-2.0
"""Paths laid over one another: dead reckoning against another source of positions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray, Trajectory

WINDOW_S = 30.0
MAX_WINDOWS = 20

_MIN_ROWS = 8
_MIN_SPREAD_M = 0.3


@dataclass(frozen=True)
class Track:
    """Where something on the robot was, as one source reports it.

    `name` is the file of the log, for people; `path` is in world. `lever` [m] is the point of the
    body that moves along it.
    """

    name: str
    path: Trajectory
    lever: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Alignment:
    """How one path lies on another.

    `angle` [rad] lays the first on the second; `scale` is length of the second over length of the
    first. `rms` [m] is what is left over, `spread` [m] the root mean square extent of the second
    about its centre.
    """

    angle: float
    scale: float
    rms: float
    spread: float


def dead_reckon(odometry: Columns, turn: float = 1.0) -> Trajectory:
    """Integrate odometry from the origin, with its rotation times `turn`."""
    stamp = odometry["stamp_ns"]
    if "dx_m" in odometry:
        dx, dy = odometry["dx_m"].copy(), odometry["dy_m"].copy()
        dheading = turn * odometry["dheading_rad"]
        dx[0] = dy[0] = dheading[0] = 0.0
        heading = np.cumsum(dheading)
        before = heading - dheading
    else:
        dt = np.diff(stamp, prepend=stamp[:1]) / NANOSECONDS
        held = np.concatenate([[0], np.arange(len(stamp) - 1)])
        left = odometry.get("v_left_mps", np.zeros(len(stamp)))
        dx, dy = odometry["v_mps"][held] * dt, left[held] * dt
        dheading = turn * odometry["omega_radps"][held] * dt
        heading = np.cumsum(dheading)
        before = heading - 0.5 * dheading
    c, s = np.cos(before), np.sin(before)
    position = np.cumsum(np.column_stack([c * dx - s * dy, s * dx + c * dy]), axis=0)
    return Trajectory(stamp, position, heading)


def at_times(track: Trajectory, stamp_ns: StampArray) -> FloatArray:
    """Return x, y and unwrapped heading (0 without one) at stamps inside the track."""
    origin = int(track.stamp_ns[0])
    at, known = stamp_ns - origin, track.stamp_ns - origin
    columns = [track.position[:, 0], track.position[:, 1]]
    columns.append(np.zeros(len(track)) if track.heading is None else np.unwrap(track.heading))
    return np.column_stack([np.interp(at, known, column) for column in columns])


def levered(poses: FloatArray, lever: tuple[float, float]) -> FloatArray:
    """Return where a point of the body is, shape (n, 2), for poses of shape (n, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = lever
    return poses[:, :2] + np.column_stack([c * x - s * y, s * x + c * y])


def windows(reference: Track, other: Trajectory) -> Iterator[StampArray]:
    """Yield the stamps of the reference in stretches in which it moves and the other is known."""
    stamp = reference.path.stamp_ns
    inside = (stamp >= other.stamp_ns[0]) & (stamp <= other.stamp_ns[-1])
    if not inside.any():
        return
    rows = np.flatnonzero(inside)
    number = (stamp[rows] - stamp[rows[0]]) // int(WINDOW_S * NANOSECONDS)
    chosen = np.unique(number)
    thin = np.linspace(0, len(chosen) - 1, min(len(chosen), MAX_WINDOWS)).astype(np.intp)
    for window in chosen[np.unique(thin)]:
        members = rows[number == window]
        at = reference.path.position[members]
        extent = np.sqrt(np.sum(np.var(at, axis=0)))
        if len(members) >= _MIN_ROWS and extent > _MIN_SPREAD_M:
            yield stamp[members]


def align(moved: FloatArray, fixed: FloatArray) -> Alignment:
    """Lay one path of shape (n, 2) on another by turning, scaling and shifting it."""
    p, q = moved - moved.mean(axis=0), fixed - fixed.mean(axis=0)
    dot, cross = float(np.sum(p * q)), float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]))
    length = float(np.sum(p * p))
    scale = np.hypot(dot, cross) / length if length > 0.0 else 1.0
    angle = float(np.arctan2(cross, dot))
    c, s = np.cos(angle), np.sin(angle)
    left = q - scale * (p @ np.array([[c, s], [-s, c]]))
    off, extent = (float(np.sqrt(np.mean(np.sum(v * v, axis=1)))) for v in (left, q))
    return Alignment(angle, float(scale), off, extent)


def compare(odometry: Trajectory, reference: Track) -> list[Alignment]:
    """Lay dead reckoning on a reference, stretch by stretch."""
    found = []
    for stamp in windows(reference, odometry):
        poses = at_times(odometry, stamp)
        fixed = at_times(reference.path, stamp)[:, :2]
        found.append(align(levered(poses, reference.lever), fixed))
    return found


def rms(alignments: list[Alignment]) -> float:
    """Return the root mean square of what several alignments leave over."""
    return float(np.sqrt(np.mean([a.rms**2 for a in alignments])))


def spread(alignments: list[Alignment]) -> float:
    """Return the root mean square extent of several stretches, metres."""
    return float(np.sqrt(np.mean([a.spread**2 for a in alignments])))


def legs(at: FloatArray, length: float = 0.6) -> NDArray[np.intp]:
    """Return rows (k, 2) between which a path of shape (n, 2) has come `length` metres far."""
    begin, found = 0, []
    for row in range(len(at)):
        if math.hypot(at[row, 0] - at[begin, 0], at[row, 1] - at[begin, 1]) >= length:
            found.append((begin, row))
            begin = row
    return np.array(found, np.intp).reshape(-1, 2)
