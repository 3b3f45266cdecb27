# SPDX-License-Identifier: Apache-2.0
"""A run: from the messages of a log to poses, outcomes and metrics."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.schema import EVERYTHING, Dataset, RunConfig, ignored_by, places_antennas
from locfuse.eval.metrics import metrics
from locfuse.eval.readiness import readiness
from locfuse.io.recording import convert_dataset, read_recording
from locfuse.run.cylinders import with_cylinders
from locfuse.run.health import health_metrics, health_of, watched_metrics, watched_of
from locfuse.run.mcl import Localization, Stopwatch, localize, with_poses_of
from locfuse.run.messages import Messages, absent, cut_off, to_messages, truth_of
from locfuse.run.missing_inputs import sigma_key
from locfuse.run.odometry import as_recorded, with_odometry
from locfuse.run.outcomes import outcomes_of, outcomes_of_mcl, with_scans, with_switches
from locfuse.run.tracker import Started, mapped_landmarks, mapping_metrics, started_ekf
from locfuse.sim.scenario import simulate
from locfuse.types import (
    NANOSECONDS,
    ConfigError,
    Log,
    LogError,
    Outcomes,
    RunResult,
    Start,
    Trajectory,
    nearest,
    rows_of,
)

Progress = Callable[[int, int], None]
Watch = Callable[[Callable[[], RunResult]], None]
_logger = logging.getLogger(__name__)

# An error is observed once its sigma falls below this share of the initial one: half the variance.
OBSERVED_SHARE = 0.7


def run(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    seed: int | None = None,
    start: _core.PoseEstimate | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> RunResult:
    """Localize along a log.

    Parameters
    ----------
    config : RunConfig
    log : Log, optional
        Overrides the log that the configuration names.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    seed : int, optional
        Overrides the seed of simulation and particle filter.
    start : PoseEstimate, optional
        Overrides the start that the configuration names.
    progress : callable, optional
        Called with (messages done, messages in all).
    watch : callable, optional
        Called now and then with a function that returns, during the call, the run so far: as if
        its log ended there. Only a late message can change a verdict of it. Where ``mcl`` is the
        source of poses, it is the run of the `Mcl`.

    Returns
    -------
    RunResult

    Raises
    ------
    ConfigError, LogError
        If the configuration or the log cannot be used as they are.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> result = run(parse_config({"simulation": {"duration_s": 10}}), seed=1)
    >>> result.metrics["position_rmse_m"] < 0.1
    True
    """
    if seed is not None:
        config = config.model_copy(update={"seed": seed})
    if log is None:
        log = load_log(config, base, config.seed)
    warn_missing_sources(config, log)
    log = with_odometry(with_cylinders(log, config), config)
    if config.mcl is None:
        return _fuse(config, log, start, progress, watch)
    localization = localize(config, log, start=start, progress=progress,
                            watch=None if watch is None else _of_mcl(watch, config))  # fmt: skip
    if config.mcl.poses_hz is not None:
        log = with_poses_of(localization, log, config.mcl.poses_hz)
        return _fuse(config, log, start, progress, localization=localization)
    if localization.searched and localization.start is None:
        raise LogError("start is 'auto', but the log ends before one place on the map is left; "
                       "set start: [x, y, heading_deg]")  # fmt: skip
    return _located(config, log, localization)


def _of_mcl(
    watch: Watch, config: RunConfig
) -> Callable[[Callable[[], tuple[Log, Localization]]], None]:
    return lambda part: watch(lambda: _located(config, *part()))


def warn_missing_sources(config: RunConfig, log: Log) -> None:
    """Warn of sources that the estimator ignores, and that ``use`` names and the log lacks."""
    if config.mcl is None:
        for source, why in ignored_by(config.estimator).items():
            if source in config.use and len(log.tables.get(source, {}).get("stamp_ns", ())):
                _logger.warning("the log has %s, which are ignored: %s", source, why)
    for source, column in (("positions", "sigma_m"), ("poses", "sigma_xy_m")):
        if source == "poses" and config.watch_poses:
            continue
        sigmas = log.tables.get(source, {}).get(column, np.zeros(0))
        unknown, key = int(np.sum(sigmas <= 0.0)), sigma_key(source, config.estimator)
        if unknown and key and source in config.use and config.mcl is None:
            _logger.warning("%d of %d %s bring no sigma and are not used; set %s", unknown,
                            len(sigmas), source, key)  # fmt: skip
    if config.use in EVERYTHING:  # whatever there is
        return
    for lacking in absent(config, log):
        bag = f"; is ros.topics.{lacking} its topic?" if log.origin == "bag" else ""
        _logger.warning("use names %s, but the log has none%s", lacking, bag)


def _fuse(
    config: RunConfig,
    log: Log,
    start: _core.PoseEstimate | None,
    progress: Progress | None,
    watch: Watch | None = None,
    localization: Localization | None = None,
) -> RunResult:
    """Run the pose EKF; its poses may come from a localization."""
    messages = to_messages(log, config)
    started = started_ekf(config, log, messages, start)
    total = len(messages.log)

    def result_of(record: _core.RunLog, log: Log, messages: Messages) -> RunResult:
        return _fused(config, log, messages, started, record, clock.seconds, localization)

    def report(done: int, record: Callable[[], _core.RunLog]) -> None:
        with clock.stopped():
            if progress is not None:
                progress(done, total)
            if watch is not None:
                watch(lambda: result_of(record(), *_beginning(log, messages, done)))

    clock = Stopwatch()
    record = _core.replay(
        started.filter,
        messages.log,
        history=round(config.history_s * NANOSECONDS),
        progress=None if progress is None and watch is None else report,
        used_until=started.used_until,
        clock_jump=_core.ClockJump[config.clock_jump.upper()],
        max_messages=config.history_messages,
        switches=_switches(config),
    )
    if config.smooth:
        if record.jumps:
            raise LogError("smooth needs stamps of one clock, but the log's goes back; cut the log")
        ekf = started.filter
        smoothed = _core.smooth(ekf.config.start.estimator, ekf.world, ekf.current(), messages.log,
                                started.used_until)  # fmt: skip
        if not smoothed.converged:
            _logger.warning("the smoother did not converge: %s", smoothed.termination)
        record = smoothed.in_place_of(record)
    result = result_of(record, log, messages)
    if progress is not None:
        progress(total, total)
    return result


def _fused(
    config: RunConfig,
    log: Log,
    messages: Messages,
    started: Started,
    record: _core.RunLog,
    wall_s: float,
    localization: Localization | None,
) -> RunResult:
    """Return the run of an EKF from the record of its replay."""
    poses = record.poses
    estimate = Trajectory(record.stamp_ns, poses[:, :2].copy(), poses[:, 2].copy(),
                          record.covariances)  # fmt: skip
    if len(record.heights):
        estimate = replace(estimate, height=record.heights,
                           height_variance=record.covariances_in_space[:, 3, 3].copy())  # fmt: skip
    if len(record.orientations):
        estimate = replace(estimate, orientation=record.orientations,
                           orientation_covariance=record.orientation_covariances)  # fmt: skip
    outcomes = outcomes_of(messages, record, log, config)
    if localization is not None:
        outcomes = with_scans(outcomes, localization, log, config)
        wall_s += localization.wall_s
    duration_s = (messages.end_ns - messages.begin_ns) / NANOSECONDS
    health, watched = health_of(record, messages, config), watched_of(record, config)
    landmarks = mapped_landmarks(config, record.landmarks, messages.landmark_names)
    figures = {
        **metrics(estimate, truth_of(log), outcomes, duration_s, wall_s),
        "interventions": int(record.interventions.sum()),
        "clock_jumps": record.jumps,
        "dropped_messages": record.dropped_messages,
        "noise_factors": _noise_factors(config, record),
        "health": health_metrics(health, record.alarms, record.restarts),
        "watched": watched_metrics(watched),
        **mapping_metrics(config, log, landmarks),
    }
    _warn_of_unused_samples(config, outcomes)
    result = _result(config, log, estimate, outcomes, figures, started.found, localization,
                     record.errors, messages.anchor_names)  # fmt: skip
    return replace(result, health=health, landmarks=landmarks, watched=watched)


def _warn_of_unused_samples(config: RunConfig, outcomes: Outcomes) -> None:
    """Say why hardly a sample moves an inertial body."""
    if not config.is_inertial:
        return
    samples = outcomes.source == "imu"
    unused = samples & (outcomes.verdict != "fused")
    if 2 * unused.sum() > samples.sum():
        reasons, counts = np.unique(outcomes.reason[unused], return_counts=True)
        _logger.warning("%d of %d samples of imu are not used: %s", unused.sum(), samples.sum(),
                        reasons[np.argmax(counts)])  # fmt: skip


def _beginning(log: Log, messages: Messages, done: int) -> tuple[Log, Messages]:
    received = np.arange(len(messages.stamp_ns)) < done
    return cut_off(log, messages, int(messages.stamp_ns[received].max()), received)


def _noise_factors(config: RunConfig, record: _core.RunLog) -> dict[str, float] | None:
    """Return the final factors of adaptive variances; None if they do not adapt."""
    if config.estimator.adaptive.messages == 0.0:
        return None
    return {source: record.noise_factor(_core.Source[source.upper()])
            for source in config.use if source not in ("odometry", "imu")}  # fmt: skip


def _switches(config: RunConfig) -> list[tuple[int, _core.Source, bool]]:
    """Return the stamps [ns] at which sources are switched off (False) and on (True)."""
    switches = []
    for off in config.switched_off:
        source = _core.Source[off.source.upper()]
        switches.append((round(off.from_s * NANOSECONDS), source, False))
        if off.until_s is not None:
            switches.append((round(off.until_s * NANOSECONDS), source, True))
    return switches


def _located(config: RunConfig, log: Log, localization: Localization) -> RunResult:
    """Return the run of the `Mcl`; without a prior it begins when ready."""
    estimate, found = localization.estimate, localization.start
    if localization.searched:
        ready = found is not None and estimate.stamp_ns >= found.stamp_ns
        estimate = rows_of(estimate, np.broadcast_to(ready, len(estimate)))
    outcomes = outcomes_of_mcl(localization, log, config)
    lost = np.concatenate([[False], localization.health.state == "lost"])
    alarms = int(np.sum(lost[1:] & ~lost[:-1]))
    duration_s = (localization.end_ns - localization.begin_ns) / NANOSECONDS
    figures = {
        **metrics(estimate, truth_of(log), outcomes, duration_s, localization.wall_s),
        **dict.fromkeys(("interventions", "clock_jumps", "dropped_messages", "noise_factors")),
        "health": health_metrics(localization.health, alarms, alarms - int(lost[-1])),
        "watched": watched_metrics(localization.watched),
    }
    outcomes = with_switches(outcomes, localization)
    result = _result(config, log, estimate, outcomes, figures, found, localization)
    return replace(result, health=localization.health, watched=localization.watched)


def _result(
    config: RunConfig,
    log: Log,
    estimate: Trajectory,
    outcomes: Outcomes,
    figures: dict[str, Any],
    found: Start | None,
    localization: Localization | None,
    errors: Sequence[_core.CalibratedError] = (),
    anchor_names: Sequence[str] = (),
) -> RunResult:
    truth = truth_of(log)
    return RunResult(
        config=config.model_dump(mode="json"),
        log=as_recorded(log, config.history_s),
        estimate=estimate,
        truth=truth,
        outcomes=outcomes,
        metrics={
            **figures,
            "start_s": None if found is None else found.seconds,
            "calibration": _calibration(errors, anchor_names) or None,
            "mcl": None if localization is None else _mcl_metrics(localization, truth),
        },
        start=found,
        frames=() if localization is None else localization.frames,
    )


def _calibration(
    errors: Sequence[_core.CalibratedError], anchor_names: Sequence[str]
) -> dict[str, dict[str, float | bool]]:
    return {
        e.name if e.anchor is None else f"{e.name} {anchor_names[e.anchor]}": {
            "value": e.value,
            "sigma": e.sigma,
            "observed": e.sigma < OBSERVED_SHARE * e.sigma_start,
        }
        for e in errors
    }


def _mcl_metrics(localization: Localization, truth: Trajectory | None) -> dict[str, Any]:
    return {
        **readiness(localization.estimate, localization.ready, localization.begin_ns, truth),
        "particles_median": float(np.median(localization.particles)),
        "switches": len(localization.injections),
    }


def load_log(config: RunConfig, base: Path | None, seed: int) -> Log:
    """Return the log that a configuration names: simulated, read or converted."""
    base = Path() if base is None else base
    if config.simulation is not None:
        return simulate(config.simulation, np.random.default_rng(seed), base)
    if isinstance(config.log, Dataset):
        source = (base / config.log.path).resolve()
        with tempfile.TemporaryDirectory() as out:
            converted = convert_dataset(config.log.dataset, source, Path(out) / "log")
            folders = {folder.name: folder for folder in converted}
            name = config.log.run or next(iter(folders))
            if name not in folders:
                raise ConfigError(f"log.run: no run {name!r}; {nearest(name, folders)}")
            return read_recording(folders[name], config.ros, base)
    if config.log is not None:
        return read_recording(base / config.log, config.ros, base,
                              antennas=places_antennas(config.estimator))  # fmt: skip
    raise ConfigError("the config names no 'log' and no 'simulation'; give one, or --log DIR")
