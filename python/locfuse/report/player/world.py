# SPDX-License-Identifier: Apache-2.0
"""The static world of a run for the player: map, walls, anchors, landmarks, tags."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np

from locfuse.report.html_page import png_address
from locfuse.types import FREE, OCCUPIED, UNKNOWN, Columns, GridMap, MappedLandmarks, RunResult

_GREY = {OCCUPIED: 0, FREE: 255}  # unknown is 128
_MAX_CELLS = 2000  # per side of the map
_MAX_PLACES = 2000


def world_of(result: RunResult, most_map_bytes: int) -> dict[str, Any]:
    """Return the world of a run, with a map of at most `most_map_bytes`."""
    log = result.log
    anchors = log.tables.get("anchors", {})
    landmarks = log.tables.get("landmarks", {})
    return {
        "map": None if log.grid is None else map_picture(log.grid, most_map_bytes),
        "walls": _walls(result),
        "anchors": _places(anchors, "anchor", "z_m"),
        "landmarks": _places(landmarks, "landmark", "radius_m"),
        "mapped": _mapped(result.landmarks),
        "tags": {name: [float(v) for v in at] for name, at in log.tags.items()},
        "landmark_sensor": None
        if log.landmark_sensor is None
        else [float(v) for v in log.landmark_sensor["pose_in_body"]],
    }


def map_picture(grid: GridMap, max_bytes: int) -> dict[str, Any]:
    """Return a map as a PNG of at most `max_bytes`, and its resolution and origin."""
    grid = _known(grid)
    side = max(grid.cells.shape)
    if side > _MAX_CELLS:
        grid = grid.resampled(grid.resolution_m * side / _MAX_CELLS)
    png = _png(grid)
    while len(png) > max_bytes and max(grid.cells.shape) > 1:
        coarser = max(1.2, (len(png) / max(max_bytes, 1)) ** 0.5)
        grid = grid.resampled(coarser * grid.resolution_m)
        png = _png(grid)
    height, width = grid.cells.shape
    return {"png": png, "width": width, "height": height, "resolution_m": grid.resolution_m,
            "origin": list(grid.origin)}  # fmt: skip


def _known(grid: GridMap) -> GridMap:
    """Return the bounding box of the known cells of a map."""
    known = np.argwhere(grid.cells != UNKNOWN)
    if len(known) == 0:
        return grid
    (bottom, left), (top, right) = known.min(axis=0), known.max(axis=0) + 1
    x, y = grid.to_world(np.array([left, bottom], np.float64)).tolist()
    return GridMap(grid.cells[bottom:top, left:right], grid.resolution_m, (x, y, grid.origin[2]))


def _png(grid: GridMap) -> str:
    """Return the cells as the data URL of a grey PNG; its top row has the highest y."""
    grey = np.full(grid.cells.shape, 128, np.uint8)
    for cell, value in _GREY.items():
        grey[grid.cells == cell] = value
    height, width = grid.cells.shape
    rows = np.pad(grey[::-1], ((0, 0), (1, 0)))  # each begins with its filter: none
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in (
            (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)),
            (b"IDAT", zlib.compress(rows.tobytes(), 9)),
            (b"IEND", b""),
        )
    )
    return png_address(png)


def _walls(result: RunResult) -> list[list[float]]:
    """Return the walls that block ranges in a simulation: x1, y1, x2, y2 in metres."""
    scenario = result.config.get("simulation") or {}
    walls = [wall for fault in scenario.get("faults") or [] for wall in fault.get("walls") or []]
    return [[float(v) for v in wall] for wall in walls[:_MAX_PLACES]]


def _mapped(landmarks: MappedLandmarks | None) -> list[list[float]]:
    """Return mapped landmarks: x, y [m] and the covariance xx, xy, yy [m^2] of each."""
    if landmarks is None:
        return []
    covariance = landmarks.covariance.reshape(-1, 4)[:, [0, 1, 3]]
    rows: list[list[float]] = np.column_stack([landmarks.position, covariance]).tolist()
    return rows[:_MAX_PLACES]


def _places(table: Columns, name: str, third: str) -> dict[str, list[float]]:
    """Return named points: x, y and the column `third` (height or radius), in metres."""
    if not table:
        return {}
    more = table.get(third, np.zeros(len(table[name])))
    columns = (table[key].tolist()[:_MAX_PLACES] for key in ("x_m", "y_m"))
    rows = zip(*columns, more.tolist()[:_MAX_PLACES], strict=True)
    return dict(zip(table[name].tolist()[:_MAX_PLACES], map(list, rows), strict=True))
