# SPDX-License-Identifier: Apache-2.0
"""Many messages of one type at once: where each of their fields is, and its values as arrays.

A message of ROS has no index: where a field begins depends on the lengths of those before it. So
all messages are walked side by side, field by field, and one step of numpy moves all of them on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Places: TypeAlias = NDArray[np.int64]
Structure: TypeAlias = "tuple[tuple[str, Node], ...]"

TEXT, STRUCTURE = np.dtype("S"), np.dtype("V")
ORDERS = {b"\x00\x01": "<", b"\x00\x00": ">"}  # how CDR begins, and the order of its bytes
CDR_HEAD, CDR_SPARE = 4, 3  # bytes in front of a message, and behind it at most


class Node(NamedTuple):
    """What a field is: a number or text, a `structure`, or several of either.

    `length` is None for a field alone, how many there are for an array, and -1 for a sequence,
    which tells it.
    """

    dtype: np.dtype[Any]
    structure: Structure | None = None
    length: int | None = None


class MisfitError(KeyError):
    """Messages have no such field, or one of another kind."""


class Texts(NamedTuple):
    """Texts (n,): each is ``names[codes]``."""

    names: list[str]
    codes: Places

    @classmethod
    def all(cls, name: str, n: int) -> Texts:
        """Return n times the same text."""
        return cls([name], np.zeros(n, np.int64))

    def array(self) -> NDArray[np.str_]:
        """Return the texts themselves."""
        return np.array(self.names or [""], np.str_)[self.codes]

    def each(self, holds: Sequence[bool]) -> NDArray[np.bool_]:
        """Return for each text what holds for its name."""
        return np.array(holds, bool)[self.codes]

    def renamed(self, change: Callable[[str], str]) -> Texts:
        """Return other texts for these."""
        return Texts([change(name) for name in self.names], self.codes)

    def or_else(self, others: Texts, which: Places) -> Texts:
        """Return these texts; where one is empty, that one `which` of others."""
        empty = self.each([name == "" for name in self.names])
        codes = np.where(empty, others.codes[which] + len(self.names), self.codes)
        return Texts([*self.names, *others.names], codes)


@dataclass
class _Leaf:
    """Where a field is in each message of `rows`, and how many elements are there."""

    dtype: np.dtype[Any]
    rows: list[Places] = field(default_factory=list)
    at: list[Places] = field(default_factory=list)
    count: list[Places] = field(default_factory=list)


class Unpacked:
    """Messages of one type.

    Fields are named by their path, as ``pose.pose.position.x``; those of the elements of a sequence
    of structures as ``ranges[].anchor``, of all messages, one after another.

    Attributes
    ----------
    rows : int64 array, shape (n,)
        Which of the messages that were given these are; the others are not what the type says.
    """

    def __init__(self, rows: Places, data: bytes, leaves: dict[str, _Leaf]) -> None:
        self.rows = rows
        self._data = data
        self._leaves = leaves
        self._texts: dict[str, Texts] = {}
        self._orders: dict[str, Places] = {}

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, path: str) -> bool:
        return path in self._leaves

    def paths(self) -> list[str]:
        """Return which fields there are."""
        return list(self._leaves)

    def number(self, path: str) -> NDArray[Any]:
        """Return a number of each message, shape (n,), in the type it is sent in.

        Raises
        ------
        MisfitError
            As all that follow: if there is no such field, or it is another kind of one.
        """
        leaf = self._leaf(path)
        if leaf.count or leaf.dtype.kind not in "iuf":
            raise MisfitError(path)
        return _gathered(self._data, leaf.dtype, self._of(path, leaf.at))

    def real(self, path: str) -> NDArray[np.float64]:
        """Return a number of each message as float64."""
        return self.number(path).astype(np.float64)

    def counts(self, path: str) -> Places:
        """Return how many elements an array or sequence of each message has."""
        leaf = self._leaf(path)
        if not leaf.count or leaf.dtype == TEXT:
            raise MisfitError(path)
        return self._of(path, leaf.count)

    def elements(self, path: str, chosen: Any, which: Sequence[int] | int) -> NDArray[Any]:
        """Return elements `which`, or the first so many, of the numbers of `chosen` messages."""
        leaf = self._leaf(path)
        if not leaf.count or leaf.dtype.kind not in "iuf":
            raise MisfitError(path)
        at = self._of(path, leaf.at)[chosen]
        if isinstance(which, int):  # all beside each other: at one go
            row = np.dtype((leaf.dtype, (which,)))
            return _gathered(self._data, row, at).reshape(len(at), which)
        steps = leaf.dtype.itemsize * np.asarray(which)
        return _gathered(self._data, leaf.dtype, at[:, None] + steps)

    def flat(self, path: str, chosen: NDArray[np.bool_]) -> NDArray[Any]:
        """Return all the numbers of `chosen` messages, one message after another."""
        at, count = self._of(path, self._leaf(path).at)[chosen], self.counts(path)[chosen]
        leaf = self._leaf(path)
        if leaf.dtype.kind not in "iuf":
            raise MisfitError(path)
        before = np.repeat(np.cumsum(count) - count, count)
        steps = (np.arange(len(before)) - before) * leaf.dtype.itemsize
        return _gathered(self._data, leaf.dtype, np.repeat(at, count) + steps)

    def text(self, path: str) -> Texts:
        """Return a text of each message."""
        leaf = self._leaf(path)
        if leaf.dtype != TEXT:
            raise MisfitError(path)
        found = self._texts[path]
        order = self._order(path)
        return found if order is None else found._replace(codes=found.codes[order])

    def owner(self, path: str) -> Places:
        """Return which of these messages, 0 to n - 1, each element of a sequence belongs to."""
        leaf = self._leaf(path)
        return self._of(path, leaf.rows)

    def _leaf(self, path: str) -> _Leaf:
        if path not in self._leaves:
            raise MisfitError(path)
        return self._leaves[path]

    def _of(self, path: str, pieces: list[Places]) -> Places:
        """Return pieces, one per element of a sequence, in the order of messages."""
        order = self._order(path)
        return pieces[0] if order is None else np.concatenate(pieces)[order]

    def _order(self, path: str) -> Places | None:
        rows = self._leaves[path].rows
        if len(rows) == 1:
            return None
        parent = path.rpartition("[]")[0]
        if parent not in self._orders:
            self._orders[parent] = np.argsort(np.concatenate(rows), kind="stable")
        return self._orders[parent]


def unpack(structure: Structure, encoding: str, messages: Sequence[bytes]) -> list[Unpacked]:
    """Return messages of a type with their fields, those of one order of bytes together.

    Messages that are not what the type says are in none.

    Parameters
    ----------
    structure : tuple of (name, Node)
    encoding : str
        ``ros1`` or ``cdr``.
    messages : sequence of bytes
    """
    data = b"".join(messages)
    ends = np.cumsum([len(message) for message in messages], dtype=np.int64)
    begins = ends - np.array([len(message) for message in messages], np.int64)
    if encoding == "ros1":
        return _walked(structure, "<", False, np.arange(len(messages)), data, begins, ends)
    heads = [message[:2] if len(message) >= CDR_HEAD else b"" for message in messages]
    found = []
    for head, order in ORDERS.items():
        rows = np.array([row for row, other in enumerate(heads) if other == head], np.int64)
        found += _walked(structure, order, True, rows, data, begins[rows] + CDR_HEAD, ends[rows])
    return sorted(found, key=lambda messages: int(messages.rows[0]))


def _walked(
    structure: Structure, order: str, aligned: bool, rows: Places, data: bytes, begins: Places,
    ends: Places,
) -> list[Unpacked]:  # fmt: skip
    """Walk messages; where some turn out to be broken, the others once more."""
    while len(rows):
        walk = _Walk(data, order, aligned, begins, ends)
        try:
            texts = walk.all(structure)
        except _BrokenError as error:
            whole = np.ones(len(rows), bool)
            whole[error.rows] = False
            rows, begins, ends = rows[whole], begins[whole], ends[whole]
            continue
        found = Unpacked(rows, data, walk.leaves)
        found._texts = texts
        return [found]
    return []


class _BrokenError(Exception):
    """Some messages are not what their type says."""

    def __init__(self, rows: Places) -> None:
        super().__init__()
        self.rows = rows


@dataclass
class _Walk:
    """Messages side by side; `at` is where each is, `rows` which of them are on their way."""

    data: bytes
    order: str
    aligned: bool
    begins: Places
    ends: Places
    leaves: dict[str, _Leaf] = field(default_factory=dict)

    def all(self, structure: Structure) -> dict[str, Texts]:
        """Walk to the ends of the messages; return their texts by path."""
        rows = np.arange(len(self.begins))
        left = self.ends - self._structure(structure, "", rows, self.begins)
        self._require(rows, (left >= 0) & (left <= (CDR_SPARE if self.aligned else 0)))
        return {path: self._texts(leaf) for path, leaf in self.leaves.items()
                if leaf.dtype == TEXT}  # fmt: skip

    def _structure(self, structure: Structure, path: str, rows: Places, at: Places) -> Places:
        for name, node in structure:
            at = self._field(node, f"{path}{name}", rows, at)
        return at

    def _field(self, node: Node, path: str, rows: Places, at: Places) -> Places:
        if node.length is None:
            return self._one(node, path, rows, at)
        if node.length >= 0:
            count = np.full(len(rows), node.length, np.int64)
        else:
            at, count = self._length(rows, at)
        if node.structure is None and node.dtype != TEXT:
            begin = np.where(count > 0, self._even(node.dtype.itemsize, rows, at), at)
            self._keep(path, node.dtype, rows, begin, count)
            return begin + count * node.dtype.itemsize
        self._require(rows, count <= self.ends[rows] - at)
        self._keep(path, STRUCTURE, rows, at, count)
        at = at.copy()
        inside = np.flatnonzero(count > 0)
        number = 0
        while len(inside) or number == 0:
            at[inside] = self._one(node, f"{path}[]", rows[inside], at[inside])
            number += 1
            inside = inside[count[inside] > number]
        return at

    def _one(self, node: Node, path: str, rows: Places, at: Places) -> Places:
        if node.structure is not None:
            return self._structure(node.structure, f"{path}.", rows, at)
        if node.dtype != TEXT:
            at = self._even(node.dtype.itemsize, rows, at)
            self._keep(path, node.dtype, rows, at)
            return at + node.dtype.itemsize
        at, length = self._length(rows, at)
        end = at + length
        self._require(rows, (end <= self.ends[rows]) & (length >= int(self.aligned)))
        if self.aligned:  # CDR ends a text by a zero and counts it
            self._require(rows, _gathered(self.data, np.dtype("u1"), end - 1) == 0)
        self._keep(path, TEXT, rows, at, length - int(self.aligned))
        return end

    def _length(self, rows: Places, at: Places) -> tuple[Places, Places]:
        at = self._even(4, rows, at)
        self._require(rows, at + 4 <= self.ends[rows])
        length = _gathered(self.data, np.dtype("u4"), at, self.order)
        return at + 4, length.astype(np.int64)

    def _even(self, size: int, rows: Places, at: Places) -> Places:
        """Return the next place at which a number of that size may be."""
        return at + (self.begins[rows] - at) % size if self.aligned else at

    def _require(self, rows: Places, holds: NDArray[np.bool_]) -> None:
        if not holds.all():
            raise _BrokenError(rows[~holds])

    def _keep(
        self, path: str, dtype: np.dtype[Any], rows: Places, at: Places, count: Places | None = None
    ) -> None:
        ordered = dtype if dtype == TEXT else dtype.newbyteorder(self.order)  # type: ignore[arg-type]
        leaf = self.leaves.setdefault(path, _Leaf(ordered))
        leaf.rows.append(rows)
        leaf.at.append(at)
        if count is not None:
            leaf.count.append(count)

    def _texts(self, leaf: _Leaf) -> Texts:
        rows, at, length = map(np.concatenate, (leaf.rows, leaf.at, leaf.count))
        if not len(rows):
            return Texts([], np.zeros(0, np.int64))
        if (length == length[0]).all():
            first = self.data[at[0] : at[0] + length[0]]
            same = not length[0] or (
                _gathered(self.data, np.dtype(f"V{length[0]}"), at) == np.void(first)
            ).all()  # fmt: skip
        else:
            same = False
        if same:
            known, codes = {first: 0}, np.zeros(len(rows), np.int64)
        else:
            known = {}
            places = zip(at.tolist(), (at + length).tolist(), strict=True)
            codes = np.array([known.setdefault(self.data[begin:end], len(known))
                              for begin, end in places])  # fmt: skip
        names = []
        for code, text in enumerate(known):
            try:
                names.append(text.decode())
            except UnicodeDecodeError:
                self._require(rows, codes != code)
        return Texts(names, codes)


def _gathered(data: bytes, dtype: np.dtype[Any], at: Places, order: str = "=") -> NDArray[Any]:
    """Return what stands at places of some bytes, aligned or not."""
    dtype = dtype.newbyteorder(order) if order != "=" else dtype  # type: ignore[arg-type]
    size = max(0, len(data) - dtype.itemsize + 1)
    if dtype.shape:
        (length,) = dtype.shape
        base = dtype.base
        view: NDArray[Any] = np.ndarray((size, length), base, data, 0, (1, base.itemsize))
    else:
        view = np.ndarray((size,), dtype, data, 0, (1,))
    return view[at]
