# SPDX-License-Identifier: Apache-2.0
"""What a body in space knows after 20 s without ranges, cut out of recordings; for docs/air.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.run.run import run
from locfuse.types import NANOSECONDS, Log, LogError
from papers.claims import Claim, absent
from papers.recorded import load_recording

PLACES = 35
CUT_S = 20.0
BACK_S = 10.0  # in which it must be back
FIRST_S = 10.0  # of the recording, before the first cut
BACK_M = 1.0
WRONG_M = 3.0
MIN_BACK = 33  # of PLACES
DRIVES = ("los_a1", "nlos_a1", "los_b3", "nlos_b3")  # in the yard


@dataclass(frozen=True)
class Silence:
    """How a run went on after cuts.

    Attributes
    ----------
    back : int
        Cuts after which it is within `BACK_M` of the truth within `BACK_S`.
    after_s : float
        The median of how long that takes.
    sure : int
        Cuts after which it is, ever, more than `WRONG_M` off and beyond 3 sigma in x or y.
    apart_m : float
        The largest distance to the run without the cut, `BACK_S` after it.
    """

    back: int
    after_s: float
    sure: int
    apart_m: float


def silence(config: RunConfig, log: Log, places: int = PLACES) -> Silence:
    """Cut 20 s of all ranges out at evenly spaced places, once for each place."""
    second = log["ranges"]["stamp_ns"] / NANOSECONDS
    cuts = np.linspace(second[0] + FIRST_S, second[-1] - CUT_S - BACK_S, places)
    whole = run(config, log).estimate
    after, apart, sure = [], [], 0
    for cut in cuts.tolist():
        again, end = cut + CUT_S, cut + CUT_S + BACK_S
        kept = (second < cut) | ((second >= again) & (second < end))
        ranges = {name: column[kept] for name, column in log["ranges"].items()}
        result = run(config, replace(log, tables={**log.tables, "ranges": ranges}))
        assert result.truth is not None
        errors = errors_against(result.estimate, result.truth)
        assert errors.sigma is not None
        late = errors.stamp_ns / NANOSECONDS >= again
        off = np.linalg.norm(errors.position[late], axis=1)
        sigma = errors.sigma[late, :2]
        beyond = (np.abs(errors.position[late]) > 3.0 * sigma).any(axis=1)
        sure += bool((beyond & (off > WRONG_M)).any())
        back = np.flatnonzero(off < BACK_M)
        after.append(errors.stamp_ns[late][back[0]] / NANOSECONDS - again if len(back) else np.inf)
        last = int(result.estimate.stamp_ns[-1])
        row = int(np.searchsorted(whole.stamp_ns, last))
        apart.append(np.linalg.norm(whole.position[row] - result.estimate.position[-1]))
    return Silence(int(np.isfinite(after).sum()), float(np.median(after)), sure,
                   float(np.max(apart)))  # fmt: skip


def silence_claims(configs: Path | None, drive: str) -> Iterator[Claim]:
    """Yield the rows of a drive in the yard."""
    what = f"yard {drive}, {CUT_S:g} s cut out at {PLACES} places"
    try:
        config, log = load_recording(configs, "hanyang_outdoor", "hanyang-outdoor", drive,
                                     estimator={"kind": "air"})  # fmt: skip
    except LogError as error:
        yield absent(f"silence_{drive}", what, str(error))
        return
    found = silence(config, log)
    for key, claim, unit, value, required, met in (
        ("back", f"within {BACK_M:g} m in {BACK_S:g} s", "of 35", found.back, f">= {MIN_BACK}",
         found.back >= MIN_BACK),
        ("sure", f"ever {WRONG_M:g} m off and beyond 3 sigma", "of 35", found.sure, "0",
         found.sure == 0),
        ("after", f"within {BACK_M:g} m after, median", "s", found.after_s, "-", True),
        ("apart", f"{BACK_S:g} s later, largest distance to the run without the cut", "m",
         found.apart_m, "-", True),
    ):  # fmt: skip
        yield Claim(f"silence_{drive}_{key}", f"{what}: {claim}", unit, None, value, value, value,
                    required, met)  # fmt: skip
