# SPDX-License-Identifier: Apache-2.0
"""Messages and their verdicts, packed for the player."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.verdicts import source_rank
from locfuse.report.player.parts import Part, table_part
from locfuse.report.text import VERDICT_LABELS, seconds
from locfuse.types import FloatArray, RunResult

# Columns of a log's table that hold the measurement of a message.
_SEEN = {
    "ranges": ("range_m",),
    "landmark_sightings": ("range_m", "bearing_rad"),
    "positions": ("x_m", "y_m"),
    "poses": ("x_m", "y_m"),
}
_MAX_TEXTS = 2000
_GATED = re.compile(r"^nis \S+ > (\S+)$")


def messages_part(result: RunResult, origin: int) -> tuple[dict[str, Any], Part]:
    """Return the texts that messages refer to, and the messages in order of their stamps.

    Fused odometry is left out: it has neither a position nor a NIS.
    """
    outcomes = result.outcomes
    shown = (outcomes.source != "switch") & ~(
        (outcomes.source == "odometry") & (outcomes.verdict == "fused")
    )
    rows = np.flatnonzero(shown)
    rows = rows[np.argsort(outcomes.stamp_ns[rows], kind="stable")]
    sources, source = _indexed(outcomes.source[rows])
    names, who = _indexed(outcomes.anchor[rows])
    tags, tag = _indexed(outcomes.tag[rows])
    verdicts, verdict = _indexed(outcomes.verdict[rows])
    reasons, reason = _indexed(_in_words(outcomes.reason[rows]))
    ranked = sorted(sources, key=source_rank)
    words: dict[str, Any] = {
        "sources": ranked,
        "names": names,
        "tag_names": tags,
        "verdicts": [[name, VERDICT_LABELS.get(name, name)] for name in verdicts],
        "reasons": reasons,
    }
    order = np.array([ranked.index(name) for name in sources], np.uint8)
    columns: dict[str, NDArray[Any]] = {
        "t": seconds(outcomes.stamp_ns[rows], origin),
        "source": order[source] if len(rows) else np.empty(0, np.uint8),
        "who": who,
        "tag": tag,
        "verdict": verdict.astype(np.uint8),
        "nis": outcomes.nis[rows].astype(np.float32),
        "dof": outcomes.dof[rows].astype(np.uint8),
        "reason": reason,
        "seen": seen_of(result)[rows],
    }
    return words, table_part(columns, outcomes.verdict[rows] == "gated")


def _indexed(texts: NDArray[np.str_]) -> tuple[list[str], NDArray[np.uint16]]:
    """Return the distinct texts, and the index of each row's text.

    Only the most frequent ones if there are too many; the others become "…".
    """
    names, at, counts = np.unique(texts, return_inverse=True, return_counts=True)
    if len(names) <= _MAX_TEXTS:
        return names.tolist(), at.astype(np.uint16)
    frequent = np.sort(np.argsort(-counts, kind="stable")[:_MAX_TEXTS])
    index = np.full(len(names), _MAX_TEXTS, np.uint16)
    index[frequent] = np.arange(_MAX_TEXTS)
    return [*names[frequent].tolist(), "…"], index[at]


def _in_words(reasons: NDArray[np.str_]) -> NDArray[np.str_]:
    """Return reasons with the NIS of the single message replaced by ``{nis}``."""
    texts, at = np.unique(reasons, return_inverse=True)
    words = [_GATED.sub(r"NIS {nis} above the gate of \1", text) for text in texts.tolist()]
    return np.array(words, dtype=np.str_)[at] if len(texts) else reasons


def seen_of(result: RunResult) -> FloatArray:
    """Return the measurement of each message, (n, 2); NaN where the log lacks the message."""
    outcomes = result.outcomes
    seen = np.full((len(outcomes), 2), np.nan)
    for source, columns in _SEEN.items():
        rows = np.flatnonzero(outcomes.source == source)
        table = result.log.tables.get(source)
        if table is None or len(table["stamp_ns"]) != len(rows):
            continue
        order = np.argsort(table.get("arrival_ns", table["stamp_ns"]), kind="stable")
        for k, column in enumerate(columns):
            seen[rows, k] = table[column][order]
    return seen
