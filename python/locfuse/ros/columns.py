# SPDX-License-Identifier: Apache-2.0
"""Tables that grow row by row in little more memory than they end up with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

CHUNK = 4096  # rows that wait as objects of Python


class Rows:
    """Rows of a table, of which each column becomes an array.

    Parameters
    ----------
    **dtypes
        Type of each column, by name; a column of arrays of one length becomes one of shape
        (n, length).

    Examples
    --------
    >>> rows = Rows(stamp_ns=np.int64, name=np.str_)
    >>> rows.add(5, "a")
    >>> rows.add(6, "bc")
    >>> len(rows), rows.columns()["name"].tolist()
    (2, ['a', 'bc'])
    """

    def __init__(self, **dtypes: Any) -> None:
        self._dtypes = dtypes
        self._waiting: list[tuple[Any, ...]] = []
        self._packed: list[list[NDArray[Any]]] = []  # one array per column in each chunk
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, *row: Any) -> None:
        """Add a row, in the order of the columns."""
        self._waiting.append(row)
        self._count += 1
        if len(self._waiting) == CHUNK:
            self._pack()

    def lag_ns(self) -> float:
        """Return the median of `record_ns` minus `stamp_ns`, the first two columns."""
        lags = [np.asarray(chunk[1] - chunk[0]) for chunk in self._packed]
        lags.append(np.array([row[1] - row[0] for row in self._waiting], np.int64))
        return float(np.median(np.concatenate(lags)))

    def _pack(self) -> None:
        columns = zip(*self._waiting, strict=True)
        self._packed.append(
            [np.array(column, dtype) for column, dtype in zip(columns, self._dtypes.values(),
                                                              strict=True)]
        )  # fmt: skip
        self._waiting = []

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns; the rows are gone then, so that they are not held twice."""
        if self._waiting:
            self._pack()
        found = {}
        for index, (name, dtype) in enumerate(self._dtypes.items()):
            parts = [chunk[index] for chunk in self._packed]
            found[name] = np.concatenate(parts) if parts else np.zeros(0, dtype)
            for chunk in self._packed:
                chunk[index] = np.zeros(0)
        self._packed, self._count = [], 0
        return found
