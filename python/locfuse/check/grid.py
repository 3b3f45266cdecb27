# SPDX-License-Identifier: Apache-2.0
"""The map of a log as cells, for what can be said of it before a run."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from locfuse.types import FloatArray, LogError


@dataclass(frozen=True)
class Grid:
    """A ROS map.

    Attributes
    ----------
    occupied, free : bool arrays, shape (rows, columns)
        Row 0 lies south, as y grows; cells that are neither are unknown.
    resolution : float
        Side of a cell, metres.
    origin : tuple of 2 floats
        South-west corner in world, metres.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float
    origin: tuple[float, float]

    def inside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points of shape (n, 2) lie on the map."""
        size = np.array(self.occupied.shape[::-1]) * self.resolution
        off = points - np.array(self.origin)
        within: NDArray[np.bool_] = np.all((off >= 0.0) & (off < size), axis=1)
        return within

    def known(self, points: FloatArray, around: float = 0.3) -> NDArray[np.bool_]:
        """Return around which points of shape (n, 2) most cells are free or occupied.

        Those within `around` metres in x and y count, so that specks neither add nor take floor.
        """
        size = np.array(self.occupied.shape[::-1])
        cell = np.floor((points - np.array(self.origin)) / self.resolution).astype(np.intp)
        reach = int(around / self.resolution)
        low, high = np.clip(cell - reach, 0, size), np.clip(cell + reach + 1, 0, size)
        total = np.pad(np.cumsum(np.cumsum(self.occupied | self.free, axis=0), axis=1), (1, 0))
        (x1, y1), (x2, y2) = low.T, high.T
        seen = total[y2, x2] - total[y1, x2] - total[y2, x1] + total[y1, x1]
        most: NDArray[np.bool_] = 2 * seen > (2 * reach + 1) ** 2
        return most

    def bounds(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the corners of the box around what is known; None if nothing is."""
        row, column = np.nonzero(self.occupied | self.free)
        cells = np.column_stack([column, row]).astype(np.float64)
        centres: FloatArray = np.array(self.origin) + (cells + 0.5) * self.resolution
        centres = centres[self.known(centres)]
        if len(centres) == 0:
            return None
        half = 0.5 * self.resolution
        return centres.min(axis=0) - half, centres.max(axis=0) + half


def read_grid(path: Path) -> Grid:
    """Read a ROS map: a YAML file and the PGM picture that it names.

    Raises
    ------
    LogError
        If a file is missing or is no map; names the file and the key.
    """
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise LogError(f"{path}: cannot be read ({' '.join(str(error).split())})") from None
    if not isinstance(said, dict):
        raise LogError(f"{path}: is no map; expected keys image, resolution, origin")
    resolution = _number(said, "resolution", path)
    if resolution <= 0.0:
        raise LogError(f"{path}: resolution is {resolution:g}, expected metres > 0")
    grey = _read_pgm(path.parent / str(said.get("image")))
    dark = grey if said.get("negate") else 1.0 - grey
    origin = said.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise LogError(f"{path}: origin is {origin!r}, expected [x, y, yaw]")
    occupied = dark > float(said.get("occupied_thresh", 0.65))
    free = dark < float(said.get("free_thresh", 0.196))
    x, y = float(origin[0]), float(origin[1])
    return Grid(occupied[::-1], free[::-1], resolution, (x, y))


def _number(said: dict[str, Any], key: str, path: Path) -> float:
    value = said.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise LogError(f"{path}: {key} is {value!r}, expected a number")
    return float(value)


def _read_pgm(path: Path) -> FloatArray:
    """Return the grey values of a PGM picture, 0 black to 1 white, first row on top."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    head = re.match(rb"(P2|P5)\s(?:\s*#[^\n]*\n)*\s*(\d+)\s+(\d+)\s+(?:#[^\n]*\n)?(\d+)\s", data)
    if head is None or not 0 < int(head[4]) < 256:
        raise LogError(f"{path}: is no PGM picture of 8 bits")
    columns, rows, top = int(head[2]), int(head[3]), int(head[4])
    body = data[head.end() :]
    try:
        cells = (
            np.array(body.split(), np.uint8) if head[1] == b"P2" else np.frombuffer(body, np.uint8)
        )
        grey: FloatArray = cells[: rows * columns].reshape(rows, columns) / float(top)
    except ValueError:
        raise LogError(f"{path}: holds less than {rows} rows of {columns} cells") from None
    return grey
