# SPDX-License-Identifier: Apache-2.0
"""What the converters share: reading published CSV files, wrapping, joining columns."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import read_table
from locfuse.types import Columns, LogError

MAP_FILES = ("map.pgm", "map.yaml")


def read_source(
    path: Path, kinds: Mapping[str, str], beams: str | None = None
) -> dict[str, NDArray[Any]]:
    """Read a CSV file whose header must be exactly the keys of `kinds`, in order.

    Parameters
    ----------
    path : Path
    kinds : mapping of column name to letter of `parse_table`
    beams : str, optional
        Letter in front of the numbers of further columns, returned as ``beams``.

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
    numbered = tuple(f"{beams}{number}" for number in range(len(rest)))
    if named != tuple(kinds) or rest != numbered or (beams is not None and not rest):
        expected = ",".join(kinds) + (f",{beams}0,{beams}1,..." if beams else "")
        raise LogError(f"{path}, line {file.first_line - 1}: expected the header {expected}")
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


def copy_map(source: Path, out: Path) -> None:
    """Copy a ROS map into a log folder."""
    for name in MAP_FILES:
        shutil.copyfile(source / name, out / name)


def check_map(source: Path) -> None:
    """Refuse a source without its map before anything is written."""
    for name in MAP_FILES:
        if not (source / name).is_file():
            raise LogError(f"{source / name}: no such file")
