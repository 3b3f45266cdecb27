# SPDX-License-Identifier: Apache-2.0
"""Power-ups in a real office, whose reference is first settled on its map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from locfuse.types import Log, LogError
from papers.claims import Claim, absent, share
from papers.ekim2020.runs import recording
from papers.ekim2020.scans import judged, power_up_states
from papers.recordings.reference_alignment import OFFICE_FRAMES, settled_truth


def office_claims(configs: Path) -> Iterator[Claim]:
    try:
        config, log = recording(configs, "mrpt_office.yaml")
    except LogError as error:
        yield absent("start_office", "office power-ups", str(error))
        return
    log = _first_scans(log, OFFICE_FRAMES)
    states = power_up_states(log, config)
    stated = judged(states, log, 0.3, 3.0)
    matched = judged(states, settled_truth(log), 0.3, 3.0)
    for key, text, found, required in (
        ("", "office power-ups (real): right, or not ready", matched, 0.98),
        ("_stated", "the same against the reference as published", stated, None),
    ):
        good = found.fits | ~found.ready
        yield share(f"start_office{key}", text, int(good.sum()), len(good), required)
    yield share("start_office_ready", "office power-ups (real): ready at once",
                int(matched.ready.sum()), len(matched.ready), 0.5)  # fmt: skip


def _first_scans(log: Log, count: int) -> Log:
    scans = {name: values[:count] for name, values in log["scans"].items()}
    return replace(log, tables={**log.tables, "scans": scans})
