# SPDX-License-Identifier: Apache-2.0
"""A hall of 20 x 20 m with boxes and scans along a circle, like benchmarks/cpp/scan_room.hpp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import locfuse as lf
from locfuse.sim.beams import cast
from locfuse.types import FREE, OCCUPIED, FloatArray, GridMap

CELLS, RESOLUTION_M, ORIGIN = 400, 0.05, (-10.0, -10.0, 0.0)
BEAMS, POSES = 360, 51


@dataclass(frozen=True)
class Hall:
    """`surface` (10,000, 2), `truth` and `guess` (51, 3), `ranges_m` and `angles` (51, 360)."""

    grid: lf.OccupancyGrid
    surface: FloatArray
    truth: FloatArray
    guess: FloatArray
    angles: FloatArray
    ranges_m: FloatArray

    def points(self, k: int) -> FloatArray:
        """Return the end points of a scan in the body frame, metres."""
        points: FloatArray = self.ranges_m[k][:, None] * np.column_stack(
            [np.cos(self.angles), np.sin(self.angles)]
        )
        return points

    def errors(self, pose: FloatArray) -> dict[str, float]:
        """Return the position RMSE in metres and the fraction within 5 cm and one degree."""
        off = np.hypot(*(pose - self.truth).T[:2])
        turned = np.abs(np.mod(pose[:, 2] - self.truth[:, 2] + np.pi, 2 * np.pi) - np.pi)
        right = (off < 0.05) & (turned < np.deg2rad(1.0))
        return {"rmse_m": float(np.sqrt(np.mean(off**2))), "right": float(right.mean())}


def hall(seed: int = 3) -> Hall:
    """Return the hall of a seed."""
    rng = np.random.default_rng(seed)
    cells = _cells(rng)
    grid = GridMap(cells, RESOLUTION_M, ORIGIN)
    turn = 0.04 * np.arange(POSES)
    circle = [5.0 * np.cos(turn), 5.0 * np.sin(turn), turn + np.pi / 2]
    truth = np.column_stack(circle).astype(np.float64)
    angles = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    seen = cast(
        grid, np.repeat(truth[:, :2], BEAMS, axis=0), (truth[:, 2:] + angles).ravel(), 50.0
    ).reshape(POSES, BEAMS)
    off = rng.uniform(-1.0, 1.0, (POSES, 3)) * [0.2, 0.2, np.deg2rad(5.0)]
    row, column = np.nonzero(cells == FREE)
    chosen = rng.integers(0, len(row), 10_000)
    start = RESOLUTION_M * (np.column_stack([column, row])[chosen] + 0.5) + ORIGIN[:2]
    direction = rng.uniform(-np.pi, np.pi, len(start))
    reach = cast(grid, start, direction, 50.0) + rng.normal(0.0, 0.005, len(start))
    return Hall(
        lf.OccupancyGrid(cells, RESOLUTION_M, lf.Pose2(*ORIGIN)),
        start + reach[:, None] * np.column_stack([np.cos(direction), np.sin(direction)]),
        truth,
        np.asarray(truth + off, dtype=np.float64),
        angles,
        seen + rng.normal(0.0, 0.02, seen.shape),
    )


def _cells(rng: np.random.Generator) -> NDArray[np.int8]:
    cells = np.full((CELLS, CELLS), FREE, np.int8)
    cells[:2] = cells[-2:] = OCCUPIED
    cells[:, :2] = cells[:, -2:] = OCCUPIED
    centre = RESOLUTION_M * (np.arange(CELLS) + 0.5) - 10.0
    on_the_way = np.abs(np.hypot(*np.meshgrid(centre, centre)) - 5.0) < 0.6
    placed = 0
    while placed < 25:
        (high, wide), (row, column) = rng.integers(6, 31, 2), rng.integers(4, CELLS - 36, 2)
        box = np.s_[row : row + high, column : column + wide]
        if not on_the_way[box].any():
            cells[box] = OCCUPIED
            placed += 1
    return cells
