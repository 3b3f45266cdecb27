# SPDX-License-Identifier: Apache-2.0
"""From poses of odometry to increments and back, to the last bit."""

from __future__ import annotations

import math

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray

TRIES = 8


def poses_of(motion: FloatArray) -> FloatArray:
    """Return the poses that increments lead to, one after another, from the origin on.

    `motion` (n, 3) is dx, dy [m] and dheading [rad] in the body at the row before; of the first
    row, in odom. The poses (n, 3) are x, y and heading in odom.
    """
    found = []
    x = y = heading = 0.0
    for dx, dy, turn in motion.tolist():
        c, s = math.cos(heading), math.sin(heading)
        x, y = x + (c * dx - s * dy), y + (s * dx + c * dy)
        heading += turn
        if not -math.pi <= heading < math.pi:
            heading = _core.wrap_angle(heading)
        found.append((x, y, heading))
    return np.array(found, np.float64).reshape(-1, 3)


def increments_of(poses: FloatArray) -> FloatArray:
    """Return the increments between poses, which `poses_of` takes to poses that give them again.

    Differences of rounded numbers are rounded themselves, and a million of them add up to other
    last digits. So each increment leads from where those before it lead to, and is moved until it
    ends at the pose that was given; where no increment does, at its neighbour. `poses` (n, 3) are
    x, y and heading in odom; the first row of the increments (n, 3), dx, dy, dheading, leads from
    odom's origin to the first pose.

    Examples
    --------
    >>> poses = np.array([[0.1, 0.2, 0.3], [0.7, 0.1, 0.4], [0.9, 0.3, 0.2]])
    >>> motion = increments_of(poses)
    >>> np.allclose(poses_of(motion), poses, rtol=0, atol=1e-15)
    True
    >>> np.array_equal(increments_of(poses_of(motion)), motion)
    True
    """
    origin = np.zeros((1, 3))
    found, ends = _steps(np.concatenate([origin, poses[:-1]]), poses)
    done = -1
    for row in np.flatnonzero((ends != poses).any(axis=1)).tolist():
        while row > done:
            done, end = row, ends[row]
            if row + 1 < len(poses) and (end != poses[row]).any():  # the next one begins elsewhere
                row += 1
                found[row : row + 1], ends[row : row + 1] = _steps(end[None], poses[row][None])
    return found


def _steps(begins: FloatArray, given: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return increments (n, 3) from poses to others, and where they lead to, which is near."""
    ends = given.copy()
    motion = np.empty_like(ends)
    c, s = (np.array(list(map(turn, begins[:, 2].tolist()))) for turn in (math.cos, math.sin))
    rows = np.arange(len(given))
    for _ in range(TRIES):
        begin, end, cos, sin = begins[rows], ends[rows], c[rows], s[rows]
        dx, dy = _straight(begin, cos, sin, end)
        turn = _turn(begin[:, 2], end[:, 2])
        motion[rows] = np.column_stack([dx, dy, turn])
        ends[rows] = np.column_stack([begin[:, 0] + (cos * dx - sin * dy),
                                      begin[:, 1] + (sin * dx + cos * dy),
                                      wrapped(begin[:, 2] + turn)])  # fmt: skip
        rows = rows[(ends[rows] != end).any(axis=1)]
        if not len(rows):
            break
    return motion, ends


def _straight(
    begin: FloatArray, c: FloatArray, s: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    x, y = begin[:, 0], begin[:, 1]
    to_x, to_y = end[:, 0], end[:, 1]
    dx, dy = c * (to_x - x) + s * (to_y - y), c * (to_y - y) - s * (to_x - x)
    for _ in range(TRIES):
        rx, ry = to_x - (x + (c * dx - s * dy)), to_y - (y + (s * dx + c * dy))
        off = (rx != 0.0) | (ry != 0.0)
        if not off.any():
            break
        dx = np.where(off, dx + (c * rx + s * ry), dx)
        dy = np.where(off, dy + (c * ry - s * rx), dy)
    return dx, dy


def _turn(heading: FloatArray, to_heading: FloatArray) -> FloatArray:
    turn = wrapped(to_heading - heading)
    for _ in range(TRIES):
        rest = to_heading - wrapped(heading + turn)
        if not rest.any():
            break
        turn = np.where(rest == 0.0, turn, turn + wrapped(rest))
    return turn


def wrapped(angles: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi), as the core wraps them to the last bit."""
    outside = ~((angles >= -math.pi) & (angles < math.pi))
    if outside.any():
        angles = angles.copy()
        angles[outside] = [_core.wrap_angle(angle) for angle in angles[outside].tolist()]
    return angles
