# SPDX-License-Identifier: Apache-2.0
"""The table of a sweep, and the folder that stores it during and after the sweep."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.whole import PART, whole_file, write_whole
from locfuse.sweep.trial import INSTANTS, SCORES, Row
from locfuse.sweep.vary import Axis
from locfuse.types import ConfigError, FloatArray

TABLE = "trials.parquet"
ABOUT = "sweep.json"
PARTS = "parts"
BATCHES = "[0-9]*.parquet"  # in there; what a program that was killed left has another name
MAX_PARTS = 200  # more are merged into the table
NOT_REPEATED = ("wall_s",)  # columns that differ between runs of the same trial


@dataclass(frozen=True)
class Trials:
    """Results of the trials of a sweep, in order of their numbers.

    Attributes
    ----------
    axes : tuple of Axis
        What varied.
    columns : mapping of name to array, shape (n,)
        ``trial`` and ``seed`` (int64), the varied keys (int64, float64 or str), all `SCORES`
        (float64, NaN where there is none), ``error`` (str, empty where nothing went wrong), and
        ``nees_at``, float64 of shape (n, 25). docs/sweep.md lists them with their units.
    """

    axes: tuple[Axis, ...]
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.columns["trial"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which trials ended with an error."""
        return np.asarray(self.columns["error"] != "")

    def some(self, rows: NDArray[Any]) -> Trials:
        """Return some of the trials, by mask or indices."""
        return Trials(self.axes, {name: column[rows] for name, column in self.columns.items()})


def trials_of(rows: Iterable[Row], axes: Sequence[Axis]) -> Trials:
    """Return rows as columns, in order of the trials."""
    ordered = sorted(rows, key=lambda row: int(row["trial"]))
    columns: dict[str, NDArray[Any]] = {}
    for name, kind in _kinds(axes).items():
        values = [row[name] for row in ordered]
        if kind == "nees_at":
            columns[name] = _matrix(values)
        elif kind == "string":
            columns[name] = np.array(["" if v is None else v for v in values], dtype=np.str_)
        elif kind == "int64":
            columns[name] = np.array(values, dtype=np.int64)
        else:
            numbers = [np.nan if v is None else v for v in values]
            columns[name] = np.array(numbers, dtype=np.float64)
    return Trials(tuple(axes), columns)


def _matrix(values: Sequence[Any]) -> FloatArray:
    none = [np.nan] * INSTANTS
    filled = [none if value is None else list(value) for value in values]
    return np.array(filled, dtype=np.float64).reshape(len(values), INSTANTS)


def _kinds(axes: Sequence[Axis]) -> dict[str, str]:
    """Return the type of each column, in order."""
    varied = {axis.key: axis.kind for axis in axes}
    scored = dict.fromkeys(SCORES, "float64")
    return {"trial": "int64", "seed": "int64", **varied, **scored, "nees_at": "nees_at",
            "error": "string"}  # fmt: skip


class Folder:
    """A folder of a sweep, of one program at a time: rows are added batch by batch, and stay.

    ``sweep.json`` identifies the sweep. Each batch is a file in ``parts``, written whole;
    ``trials.parquet`` holds the merged rows, in the end all of them.

    `path` is created if missing. `about` identifies the sweep, ready for JSON; ``trials`` may grow.
    Raises ConfigError if the folder holds another sweep, or what is in it cannot be read, or
    pyarrow is missing.
    """

    def __init__(self, path: Path, about: dict[str, Any], axes: Sequence[Axis]) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError:
            raise ConfigError(
                "results of a sweep are written as Parquet, which needs pyarrow; "
                "pip install 'locfuse[sweep]'"
            ) from None
        self._parquet = pq
        types = {"int64": pa.int64(), "float64": pa.float64(), "string": pa.string(),
                 "nees_at": pa.list_(pa.float64())}  # fmt: skip
        self._schema = pa.schema([(name, types[kind]) for name, kind in _kinds(axes).items()])
        self._path = path
        _claim(path, about)
        for left in (path / PARTS).glob(f"{PART}*"):
            left.unlink()
        files = [*sorted((path / PARTS).glob(BATCHES)), path / TABLE]
        found = [row for file in files if file.is_file() for row in self._read(file)]
        self._rows: dict[int, Row] = {row["trial"]: row for row in found}
        self._parts = len(files) - 1

    @property
    def rows(self) -> list[Row]:
        """All rows of the folder."""
        return list(self._rows.values())

    def add(self, rows: Sequence[Row]) -> None:
        """Write a batch."""
        if not rows:
            return
        self._rows |= {row["trial"]: row for row in rows}
        self._write(rows, self._path / PARTS / f"{rows[0]['trial']:09d}.parquet")
        self._parts += 1
        if self._parts > MAX_PARTS:
            self.put_together()

    def put_together(self) -> None:
        """Merge all rows into the table, in order of the trials, and remove the parts."""
        parts = sorted((self._path / PARTS).glob(BATCHES))
        self._write([self._rows[k] for k in sorted(self._rows)], self._path / TABLE)
        for part in parts:
            part.unlink()
        self._parts = 0

    def _write(self, rows: Sequence[Row], file: Path) -> None:
        import pyarrow as pa

        with whole_file(file) as part:
            self._parquet.write_table(pa.Table.from_pylist(list(rows), schema=self._schema), part)

    def _read(self, file: Path) -> list[Row]:
        try:
            table = self._parquet.read_table(file)
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"{file}: cannot be read ({str(error).splitlines()[0]}); remove it, and its trials "
                "are run again"
            ) from None
        if table.schema.names != self._schema.names:
            raise ConfigError(f"{file}: has other columns than this sweep; choose another folder")
        rows: list[Row] = table.to_pylist()
        return rows


def _claim(path: Path, about: dict[str, Any]) -> None:
    """Create the folder of the sweep, or check that it is of the same sweep."""
    file = path / ABOUT
    (path / PARTS).mkdir(parents=True, exist_ok=True)
    if file.is_file():
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
        except ValueError:
            raise ConfigError(f"{file}: is no JSON; choose another folder") from None
        where = difference({**found, "trials": 0}, {**json.loads(json.dumps(about)), "trials": 0})
        if where is not None:
            raise ConfigError(f"{path} holds another sweep: its {where}; choose another folder")
        if found["trials"] > about["trials"]:
            raise ConfigError(
                f"{path} holds this sweep with {found['trials']} trials; ask for at least as many, "
                "or choose another folder"
            )
    write_whole(file, json.dumps(about, indent=1) + "\n")


def difference(found: Any, asked: Any, where: str = "") -> str | None:
    """Return where two JSON values differ first, as text; None if they are equal."""
    if found == asked:
        return None
    if isinstance(found, dict) and isinstance(asked, dict):
        for key in [*found, *(k for k in asked if k not in found)]:
            inner = difference(found.get(key), asked.get(key), f"{where}.{key}" if where else key)
            if inner is not None:
                return inner
    return f"{where or 'content'} is {json.dumps(found)} instead of {json.dumps(asked)}"
