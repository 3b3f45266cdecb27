# SPDX-License-Identifier: Apache-2.0
"""Many messages of one type at once, from arrays to bytes: the inverse of `unpack`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse.io.rosbag.unpack import CDR_HEAD, TEXT, Node, Places, Structure, Texts

# Values of fields by path, as `Unpacked` names them: a number or text for all messages, an array
# (n,) or Texts; an array (n, length) for several numbers; for several structures how many there
# are, shape (n,), and arrays over all of theirs.
Values: TypeAlias = Mapping[str, Any]

LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def pack(structure: Structure, encoding: str, count: int, values: Values) -> list[bytes]:
    """Return the bytes of messages of a type; fields without value are 0 or empty.

    Parameters
    ----------
    structure : tuple of (name, Node)
    encoding : str
        ``ros1`` or ``cdr``, which is written little-endian.
    count : int
        How many messages there are.
    values : mapping
    """
    aligned = encoding == "cdr"
    walk = _Walk(aligned, values)
    all_of_them = np.arange(count)
    sizes = walk.structure(structure, "", all_of_them, all_of_them, np.zeros(count, np.int64))
    head = CDR_HEAD if aligned else 0
    ends = np.cumsum(sizes + head)
    begins = ends - sizes
    data = bytearray(int(ends[-1]) if count else 0)
    for row in range(count if aligned else 0):
        data[begins[row] - head : begins[row]] = LITTLE_ENDIAN
    for part in walk.parts:
        part.write(data, begins)
    told = bytes(data)
    return [told[begin - head : end] for begin, end in zip(begins.tolist(), ends.tolist(),
                                                           strict=True)]  # fmt: skip


@dataclass
class _Part:
    """Numbers, or bytes of text, and where each goes: so many bytes after its message begins."""

    rows: Places
    at: Places
    values: NDArray[Any]

    def write(self, data: bytearray, begins: Places) -> None:
        dtype, shape = self.values.dtype, self.values.shape[1:]
        room = max(0, len(data) - dtype.itemsize * int(np.prod(shape)) + 1)
        steps = (1, dtype.itemsize)[: 1 + len(shape)]
        place: NDArray[Any] = np.ndarray((room, *shape), dtype, data, 0, steps)
        place[begins[self.rows] + self.at] = self.values


@dataclass
class _Walk:
    """Messages side by side, as long as they have become."""

    aligned: bool
    values: Values
    parts: list[_Part] = field(default_factory=list)

    def structure(
        self, structure: Structure, path: str, rows: Places, which: Places, at: Places
    ) -> Places:
        """Return where structures end that begin `at`, in `rows`; `which` are their values."""
        for name, node in structure:
            at = self._field(node, f"{path}{name}", rows, which, at)
        return at

    def _field(self, node: Node, path: str, rows: Places, which: Places, at: Places) -> Places:
        if node.length is None:
            return self._one(node, path, rows, which, at)
        value = self.values.get(path)
        if node.structure is None and node.dtype != TEXT:
            return self._numbers(node, value, rows, which, at)
        counts = np.zeros(int(which.max(initial=-1)) + 1, np.int64) if value is None else value
        if node.length < 0:
            at = self._number(np.dtype("u4"), counts[which], rows, at)
        at = at.copy()
        first = np.cumsum(counts) - counts
        for number in range(int(counts[which].max(initial=0))):
            inside = np.flatnonzero(counts[which] > number)
            at[inside] = self._one(node, f"{path}[]", rows[inside],
                                   first[which[inside]] + number, at[inside])  # fmt: skip
        return at

    def _one(self, node: Node, path: str, rows: Places, which: Places, at: Places) -> Places:
        if node.structure is not None:
            return self.structure(node.structure, f"{path}.", rows, which, at)
        value = self.values.get(path)
        if node.dtype == TEXT:
            return self._text("" if value is None else value, rows, which, at)
        if isinstance(value, np.ndarray):
            value = value[which]
        return self._number(node.dtype, value, rows, at)

    def _numbers(
        self, node: Node, value: Any, rows: Places, which: Places, at: Places
    ) -> Places:  # fmt: skip
        """Write an array or sequence of numbers."""
        length = int(node.length or 0) if value is None else value.shape[1]
        if node.length == -1:
            length = max(length, 0)
            at = self._number(np.dtype("u4"), length, rows, at)
        if not length:
            return at
        at = self._even(node.dtype.itemsize, at)
        if value is not None:
            self.parts.append(_Part(rows, at, value[which].astype(node.dtype)))
        return at + length * node.dtype.itemsize

    def _number(self, dtype: np.dtype[Any], value: Any, rows: Places, at: Places) -> Places:
        at = self._even(dtype.itemsize, at)
        if value is not None:
            values = np.broadcast_to(np.asarray(value), rows.shape).astype(dtype)
            self.parts.append(_Part(rows, at, values))
        return at + dtype.itemsize

    def _text(self, value: Texts | str, rows: Places, which: Places, at: Places) -> Places:
        end = b"\x00" if self.aligned else b""
        if isinstance(value, str):
            value = Texts([value], np.zeros(int(which.max(initial=-1)) + 1, np.int64))
        names = [name.encode() + end for name in value.names]
        codes = value.codes[which]
        lengths = np.array([len(name) for name in names], np.int64)[codes]
        at = self._number(np.dtype("u4"), lengths, rows, at)
        for code, name in enumerate(names):
            there = np.flatnonzero(codes == code)
            if len(there) and name:
                letters = np.broadcast_to(np.frombuffer(name, np.uint8), (len(there), len(name)))
                self.parts.append(_Part(rows[there], at[there], letters))
        return at + lengths

    def _even(self, size: int, at: Places) -> Places:
        """Return the next place at which a number of that size may be."""
        return at + -at % size if self.aligned else at
