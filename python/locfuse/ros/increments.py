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

    Parameters
    ----------
    motion : float64 array, shape (n, 3)
        dx, dy [m] and dheading [rad] in the body at the row before; of the first row, in odom.

    Returns
    -------
    float64 array, shape (n, 3)
        x, y and heading in odom.
    """
    found = np.empty_like(motion)
    x = y = heading = 0.0
    for row, (dx, dy, turn) in enumerate(motion.tolist()):
        c, s = math.cos(heading), math.sin(heading)
        x, y = x + (c * dx - s * dy), y + (s * dx + c * dy)
        heading = _wrapped(heading + turn)
        found[row] = x, y, heading
    return found


def increments_of(poses: FloatArray) -> FloatArray:
    """Return the increments between poses, which `poses_of` takes to poses that give them again.

    Differences of rounded numbers are rounded themselves, and a million of them add up to other
    last digits. So each increment leads from where those before it lead to, and is moved until it
    ends at the pose that was told; where no increment does, at its neighbour.

    Parameters
    ----------
    poses : float64 array, shape (n, 3)
        x, y and heading in odom.

    Returns
    -------
    float64 array, shape (n, 3)
        dx, dy, dheading; the first row leads from odom's origin to the first pose.

    Examples
    --------
    >>> poses = np.array([[0.1, 0.2, 0.3], [0.7, 0.1, 0.4], [0.9, 0.3, 0.2]])
    >>> motion = increments_of(poses)
    >>> np.allclose(poses_of(motion), poses, rtol=0, atol=1e-15)
    True
    >>> np.array_equal(increments_of(poses_of(motion)), motion)
    True
    """
    found = np.empty_like(poses)
    x = y = heading = 0.0
    for row, (to_x, to_y, to_heading) in enumerate(poses.tolist()):
        c, s = math.cos(heading), math.sin(heading)
        for _ in range(TRIES):
            dx, dy = _straight(x, y, c, s, to_x, to_y)
            turn = _turn(heading, to_heading)
            at = x + (c * dx - s * dy), y + (s * dx + c * dy), _wrapped(heading + turn)
            if at == (to_x, to_y, to_heading):
                break
            to_x, to_y, to_heading = at
        found[row] = dx, dy, turn
        x, y, heading = at
    return found


def _straight(
    x: float, y: float, c: float, s: float, to_x: float, to_y: float
) -> tuple[float, float]:
    dx, dy = c * (to_x - x) + s * (to_y - y), c * (to_y - y) - s * (to_x - x)
    for _ in range(TRIES):
        rx, ry = to_x - (x + (c * dx - s * dy)), to_y - (y + (s * dx + c * dy))
        if rx == 0.0 and ry == 0.0:
            break
        dx, dy = dx + (c * rx + s * ry), dy + (c * ry - s * rx)
    return dx, dy


def _turn(heading: float, to_heading: float) -> float:
    turn = _wrapped(to_heading - heading)
    for _ in range(TRIES):
        rest = to_heading - _wrapped(heading + turn)
        if rest == 0.0:
            break
        turn += _wrapped(rest)
    return turn


def _wrapped(angle: float) -> float:
    return float(_core.wrap_angle(angle))
