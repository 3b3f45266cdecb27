# SPDX-License-Identifier: Apache-2.0
"""Beams end where they enter an occupied cell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.sim.beams import cast
from locfuse.sim.room import room_grid
from locfuse.types import GridMap

ROOM = room_grid((10.0, 10.0), [], 0.05)  # faces 2.5 cm inside of the lines


def rng(seed: int = 4) -> np.random.Generator:
    return np.random.default_rng(seed)


def one_beam(grid: GridMap, x: float, y: float, heading: float, reach: float = 100.0) -> float:
    return float(cast(grid, np.array([[x, y]]), np.array([heading]), reach)[0])


def test_a_slanted_beam_ends_where_its_line_meets_the_wall() -> None:
    for heading in (0.3, -0.4, 0.1):
        expected = (9.975 - 2.0) / math.cos(heading)
        assert one_beam(ROOM, 2.0, 5.0, heading) == pytest.approx(expected, abs=1e-12)


def test_a_map_that_is_turned_and_moved_is_seen_in_its_place() -> None:
    cells = np.zeros((1, 40), np.int8)
    cells[0, 30] = 100
    grid = GridMap(cells, 0.1, (5.0, -2.0, 0.5 * math.pi))  # its x axis points north
    # The cell spans x from 4.9 to 5.0 and y from 1.0 to 1.1.
    assert one_beam(grid, 4.95, -1.5, 0.5 * math.pi) == pytest.approx(2.5, abs=1e-12)
    assert one_beam(grid, 9.0, 1.05, math.pi) == pytest.approx(4.0, abs=1e-12)
    assert one_beam(grid, 9.0, 1.15, math.pi) == math.inf


def test_beams_agree_with_the_nearest_face_of_all_occupied_squares() -> None:
    random = rng()
    cells = np.where(random.random((40, 50)) < 0.05, 100, random.choice([0, -1], (40, 50)))
    grid = GridMap(cells.astype(np.int8), 0.07, (-1.3, 0.4, 0.6))
    start = random.uniform(-1.5, 3.0, (400, 2))
    heading = random.uniform(-math.pi, math.pi, 400)

    walked = cast(grid, start, heading, 4.0)

    # Slabs: where each beam is inside of each occupied square, in the map's frame.
    c, s = math.cos(0.6), math.sin(0.6)
    moved = start - [-1.3, 0.4]
    at = np.column_stack([c * moved[:, 0] + s * moved[:, 1], c * moved[:, 1] - s * moved[:, 0]])
    along = np.column_stack([np.cos(heading - 0.6), np.sin(heading - 0.6)])[:, None, :]
    low = 0.07 * np.argwhere(cells == 100)[:, ::-1] - at[:, None, :]
    first, second = low / along, (low + 0.07) / along
    enters = np.minimum(first, second).max(axis=2)
    leaves = np.maximum(first, second).min(axis=2)
    entry = np.where((enters <= leaves) & (leaves >= 0.0), np.maximum(enters, 0.0), np.inf)
    nearest = entry.min(axis=1)
    nearest[nearest > 4.0] = np.inf
    assert 100 < np.isfinite(nearest).sum() < 380
    np.testing.assert_allclose(walked, nearest, atol=1e-12)


def test_a_beam_that_starts_in_a_wall_has_gone_no_way() -> None:
    assert one_beam(ROOM, 0.0, 5.0, 0.3) == 0.0


def test_no_beam_slips_between_cells_that_meet_at_a_corner() -> None:
    cells = np.zeros((30, 30), np.int8)
    cells[np.arange(30), np.arange(30)] = 100
    grid = GridMap(cells, 1.0)
    start = np.column_stack([np.linspace(5.0, 25.0, 1001), np.full(1001, 29.9)])
    heading = np.full(1001, -0.25 * math.pi)
    below = start[:, 0] < 29.0
    assert np.isfinite(cast(grid, start, heading, 100.0)[below]).all()


def test_unknown_cells_and_the_outside_let_beams_pass() -> None:
    cells = np.full((3, 10), -1, np.int8)
    cells[1, 7] = 100
    grid = GridMap(cells, 1.0)
    assert one_beam(grid, -5.0, 1.5, 0.0) == pytest.approx(12.0)
    assert one_beam(grid, -5.0, 1.5, math.pi) == math.inf
    assert one_beam(grid, 0.5, 0.5, 0.0) == math.inf


def test_a_beam_ends_at_its_reach() -> None:
    assert one_beam(ROOM, 5.0, 5.0, 0.0, 4.98) == pytest.approx(4.975)
    assert one_beam(ROOM, 5.0, 5.0, 0.0, 4.97) == math.inf
