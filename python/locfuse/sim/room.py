# SPDX-License-Identifier: Apache-2.0
"""A room as a grid map: which cells its walls touch."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FREE, OCCUPIED, FloatArray, GridMap

Segment = tuple[float, float, float, float]


def room_grid(
    room_m: tuple[float, float], walls: Sequence[Segment], resolution_m: float
) -> GridMap:
    """Return the map of an otherwise empty room.

    The point (0, 0) is the middle of a cell: walls whose coordinates are multiples of the
    resolution run through the middle of their cells, whose faces stand half a cell before them.

    `room_m` is (width, depth) between its walls' lines, from (0, 0); `walls` are further ones,
    (x1, y1, x2, y2), cut off where they leave the room; all metres. Raises ValueError where a side
    or the resolution is not positive.

    Examples
    --------
    >>> room_grid((2.0, 1.0), [], 0.5).cells.tolist()[1]
    [100, 0, 0, 0, 100]
    """
    width, depth = room_m
    if not (width > 0.0 and depth > 0.0 and resolution_m > 0.0):
        raise ValueError(
            f"a room of {width} m x {depth} m in cells of {resolution_m} m, expected three "
            "numbers > 0"
        )
    columns, rows = (math.floor(side / resolution_m + 0.5) + 1 for side in room_m)
    cells = np.full((rows, columns), FREE, np.int8)
    around = [(0.0, 0.0, width, 0.0), (width, 0.0, width, depth),
              (0.0, depth, width, depth), (0.0, 0.0, 0.0, depth)]  # fmt: skip
    grid = GridMap(cells, resolution_m, (-0.5 * resolution_m, -0.5 * resolution_m, 0.0))
    cells[touched(grid, [*around, *walls])] = OCCUPIED
    return grid


def touched(grid: GridMap, walls: Sequence[Segment]) -> NDArray[np.bool_]:
    """Return which cells of a map walls touch, shape (height, width).

    `walls` are (x1, y1, x2, y2) in world, metres.
    """
    # Both are turned into the map's axes and neither is shifted: on a room's own grid a line along
    # the edges or over the corners of cells is then compared with the numbers it was given by.
    x0, y0, yaw = grid.origin
    c, s = math.cos(yaw), math.sin(yaw)
    half = 0.5 * grid.resolution_m
    height, width = grid.cells.shape
    x = c * x0 + s * y0 + half + grid.resolution_m * np.arange(width, dtype=np.float64)
    y = c * y0 - s * x0 + half + grid.resolution_m * np.arange(height, dtype=np.float64)
    found = np.zeros(grid.cells.shape, np.bool_)
    for x1, y1, x2, y2 in walls:
        turned = (c * x1 + s * y1, c * y1 - s * x1, c * x2 + s * y2, c * y2 - s * x2)
        found |= _touches(turned, x, y[:, None], half)
    return found


def _touches(wall: Segment, x: FloatArray, y: FloatArray, half: float) -> NDArray[np.bool_]:
    """Return which squares around (x, y) a wall touches: no axis separates the two."""
    x1, y1, x2, y2 = wall
    dx, dy = 0.5 * (x2 - x1), 0.5 * (y2 - y1)
    right, up = x - 0.5 * (x1 + x2), y - 0.5 * (y1 + y2)
    across = np.abs(right * dy - up * dx)
    touches: NDArray[np.bool_] = (
        (np.abs(right) <= half + abs(dx))
        & (np.abs(up) <= half + abs(dy))
        & (across <= half * (abs(dx) + abs(dy)))
    )
    return touches
