# SPDX-License-Identifier: Apache-2.0
"""Where a robot has room, and that it stays there."""

from __future__ import annotations

import math
from itertools import islice, pairwise

import numpy as np
import pytest

from locfuse.config.scenario import Roam
from locfuse.sim.maps import rooms
from locfuse.sim.space import cell_of, largest_part, middle_of, roam, room_for, steps_from
from locfuse.types import ConfigError, GridMap

MAZE = np.array([[1, 1, 1, 0, 1], [0, 0, 1, 0, 1], [1, 1, 1, 0, 1]], np.bool_)


def test_cells_and_their_middles_are_found_on_a_map_that_is_turned() -> None:
    grid = GridMap(np.zeros((3, 4), np.int8), 0.5, (2.0, 1.0, 0.5 * math.pi))
    cell = np.array([[0, 0], [2, 3], [-1, 5]])

    middle = middle_of(grid, cell)

    # The map's x axis points north, its y axis west.
    np.testing.assert_allclose(middle, [[1.75, 1.25], [0.75, 2.75], [2.25, 3.75]], atol=1e-12)
    np.testing.assert_array_equal(cell_of(grid, middle), cell)


def test_a_disc_has_room_where_it_touches_free_cells_only() -> None:
    cells = np.zeros((9, 9), np.int8)
    cells[4, 4] = 100
    room = room_for(GridMap(cells, 1.0), 1.6)

    # One cell off the middle 4 the square is 0.5 away, two off 1.5; aslant two, one: hypot(1.5,
    # 0.5) = 1.58, two, two: 2.12. The outside is 0.5 away from the first cells, 1.5 from the next.
    expected = np.zeros((9, 9), np.bool_)
    expected[2:7, 2:7] = True
    expected[2:7, 3:6] = expected[3:6, 2:7] = False
    np.testing.assert_array_equal(room, expected)


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.77, 1.2, 50.0])
def test_room_is_where_the_nearest_square_that_is_not_free_is_farther_than_the_radius(
    radius: float,
) -> None:
    cells = np.random.default_rng(2).choice(
        np.array([0, 100, -1], np.int8), (25, 31), p=[0.9, 0.07, 0.03]
    )
    wide = np.pad(cells, 3, constant_values=-1)
    taken = np.argwhere(wide != 0) - 3
    rows, columns = np.indices(cells.shape)
    off = np.abs(np.stack([rows, columns], -1)[:, :, None, :] - taken)
    nearest = 0.25 * np.hypot(*np.moveaxis(np.maximum(off - 0.5, 0.0), -1, 0)).min(axis=-1)
    expected = (cells == 0) & (nearest >= radius) if radius < 50.0 else np.zeros_like(cells, bool)

    np.testing.assert_array_equal(room_for(GridMap(cells, 0.25), radius), expected)


def test_steps_lead_around_walls_and_not_over_corners() -> None:
    steps = steps_from(MAZE, (0, 0))
    assert steps.tolist() == [[0, 1, 2, -1, -1], [-1, -1, 3, -1, -1], [6, 5, 4, -1, -1]]
    assert (steps_from(MAZE, (1, 0)) == -1).all()


def test_the_largest_part_is_the_one_with_most_cells() -> None:
    np.testing.assert_array_equal(largest_part(MAZE), MAZE & (np.arange(5) < 3))
    assert not largest_part(np.zeros((2, 3), np.bool_)).any()


def test_a_roaming_robot_keeps_its_clearance_on_straight_ways() -> None:
    grid = rooms(np.random.default_rng(4), (12.0, 9.0), 0.1)
    moved = GridMap(grid.cells, 0.1, (3.0, -2.0, 0.7))
    points = np.array(list(islice(roam(moved, Roam(), np.random.default_rng(1)), 60)))

    way = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(points)])
    row, column = cell_of(moved, way).T

    assert room_for(moved, 0.3)[row, column].all()
    assert np.ptp(points[:, 0]) > 6.0
    again = list(islice(roam(moved, Roam(), np.random.default_rng(1)), 60))
    np.testing.assert_array_equal(points, again)


def test_ways_are_drawn_straight_as_far_as_there_is_room() -> None:
    grid = GridMap(np.zeros((30, 40), np.int8), 0.1)
    points = islice(roam(grid, Roam(clearance_m=0.0), np.random.default_rng(3)), 50)
    cells = cell_of(grid, np.array(list(points)))
    same = np.random.default_rng(3)
    drawn = [divmod(int(same.integers(1200)), 40) for _ in range(50)]
    assert [tuple(cell) for cell in cells.tolist()] == drawn  # straight from place to place


@pytest.mark.parametrize("cells", [[[0]], [[100, 100], [100, 0]], [[0, 100, 0]]])
def test_a_map_without_two_places_cannot_be_roamed(cells: list[list[int]]) -> None:
    grid = GridMap(np.array(cells, np.int8), 1.0)
    with pytest.raises(ConfigError, match=r"clearance_m 0\.2 has no room to roam"):
        next(roam(grid, Roam(clearance_m=0.2), np.random.default_rng(0)))
