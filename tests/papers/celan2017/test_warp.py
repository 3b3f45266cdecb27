# SPDX-License-Identifier: Apache-2.0
"""A bent map: right where it must be, off by no more than asked elsewhere, and closed."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.sim.room import room_grid
from locfuse.sim.space import cell_of, largest_part
from locfuse.types import FREE, OCCUPIED, FloatArray
from papers.celan2017.warp import bend, bent

AROUND, RIGHT = (0.0, 0.0, 50.0, 25.0), (36.0, 0.0, 43.0, 7.0)


def places(seed: int, count: int = 5000) -> FloatArray:
    return np.random.default_rng(seed).uniform([0.0, 0.0], [50.0, 25.0], (count, 2))


@pytest.mark.parametrize("seed", range(5))
def test_shifts_are_as_long_as_asked_and_none_is_where_the_map_is_right(seed: int) -> None:
    shift = bend(np.random.default_rng(seed), AROUND, RIGHT, 0.2)
    longest = np.hypot(*shift(places(seed)).T)
    assert 0.15 < longest.max() <= 0.201
    inside = np.random.default_rng(seed).uniform(RIGHT[:2], RIGHT[2:], (200, 2))
    assert not shift(inside).any()
    assert not shift(np.array([[35.5, 3.0], [40.0, 7.9]])).any(), "within the rim of a metre"


def test_shifts_change_slowly() -> None:
    shift = bend(np.random.default_rng(1), AROUND, RIGHT, 0.2)
    at = places(2)
    for step in ([0.1, 0.0], [0.0, 0.1]):
        stretch = np.hypot(*(shift(at + step) - shift(at)).T) / 0.1
        assert 0.005 < stretch.max() < 0.1


def test_walls_stand_where_they_were_shifted_to_and_stay_closed() -> None:
    grid = room_grid((50.0, 25.0), [(20.0, 0.0, 20.0, 25.0)], 0.1)
    shift = bend(np.random.default_rng(3), AROUND, RIGHT, 0.4)
    map_ = bent(grid, shift, 1.0)
    wall = np.column_stack([np.full(240, 20.0), np.linspace(0.5, 24.5, 240)])
    row, column = cell_of(map_, wall + shift(wall)).T
    assert (map_.cells[row, column] == OCCUPIED).all()
    free = map_.cells == FREE
    parts = [int(largest_part(free).sum())]
    parts.append(int(largest_part(free & ~largest_part(free)).sum()))
    assert sum(parts) == free.sum(), "the wall lets nobody through, and nothing else is cut off"


def test_a_map_that_is_not_bent_is_the_same_with_a_margin() -> None:
    grid = room_grid((6.0, 4.0), [(2.0, 0.0, 2.0, 3.0)], 0.1)
    map_ = bent(grid, lambda point: np.zeros_like(point), 0.5)
    assert map_.origin == pytest.approx((-0.55, -0.55, 0.0))
    np.testing.assert_array_equal(map_.cells[5:-5, 5:-5], grid.cells)
    assert (map_.cells[:5] == -1).all()


def test_what_cannot_be_bent_is_refused() -> None:
    with pytest.raises(ValueError, match="most_m is -1"):
        bend(np.random.default_rng(0), AROUND, RIGHT, -1.0)
    with pytest.raises(ValueError, match="leaves nothing to bend"):
        bend(np.random.default_rng(0), AROUND, AROUND, 0.2)
