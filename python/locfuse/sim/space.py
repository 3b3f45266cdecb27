# SPDX-License-Identifier: Apache-2.0
"""Where on a map something of a given size has room, and the ways that lead there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from locfuse.config.scenario import Roam
from locfuse.sim.beams import cast
from locfuse.types import FREE, OCCUPIED, ConfigError, FloatArray, GridMap

Cells = NDArray[np.bool_]


def cell_of(grid: GridMap, point: FloatArray) -> NDArray[np.int64]:
    """Return the (row, column) of points, also beyond the edges of the map.

    `point`, shape (n, 2), is x and y in world, metres.
    """
    return np.floor(grid.to_grid(point)[:, ::-1]).astype(np.int64)


def middle_of(grid: GridMap, cell: NDArray[np.int64]) -> FloatArray:
    """Return the middles of cells, (row, column), shape (n, 2), as x and y in world, metres."""
    return grid.to_world(cell[:, ::-1].astype(np.float64) + 0.5)


def room_for(grid: GridMap, radius_m: float) -> Cells:
    """Return the cells in whose middle a disc touches free cells only, shape (height, width).

    What lies outside of the map is not free.
    """
    radius = radius_m / grid.resolution_m
    reach = int(np.ceil(radius + 0.5)) - 1  # rows that the disc can enter on either side
    reach = min(max(reach, 0), max(grid.cells.shape))
    taken = np.pad(grid.cells != FREE, reach, constant_values=True)
    rows, columns = grid.cells.shape
    before = np.pad(np.cumsum(taken, axis=1, dtype=np.int64), ((0, 0), (1, 0)))
    blocked: Cells = grid.cells != FREE
    for row in range(-reach, reach + 1):
        height = max(abs(row) - 0.5, 0.0)
        if height < radius:
            half = int(np.ceil(np.sqrt(radius**2 - height**2) + 0.5)) - 1
            half = min(half, reach)
            part = before[reach + row : reach + row + rows]
            low, high = reach - half, reach + half + 1
            blocked |= part[:, high : high + columns] > part[:, low : low + columns]
    return ~blocked


def steps_from(room: Cells, cell: tuple[int, int]) -> NDArray[np.int64]:
    """Return how many steps lead from one cell to each, over edges between cells with room.

    The shape is (height, width), `cell` is (row, column); -1 where no way leads.
    """
    wide = np.pad(room, 1)
    width = wide.shape[1]
    free = wide.ravel().copy()
    steps = np.full(free.size, -1, np.int64)
    front = np.array([(cell[0] + 1) * width + cell[1] + 1])
    front = front[free[front]]
    count = 0
    while len(front) > 0:
        steps[front], free[front] = count, False
        beside = (front[:, None] + [-1, 1, -width, width]).ravel()
        front = np.unique(beside[free[beside]])
        count += 1
    return steps.reshape(wide.shape)[1:-1, 1:-1]


def largest_part(room: Cells) -> Cells:
    """Return the largest set of cells that ways with room connect; of equal ones the first."""
    best = np.zeros_like(room)
    left = room.copy()
    while left.sum() > best.sum():
        row, column = np.argwhere(left)[0].tolist()
        part = steps_from(left, (row, column)) >= 0
        best = part if part.sum() > best.sum() else best
        left &= ~part
    return best


def roam(grid: GridMap, path: Roam, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Yield the points of a walk without end, each seen from the one before.

    Random places of the largest part that has room for the robot, joined by ways of the fewest
    steps from cell to cell, which are drawn straight as far as there is room.

    Yields x and y in world, metres, shape (2,). Raises ConfigError if the map has no two places for
    the robot.
    """
    room = largest_part(room_for(grid, path.clearance_m))
    places = np.argwhere(room)
    if len(places) < 2:
        raise ConfigError(
            f"simulation.path: a robot with clearance_m {path.clearance_m} has no room to roam on "
            "the map; expected free space of some cells"
        )
    here = places[rng.integers(len(places))]
    yield middle_of(grid, here[None])[0]
    while True:
        there = places[rng.integers(len(places))]
        yield from way(grid, room, here, there)
        here = there


def way(
    grid: GridMap, room: Cells, here: NDArray[np.int64], there: NDArray[np.int64]
) -> Iterator[FloatArray]:
    """Yield the points at which a way from cell to cell turns, the end included, not the start.

    `room`, shape (height, width), is where the way may lead; it must join `here` and `there`, both
    (row, column). Points are x and y in world, metres, shape (2,); each is seen from the one
    before, past what has no room.
    """
    walls = GridMap(np.where(room, FREE, OCCUPIED).astype(np.int8), grid.resolution_m, grid.origin)
    yield from _corners(walls, _way(room, here, there))


def _way(room: Cells, here: NDArray[np.int64], there: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the cells from one to another, shape (n, 2), both included."""
    left = np.pad(steps_from(room, (int(there[0]), int(there[1]))), 1, constant_values=-1)
    way = [here]
    for count in range(int(left[here[0] + 1, here[1] + 1]) - 1, -1, -1):
        beside = way[-1] + [[0, 1], [1, 0], [0, -1], [-1, 0]]
        way.append(beside[left[beside[:, 0] + 1, beside[:, 1] + 1] == count][0])
    return np.array(way)


def _corners(walls: GridMap, way: NDArray[np.int64]) -> Iterator[FloatArray]:
    """Yield the points of a way where it turns: always the farthest that is seen from the last."""
    points = middle_of(walls, way)
    at = 0
    while at < len(points) - 1:
        ahead = points[at + 1 :] - points[at]
        distance, heading = np.hypot(*ahead.T), np.arctan2(ahead[:, 1], ahead[:, 0])
        start = np.broadcast_to(points[at], ahead.shape)
        seen = cast(walls, start, heading, float(distance.max())) > distance
        at += int(np.flatnonzero(seen).max(initial=0)) + 1
        yield points[at]
