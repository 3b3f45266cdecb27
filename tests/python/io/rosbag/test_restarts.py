# SPDX-License-Identifier: Apache-2.0
"""Odometry that was set anew is told from odometry that moves, by bag and message by message."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from locfuse.io.rosbag.decode import OdometryRow
from locfuse.io.rosbag.increments import increments_of
from locfuse.io.rosbag.restarts import rows_of_leaps
from locfuse.io.rosbag.rows import Wheels
from locfuse.types import NANOSECONDS, FloatArray


def leaps_of(seconds: FloatArray, poses: FloatArray, velocity: FloatArray) -> list[int]:
    """Return the rows of leaps of a whole drive, which are those message by message."""
    stamp = np.round(seconds * NANOSECONDS).astype(np.int64)
    found = rows_of_leaps(stamp, poses, velocity, increments_of(poses))
    said: list[str] = []
    wheels, one_by_one = Wheels("pose", said.append), []
    for row, (at, (x, y, heading), (v, left, omega)) in enumerate(
        zip(stamp.tolist(), poses.tolist(), velocity.tolist(), strict=True)
    ):
        before = len(said)
        wheels.row(OdometryRow(at, x, y, heading, v, omega, "odom", "base", 0.0, left))
        if len(said) > before:
            one_by_one.append(row)
    assert one_by_one == found
    return found


def straight(
    speed: float, rate_hz: float = 20.0, count: int = 200
) -> tuple[FloatArray, FloatArray]:
    seconds = np.arange(count) / rate_hz
    return seconds, np.column_stack([speed * seconds, np.zeros(count), np.zeros(count)])


@pytest.mark.parametrize("speed", [0.1, 1.0, 8.0, 30.0])
@pytest.mark.parametrize("rate_hz", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("stated", [1.0, 0.0, 0.5])
def test_a_drive_has_no_leap(speed: float, rate_hz: float, stated: float) -> None:
    seconds, poses = straight(speed, rate_hz)
    velocity = np.zeros_like(poses)
    velocity[:, 0] = stated * speed
    found = leaps_of(seconds, poses, velocity)
    # A car whose driver states no velocity is one from its first motion on.
    assert found == [] if stated or speed < 5.0 else found in ([], [1])


def test_a_turn_in_place_a_start_and_a_stop_are_no_leaps() -> None:
    seconds = np.arange(300) / 20.0
    turn = np.clip(seconds - 5.0, 0.0, 5.0) * 2.0
    heading = (turn + math.pi) % (2.0 * math.pi) - math.pi
    poses = np.column_stack([np.zeros(300), np.zeros(300), heading])
    velocity = np.zeros_like(poses)
    velocity[:, 2] = np.where((seconds > 5.0) & (seconds < 10.0), 2.0, 0.0)
    assert leaps_of(seconds, poses, velocity) == []
    assert leaps_of(seconds, poses, np.zeros_like(velocity)) == []


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("gap", [0, 40])
def test_a_pose_that_begins_again_at_home_is_a_leap(stated: bool, gap: int) -> None:
    seconds, poses = straight(0.5)
    poses[100:] -= poses[100]
    seconds[100:] += gap / 20.0
    velocity = np.zeros_like(poses)
    velocity[:, 0] = 0.5 if stated else 0.0
    assert leaps_of(seconds, poses, velocity) == [100]


def test_a_short_leap_home_is_found_too() -> None:
    seconds, poses = straight(0.02)
    poses[150:] -= poses[150]  # after 15 cm
    velocity = np.zeros_like(poses)
    velocity[:, 0] = 0.02
    assert leaps_of(seconds, poses, velocity) == [150]


def test_a_heading_that_is_set_anew_is_a_leap() -> None:
    seconds, poses = straight(0.5)
    poses[:100, 2] = 1.0
    velocity = np.zeros_like(poses)
    velocity[:, 0] = 0.5
    assert leaps_of(seconds, poses, velocity) == [100]


def test_messages_in_a_packet_are_no_leap() -> None:
    _, poses = straight(1.0)
    seconds = np.floor(np.arange(200) / 10.0) / 2.0 + 15e-6 * (np.arange(200) % 10)
    velocity = np.zeros_like(poses)
    velocity[:, 0] = 1.0
    assert leaps_of(seconds, poses, velocity) == []
    assert leaps_of(seconds, poses, np.zeros_like(velocity)) == []


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("away", [30.0, -5.0])
def test_one_message_that_is_wrong_costs_no_more_than_itself(stated: bool, away: float) -> None:
    seconds, poses = straight(0.5)
    poses[100] = (away, 0.0, 0.0) if away > 0.0 else (0.0, 0.0, 0.0)
    velocity = np.zeros_like(poses)
    velocity[:, 0] = 0.5 if stated else 0.0
    assert leaps_of(seconds, poses, velocity) == [100, 101]


@pytest.mark.parametrize("stated", [(1, 1), (1, 0), (0, 1)])
@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 5.0])
def test_what_a_robot_does_between_two_messages_is_no_leap(
    stated: tuple[int, int], rate_hz: float
) -> None:
    """It starts, drives a second, turns on the spot by 90 degrees, again and again."""
    fine = np.arange(0.0, 60.0, 0.05)
    turns = (fine % 4.0) >= 2.0
    v, omega = np.where(turns, 0.0, 1.0), np.where(turns, math.pi / 4.0, 0.0)
    heading = np.cumsum(omega) * 0.05
    x, y = np.cumsum(v * np.cos(heading)) * 0.05, np.cumsum(v * np.sin(heading)) * 0.05
    every = round(20.0 / rate_hz)
    wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
    poses = np.column_stack([x, y, wrapped])[7::every]
    velocity = np.column_stack([stated[0] * v, 0.0 * v, stated[1] * omega])[7::every]
    assert leaps_of(fine[7::every], poses, velocity) == []


def test_a_robot_may_drive_while_its_driver_is_silent() -> None:
    seconds, poses = straight(0.5, count=20)
    seconds[10:] += 5.0
    poses[10:, 0] += 2.0
    velocity = np.zeros_like(poses)
    velocity[:, 0] = np.where((seconds > 0.1) & (seconds < 0.3), 0.5, 0.0)
    assert leaps_of(seconds, poses, velocity) == []


def test_a_pose_beyond_all_numbers_is_a_leap_without_a_warning() -> None:
    seconds, poses = straight(0.5, count=20)
    poses[10, 0], poses[12, 1] = 1e300, -1e308
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert leaps_of(seconds, poses, np.zeros_like(poses)) == [10, 11, 12, 13]
