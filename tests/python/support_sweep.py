# SPDX-License-Identifier: Apache-2.0
"""What the tests of sweeps share: a short room, tables compared, batches that end their worker."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from locfuse.config.schema import RunConfig
from locfuse.sweep import Trials
from locfuse.sweep.table import NOT_REPEATED
from locfuse.sweep.trial import Row, Trial, Work, run_batch
from support_runs import room

VARY = {"simulation.ranges.sigma_relative": "0.01..0.04:log", "simulation.ranges.rate_hz": "2,5"}


def short_room(**simulation: object) -> RunConfig:
    """Return the room of ekim2020 for a few seconds."""
    return room(simulation={"duration_s": 4.0, **simulation})


def assert_same(found: Trials, expected: Trials) -> None:
    """Compare two tables bit for bit, but for how long the trials took."""
    assert list(found.columns) == list(expected.columns)
    for name, column in expected.columns.items():
        if name not in NOT_REPEATED:
            np.testing.assert_array_equal(found[name], column, err_msg=name)


def ends_its_worker(work: Work, trials: Sequence[Trial], budget_s: float) -> list[Row]:
    """Run a batch, but for trial 3, which ends the process that runs it."""
    if any(trial.index == 3 for trial in trials):
        os._exit(9)
    return run_batch(work, trials, budget_s)


def ends_its_worker_once(work: Work, trials: Sequence[Trial], budget_s: float) -> list[Row]:
    """Run a batch; the first time that trial 3 is in it, the process ends."""
    marker = Path(work.base) / "ended"
    if any(trial.index == 3 for trial in trials) and not marker.exists():
        marker.write_text("")
        os._exit(9)
    return run_batch(work, trials, budget_s)
