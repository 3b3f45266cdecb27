# SPDX-License-Identifier: Apache-2.0
"""Worlds to drive in, made from a seed: rooms, hallways, a warehouse, a laboratory, an office.

All have the frame of a room: the origin in the south-west corner, in the middle of its cell; a wall
all around that is one cell thick; and free space of one piece. Each is made from a random
generator, (width, depth) and the side of a cell, at most `COARSEST_M`, all metres, and raises
ValueError where size or resolution are out of bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse.sim.room import Segment, room_grid
from locfuse.types import FREE, OCCUPIED, UNKNOWN, GridMap

Size: TypeAlias = tuple[float, float]
Box: TypeAlias = tuple[float, float, float, float]
Generator: TypeAlias = Callable[[np.random.Generator, Size, float], GridMap]

COARSEST_M = 0.25  # of cells that leave every door and gap open
DOOR_M = 1.0
ROOM_M = 3.0  # shortest side of a room
HALL_M = 2.0  # width of a hallway
GAP_M = 0.8  # kept between furniture and walls
SHELF_M = 1.2  # two shelves back to back
OPEN_M = 7.0  # side of the room of a floor that stands empty, and depth of the rooms beside it


def rooms(rng: np.random.Generator, size_m: Size, resolution_m: float) -> GridMap:
    """Return a floor of rooms with a door in every wall between two parts of it, and tables.

    The floor is cut in two, each part again, until rooms are shorter than twice `ROOM_M`.

    Its size is at least 3 m x 3 m.

    Examples
    --------
    >>> rooms(np.random.default_rng(1), (12.0, 8.0), 0.1).cells.shape
    (81, 121)
    """
    _check("rooms", size_m, resolution_m, (ROOM_M, ROOM_M))
    walls: list[Segment] = []
    doors: list[tuple[float, float]] = []
    finished: list[Box] = []
    todo: list[Box] = [(0.0, 0.0, *size_m)]
    while todo:
        part = todo.pop()
        cut = _cut(rng, part, doors)
        if cut is None:
            finished.append(part)
            continue
        axis, at = cut
        low, high = part[1 - axis], part[3 - axis]
        door = rng.uniform(low + DOOR_M, high - DOOR_M)
        doors.append((at, door) if axis == 0 else (door, at))
        for begin, end in ((low, door - 0.5 * DOOR_M), (door + 0.5 * DOOR_M, high)):
            walls.append((at, begin, at, end) if axis == 0 else (begin, at, end, at))
        x1, y1, x2, y2 = part
        todo += [(x1, y1, at, y2), (at, y1, x2, y2)] if axis == 0 else [
            (x1, y1, x2, at), (x1, at, x2, y2)]  # fmt: skip
    grid = room_grid(size_m, walls, resolution_m)
    for part in finished:
        _furnish(rng, grid, part)
    return grid


def hallways(rng: np.random.Generator, size_m: Size, resolution_m: float) -> GridMap:
    """Return hallways along the longer side, joined by two across; what lies between is unknown.

    Along a hallway few features distinguish places: recesses of doors, and the junctions.

    Its size is at least 8 m x 4 m, or 4 m x 8 m.
    """
    turned = size_m[1] > size_m[0]
    length, depth = size_m[::-1] if turned else size_m
    _check("hallways", (length, depth), resolution_m, (8.0, 4.0))
    middles = [rng.uniform(1.5, min(3.0, depth - 1.5))]
    while (middle := middles[-1] + rng.uniform(4.5, 7.0)) < depth - 1.5:
        middles.append(middle)
    half = 0.5 * HALL_M
    free: list[Box] = [(0.5, y - half, length - 0.5, y + half) for y in middles]
    for y1, y2 in pairwise(middles):
        for low, high in ((1.5, length / 3.0), (length / 1.5, length - 1.5)):
            x = rng.uniform(low, high)
            free.append((x - half, y1, x + half, y2))
    for y in middles:
        for x in rng.uniform(1.0, length - 2.0, max(1, int(length / 6.0))).tolist():
            side = half + 0.3 if rng.random() < 0.5 else -half - 0.3
            free.append((x, min(y, y + side), x + 1.0, max(y, y + side)))
    cells = room_grid((length, depth), [], resolution_m).cells
    cells[:] = UNKNOWN
    for box in free:
        cells[_inside(cells, resolution_m, box)] = FREE
    cells[_beside(cells == FREE) & (cells == UNKNOWN)] = OCCUPIED
    half = -0.5 * resolution_m
    return GridMap(cells.T.copy() if turned else cells, resolution_m, (half, half, 0.0))


def warehouse(rng: np.random.Generator, size_m: Size, resolution_m: float) -> GridMap:
    """Return aisles between shelves that all look the same, and a yard of pallets in the south.

    The seed decides the width of the aisles and where pallets stand; the aisles are equally wide,
    and crossed where shelves would be longer than 15 m.

    Its size is at least 10 m x 10 m.
    """
    _check("warehouse", size_m, resolution_m, (10.0, 10.0))
    width, depth = size_m
    yard, aisle = 4.0, rng.uniform(2.2, 3.2)
    count = int((width - aisle) / (SHELF_M + aisle))
    aisle = (width - count * SHELF_M) / (count + 1)
    begin, end = yard, depth - 2.0
    parts = int(np.ceil((end - begin) / 15.0))
    length = (end - begin - (parts - 1) * 2.5) / parts
    grid = room_grid(size_m, [], resolution_m)
    for row in range(count):
        x = aisle + row * (SHELF_M + aisle)
        for part in range(parts):
            y = begin + part * (length + 2.5)
            grid.cells[_inside(grid.cells, resolution_m, (x, y, x + SHELF_M, y + length))] = (
                OCCUPIED
            )
    _furnish(rng, grid, (0.0, 0.0, width, yard))
    return grid


def zhang(rng: np.random.Generator, size_m: Size, resolution_m: float) -> GridMap:
    """Return a floor such as the TurtleBot of Zhang may have driven on; its plan is assumed.

    Zhang Hong, "A Fusion Localization Algorithm Combining MCL with EKF", section IV B, states that
    a 2D grid map was made with ROS and that the robot drove from a first point to a last one. The
    text gives neither size nor plan. Assumed are a hallway in the south, two rooms with a door each
    to it and one between them, and a table in every part, which the seed places.

    Its size is at least 8 m x 8 m.
    """
    _check("zhang", size_m, resolution_m, (8.0, 8.0))
    width, depth = size_m
    hall, middle = 2.0, 0.55 * width
    half = 0.5 * DOOR_M
    left, right, between = 0.4 * width, 0.85 * width, 0.75 * depth
    walls = [
        (0.0, hall, left - half, hall),
        (left + half, hall, right - half, hall),
        (right + half, hall, width, hall),
        (middle, hall, middle, between - half),
        (middle, between + half, middle, depth),
    ]
    grid = room_grid(size_m, walls, resolution_m)
    _furnish(rng, grid, (0.0, hall, middle, depth), 1.0)
    _furnish(rng, grid, (middle, hall, width, depth), 1.0)
    return grid


@dataclass(frozen=True)
class FloorPlan:
    """Where walls run and doors are on a floor of an office building, metres.

    `walls` (x1, y1, x2, y2) are those inside of the outer ones, with gaps for doors; `rooms` are
    corners (x1, y1, x2, y2), the open room's first; `doors` (x, y) are the middles of each room's
    door to a hallway.
    """

    walls: list[Segment]
    rooms: list[Box]
    doors: list[tuple[float, float]]

    @property
    def open_room(self) -> Box:
        return self.rooms[0]


def floor_plan(rng: np.random.Generator, size_m: Size) -> FloorPlan:
    """Return two long hallways joined by three across, and rooms on both sides of each.

    The open room, `OPEN_M` square, is in the south-east. The seed decides where it is, how wide the
    other rooms are, to which hallway those in the middle open, and where their doors are.

    The size, (width, depth) in metres, is at least 40 m x 21 m; raises ValueError if it is less.
    """
    _check("floor", size_m, COARSEST_M, (40.0, 3.0 * OPEN_M))
    width, depth = size_m
    south, north = OPEN_M, depth - OPEN_M
    begin = width - OPEN_M - rng.uniform(4.0, 8.0)
    across = rng.uniform(0.4, 0.5) * width
    rooms: list[Box] = [(begin, 0.0, begin + OPEN_M, south)]
    sides = [south]  # on which of its walls each room's door is
    for low, high in ((0.0, begin), (begin + OPEN_M, width)):
        rooms += [(x1, 0.0, x2, south) for x1, x2 in _shares(rng, low, high)]
    rooms += [(x1, north, x2, depth) for x1, x2 in _shares(rng, 0.0, width)]
    sides += [south if room[1] == 0.0 else north for room in rooms[1:]]
    south, north = south + HALL_M, north - HALL_M
    for low, high in ((HALL_M, across), (across + HALL_M, width - HALL_M)):
        inner = [(x1, south, x2, north) for x1, x2 in _shares(rng, low, high)]
        rooms += inner
        sides += [south if rng.random() < 0.5 else north for _ in inner]
    doors = [(rng.uniform(x1 + DOOR_M, x2 - DOOR_M), side)
             for (x1, _, x2, _), side in zip(rooms, sides, strict=True)]  # fmt: skip
    walls = [wall for room, door in zip(rooms, doors, strict=True) for wall in _around(room, door)]
    return FloorPlan(walls, rooms, doors)


def floor(rng: np.random.Generator, size_m: Size, resolution_m: float) -> GridMap:
    """Return a floor as `floor_plan` plans it, with tables in all rooms but the open one.

    The open room has a cupboard at its southern wall.

    Its size is at least 40 m x 21 m.
    """
    _check("floor", size_m, resolution_m, (40.0, 3.0 * OPEN_M))
    return furnished(floor_plan(rng, size_m), rng, size_m, resolution_m)


def furnished(
    plan: FloorPlan, rng: np.random.Generator, size_m: Size, resolution_m: float
) -> GridMap:
    """Return the map of a planned floor, with furniture from a seed."""
    grid = room_grid(size_m, plan.walls, resolution_m)
    for room in plan.rooms[1:]:
        _furnish(rng, grid, room)
    x1, y1, x2, _ = plan.open_room
    at = rng.uniform(x1 + 1.0, x2 - 2.2)
    grid.cells[_inside(grid.cells, resolution_m, (at, y1, at + 1.2, y1 + 0.5))] = OCCUPIED
    return grid


def _shares(rng: np.random.Generator, low: float, high: float) -> list[tuple[float, float]]:
    """Return neighbours of 4 m to 8 m, or of less in between less than 8 m."""
    ends = [low]
    while high - ends[-1] > 8.0:
        ends.append(ends[-1] + rng.uniform(4.0, min(8.0, high - ends[-1] - 4.0)))
    return list(pairwise([*ends, high]))


def _around(room: Box, door: tuple[float, float]) -> Iterator[Segment]:
    """Yield the walls of a room, that of its door in two parts."""
    x1, y1, x2, y2 = room
    yield (x1, y1, x1, y2)
    yield (x2, y1, x2, y2)
    for y in (y1, y2):
        if y == door[1]:
            yield (x1, y, door[0] - 0.5 * DOOR_M, y)
            yield (door[0] + 0.5 * DOOR_M, y, x2, y)
        else:
            yield (x1, y, x2, y)


GENERATORS: Mapping[str, Generator] = {
    "rooms": rooms,
    "hallways": hallways,
    "warehouse": warehouse,
    "zhang": zhang,
    "floor": floor,
}


def _check(name: str, size_m: Size, resolution_m: float, least_m: Size) -> None:
    if not 0.0 < resolution_m <= COARSEST_M:
        raise ValueError(
            f"resolution_m is {resolution_m}, expected > 0 and at most {COARSEST_M}, which leaves "
            "doors open"
        )
    if not (np.isfinite(size_m).all() and size_m[0] >= least_m[0] and size_m[1] >= least_m[1]):
        raise ValueError(
            f"{name} of {size_m[0]:g} m x {size_m[1]:g} m, expected at least {least_m[0]:g} m x "
            f"{least_m[1]:g} m"
        )


def _cut(
    rng: np.random.Generator, part: Box, doors: Sequence[tuple[float, float]]
) -> tuple[int, float] | None:
    """Return the axis across which to cut a part, and where; None if it stays whole.

    A wall never ends in a door.
    """
    sides = (part[2] - part[0], part[3] - part[1])
    axis = int(sides[1] > sides[0])
    if sides[axis] < 2.0 * ROOM_M:
        return None
    ends = (part[1 - axis], part[3 - axis])
    met = [door[axis] for door in doors if door[1 - axis] in ends]
    for at in rng.uniform(part[axis] + ROOM_M, part[axis + 2] - ROOM_M, 20).tolist():
        if all(abs(at - door) > DOOR_M for door in met):
            return axis, at
    return None


def _furnish(rng: np.random.Generator, grid: GridMap, area: Box, chance: float = 0.7) -> None:
    """Put a box, by chance, into each of equal shares of an area, `GAP_M` from their borders."""
    x1, y1, x2, y2 = area
    columns, rows = max(1, int((x2 - x1) / ROOM_M)), max(1, int((y2 - y1) / ROOM_M))
    share = np.array([(x2 - x1) / columns, (y2 - y1) / rows])
    for row in range(rows):
        for column in range(columns):
            room = share - 2.0 * GAP_M
            sides = np.minimum(rng.uniform(0.5, 1.6, 2), room)
            corner = np.array([x1, y1]) + share * [column, row] + GAP_M
            low = corner + rng.random(2) * (room - sides)
            if rng.random() < chance:
                box = (*low.tolist(), *(low + sides).tolist())
                grid.cells[_inside(grid.cells, grid.resolution_m, box)] = OCCUPIED


def _inside(cells: NDArray[np.int8], resolution_m: float, box: Box) -> tuple[slice, slice]:
    """Return the rows and columns of the cells whose middle lies in a box."""
    x1, y1, x2, y2 = (side / resolution_m for side in box)
    rows, columns = (
        slice(max(0, int(np.ceil(low))), int(np.floor(high)) + 1)
        for low, high in ((y1, y2), (x1, x2))
    )
    return rows, columns


def _beside(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells that are marked or touch a marked one, corners included."""
    wide = np.pad(marked, 1)
    rows = wide[:-2] | wide[1:-1] | wide[2:]
    return rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]
