# SPDX-License-Identifier: Apache-2.0
"""Worlds made from a seed: closed, of one piece, wide enough for a robot, the same every time."""

from __future__ import annotations

from collections import deque
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.config.scenario import RoomMap
from locfuse.sim.maps import GENERATORS, OPEN_M, floor_plan, furnished
from locfuse.sim.space import largest_part, room_for
from locfuse.types import GridMap

SIZES = {
    "rooms": [(3.0, 3.0), (12.0, 8.0), (7.3, 21.1)],
    "hallways": [(8.0, 4.0), (40.0, 20.0), (9.0, 30.0)],
    "warehouse": [(10.0, 10.0), (30.0, 25.0), (21.7, 40.3)],
    "zhang": [(8.0, 8.0), (10.0, 10.0), (14.0, 9.0)],
    "floor": [(40.0, 21.0), (50.0, 25.0), (43.3, 27.1)],
}
CASES = [(name, size) for name, sizes in SIZES.items() for size in sizes]


def make(name: str, size: tuple[float, float], seed: int, resolution: float = 0.1) -> GridMap:
    return GENERATORS[name](np.random.default_rng(seed), size, resolution)


def filled(free: NDArray[np.bool_]) -> int:
    """Return how many free cells a flood from the first one reaches, cell by cell."""
    left = set(map(tuple, np.argwhere(free).tolist()))
    todo = deque([left.pop()])
    reached = 1
    while todo:
        row, column = todo.popleft()
        for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if near in left:
                left.remove(near)
                todo.append(near)
                reached += 1
    return reached


@pytest.mark.parametrize("resolution", [0.05, 0.13, 0.25])
@pytest.mark.parametrize(("name", "size"), CASES)
def test_free_space_is_of_one_piece(
    name: str, size: tuple[float, float], resolution: float
) -> None:
    for seed in range(3):
        free = make(name, size, seed, resolution).cells == 0
        assert free.sum() > 20
        assert filled(free) == free.sum()


@pytest.mark.parametrize(("name", "size"), CASES)
def test_a_robot_of_60_cm_reaches_whatever_it_fits_into(
    name: str, size: tuple[float, float]
) -> None:
    for seed in range(20):
        room = room_for(make(name, size, seed), 0.3)
        assert largest_part(room).sum() == room.sum() > 20


@pytest.mark.parametrize(("name", "size"), CASES)
def test_no_free_cell_is_at_the_edge_or_beside_the_unknown(
    name: str, size: tuple[float, float]
) -> None:
    for seed in range(5):
        grid = make(name, size, seed)
        assert grid.cells.shape == (round(size[1] / 0.1) + 1, round(size[0] / 0.1) + 1)
        assert grid.origin == (-0.05, -0.05, 0.0)
        around = np.pad(grid.cells, 1, constant_values=-1)
        free = around == 0
        for axis in (0, 1):
            for step in (-1, 1):
                assert (np.roll(around, step, axis)[free] != -1).all()


@pytest.mark.parametrize("name", GENERATORS)
def test_a_seed_makes_one_world_and_another_seed_another_one(name: str) -> None:
    size = SIZES[name][1]
    first, same, other = (make(name, size, seed).cells for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, same)
    assert (first != other).any()


def test_shelves_of_a_warehouse_look_alike() -> None:
    cells = make("warehouse", (30.0, 25.0), 2).cells
    shelves = cells[60:220, 1:-1]  # north of the yard
    edges = np.diff((shelves == 100).astype(int), axis=1)
    rows = edges.any(axis=1)
    assert (edges[rows] == edges[rows][0]).all()
    begins = np.flatnonzero(edges[rows][0] == 1)
    assert len(begins) >= 5
    assert np.ptp(np.diff(begins)) <= 1  # equal but for the cell


def test_hallways_are_long_and_show_little() -> None:
    cells = make("hallways", (40.0, 20.0), 1).cells
    longest = (cells == 0).sum(axis=1).max()
    assert 0.1 * longest == pytest.approx(39.0, abs=0.2)


@pytest.mark.parametrize("seed", range(5))
def test_every_room_of_a_floor_has_a_door_and_one_room_stands_open(seed: int) -> None:
    size = (50.0, 25.0)
    rng = np.random.default_rng(seed)
    plan = floor_plan(rng, size)
    grid = furnished(plan, rng, size, 0.05)
    assert len(plan.doors) == len(plan.rooms) > 15
    for x, y in plan.doors:
        column, row = np.floor(grid.to_grid(np.array([x, y]))).astype(int)
        assert (grid.cells[row - 4 : row + 5, column - 8 : column + 9] == 0).all()
    x1, y1, x2, y2 = plan.open_room
    assert x2 - x1 == pytest.approx(OPEN_M)
    assert y2 - y1 == OPEN_M
    (left, bottom), (right, top) = np.floor(grid.to_grid(np.array([[x1, y1], [x2, y2]]))).astype(
        int
    )
    open_ = grid.cells[bottom + 1 : top, left + 1 : right] == 0
    assert 0.95 < open_.mean() < 1.0, "a cupboard"


def test_a_configuration_can_ask_for_every_world() -> None:
    annotation = RoomMap.model_fields["generate"].annotation
    asked = [name for part in get_args(annotation) for name in get_args(part)]
    assert asked == list(GENERATORS)


@pytest.mark.parametrize("name", GENERATORS)
@pytest.mark.parametrize(
    ("size", "resolution", "text"),
    [
        ((2.0, 20.0), 0.1, "2 m x 20 m|20 m x 2 m"),
        ((20.0, float("nan")), 0.1, "nan m"),
        ((20.0, 20.0), 0.0, "resolution_m is 0.0, expected > 0"),
        ((20.0, 20.0), -0.1, "resolution_m is -0.1, expected > 0"),
        ((20.0, 20.0), 0.3, "resolution_m is 0.3, expected > 0 and at most 0.25"),
    ],
)
def test_a_world_that_cannot_be_is_refused(
    name: str, size: tuple[float, float], resolution: float, text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        make(name, size, 0, resolution)
