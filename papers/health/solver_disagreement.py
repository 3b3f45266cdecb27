# SPDX-License-Identifier: Apache-2.0
"""Whether two solvers that disagree about one epoch of ranges reveal what health misses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse._core import locate
from locfuse.run.run import run
from locfuse.types import NANOSECONDS, FloatArray, Log
from papers.claims import Claim, absent, share
from papers.health.scenarios import LIMIT_M, SCENARIOS, drive_of

EPOCH_S = 0.2  # ranges of one moment
EVERY_S = 1.0
SIGMA_M = 0.15  # of a range, and of how far the robot gets within an epoch
MIN_RANGES = 4  # ranges of which one may be wrong
WRONG_FOR_LONG = ("walls that lengthen ranges", "an anchor moved", "two anchors swapped")


@dataclass(frozen=True)
class Moments:
    """Moments of some drives.

    Attributes
    ----------
    disagree : bool array, shape (n,)
        Whether SR-LS and maximum likelihood disagree about the ranges of that moment.
    is_ok, is_far : bool arrays, shape (n,)
        Whether health says ok, and whether the position is more than `LIMIT_M` off.
    """

    disagree: NDArray[np.bool_]
    is_ok: NDArray[np.bool_]
    is_far: NDArray[np.bool_]


def solver_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: of ranges that are right, of a wrong pose, of anchors that are wrong."""
    of = {name: moments_of(name, seeds) for name in SCENARIOS}
    right = [of[name] for name in SCENARIOS if name not in {*WRONG_FOR_LONG, "outliers"}]
    disagree = np.concatenate([moments.disagree for moments in right])
    far = np.concatenate([moments.is_far for moments in right])
    yield _share("right", "ranges are right: solvers disagree", disagree)
    yield _share("far", f"the same, more than {LIMIT_M:g} m off: solvers disagree", disagree[far])
    wrong = [of[name] for name in WRONG_FOR_LONG]
    is_ok = np.concatenate([moments.is_ok[moments.disagree] for moments in wrong])
    yield _share("wrong", "anchors are wrong for long, solvers disagree: health says ok", is_ok)


def _share(key: str, what: str, happens: NDArray[np.bool_]) -> Claim:
    id = f"trust_solvers_{key}"
    if len(happens) == 0:
        return absent(id, what, "there is no such moment")
    return share(id, what, int(happens.sum()), len(happens), None)


def moments_of(name: str, seeds: int) -> Moments:
    """Return the moments of a scenario of `SCENARIOS`, seeds 0 to seeds - 1."""
    rows = [row for seed in range(seeds) for row in _of_drive(name, seed)]
    return Moments(*np.array(rows, dtype=bool).reshape(-1, 3).T)


def _of_drive(name: str, seed: int) -> Iterator[tuple[bool, bool, bool]]:
    config, log = SCENARIOS[name](seed)
    drive = drive_of(run(config, log))
    for stamp, anchors, ranges in _epochs(log):
        row = int(np.searchsorted(drive.health.stamp_ns, stamp, side="right")) - 1
        compared = locate(anchors, ranges, SIGMA_M).comparison
        if row >= 0 and compared is not None:
            yield (not compared.agree, drive.health.state[row] == "ok",
                   bool(drive.distance[row] > LIMIT_M))  # fmt: skip


def _epochs(log: Log) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Yield stamp, anchors, shape (m, 2), and ranges, shape (m,), of a moment every `EVERY_S`."""
    table, measured = log["anchors"], log["ranges"]
    place = dict(zip(table["anchor"].tolist(),
                     np.column_stack([table["x_m"], table["y_m"]]), strict=True))  # fmt: skip
    stamps = measured["stamp_ns"]
    for begin in range(int(stamps[0]), int(stamps[-1]), round(EVERY_S * NANOSECONDS)):
        rows = slice(*np.searchsorted(stamps, [begin, begin + round(EPOCH_S * NANOSECONDS)]))
        of = dict(
            zip(measured["anchor"][rows].tolist(), measured["range_m"][rows].tolist(), strict=True)
        )
        if len(of) >= MIN_RANGES:
            yield (int(stamps[rows][-1]), np.array([place[name] for name in of]),
                   np.array(list(of.values())))  # fmt: skip
