# SPDX-License-Identifier: Apache-2.0
"""Walls become the cells they touch, and no others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.sim.room import room_grid, touched
from locfuse.types import GridMap


def test_a_room_has_four_walls_of_one_cell_with_their_lines_in_the_middle() -> None:
    grid = room_grid((2.0, 1.0), [], 0.5)

    assert grid.cells.tolist() == [
        [100, 100, 100, 100, 100],
        [100, 0, 0, 0, 100],
        [100, 100, 100, 100, 100],
    ]
    assert (grid.resolution_m, grid.origin) == (0.5, (-0.25, -0.25, 0.0))


def test_a_room_that_is_no_multiple_of_the_resolution_keeps_its_far_walls() -> None:
    cells = room_grid((10.03, 4.98), [], 0.1).cells

    assert cells.shape == (51, 101)  # 4.98 m lies in the cell from 4.95 m to 5.05 m
    assert (cells[:, -1] == 100).all()
    assert (cells[-1] == 100).all()
    assert not cells[1:-1, 1:-1].any()


def test_a_diagonal_wall_takes_every_cell_that_its_line_enters() -> None:
    wall = (1.0, 1.0, 4.0, 2.5)  # rises one half per metre
    inside = room_grid((6.0, 4.0), [wall], 1.0).cells[1:-1, 1:-1]

    # Between y = 0.5 and 1.5 the line spans x = 1 to 2, then up to 4; the corner (4, 2.5) is in
    # two cells.
    assert inside.tolist() == [[100, 100, 0, 0, 0], [0, 100, 100, 100, 0], [0, 0, 0, 100, 0]]


def test_walls_cover_the_cells_of_dense_samples_of_their_lines() -> None:
    rng = np.random.default_rng(2)
    for wall in rng.uniform(0.0, 5.0, (50, 4)).tolist():
        grid = room_grid((5.0, 5.0), [tuple(wall)], 0.1)
        line = np.linspace(wall[:2], wall[2:], 20_000)
        column, row = np.floor((line - grid.origin[:2]) / grid.resolution_m).astype(int).T
        sampled = room_grid((5.0, 5.0), [], 0.1).cells
        sampled[row, column] = 100
        assert (grid.cells[row, column] == 100).all()
        # Only where the line cuts off a corner shorter than the step is there more.
        assert (grid.cells != sampled).sum() <= 1


def test_walls_are_touched_in_the_frame_of_the_map() -> None:
    plain = GridMap(np.zeros((8, 10), np.int8), 0.5)
    turned = GridMap(plain.cells, 0.5, (3.0, -1.0, 0.5 * math.pi))
    for wall in ((0.7, 0.3, 4.1, 2.9), (1.1, 1.2, 1.1, 3.3)):
        x1, y1, x2, y2 = wall
        there = (3.0 - y1, -1.0 + x1, 3.0 - y2, -1.0 + x2)
        expected = touched(plain, [wall])
        assert 5 <= expected.sum() < 20
        np.testing.assert_array_equal(touched(turned, [there]), expected)


def test_walls_outside_are_cut_off() -> None:
    plain = room_grid((2.0, 2.0), [], 0.1)
    walled = room_grid((2.0, 2.0), [(5.0, 0.0, 9.0, 9.0), (-3.0, 1.0, 0.0, 1.0)], 0.1)
    np.testing.assert_array_equal(walled.cells, plain.cells)


@pytest.mark.parametrize(
    ("room", "resolution"),
    [((2.0, 2.0), 0.0), ((2.0, 2.0), -0.1), ((2.0, 2.0), float("nan")), ((0.0, 2.0), 0.1)],
)
def test_a_room_without_size_or_cells_is_refused(
    room: tuple[float, float], resolution: float
) -> None:
    with pytest.raises(ValueError, match="expected three numbers > 0"):
        room_grid(room, [], resolution)
