# SPDX-License-Identifier: Apache-2.0
"""Prediction and correction: Jacobians against differences, a linear case by hand, a room."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from locfuse.sim.beams import cast
from locfuse.sim.room import room_grid
from locfuse.types import FloatArray, wrap_angle
from papers.zhang import motion
from papers.zhang.line_features import (
    Lines,
    correct,
    expected_lines,
    line_jacobians,
    map_lines,
    scan_lines,
)
from papers.zhang.world import BEAM_RAD, control_variance

STEP = 1e-6


def differences(function: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Return central differences, shape (rows, len(at)); headings come last and may wrap."""
    columns = []
    for k in range(len(at)):
        off = np.zeros(len(at))
        off[k] = STEP
        change = function(at + off) - function(at - off)
        change[-1] = wrap_angle(change[-1])
        columns.append(change / (2.0 * STEP))
    return np.stack(columns, axis=-1)


def poses() -> FloatArray:
    rng = np.random.default_rng(3)
    drawn = rng.uniform([-9.0, -9.0, -np.pi], [9.0, 9.0, np.pi], (100, 3))
    return np.vstack([drawn, [0.0, 0.0, np.pi], [1.0, 2.0, -np.pi], [0.0, 0.0, 0.0]])


def test_motion_jacobians_match_differences() -> None:
    control = np.array([0.3, -0.7])
    F, G = motion.jacobians(poses(), control)
    for pose, f, g in zip(poses(), F, G, strict=True):
        by_pose = differences(partial(motion.drive, control=control), pose)
        by_control = differences(partial(motion.drive, pose), control)
        np.testing.assert_allclose(f, by_pose, atol=1e-8)
        np.testing.assert_allclose(g, by_control, atol=1e-8)


def test_line_jacobians_match_differences() -> None:
    walls = map_lines(room_grid((6.0, 4.0), [(1.0, 1.0, 4.0, 1.0)], 0.05))
    H = line_jacobians(walls)
    for pose in poses():
        for wall in range(len(walls)):

            def seen(at: FloatArray, wall: int = wall) -> FloatArray:
                r, alpha = expected_lines(at[None], walls)
                return np.array([r[0, wall], alpha[0, wall]])

            np.testing.assert_allclose(H[wall], differences(seen, pose), atol=1e-8)


def test_a_turn_comes_before_the_way() -> None:
    end = motion.drive(np.array([1.0, 2.0, 0.0]), np.array([3.0, np.pi / 2.0]))
    np.testing.assert_allclose(end, [1.0, 5.0, np.pi / 2.0], atol=1e-12)


def test_predicted_covariance_is_that_of_samples() -> None:
    rng = np.random.default_rng(4)
    controls = np.tile([0.4, 0.2], (5, 1))
    start = np.tile([1.0, 2.0, 0.5], (20_000, 1))
    pose, P = motion.predict(start[:1], np.zeros((1, 3, 3)), controls)
    drawn = motion.sample(start, controls, rng)
    np.testing.assert_allclose(drawn.mean(axis=0), pose[0], atol=1e-3)
    np.testing.assert_allclose(np.cov(drawn.T), P[0], rtol=0.1, atol=1e-6)


def test_two_readings_of_a_turn_have_a_quarter_of_their_variances() -> None:
    still, turning = control_variance(np.array([[0.0, 0.0], [0.0, 1.0]]))
    assert still[0] == turning[0] == 0.0
    assert turning[1] - still[1] == pytest.approx(0.25 * 0.03**2)


def one_wall(r: float, sigma: float) -> Lines:
    return Lines(np.array([r]), np.zeros(1), np.array([[r, 0.0]]), np.array([5.0]),
                 np.diag([sigma**2, 1e-2])[None])  # fmt: skip


def test_a_wall_ahead_corrects_x_by_the_scalar_kalman_filter_and_leaves_y() -> None:
    P = np.diag([0.09, 0.09, 1e-12])[None]
    pose, after = correct(np.zeros((1, 3)), P, one_wall(1.8, 0.4), one_wall(2.0, 0.0))
    gain = 0.09 / (0.09 + 0.16)
    np.testing.assert_allclose(pose[0], [0.2 * gain, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(np.diag(after[0])[:2], [0.09 * (1.0 - gain), 0.09], atol=1e-9)


def test_a_wall_beyond_the_gate_or_seen_from_behind_corrects_nothing() -> None:
    P = np.diag([0.01, 0.01, 1e-4])[None]
    for pose, seen in (([0.0, 0.0, 0.0], 1.0), ([2.1, 0.0, 0.0], 0.01)):
        start = np.array([pose])
        after, _ = correct(start, P, one_wall(seen, 0.05), one_wall(2.0, 0.0))
        np.testing.assert_array_equal(after, start)


def test_a_pose_that_is_off_comes_home_by_the_walls_of_a_room() -> None:
    grid = room_grid((6.0, 4.0), [], 0.05)
    truth = np.array([2.0, 1.5, 3.1])
    ranges = cast(grid, np.tile(truth[:2], (181, 1)), truth[2] + BEAM_RAD, 30.0)
    start = truth + [[0.4, -0.3, 0.15]]
    P = np.diag(np.square([0.5, 0.5, 0.2]))[None]
    pose, after = correct(start, P, scan_lines(ranges), map_lines(grid))
    off = pose[0] - truth
    off[2] = wrap_angle(off[2])
    assert np.all(np.abs(off) < [0.02, 0.02, 0.005])
    assert np.all(np.linalg.eigvalsh(after[0]) > 0.0)
