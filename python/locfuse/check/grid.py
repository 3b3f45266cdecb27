# SPDX-License-Identifier: Apache-2.0
"""The map of a log, for what can be said of it before a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from locfuse.types import UNKNOWN, FloatArray, GridMap


def on_map(grid: GridMap, points: FloatArray) -> NDArray[np.bool_]:
    """Return which points of shape (n, 2) lie on the map."""
    cell = grid.to_grid(points)
    return np.asarray(np.all((cell >= 0.0) & (cell < grid.cells.shape[::-1]), axis=1))


def known(grid: GridMap, points: FloatArray, around: float = 0.3) -> NDArray[np.bool_]:
    """Return around which points of shape (n, 2) most cells are free or occupied.

    Those within `around` metres along columns and rows count, so that specks neither add nor take
    floor.
    """
    size = np.array(grid.cells.shape[::-1])
    cell = np.floor(grid.to_grid(points)).astype(np.intp)
    reach = int(around / grid.resolution_m)
    low, high = np.clip(cell - reach, 0, size), np.clip(cell + reach + 1, 0, size)
    total = np.pad(np.cumsum(np.cumsum(grid.cells != UNKNOWN, axis=0), axis=1), (1, 0))
    (x1, y1), (x2, y2) = low.T, high.T
    seen = total[y2, x2] - total[y1, x2] - total[y2, x1] + total[y1, x1]
    return np.asarray(2 * seen > (2 * reach + 1) ** 2)


def bounds(grid: GridMap) -> tuple[FloatArray, FloatArray] | None:
    """Return the corners of the box in world around what is known; None if nothing is."""
    centres = grid.to_world(np.argwhere(grid.cells != UNKNOWN)[:, ::-1].astype(float) + 0.5)
    centres = centres[known(grid, centres)]
    if len(centres) == 0:
        return None
    yaw = grid.origin[2]
    half = 0.5 * grid.resolution_m * (abs(np.cos(yaw)) + abs(np.sin(yaw)))
    return centres.min(axis=0) - half, centres.max(axis=0) + half
