# SPDX-License-Identifier: Apache-2.0
"""One row of a comparison with a paper: its claim, its figure, ours, what is required."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

Progress = Callable[[int, int], None]
INTERVAL = "[95 % interval]"  # how a share's note ends


@dataclass(frozen=True)
class Claim:
    """One row of the comparison; `met` is None where it could not be run, and `note` says why."""

    id: str
    claim: str
    unit: str
    paper: float | None
    ours_median: float | None
    ours_low: float | None
    ours_high: float | None
    required: str
    met: bool | None
    note: str = ""

    def row(self) -> dict[str, Any]:
        """Return the row as JSON-ready values."""
        return asdict(self)


def claim_of(
    id: str, claim: str, unit: str, paper: float | None, values: Iterable[float],
    required: str, met: Callable[[float], bool], note: str = "",
) -> Claim:  # fmt: skip
    low, median, high = (float(v) for v in np.quantile(list(values), [0.05, 0.5, 0.95]))
    return Claim(id, claim, unit, paper, median, low, high, required, met(median), note)


def claims_of(parts: Sequence[Callable[[], Iterable[Claim]]], progress: Progress) -> list[Claim]:
    """Return the rows of all parts, telling (parts done, parts in all)."""
    claims: list[Claim] = []
    for done, part in enumerate(parts):
        progress(done, len(parts))
        claims += part()
    progress(len(parts), len(parts))
    return claims


def share(
    id: str, claim: str, part: int, of: int, required: float | None, at_most: bool = False
) -> Claim:
    """Return a row about how often something happens, in percent, with its 95 % interval."""
    p = part / of
    half = 1.96 * np.sqrt(max(p * (1.0 - p), 1.0 / of) / of)
    met, limit = True, "-"
    if required is not None:
        met = bool(p <= required if at_most else p >= required)  # counts may be numpy's
        limit = f"{'<=' if at_most else '>='} {100.0 * required:g}"
    return Claim(id, claim, "%", None, 100.0 * p, 100.0 * max(p - half, 0.0),
                 100.0 * min(p + half, 1.0), limit, met,
                 f"{part} of {of}; {INTERVAL}")  # fmt: skip


def consistent(
    id: str, what: str, nees: Iterable[float], limits: tuple[float, float], required: bool = True
) -> Claim:
    """Return a row about a mean NEES that lies between two limits, if it must."""
    mean, (low, high) = float(np.mean(list(nees))), limits
    return Claim(f"{id}_nees", f"{what}NEES at the end, mean over seeds", "1", None, mean, mean,
                 mean, f"{low:.2f}..{high:.2f}" if required else "-",
                 low <= mean <= high or not required)  # fmt: skip


def absent(id: str, claim: str, why: str, required: str = "-") -> Claim:
    """Return a row that could not be run."""
    return Claim(id, claim, "m", None, None, None, None, required, None, why)
