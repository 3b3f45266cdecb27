# SPDX-License-Identifier: Apache-2.0
"""Odometry that was set anew: its pose leaps, the body does not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.io.log_folder import MAX_SPEED_MPS, MAX_TURN_RATE_RADPS
from locfuse.types import NANOSECONDS, FloatArray

JITTER_S = 0.1  # of stamps: messages that come in a packet are no leap
STEADY_S = 0.3  # for how long a velocity bounds the motion; afterwards it may have been any
MARGIN = 3.0  # times the fastest of what is known, that a body may have moved between two messages
MIN_LEAP = np.array([0.3, 0.3])  # m and rad: less may be a curb or a wheel that slips
MIN_LEAP_HOME = np.array([0.05, 0.05])  # to exactly (0, 0, 0), where drivers begin; no margin then
HOME = 1e-6  # m and rad: at most that far from it
UNKNOWN_RATE = np.array([5.0, 3.0])  # m/s and rad/s that a body may reach where nothing states one
LIMITS = np.array([MAX_SPEED_MPS, MAX_TURN_RATE_RADPS])


class Leaps:
    """Tells, message by message, motion of the body from poses of odometry that leap.

    A body goes on about as fast as the velocities of both messages say, or the motion before. A
    velocity that was never other than 0, along or around, is not stated. What goes on like the last
    leap was none: a car whose driver states no velocity, seen from its first motion on.
    """

    def __init__(self) -> None:
        self._rate = np.zeros(2)  # of the last motion that was none [m/s, rad/s]
        self._leap: FloatArray | None = None  # the last motion, per second, if it was one
        self._is_known = np.zeros(2, np.bool_)

    @np.errstate(over="ignore", invalid="ignore")  # what overflows has leapt
    def is_leap(
        self, seconds: float, motion: FloatArray, pose: FloatArray, velocity: FloatArray
    ) -> bool:
        """Take the next message and return whether its pose leapt.

        Parameters
        ----------
        seconds : float
            Since the message before [s].
        motion, pose : ndarray (3,)
            Since then, in the body, and now in odom: x [m], y [m], heading [rad].
        velocity : ndarray (2, 3)
            Forward [m/s], left [m/s] and turn rate [rad/s] of the message before and of this one.
        """
        stated = _sizes(velocity)
        self._is_known |= stated.any(axis=0)
        size, lasted = _sizes(motion[None])[0], seconds + JITTER_S
        rate = np.maximum(stated.max(axis=0), self._rate)
        if np.all(np.abs(pose) <= HOME):
            reach = rate * lasted + MIN_LEAP_HOME
        else:
            unknown = np.where(self._is_known, max(seconds - STEADY_S, 0.0), lasted)
            reach = MARGIN * rate * lasted + MIN_LEAP + UNKNOWN_RATE * unknown
        now = motion / lasted
        goes_on = self._leap is not None and bool(
            np.linalg.norm(now - self._leap) <= 0.5 * np.linalg.norm(self._leap)
        )
        too_far = bool(np.any(size > LIMITS * lasted))
        is_leap = too_far or (bool(np.any(size > reach)) and not goes_on)
        self._leap = now if is_leap else None
        if not is_leap:
            self._rate = size / lasted
        return is_leap


def rows_of_leaps(
    stamp: NDArray[Any], poses: FloatArray, velocity: FloatArray, motion: FloatArray
) -> list[int]:
    """Return the rows of a whole drive at which odometry was set anew.

    `velocity` (n, 3) is forward [m/s], left [m/s] and turn rate [rad/s] at `stamp` [ns].
    """
    leaps = Leaps()
    seconds = np.diff(stamp, prepend=stamp[:1]) / NANOSECONDS
    return [row for row in range(1, len(stamp))
            if leaps.is_leap(float(seconds[row]), motion[row], poses[row],
                             velocity[row - 1 : row + 1])]  # fmt: skip


def motion_by_velocity(seconds: float, velocity: FloatArray) -> _core.Pose2:
    """Return the motion between two messages by the mean of their velocities (2, 3).

    None where that is beyond any robot: it is in other units.
    """
    mean = velocity.mean(axis=0)
    if np.any(_sizes(mean[None]) > LIMITS):
        return _core.Pose2()
    return _core.arc(*(seconds * mean).tolist())


def _sizes(motion: FloatArray) -> FloatArray:
    """Return how far and how much around (n, 2) motions (n, 3) lead."""
    return np.column_stack([np.hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])])


def sentence(stamp_ns: int, motion: FloatArray, count: int = 1) -> str:
    """Return what is said of odometry that leapt by a motion, first at a stamp."""
    return (f"odometry jumps {count} times, first by {np.hypot(*motion[:2]):.3g} m and "
            f"{np.degrees(motion[2]):.3g} deg at {stamp_ns / NANOSECONDS:.3f} s; it was set anew, "
            "so the motion there is that of its velocities")  # fmt: skip
