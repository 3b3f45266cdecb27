# SPDX-License-Identifier: Apache-2.0
"""Lines by split and merge: cases by hand, of scans and of maps."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.sim.beams import cast
from locfuse.sim.room import room_grid
from locfuse.types import FREE, OCCUPIED, FloatArray, GridMap
from papers.zhang.line_features import map_lines, outlines, scan_lines, split_and_merge
from papers.zhang.world import BEAM_RAD


def room_scan(x: float, y: float, heading: float) -> FloatArray:
    """Return what is seen in an empty room of 6 m x 4 m."""
    grid = room_grid((6.0, 4.0), [], 0.05)
    start = np.tile([x, y], (len(BEAM_RAD), 1))
    return cast(grid, start, heading + BEAM_RAD, 30.0)


def test_a_wall_ahead_has_its_distance_and_its_normal() -> None:
    ranges = np.full(181, np.nan)
    ranges[60:121] = 2.0 / np.cos(BEAM_RAD[60:121])
    lines = scan_lines(ranges)
    assert len(lines) == 1
    assert lines.r[0] == pytest.approx(2.0)
    assert lines.alpha[0] == pytest.approx(0.0, abs=1e-12)
    assert lines.half_m[0] == pytest.approx(2.0 * np.tan(np.pi / 6.0))


def test_a_corner_is_cut_into_two_lines_at_right_angles() -> None:
    lines = scan_lines(room_scan(4.0, 2.0, np.pi / 4.0))
    np.testing.assert_allclose(lines.r, [1.975, 1.975], atol=1e-6)
    np.testing.assert_allclose(np.sort(np.rad2deg(lines.alpha)), [-45.0, 45.0], atol=1e-3)


def test_a_wall_seen_past_something_is_cut_at_the_jump() -> None:
    ranges = 2.0 / np.cos(BEAM_RAD)
    ranges[:45] = ranges[136:] = np.nan
    ranges[80:100] = 1.0
    lines = scan_lines(ranges)
    assert len(lines) == 2
    np.testing.assert_allclose(lines.r, 2.0)


def test_no_returns_are_no_lines() -> None:
    assert len(scan_lines(np.full(181, np.nan))) == 0


def test_pieces_of_one_wall_are_joined_and_a_bend_is_not() -> None:
    x = np.arange(10.0)
    zigzag = np.column_stack([x, 0.04 * (-1.0) ** x])
    assert len(split_and_merge(zigzag, 0.06)) == 1
    bend = np.column_stack([x, np.maximum(x - 4.0, 0.0)])
    assert len(split_and_merge(bend, 0.06)) == 2


def test_outlines_keep_what_is_free_on_their_left() -> None:
    cells = np.full((4, 5), OCCUPIED, np.int8)
    cells[1:3, 1:4] = FREE
    (loop,) = outlines(GridMap(cells, 1.0))
    x, y = loop.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert area == 6.0  # counter-clockwise around the free cells


def test_the_lines_of_an_empty_room_are_the_faces_of_its_walls() -> None:
    lines = map_lines(room_grid((6.0, 4.0), [], 0.05))
    assert len(lines) == 4
    by_turn = np.argsort(np.mod(lines.alpha + 0.1, 2.0 * np.pi))
    np.testing.assert_allclose(lines.r[by_turn], [5.975, 3.975, -0.025, -0.025], atol=1e-9)
    np.testing.assert_allclose(lines.half_m[by_turn], [1.975, 2.975, 1.975, 2.975], atol=0.03)


def test_a_wall_inside_has_a_line_on_either_side() -> None:
    lines = map_lines(room_grid((6.0, 4.0), [(3.0, 0.0, 3.0, 2.0)], 0.05))
    inside = np.abs(np.abs(lines.r) - 3.0) < 0.1
    np.testing.assert_allclose(np.sort(lines.r[inside]), [-3.025, 2.975], atol=1e-9)


def test_the_covariance_of_a_line_is_that_of_many_noisy_ones() -> None:
    rng = np.random.default_rng(1)
    beam = BEAM_RAD[70:131]
    found = []
    for _ in range(400):
        ranges = np.full(181, np.nan)
        ranges[70:131] = (2.0 + 0.01 * rng.standard_normal(61)) / np.cos(beam)
        line = scan_lines(ranges)
        found.append([line.r[0], line.alpha[0]])
    measured = np.cov(np.array(found).T) * 9.0  # the lines expect readings of 3 cm
    np.testing.assert_allclose(measured, line.covariance[0], rtol=0.35)
