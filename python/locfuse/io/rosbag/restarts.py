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
MARGIN = 3.0  # times the fastest of what is known, that a body may have moved between two messages
MIN_LEAP = np.array([0.3, 0.3])  # m and rad: less may be a curb or a wheel that slips
MIN_LEAP_HOME = np.array([0.05, 0.05])  # to exactly (0, 0, 0), where drivers begin; no margin then
HOME = 1e-6  # m and rad: at most that far from it
UNKNOWN_RATE = np.array([5.0, 3.0])  # m/s and rad/s that a body may reach whose driver states none
LIMITS = np.array([MAX_SPEED_MPS, MAX_TURN_RATE_RADPS])


def leaps(
    seconds: FloatArray, motion: FloatArray, pose: FloatArray, rates: FloatArray,
    is_known: NDArray[np.bool_],
) -> NDArray[np.bool_]:  # fmt: skip
    """Return at which messages the pose of odometry leapt, shape (n,).

    Parameters
    ----------
    seconds : ndarray (n,)
        Since the message before [s].
    motion, pose : ndarray (n, 3)
        Since then, and now: x [m], y [m], heading [rad].
    rates : ndarray (n, 2)
        The fastest [m/s, rad/s] of the velocities of both messages, and of the motion before.
    is_known : ndarray (n,)
        Whether the driver has ever stated a velocity that is not 0.
    """
    size = np.column_stack([np.hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])])
    home = np.all(np.abs(pose) <= HOME, axis=1, keepdims=True)
    lasted = (seconds + JITTER_S)[:, None]
    reach = np.where(home, 1.0, MARGIN) * rates * lasted + np.where(home, MIN_LEAP_HOME, MIN_LEAP)
    reach += np.where(is_known[:, None] | home, 0.0, UNKNOWN_RATE * lasted)
    return np.asarray(((size > reach) | (size > LIMITS * lasted)).any(axis=1))


def rows_of_leaps(
    stamp: NDArray[Any], poses: FloatArray, velocity: FloatArray, motion: FloatArray
) -> NDArray[Any]:
    """Return the rows of a whole drive at which odometry was set anew.

    `velocity` (n, 3) is forward [m/s], left [m/s] and turn rate [rad/s] at `stamp` [ns].
    """
    if len(stamp) < 2:
        return np.zeros(0, np.int64)
    seconds = np.diff(stamp) / NANOSECONDS
    moving = np.column_stack([np.hypot(velocity[:, 0], velocity[:, 1]), np.abs(velocity[:, 2])])
    moved = np.column_stack([np.hypot(motion[1:, 0], motion[1:, 1]), np.abs(motion[1:, 2])])
    before = np.zeros_like(moved)
    before[1:] = moved[:-1] / (seconds[:-1] + JITTER_S)[:, None]
    rates = np.maximum(np.maximum(moving[:-1], moving[1:]), before)
    known = np.logical_or.accumulate(moving.any(axis=1))[1:]
    return 1 + np.flatnonzero(leaps(seconds, motion[1:], poses[1:], rates, known))


def motion_by_velocity(seconds: float, before: FloatArray, now: FloatArray) -> _core.Pose2:
    """Return the motion between two messages by the mean of their velocities."""
    return _core.arc(*(seconds * 0.5 * (before + now)).tolist())


def sentence(stamp_ns: int, motion: FloatArray, count: int = 1) -> str:
    """Return what is said of odometry that leapt by a motion, first at a stamp."""
    return (f"odometry jumps {count} times, first by {np.hypot(*motion[:2]):.3g} m and "
            f"{np.degrees(motion[2]):.3g} deg at {stamp_ns / NANOSECONDS:.3f} s; it was set anew, "
            "so the motion there is that of its velocities")  # fmt: skip
