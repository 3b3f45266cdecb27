# SPDX-License-Identifier: Apache-2.0
"""Which source or anchor was rejected when: messages by origin, and stretches of rejections."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import Outcomes, StampArray

SUSPECT_SHARE = 0.10  # rejected share from which an anchor is pointed out

_SOURCE_ORDER = ("odometry", "ranges", "positions", "poses", "landmark_sightings", "altitudes",
                 "headings", "scans")  # fmt: skip


@dataclass(frozen=True)
class Stretch:
    """Consecutive rejected messages: how many, and the stamps of the first and the last."""

    messages: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True)
class MessageRow:
    """All messages of one source, or of one anchor for ranges, or of one landmark that is named.

    `anchor` is the landmark for sightings, and empty for sources that have neither. `stamp_ns` and
    `verdict` (n,), n at least 1, are in order of time, which may differ from the order of delivery.
    """

    source: str
    anchor: str
    stamp_ns: StampArray
    verdict: NDArray[np.str_]

    @property
    def label(self) -> str:
        """Name of the row: the anchor or landmark if there is one, else the source."""
        if not self.anchor:
            return self.source
        kind = "landmark" if self.source == "landmark_sightings" else "anchor"
        named = self.anchor.lower().startswith(kind)
        return self.anchor if named else f"{kind} {self.anchor}"

    @property
    def rejected(self) -> int:
        """Messages that the gate turned down."""
        return int(np.count_nonzero(self.verdict == "gated"))

    @property
    def rejected_share(self) -> float:
        """Rejected messages over all messages of the row, 0 to 1."""
        return self.rejected / len(self.stamp_ns)

    @property
    def suspect(self) -> bool:
        """Whether so much was rejected that the row should be pointed out."""
        return self.rejected_share >= SUSPECT_SHARE


def message_rows(outcomes: Outcomes) -> list[MessageRow]:
    """Split messages by source and, for ranges, by anchor.

    Odometry is first, then ranges, positions, poses, scans, others; anchors are in natural order
    (A2 before A10). No row is empty. Switches are not messages.
    """
    if not np.any(outcomes.source != "switch"):
        return []
    source_id = np.unique(outcomes.source, return_inverse=True)[1]
    anchor_id = np.unique(outcomes.anchor, return_inverse=True)[1]
    key = source_id * (int(anchor_id.max()) + 1) + anchor_id
    order = np.lexsort((outcomes.stamp_ns, key))
    order = order[outcomes.source[order] != "switch"]
    rows = [
        MessageRow(
            source=str(outcomes.source[index[0]]),
            anchor=str(outcomes.anchor[index[0]]),
            stamp_ns=outcomes.stamp_ns[index],
            verdict=outcomes.verdict[index],
        )
        for index in np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    ]
    return sorted(rows, key=lambda row: (source_rank(row.source), _natural(row.anchor)))


def rejected_stretches(row: MessageRow) -> list[Stretch]:
    """Return the unbroken series of rejected messages, in order of time.

    Examples
    --------
    >>> verdict = np.array(["fused", "gated", "gated", "fused"])
    >>> rejected_stretches(MessageRow("ranges", "A1", np.arange(4) * 100, verdict))
    [Stretch(messages=2, first_ns=100, last_ns=200)]
    """
    return [
        Stretch(end - first, int(row.stamp_ns[first]), int(row.stamp_ns[end - 1]))
        for first, end in series_of(row.verdict == "gated")
    ]


def series_of(happens: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first row and the one after the last of each unbroken series."""
    padded = np.concatenate(([False], happens, [False]))
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[0::2], edges[1::2], strict=True))


def source_rank(source: str) -> int:
    """Return the place of a source in every list: odometry first, unknown ones last."""
    return _SOURCE_ORDER.index(source) if source in _SOURCE_ORDER else len(_SOURCE_ORDER)


def _natural(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key that puts A2 before A10."""
    parts = re.split(r"(\d+)", name)
    return [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts if p]
