# SPDX-License-Identifier: Apache-2.0
"""A localizer like AMCL that goes wrong, watched by ranges or by scans on a map."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse._core import PoseWatch
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.run.messages import truth_of
from locfuse.run.run import run
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, StampArray, wrap_angle
from papers.claims import Claim, Progress, absent, claim_of, claims_of, share
from papers.consistency.pose_sources import carried, gauss_markov
from papers.consistency.recordings import on_map
from papers.health import map_scenarios, scenarios
from papers.health.alarms import PATIENCE_S, alarms_of, joined
from papers.health.scenarios import (
    DURATION_S,
    LIMIT_M,
    Drive,
    Scenario,
    carried_off,
    drives_of,
    rows_of_health,
)

SIGMA = np.array([0.06, 0.06, np.deg2rad(1.0)])  # of its errors, each axis, as it states them
CORRELATION_S = 5.0
STEP_M, STEP_RAD = 0.25, 0.2  # it publishes after so much motion, as AMCL does
DELAY_NS = NANOSECONDS // 10  # from a scan to its pose
FAULT_S = 30.0  # that a fault lasts
RECORDINGS = ("Wean Hall 1", "Wean Hall 3", "TurtleBot 4", "office")

# Of the fault: seconds since it began (negative before), poses (n, 3), generator -> poses.
Fault = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]


def right(seconds: FloatArray, poses: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Go on as it was."""
    return poses


def drifts(seconds: FloatArray, poses: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Drift by 10 cm/s, as on wheels that slip, and come back at the end."""
    return _moved(poses, 0.1 * np.where(_lasts(seconds), seconds, 0.0), rng)


def jumps(seconds: FloatArray, poses: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Jump by 1.5 to 10 m, and back."""
    distance = rng.uniform(1.5, 10.0)
    return _moved(poses, np.where(_lasts(seconds), distance, 0.0), rng)


def freezes(seconds: FloatArray, poses: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Repeat a pose with new stamps."""
    frozen = _lasts(seconds)
    kept = poses.copy()
    if frozen.any():
        kept[frozen] = poses[np.flatnonzero(frozen)[0]]
    return kept


def sure_and_wrong(seconds: FloatArray, poses: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Be 10 m off to the end."""
    return _moved(poses, np.where(seconds > 0.0, 10.0, 0.0), rng)


def _lasts(seconds: FloatArray) -> NDArray[np.bool_]:
    lasts: NDArray[np.bool_] = (seconds > 0.0) & (seconds < FAULT_S)
    return lasts


def _moved(poses: FloatArray, distance: FloatArray, rng: np.random.Generator) -> FloatArray:
    angle = rng.uniform(-np.pi, np.pi)
    off = np.column_stack([np.cos(angle) * distance, np.sin(angle) * distance, 0.0 * distance])
    moved: FloatArray = poses + off
    return moved


FAULTS: Mapping[str, Fault] = {
    "right": right,
    "drifts": drifts,
    "jumps": jumps,
    "freezes": freezes,
    "sure and wrong by 10 m": sure_and_wrong,
}


def by_ranges(stated: float) -> Callable[[int], RunConfig]:
    """Return a room with six anchors, whose ranges' sigma is stated so many times too large."""

    def config_of(seed: int) -> RunConfig:
        config = scenarios.config_of()
        of_range = config.estimator.range
        sigma = of_range.model_copy(update={"sigma_m": stated * of_range.sigma_m})
        estimator = config.estimator.model_copy(update={"range": sigma})
        return config.model_copy(update={"estimator": estimator})

    return config_of


WITH_RANGES = ("odometry", "ranges", "truth")
JUDGES: Mapping[str, tuple[Callable[[int], RunConfig], tuple[str, ...]]] = {
    "ranges": (by_ranges(1.0), WITH_RANGES),
    "ranges of half the sigma": (by_ranges(0.5), WITH_RANGES),
    "ranges of twice the sigma": (by_ranges(2.0), WITH_RANGES),
    "scans": (map_scenarios.config_of, ("odometry", "scans", "truth")),
}


def with_poses(log: Log, fault: Fault, seed: int) -> Log:
    """Return a log with the poses of a localizer that has a fault in mid-drive."""
    rng = np.random.default_rng([seed, 6])
    stamp_ns, true = _published(log)
    seconds = (stamp_ns - stamp_ns[0]) / NANOSECONDS
    kept = np.exp(-np.diff(seconds, prepend=0.0) / CORRELATION_S)
    errors = gauss_markov(rng.standard_normal(true.shape), kept)
    begin = rng.uniform(0.2, 0.8) * seconds[-1]
    return _with_table(log, stamp_ns, fault(seconds - begin, true + SIGMA * errors, rng))


def by_odometry(log: Log, from_ns: int) -> Log:
    """Return a log whose poses go on by odometry alone from a stamp on: nobody carried it off."""
    table = log["poses"]
    stamp_ns = table["stamp_ns"]
    poses = np.column_stack([table["x_m"], table["y_m"], table["heading_rad"]])
    last = int(np.searchsorted(stamp_ns, from_ns, side="right")) - 1
    cut = Log({**log.tables, "poses": {name: v[: last + 1] for name, v in table.items()}})
    at, along = carried(cut)
    after = np.searchsorted(at, stamp_ns[last + 1 :], side="right") - 1
    poses[last + 1 :] = along[after]
    return _with_table(log, stamp_ns, poses)


def _published(log: Log) -> tuple[StampArray, FloatArray]:
    """Return the stamps at which it publishes, and the true poses."""
    truth = truth_of(log)
    assert truth is not None
    last = np.full(3, np.inf)
    at, _ = interpolate(truth, log["odometry"]["stamp_ns"])
    assert at.heading is not None
    poses = np.column_stack([at.position, at.heading])
    rows = []
    for row, pose in enumerate(poses):
        off = pose - last
        if not np.hypot(off[0], off[1]) < STEP_M or abs(wrap_angle(off[2])) >= STEP_RAD:
            rows.append(row)
            last = pose
    return at.stamp_ns[rows], poses[rows]


def _with_table(log: Log, stamp_ns: StampArray, poses: FloatArray) -> Log:
    count = len(stamp_ns)
    table = {"stamp_ns": stamp_ns, "x_m": poses[:, 0].copy(), "y_m": poses[:, 1].copy(),
             "heading_rad": wrap_angle(poses[:, 2]), "sigma_xy_m": np.full(count, SIGMA[0]),
             "sigma_heading_rad": np.full(count, SIGMA[2]),
             "arrival_ns": stamp_ns + DELAY_NS}  # fmt: skip
    return replace(log, tables={**log.tables, "poses": table})


def faulty(judge: str, fault: str) -> Scenario:
    """Return the scenario of a localizer with a fault."""
    drives = drives_of(JUDGES[judge][0])

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        config, log = drives(seed)
        return config, with_poses(log, FAULTS[fault], seed)

    return scenario


def kidnapped(judge: str) -> Scenario:
    """Return the scenario of a robot that is carried off, which its localizer does not notice."""
    config_of, tables = JUDGES[judge]
    drives = carried_off(config_of, *tables)

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        config, log = drives(seed)
        begin = int(log["truth"]["stamp_ns"][0])
        cut = begin + round(0.5 * DURATION_S * NANOSECONDS)
        return config, by_odometry(with_poses(log, right, seed), cut)

    return scenario


class WatchedDrive(Drive):
    """One drive, and what was said of the watched poses, and their errors."""

    @property
    def distance(self) -> FloatArray:
        """Return the position errors, or the heading's on the same scale, metres."""
        per_rad = LIMIT_M / PoseWatch.max_heading_error
        distance: FloatArray = np.maximum(super().distance, per_rad * np.abs(self.error[:, 2]))
        return distance


def recorded(configs: Path, name: str, fault: str) -> Scenario:
    """Return the scenario of a localizer with a fault beside a recording, judged by its scans.

    Its poses are simulated about the reference. Raises LogError if the recording is absent.
    """
    config, log = on_map(configs, name, estimator={}, mcl={}, use=["odometry", "poses"])

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        return config.model_copy(update={"seed": seed}), with_poses(log, FAULTS[fault], seed)

    return scenario


def watched_drive(scenario: Scenario, seed: int) -> WatchedDrive:
    """Drive a scenario; what is said of the watched poses, and how far off they are."""
    config, log = scenario(seed)
    result = run(config.model_copy(update={"watch_poses": True}), log)
    watched, truth = result.watched, result.truth
    assert watched is not None
    assert truth is not None
    at, along = carried(log)
    row = np.searchsorted(at, watched.stamp_ns, side="right") - 1
    kept = (row >= 0) & interpolate(truth, watched.stamp_ns)[1]
    there, _ = interpolate(truth, watched.stamp_ns[kept])
    assert there.heading is not None
    error = along[row[kept]] - np.column_stack([there.position, there.heading])
    error[:, 2] = wrap_angle(error[:, 2])
    return WatchedDrive(rows_of_health(watched, kept), error)


def watch_claims(seeds: int, progress: Progress, configs: Path | None) -> list[Claim]:
    """Return the rows of each judge, and of recordings: seeds 0 to seeds - 1 of every fault."""
    parts = [partial(_judged_by, judge, seeds) for judge in JUDGES]
    if configs is not None:
        parts += [partial(_beside, configs, name, min(seeds, 10)) for name in RECORDINGS]
    return claims_of(parts, progress)


def _beside(configs: Path, name: str, seeds: int) -> Iterator[Claim]:
    try:
        of = {fault: recorded(configs, name, fault) for fault in FAULTS}
    except LogError as error:
        yield absent(f"watch_{name}", f"beside {name}", str(error))
        return
    yield from _rows(f"scans of {name}", of, seeds)


def _judged_by(judge: str, seeds: int) -> Iterator[Claim]:
    of = {name: faulty(judge, name) for name in FAULTS} | {"robot kidnapped": kidnapped(judge)}
    yield from _rows(judge, of, seeds)


def _rows(judge: str, of: Mapping[str, Scenario], seeds: int) -> Iterator[Claim]:
    sets = []
    for name, scenario in of.items():
        drives = [watched_drive(scenario, seed) for seed in range(seeds)]
        alarms = alarms_of(drives)
        sets.append(alarms)
        key = f"watch_{judge}_{name}".replace(" ", "_")
        what = f"by {judge}, {name}"
        ok = np.concatenate([d.health.state == "ok" for d in drives])
        far = np.concatenate([d.distance > LIMIT_M for d in drives])
        beyond = float((ok & far).mean())
        yield Claim(f"{key}_ok", f"{what}: ok, but more than {LIMIT_M:g} m off", "1", None,
                    *3 * (beyond,), "<= 0.01", beyond <= 0.01,
                    f"ok {100.0 * ok.mean():.1f} % of the time")  # fmt: skip
        if alarms.losses:
            yield share(f"{key}_missed", f"{what}: not noticed within {PATIENCE_S:g} s",
                        alarms.missed, alarms.losses, 0.01, at_most=True)  # fmt: skip
            yield claim_of(f"{key}_delay", f"{what}: noticed after", "s", None, alarms.delays_s,
                           "<= 2", lambda v: v <= 2.0)  # fmt: skip
        if name == "right":
            yield _false(f"{key}_false", f"{what}: false alarms", alarms.false_per_hour,
                         alarms.hours)  # fmt: skip
    every = joined(sets)
    all_of = f"watch_{judge}_all".replace(" ", "_")
    yield share(f"{all_of}_missed", f"by {judge}, all: not noticed within {PATIENCE_S:g} s",
                every.missed, every.losses, 0.01, at_most=True)  # fmt: skip
    yield _false(f"{all_of}_false", f"by {judge}, all: false alarms", every.false_per_hour,
                 every.hours)  # fmt: skip


def _false(key: str, what: str, rate: float, hours: float) -> Claim:
    return Claim(key, f"{what} in {hours:.1f} h", "1/h", None, rate, rate, rate, "<= 0.1",
                 rate <= 0.1)  # fmt: skip
