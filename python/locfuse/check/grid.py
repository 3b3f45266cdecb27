# SPDX-License-Identifier: Apache-2.0
"""The map of a log as cells, for what can be said of it before a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FREE, OCCUPIED, FloatArray, Log


@dataclass(frozen=True)
class Grid:
    """A ROS map.

    Attributes
    ----------
    occupied, free : bool arrays, shape (rows, columns)
        Row 0 has the lowest y of the map's frame; cells that are neither are unknown.
    resolution : float
        Side of a cell, metres.
    origin : tuple of 2 floats
        Outer corner of cell (0, 0) in world, metres.
    yaw : float
        How the map's frame is turned in world, radians.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    origin: tuple[float, float]
    yaw: float = 0.0

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points of shape (n, 2) lie on the map."""
        size = np.array(self.occupied.shape[::-1])
        at = self._in_cells(points)
        within: NDArray[np.bool_] = np.all((at >= 0.0) & (at < size), axis=1)
        return within

    def known(self, points: FloatArray, around: float = 0.3) -> NDArray[np.bool_]:
        """Return around which points of shape (n, 2) most cells are free or occupied.

        Those within `around` metres along both of the map's axes count, so that specks neither add
        nor take floor.
        """
        size = np.array(self.occupied.shape[::-1])
        cell = np.floor(self._in_cells(points)).astype(np.intp)
        reach = int(around / self.resolution)
        low, high = np.clip(cell - reach, 0, size), np.clip(cell + reach + 1, 0, size)
        total = np.pad(np.cumsum(np.cumsum(self.occupied | self.free, axis=0), axis=1), (1, 0))
        (x1, y1), (x2, y2) = low.T, high.T
        seen = total[y2, x2] - total[y1, x2] - total[y2, x1] + total[y1, x1]
        most: NDArray[np.bool_] = 2 * seen > (2 * reach + 1) ** 2
        return most

    def bounds(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the corners of the box in world around what is known; None if nothing is."""
        row, column = np.nonzero(self.occupied | self.free)
        cells = np.column_stack([column, row]).astype(np.float64) + 0.5
        centres: FloatArray = self.resolution * cells @ self._turn().T + np.array(self.origin)
        centres = centres[self.known(centres)]
        if len(centres) == 0:
            return None
        half = 0.5 * self.resolution * np.abs(self._turn()).sum(axis=1)
        return centres.min(axis=0) - half, centres.max(axis=0) + half

    def _in_cells(self, points: FloatArray) -> FloatArray:
        """Return points of shape (n, 2) in the map's frame, one cell long per unit."""
        at: FloatArray = (points - np.array(self.origin)) @ self._turn() / self.resolution
        return at

    def _turn(self) -> FloatArray:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s], [s, c]])


def grid_of(log: Log) -> Grid | None:
    """Return the map of a log, None without one."""
    if log.grid is None:
        return None
    cells, (x, y, yaw) = log.grid.cells, log.grid.origin
    return Grid(cells == OCCUPIED, cells == FREE, log.grid.resolution_m, (x, y), yaw)
