# SPDX-License-Identifier: Apache-2.0
"""Tables that grow block by block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.types import Columns

BLOCK_ROWS = 2048  # after which rows become arrays


class Blocks:
    """Rows of a table in the order they arrive, held as blocks of arrays with the same columns.

    Examples
    --------
    >>> blocks = Blocks()
    >>> blocks.add({"stamp_ns": np.array([5, 6]), "name": np.array(["a", "bc"])})
    >>> blocks.add({"stamp_ns": np.array([7]), "name": np.array(["def"])})
    >>> len(blocks), blocks.columns()["name"].tolist()
    (3, ['a', 'bc', 'def'])
    """

    def __init__(self) -> None:
        self._blocks: list[dict[str, NDArray[Any]]] = []
        self._rows: list[Mapping[str, Any]] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, columns: Columns) -> None:
        """Add arrays of rows."""
        self._pack()
        self._blocks.append(dict(columns))
        self._count += length(columns)

    def append(self, row: Mapping[str, Any]) -> None:
        """Add one row: integers in columns that end in ``_ns``, else floats, texts or arrays."""
        self._rows.append(row)
        self._count += 1
        if len(self._rows) >= BLOCK_ROWS:
            self._pack()

    def _pack(self) -> None:
        rows, self._rows = self._rows, []
        if rows:
            self._blocks.append({name: _stacked(name, [row[name] for row in rows])
                                 for name in rows[0]})  # fmt: skip

    def lag_ns(self) -> float:
        """Return the median of `record_ns` minus `stamp_ns`."""
        self._pack()
        lags = [block["record_ns"] - block["stamp_ns"] for block in self._blocks]
        return float(np.median(np.concatenate(lags)))

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns; the blocks are gone then, so that they are not held twice."""
        self._pack()
        blocks, self._blocks, self._count = self._blocks, [], 0
        return {name: np.concatenate(_as_wide([block.pop(name) for block in blocks]))
                for name in list(blocks[0])}  # fmt: skip


def _stacked(name: str, values: list[Any]) -> NDArray[Any]:
    """Return values as one array; arrays of different length end in NaN."""
    if isinstance(values[0], np.ndarray) and len({len(value) for value in values}) > 1:
        return np.concatenate(_as_wide([value[None] for value in values]))
    return np.array(values, np.int64 if name.endswith("_ns") else None)


def _as_wide(blocks: list[NDArray[Any]]) -> list[NDArray[Any]]:
    """Return arrays of rows that are all as wide as the widest, with NaN where they were not."""
    if blocks[0].ndim == 1 or len({block.shape[1] for block in blocks}) == 1:
        return blocks
    widest = max(block.shape[1] for block in blocks)
    return [np.pad(block, ((0, 0), (0, widest - block.shape[1])), constant_values=np.nan)
            for block in blocks]  # fmt: skip


def length(columns: Mapping[str, NDArray[Any]]) -> int:
    """Return how many rows columns have."""
    return len(next(iter(columns.values())))
