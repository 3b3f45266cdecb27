# SPDX-License-Identifier: Apache-2.0
"""How well ranges fix a position, and how many anchors are in view, all over the floor."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from locfuse.check.grid import bounds, known
from locfuse.check.layout import WORST, dilution, information
from locfuse.config.scenario import Scenario
from locfuse.sim.faults import walls_between
from locfuse.types import FloatArray, GridMap

STEP_M = 0.05
MAX_CELLS = 60_000  # of larger floors the cells are larger
BEST = 0.5  # no three anchors do better

Wall = tuple[float, float, float, float]


@dataclass(frozen=True)
class Floor:
    """Where to look: points on a grid from a corner on.

    `low` is the first point, metres; `height_m` is the tag's.
    """

    low: tuple[float, float]
    step_m: float
    columns: int
    rows: int
    height_m: float

    def points(self) -> FloatArray:
        """Return the points, shape (rows * columns, 2), row by row from the lowest y."""
        x = self.low[0] + self.step_m * np.arange(self.columns)
        y = self.low[1] + self.step_m * np.arange(self.rows)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Coverage:
    """What anchors give over a floor.

    Arrays are (rows, columns). `hdop` is the error of a position over the error of a range, at most
    20, NaN where the map has no floor; `seen` counts the anchors in view.
    """

    floor: Floor
    hdop: FloatArray
    seen: NDArray[np.uint8]


def floor_of(scenario: Scenario, grid: GridMap | None) -> Floor:
    """Return the floor of a scenario: that of its map, or its room."""
    low, high = np.zeros(2), np.array(scenario.room_m)
    if scenario.map is not None and scenario.map.file is not None and grid is not None:
        low, high = bounds(grid) or (low, high)
    width, depth = (high - low).tolist()
    step_m = max(STEP_M, (width * depth / MAX_CELLS) ** 0.5)
    height = next(iter(scenario.tags.values()), (0.0, 0.0, 0.0))[2]
    return Floor((float(low[0]), float(low[1])), step_m, round(width / step_m) + 1,
                 round(depth / step_m) + 1, height)  # fmt: skip


def coverage(
    anchors: Mapping[str, Sequence[float]],
    walls: Sequence[Wall],
    floor: Floor,
    grid: GridMap | None = None,
) -> Coverage:
    """Return dilution of precision and anchors in view.

    The information of each anchor is cached: when one moves, only its part is recomputed.

    `anchors` are (x, y, z) by name; ranges through `walls`, (x1, y1, x2, y2), count for nothing;
    where `grid` knows nothing there is no floor.
    """
    cells = floor.rows * floor.columns
    total, seen = np.zeros((3, cells)), np.zeros(cells, np.uint8)
    around = tuple(tuple(wall) for wall in walls)
    for x, y, z in anchors.values():
        of_one, in_view = _of_anchor((float(x), float(y), float(z)), around, floor)
        total += of_one
        seen += in_view
    hdop = dilution(total.T)
    if grid is not None:
        hdop[~known(grid, floor.points())] = np.nan
    shape = (floor.rows, floor.columns)
    return Coverage(floor, hdop.reshape(shape), seen.reshape(shape))


@lru_cache(maxsize=48)
def _of_anchor(
    anchor: tuple[float, float, float], walls: tuple[Wall, ...], floor: Floor
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the information of ranges to an anchor (3, cells), and the cells that see it."""
    points = floor.points()
    total = information(np.array([anchor]), points, floor.height_m)[:, 0].T.copy()
    if not walls:
        return total, np.ones(len(points), np.bool_)
    in_view = walls_between(points, np.broadcast_to(anchor[:2], points.shape), walls) == 0
    total[:, ~in_view] = 0.0
    return total, in_view


def packed(found: Coverage) -> bytes:
    """Return a coverage as the page draws it.

    A little-endian uint32 with the length of the JSON that follows, padded to 4 bytes; then a byte
    per point for the dilution: 0 no floor, 1 to 254 from `BEST` to `WORST` in equal ratios, 255
    none; then a byte per point for the anchors in view. The JSON also says mean and worst.
    """
    floor = found.floor
    ratio = np.log(np.maximum(found.hdop, BEST) / BEST) / np.log(WORST / BEST)
    level = np.where(found.hdop >= WORST, 255.0, 1.0 + np.floor(253.0 * ratio))
    level = np.where(np.isnan(found.hdop), 0.0, level).astype(np.uint8)
    on_floor = found.hdop[~np.isnan(found.hdop)]
    on_floor = on_floor if len(on_floor) else np.array([WORST])
    head = json.dumps({
        "low": floor.low, "step_m": floor.step_m, "columns": floor.columns, "rows": floor.rows,
        "best": BEST, "none": WORST, "mean": round(float(on_floor.mean()), 3),
        "worst": round(float(on_floor.max()), 3),
        "least_seen": int(found.seen[~np.isnan(found.hdop)].min(initial=255)),
    }).encode()  # fmt: skip
    head += b" " * (-len(head) % 4)
    return struct.pack("<I", len(head)) + head + level.tobytes() + found.seen.tobytes()
