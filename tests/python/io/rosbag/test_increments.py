# SPDX-License-Identifier: Apache-2.0
"""Poses become increments and increments poses without drifting by a bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.io.rosbag.increments import increments_of, poses_of
from locfuse.types import FloatArray


def drive(seed: int, speed: float = 0.02, n: int = 3000) -> FloatArray:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0.0, 0.05, n))
    heading = np.mod(heading + math.pi, 2.0 * math.pi) - math.pi
    x, y = np.cumsum(speed * np.cos(heading)), np.cumsum(speed * np.sin(heading))
    return np.column_stack([x, y, heading])


def test_an_increment_is_given_in_the_body_before_it() -> None:
    poses = np.array([[1.0, 2.0, math.pi / 2], [1.0, 3.0, math.pi / 2], [0.5, 3.0, -math.pi / 2]])
    motion = increments_of(poses)
    assert motion[0] == pytest.approx([1.0, 2.0, math.pi / 2])
    assert motion[1] == pytest.approx([1.0, 0.0, 0.0])
    assert motion[2][:2] == pytest.approx([0.0, 0.5])
    assert abs(motion[2][2]) == pytest.approx(math.pi)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("speed", [1e-5, 0.02, 5.0])
def test_once_written_increments_come_back_bit_for_bit(seed: int, speed: float) -> None:
    poses = drive(seed, speed)
    motion = increments_of(poses)
    again = poses_of(motion)
    assert np.abs(again - poses).max() <= np.spacing(np.abs(poses).max())
    assert np.array_equal(increments_of(again), motion)
    assert np.array_equal(poses_of(increments_of(again)), again)


def test_differences_alone_would_drift() -> None:
    poses = drive(0, 5.0)
    before = np.vstack([np.zeros((1, 3)), poses[:-1]])
    c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
    step = poses[:, :2] - before[:, :2]
    naive = np.column_stack([c * step[:, 0] + s * step[:, 1], c * step[:, 1] - s * step[:, 0],
                             poses[:, 2] - before[:, 2]])  # fmt: skip
    assert (poses_of(naive) != poses).any()


def test_a_robot_that_stands_still_does_not_move() -> None:
    motion = increments_of(np.tile([3.0, -4.0, 1.0], (5, 1)))
    assert np.array_equal(motion[1:], np.zeros((4, 3)))
    assert np.array_equal(poses_of(np.zeros((0, 3))), np.zeros((0, 3)))
