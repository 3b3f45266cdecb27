# SPDX-License-Identifier: Apache-2.0
"""Maps that are cut and resampled stay where they are and promise no free space that is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.sim.space import cell_of, middle_of
from locfuse.types import GridMap

CELLS = np.array([[0, 0, 0, 0], [0, 100, 0, -1], [-1, 0, 0, 0]], np.int8)


def turned(degrees: float = 90.0) -> GridMap:
    """Return a map of 4 x 3 cells of half a metre whose corner lies at (5, 1)."""
    return GridMap(CELLS, 0.5, (5.0, 1.0, math.radians(degrees)))


# Cropping --------------------------------------------------------------------------------------


def test_a_part_holds_the_cells_that_the_box_touches() -> None:
    part = GridMap(CELLS, 0.5, (5.0, 1.0, 0.0)).cropped((5.6, 1.2), (6.4, 1.9))
    assert part.cells.tolist() == [[0, 0], [100, 0]]
    assert (part.resolution_m, part.origin) == (0.5, (5.5, 1.0, 0.0))


def test_a_box_that_ends_on_edges_takes_no_neighbour_along() -> None:
    grid = GridMap(np.zeros((10, 10), np.int8), 0.1)
    part = grid.cropped((0.3, 0.1), (0.7, 0.6))  # 0.3 / 0.1 is less than 3
    assert part.cells.shape == (5, 4)
    assert part.origin == pytest.approx((0.3, 0.1, 0.0))


def test_a_part_of_a_map_that_looks_north_has_the_corner_of_its_own_cells() -> None:
    # Its x axis points north, its y axis west: the cell (1, 1) spans x 4 to 4.5 and y 1.5 to 2.
    part = turned().cropped((4.1, 1.6), (4.4, 1.9))
    assert part.cells.tolist() == [[100]]
    assert part.origin == pytest.approx((4.5, 1.5, 0.5 * math.pi))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0, -135.0])
def test_cells_of_a_part_stay_where_they_were(degrees: float) -> None:
    grid = turned(degrees)
    middle = middle_of(grid, np.array([[1, 1], [2, 2]]))
    low, high = middle.min(axis=0) - 0.01, middle.max(axis=0) + 0.01

    part = grid.cropped((low[0], low[1]), (high[0], high[1]))

    assert part.origin[2] == grid.origin[2]
    inside = np.argwhere(np.ones(part.cells.shape, np.bool_))
    row, column = cell_of(grid, middle_of(part, inside)).T
    np.testing.assert_array_equal(part.cells.ravel(), grid.cells[row, column])
    assert {(1, 1), (2, 2)} <= set(zip(row.tolist(), column.tolist(), strict=True))


def test_a_box_around_the_map_gives_all_of_it_and_a_copy() -> None:
    grid = GridMap(CELLS.copy(), 0.5, (5.0, 1.0, 0.0))
    part = grid.cropped((-9.0, -9.0), (9.0, 9.0))
    np.testing.assert_array_equal(part.cells, CELLS)
    part.cells[:] = 100
    np.testing.assert_array_equal(grid.cells, CELLS)


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        ((0.0, 0.0), (0.0, 1.0), "expected low < high"),
        ((1.0, 1.0), (2.0, 0.0), "expected low < high"),
        ((math.nan, 0.0), (1.0, 1.0), "expected low < high"),
        ((0.0, 0.0), (math.inf, 1.0), "expected low < high"),
        ((0.0, 0.0), (5.0, 1.0), "touches no cell of the map"),  # meets at a corner
        ((7.0, 0.0), (9.0, 9.0), "touches no cell of the map"),
    ],
)
def test_a_box_without_a_cell_is_refused(
    low: tuple[float, float], high: tuple[float, float], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        GridMap(CELLS, 0.5, (5.0, 1.0, 0.0)).cropped(low, high)


# Resampling ------------------------------------------------------------------------------------


def test_occupied_wins_over_unknown_and_unknown_over_free() -> None:
    # The third row of cells has no partner: what is beyond the edge is unknown.
    assert turned().resampled(1.0).cells.tolist() == [[100, -1], [-1, -1]]


def test_coarser_cells_that_share_an_old_one_both_have_it() -> None:
    row = np.array([[0, 100, 0, 0, 0, 0]], np.int8)
    # Edges of the new cells at 1.5, 3, 4.5 and 6 old ones: the second old one is in two.
    grid = GridMap(np.repeat(row, 3, axis=0), 1.0).resampled(1.5)
    assert grid.cells.tolist() == [[100, 100, 0, 0]] * 2


def test_finer_cells_repeat_the_old_ones_and_take_both_on_an_edge() -> None:
    half = GridMap(np.array([[0, 100], [-1, 0]], np.int8), 0.1).resampled(0.05)
    assert half.cells.tolist() == [[0, 0, 100, 100]] * 2 + [[-1, -1, 0, 0]] * 2

    # Of 2 cells in thirds of 2: the middle one lies on both.
    thirds = GridMap(np.array([[0, 100]] * 2, np.int8), 0.3).resampled(0.2)
    assert thirds.cells.tolist() == [[0, 100, 100]] * 3


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.15, 0.2, 0.7])
def test_an_edge_that_rounds_is_the_same_edge(resolution: float) -> None:
    grid = GridMap(np.zeros((42, 84), np.int8), 0.1).resampled(resolution)
    assert grid.cells.shape == (round(4.2 / resolution), round(8.4 / resolution))
    assert not grid.cells.any()


def test_origin_and_yaw_stay_and_the_old_map_too() -> None:
    grid = turned(30.0)
    assert grid.resampled(1.0).origin == grid.origin
    assert grid.resampled(1.0).resolution_m == 1.0
    same = grid.resampled(0.5)
    np.testing.assert_array_equal(same.cells, CELLS)
    assert same.cells is not grid.cells


@pytest.mark.parametrize("resolution", [0.03, 0.07, 0.13, 0.4, 5.0])
def test_no_place_becomes_free_and_no_wall_is_lost(resolution: float) -> None:
    rng = np.random.default_rng(6)
    cells = rng.choice(np.array([0, 100, -1], np.int8), (30, 40), p=[0.8, 0.1, 0.1])
    old = GridMap(cells, 0.1, (1.0, 2.0, 0.3))
    new = old.resampled(resolution)

    at = rng.uniform(0.0, [4.0, 3.0], (20_000, 2)) @ np.array(
        [[math.cos(0.3), math.sin(0.3)], [-math.sin(0.3), math.cos(0.3)]]
    ) + [1.0, 2.0]  # fmt: skip
    before, after = (grid.cells[tuple(cell_of(grid, at).T)] for grid in (old, new))
    assert (after[before == 100] == 100).all()
    assert (after[before == -1] != 0).all()
    assert (before[after == 0] == 0).all()


def test_a_map_of_one_cell_is_cut_and_resampled_like_any_other() -> None:
    for cell in (0, 100, -1):
        grid = GridMap(np.array([[cell]], np.int8), 0.1, (1.0, 2.0, 3.0))
        assert grid.cropped((-9.0, -9.0), (9.0, 9.0)).origin == grid.origin
        assert grid.resampled(0.05).cells.tolist() == [[cell] * 2] * 2
        assert grid.resampled(50.0).cells.tolist() == [[cell or -1]]


@pytest.mark.parametrize("resolution", [0.0, -0.1, math.nan, math.inf])
def test_a_resolution_that_is_none_is_refused(resolution: float) -> None:
    with pytest.raises(ValueError, match=r"resolution_m is .*, expected > 0"):
        turned().resampled(resolution)
