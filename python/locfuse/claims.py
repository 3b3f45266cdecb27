# SPDX-License-Identifier: Apache-2.0
"""One row of a comparison with a paper: its claim, its figure, ours, what is required."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

Progress = Callable[[int, int], None]


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
