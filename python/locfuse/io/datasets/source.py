# SPDX-License-Identifier: Apache-2.0
"""What the converters share: reading published CSV files, wrapping, joining columns."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import read_table
from locfuse.types import Columns, FloatArray, LogError, StampArray, wrap_angle

MAP_FILES = ("map.pgm", "map.yaml")
FREE_THRESH = 0.196  # where a map says 0.25, its unexplored cells (shade 205) would be free


def read_source(
    path: Path, kinds: Mapping[str, str], beams: str | None = None, no_return: bytes | None = None
) -> dict[str, NDArray[Any]]:
    """Read a CSV file whose header must be exactly the keys of `kinds`, in order.

    Parameters
    ----------
    path : Path
    kinds : mapping of column name to letter of `parse_table`
    beams : str, optional
        Letter in front of the numbers of further columns, returned as ``beams``. The numbers may
        all have as many digits: r000, r001, ...
    no_return : bytes, optional
        What stands for an empty field.

    Returns
    -------
    dict of arrays, shape (rows,)
        And ``beams``, shape (rows, beams), NaN where a field is empty.

    Raises
    ------
    LogError
        If the file is missing or is not such a table.
    """
    file = read_table(path)
    named, rest = file.header[: len(kinds)], file.header[len(kinds) :]
    digits = len(rest[0]) - 1 if rest else 0
    numbered = tuple(f"{beams}{number:0{digits}d}" for number in range(len(rest)))
    if named != tuple(kinds) or rest != numbered or (beams is not None and not rest):
        expected = ",".join(kinds) + (f",{beams}0,{beams}1,..." if beams else "")
        raise LogError(f"{path}, line {file.first_line - 1}: expected the header {expected}")
    if no_return is not None:
        file = replace(file, data=file.data.replace(no_return, b""))
    columns = file.columns("".join(kinds.values()) + "g" * len(rest))
    if len(columns[0]) == 0:
        raise LogError(f"{path}: no row after the header")
    table = dict(zip(kinds, columns, strict=False))
    if beams is not None:
        table["beams"] = np.stack(columns[len(kinds) :], axis=1)
    return table


def runs_of(source: Path, ending: str) -> list[str]:
    """Return the names of the runs in a folder: what stands before `ending` in its files' names.

    Raises
    ------
    LogError
        If there is none.
    """
    names = sorted(path.name.removesuffix(ending) for path in source.glob(f"?*{ending}"))
    if not names:
        raise LogError(f"{source}: no file that ends in {ending}")
    return names


def with_start(stamp_ns: int, increments: Columns) -> Columns:
    """Return increments with a row of zeros in front: where the first motion begins."""
    return {
        name: np.concatenate([[stamp_ns if name == "stamp_ns" else 0], values]).astype(values.dtype)
        for name, values in increments.items()
    }


def increments(stamp_ns: StampArray, x: FloatArray, y: FloatArray, heading: FloatArray) -> Columns:
    """Return cumulative odometry as motions, each in the body frame where it begins.

    Parameters
    ----------
    stamp_ns : int64 array, shape (n,)
    x, y, heading : float64 arrays, shape (n,)
        Metres and radians, in a frame of the odometry's own.

    Returns
    -------
    columns, shape (n,)
        ``stamp_ns``, ``dx_m``, ``dy_m``, ``dheading_rad``; the first motion is zero.
    """
    cos, sin, dx, dy = np.cos(heading[:-1]), np.sin(heading[:-1]), np.diff(x), np.diff(y)
    motions = {
        "stamp_ns": stamp_ns[1:],
        "dx_m": cos * dx + sin * dy,
        "dy_m": cos * dy - sin * dx,
        "dheading_rad": wrap_angle(np.diff(heading)),
    }
    return with_start(int(stamp_ns[0]), motions)


def truth(stamp_ns: StampArray, pose: Columns) -> Columns:
    """Return poses ``x_m``, ``y_m``, ``theta_rad`` as the truth of a log."""
    return {
        "stamp_ns": stamp_ns,
        "x_m": pose["x_m"],
        "y_m": pose["y_m"],
        "heading_rad": wrap_angle(pose["theta_rad"]),
    }


def row_error(path: Path, row: int, text: str) -> LogError:
    """Return the error that names a file and the line of a row, counting rows from 0."""
    return read_table(path).error(row, text)


def copy_map(source: Path, out: Path) -> None:
    """Copy a ROS map into a log folder."""
    for name in MAP_FILES:
        shutil.copyfile(source / name, out / name)


def check_map(source: Path) -> None:
    """Refuse a source without its map before anything is written."""
    for name in MAP_FILES:
        if not (source / name).is_file():
            raise LogError(f"{source / name}: no such file")
