# SPDX-License-Identifier: Apache-2.0
"""Odometry that was set anew: its pose leaps, the body does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.io.log_folder import MAX_TURN_RATE_RADPS
from locfuse.types import MAX_SPEED_MPS, NANOSECONDS, FloatArray

JITTER_S = 0.1  # of stamps: messages that come in a packet are no leap
STEADY_S = 0.3  # for how long a velocity bounds the motion; afterwards it may have been any
MARGIN = 3.0  # times the fastest of what is known, that a body may have moved between two messages
MIN_LEAP = 0.3  # m and rad: less may be a curb or a wheel that slips
MIN_LEAP_HOME = 0.05  # m and rad, to exactly (0, 0, 0), where drivers begin; no margin then
HOME = 1e-6  # m and rad: at most that far from it
UNKNOWN_RATE = (5.0, 3.0)  # m/s and rad/s that a body may reach where nothing states one
LIMITS = (MAX_SPEED_MPS, MAX_TURN_RATE_RADPS)

Motion: TypeAlias = Sequence[float]  # x or forward, y or left, around


class Leaps:
    """Distinguishes, message by message, motion of the body from poses of odometry that leap.

    A body goes on about as fast as the velocities of both messages say, or the motion before. A
    velocity that was never other than 0, along or around, is not stated. What goes on like the last
    leap was none: a car whose driver states no velocity, seen from its first motion on.
    """

    def __init__(self) -> None:
        self._rate = [0.0, 0.0]  # of the last motion that was none [m/s, rad/s]
        self._leap: list[float] | None = None  # the last motion, per second, if it was one
        self._is_known = [False, False]

    def is_leap(
        self, seconds: float, motion: Motion, pose: Motion, velocity: Sequence[Motion]
    ) -> bool:
        """Take the next message and return whether its pose leapt.

        `seconds` have passed since the message before. `motion` since then, in the body, and
        `pose` now, in odom, are x [m], y [m] and heading [rad]; `velocity` has forward [m/s], left
        [m/s] and turn rate [rad/s] of the message before and of this one.
        """
        lasted = seconds + JITTER_S
        at_home = max(map(abs, pose)) <= HOME
        too_far = beyond = False
        size = _sizes(motion)
        for axis, stated in enumerate(map(max, *map(_sizes, velocity))):
            self._is_known[axis] = self._is_known[axis] or stated > 0.0
            unknown = max(seconds - STEADY_S, 0.0) if self._is_known[axis] else lasted
            most = max(stated, self._rate[axis]) * lasted
            reach = (most + MIN_LEAP_HOME if at_home
                     else MARGIN * most + MIN_LEAP + UNKNOWN_RATE[axis] * unknown)  # fmt: skip
            beyond = beyond or size[axis] > reach
            too_far = too_far or size[axis] > LIMITS[axis] * lasted
        now = [part / lasted for part in motion]
        goes_on = self._leap is not None and (
            math.dist(now, self._leap) <= 0.5 * math.hypot(*self._leap)
        )
        is_leap = too_far or (beyond and not goes_on)
        self._leap = now if is_leap else None
        if not is_leap:
            self._rate = [size[0] / lasted, size[1] / lasted]
        return is_leap


def rows_of_leaps(
    stamp: NDArray[Any], poses: FloatArray, velocity: FloatArray, motion: FloatArray
) -> list[int]:
    """Return the rows of a whole drive at which odometry was set anew.

    `velocity` (n, 3) is forward [m/s], left [m/s] and turn rate [rad/s] at `stamp` [ns].
    """
    leaps = Leaps()
    seconds = (np.diff(stamp) / NANOSECONDS).tolist()
    moved, at, velocities = motion.tolist(), poses.tolist(), velocity.tolist()
    return [row for row in range(1, len(stamp))
            if leaps.is_leap(seconds[row - 1], moved[row], at[row],
                             velocities[row - 1 : row + 1])]  # fmt: skip


def motion_by_velocity(seconds: float, velocity: Sequence[Motion]) -> _core.Pose2:
    """Return the motion between two messages by the mean of their velocities.

    None where that is beyond any robot: it is in other units.
    """
    mean = [0.5 * (before + now) for before, now in zip(*velocity, strict=True)]
    if any(size > limit for size, limit in zip(_sizes(mean), LIMITS, strict=True)):
        return _core.Pose2()
    return _core.arc(*(seconds * part for part in mean))


def _sizes(motion: Motion) -> tuple[float, float]:
    """Return how far and how much around a motion leads."""
    return math.hypot(motion[0], motion[1]), abs(motion[2])


def sentence(stamp_ns: int, motion: Motion, count: int = 1) -> str:
    """Return what is said of odometry that leapt by a motion, first at a stamp."""
    return (f"odometry jumps {count} times, first by {math.hypot(*motion[:2]):.3g} m and "
            f"{math.degrees(motion[2]):.3g} deg at {stamp_ns / NANOSECONDS:.3f} s; it was set "
            "anew, so the motion there is that of its velocities")  # fmt: skip
