# SPDX-License-Identifier: Apache-2.0
"""One trial of a sweep: a run with a seed and some values of its own, and its row."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.load import parse_config
from locfuse.config.scenario import Scenario
from locfuse.config.schema import SOURCES, RunConfig
from locfuse.eval.errors import Errors, errors_against
from locfuse.eval.scores import (
    LEVELS,
    aligned_rmse,
    coverage,
    negative_log_likelihood,
    recovery,
    relative_errors,
)
from locfuse.run.health import STATES
from locfuse.run.run import load_log, run
from locfuse.sweep.vary import Axis, with_values
from locfuse.types import NANOSECONDS, ConfigError, Log, Outcomes, RunResult

INSTANTS = 25  # of each trial, at which its NEES is kept
COVERAGE = {f"coverage_{round(100 * level)}": level for level in LEVELS}
HEALTH = tuple(f"health_{state}" for state in STATES.tolist())
NIS = tuple(f"nis_{source}" for source in SOURCES)
SCORES = (
    "position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg", "heading_max_deg",
    "ate_m", "rpe_m", "rpe_deg", "nees_mean", "nees_dof", "nees_in_band", *NIS, "nll", *COVERAGE,
    "recover_s", "unrecovered", *HEALTH, "alarms", "restarts", "start_s", "ready_s",
    "ready_and_wrong_share", "wall_s",
)  # fmt: skip

Row = dict[str, Any]


@dataclass(frozen=True)
class Trial:
    """Index from 0, seed, value of each axis."""

    index: int
    seed: int
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Work:
    """What all trials of a sweep have in common, as sent to the workers.

    `data` is the configuration as written, `base` the folder that its paths are relative to.
    `recovered_m` is the position error below which it has recovered; None: inside its covariance.
    `version` is that of the library that hands the trials out.
    """

    data: dict[str, Any]
    axes: tuple[Axis, ...]
    base: str
    recovered_m: float | None
    version: str


def run_batch(work: Work, trials: Sequence[Trial], budget_s: float) -> list[Row]:
    """Run trials until the time is over, but at least one; return their rows.

    Raises ConfigError if the library is of another version than the one that hands the trials out.
    """
    from locfuse import __version__

    if work.version != __version__:
        raise ConfigError(
            f"a worker runs locfuse {__version__}, but here it is {work.version}; install the same "
            "on all machines"
        )
    rows: list[Row] = []
    until = time.perf_counter() + budget_s
    for trial in trials:
        if rows and time.perf_counter() > until:
            break
        rows.append(row_of(work, trial))
    return rows


def row_of(work: Work, trial: Trial) -> Row:
    """Run a trial; an error becomes part of its row."""
    row = empty_row(work.axes, trial)
    began = time.perf_counter()
    try:
        row |= scores(_result(work, trial), work.recovered_m)
    except Exception as error:
        # A sweep must survive a failing trial: failures are what it looks for.
        row["error"] = f"{type(error).__name__}: {' '.join(str(error).split())}"
    row["wall_s"] = time.perf_counter() - began
    return row


def empty_row(axes: Sequence[Axis], trial: Trial) -> Row:
    """Return the row of a trial without results."""
    values = {a.key: a.cell(v) for a, v in zip(axes, trial.values, strict=True)}
    unknown = {**dict.fromkeys(SCORES), "nees_at": None, "error": None}
    return {"trial": trial.index, "seed": trial.seed, **values, **unknown}


def _result(work: Work, trial: Trial) -> RunResult:
    config = with_values(parse_config(work.data), work.data, work.axes, trial.values)
    if config.mcl is not None:  # one worker per processor; threads change no bit
        config = config.model_copy(update={"mcl": config.mcl.model_copy(update={"threads": 1})})
    log = None
    if config.simulation is None and config.log is not None:
        log = _log(config.model_dump_json(include={"log", "ros"}), work.base)
    return run(config, log, base=Path(work.base), seed=trial.seed)


@lru_cache(maxsize=2)
def _log(origin: str, base: str) -> Log:
    """Return a recorded log, read once per worker."""
    return load_log(RunConfig.model_validate_json(origin), Path(base), 0)


def scores(result: RunResult, recovered_m: float | None = None) -> Row:
    """Return the columns that a run has.

    It has recovered from a fault below the position error `recovered_m`; None: inside its
    covariance.
    """
    said = result.metrics
    same = ("position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg", "nees_mean",
            "nees_dof", "nees_in_band", "start_s")  # fmt: skip
    row: Row = {name: said[name] for name in same}
    row |= _nis(result.outcomes)
    if said["health"] is not None:
        share = said["health"]["share"]
        row |= {f"health_{state}": share.get(state, 0.0) for state in STATES.tolist()}
        row |= {name: said["health"][name] for name in ("alarms", "restarts")}
    if said["mcl"] is not None:
        row |= {name: said["mcl"][name] for name in ("ready_s", "ready_and_wrong_share")}
    if result.truth is not None and len(result.truth):
        errors = errors_against(result.estimate, result.truth)
        if len(errors):
            row |= _against_truth(result, errors, recovered_m)
    return row


def _nis(outcomes: Outcomes) -> Row:
    """Return the mean NIS of each source per innovation row; 1 is expected."""
    row = {}
    for source in SOURCES:
        fused = (outcomes.source == source) & (outcomes.verdict == "fused") & (outcomes.dof > 0)
        if fused.any():
            total = float(outcomes.nis[fused].sum())
            row[f"nis_{source}"] = total / int(outcomes.dof[fused].sum())
    return row


def _against_truth(result: RunResult, errors: Errors, recovered_m: float | None) -> Row:
    estimate, truth = result.estimate, result.truth
    assert truth is not None
    row: Row = {"ate_m": aligned_rmse(estimate, truth)}
    if errors.heading is not None:
        row["heading_max_deg"] = float(np.rad2deg(np.abs(errors.heading).max()))
        relative = relative_errors(estimate, truth)
        if relative is not None:
            row["rpe_m"] = float(np.sqrt(np.mean(relative.translation**2)))
            row["rpe_deg"] = float(np.rad2deg(np.sqrt(np.mean(relative.rotation**2))))
    if errors.nees is not None:
        row["nll"] = float(np.mean(negative_log_likelihood(estimate, errors)))
        row |= dict(zip(COVERAGE, coverage(errors).tolist(), strict=True))
        at = np.linspace(0, len(errors) - 1, INSTANTS).round().astype(np.intp)
        row["nees_at"] = errors.nees[at].tolist()
    ends = fault_ends_ns(RunConfig.model_validate(result.config))
    if ends and (errors.nees is not None or recovered_m is not None):
        row["recover_s"], row["unrecovered"] = recovery(estimate, errors, ends, recovered_m)
    return row


def fault_ends_ns(config: RunConfig) -> list[int]:
    """Return when faults of the simulation end and switched-off sources are on again."""
    faults = config.simulation.faults if isinstance(config.simulation, Scenario) else []
    ends = [getattr(fault, "to_s", getattr(fault, "at_s", None)) for fault in faults]
    ends += [off.until_s for off in config.switched_off]
    return sorted({round(end * NANOSECONDS) for end in ends if end is not None})
