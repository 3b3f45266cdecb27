# SPDX-License-Identifier: Apache-2.0
"""Arrays as JSON, and how many bytes each table of a run may take."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.report.decimation import stride

_NAMES = {"f8": "f64", "f4": "f32", "u4": "u32", "u2": "u16", "u1": "u8"}
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Part:
    """A part of a run that can be decimated to a number of bytes.

    `wanted` is its bytes of JSON without decimation; `packed` returns it decimated to given bytes.
    """

    wanted: int
    packed: Callable[[int], dict[str, Any]]


def encoded(array: NDArray[Any]) -> dict[str, Any]:
    """Return an array as base64 of its little-endian bytes, keyed by its type."""
    array = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    name = _NAMES[array.dtype.str[1:]]
    return {name: base64.b64encode(array.tobytes()).decode("ascii"), "shape": list(array.shape)}


def encoded_bytes(raw: int) -> int:
    """Return the length of the base64 of so many bytes."""
    return 4 * -(-raw // 3)


def shares(wanted: Mapping[str, int], total: int) -> dict[str, int]:
    """Divide bytes fairly: small wishes are granted in full, the others get equal shares.

    Examples
    --------
    >>> shares({"a": 10, "b": 500, "c": 90}, 300)
    {'a': 10, 'c': 90, 'b': 200}
    """
    given: dict[str, int] = {}
    for name, want in sorted(wanted.items(), key=lambda item: item[1]):
        given[name] = min(want, total // (len(wanted) - len(given)))
        total -= given[name]
    return given


def table_part(columns: Mapping[str, NDArray[Any]], keep: NDArray[np.bool_]) -> Part:
    """Return a table, ordered by time, in which some rows have priority.

    Columns are (n, ...). Rows in `keep` (n,) are dropped last, evenly; the first and the last row
    always stay.
    """
    n = len(keep)
    per_row = sum(column.itemsize * int(np.prod(column.shape[1:])) for column in columns.values())

    def packed(max_bytes: int) -> dict[str, Any]:
        rows = chosen(keep, max_bytes // max(encoded_bytes(per_row), 1))
        return {"of": n, **{name: encoded(column[rows]) for name, column in columns.items()}}

    return Part(n * encoded_bytes(per_row), packed)


def chosen(keep: NDArray[np.bool_], most: int) -> NDArray[np.intp]:
    """Return at most `most` rows, but at least two: the ends, those to keep, others evenly."""
    n = len(keep)
    if n <= max(most, 2):
        return np.arange(n, dtype=np.intp)
    keep = keep.copy()
    keep[[0, -1]] = True
    kept = np.flatnonzero(keep)
    if len(kept) >= most:
        return kept[stride(len(kept), max(most, 2))]
    others = np.flatnonzero(~keep)
    # Multiples of the golden ratio spread evenly and never fall in step with anchors taking turns.
    rank = np.argsort(np.mod(np.arange(len(others)) * _GOLDEN, 1.0), kind="stable")
    return np.union1d(kept, others[rank[: most - len(kept)]])
