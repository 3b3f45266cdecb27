# SPDX-License-Identifier: Apache-2.0
"""A recording that is fused again and again, and how well each measurement was predicted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import OF_MESSAGES, Odometry, RunConfig
from locfuse.run.cylinders import with_cylinders
from locfuse.run.mcl import localize, with_poses_of
from locfuse.run.messages import Messages, landmarks_of, radios_of, to_messages
from locfuse.run.odometry import uses_gyro, with_odometry
from locfuse.run.run import run
from locfuse.run.tracker import recovering_ekf, started_ekf
from locfuse.tune.steps import Steps, steps_of
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, StampArray

# Beyond six sigmas a measurement is an outlier; nearer ones are the tail of noise, or of motions.
FITS = 1.0 - 2e-9
GATE = 0.999
# Messages may be this late, as some are at latencies that are tried.
HISTORY_S = 10.0
_SENSORS = ("range", "position", "pose", "landmark", "heading")


@dataclass(frozen=True)
class Drive:
    """A log, ready to be fused, and the start that was found with the configuration as it is.

    `recorded` is the log before anything was made of its scans; `height_m` is that of the start.
    Messages up to `used_until` were used to find the start.
    """

    recorded: Log
    log: Log
    start: _core.PoseEstimate
    height_m: float
    used_until: int | None
    steps: Steps | None

    def rows(self, kept: Mapping[str, NDArray[np.bool_]]) -> Drive:
        """Return the drive with some rows of its measurements only."""
        tables = {**self.log.tables}
        for source, rows in kept.items():
            tables[source] = {name: column[rows] for name, column in tables[source].items()}
        return replace(self, log=replace(self.log, tables=tables))


@dataclass(frozen=True)
class Compared:
    """How the rows of a table fit what was predicted; NaN and 0 where nothing was, shape (n,).

    `is_late` ones are not of the first second, which is from before the start at some latencies
    that are tried: those are not compared.
    """

    stamp_ns: StampArray
    is_late: NDArray[np.bool_]
    nis: FloatArray
    dof: NDArray[np.int64]
    residual: FloatArray
    log_likelihood: FloatArray

    @property
    def is_compared(self) -> NDArray[np.bool_]:
        """Whether there was something to compare with."""
        return self.is_late & (self.dof > 0)

    @property
    def at_limit(self) -> FloatArray:
        """Log-likelihood of one that just fits; NaN where nothing is compared."""
        likelihood = self.log_likelihood + 0.5 * (self.nis - self._limits)
        return np.where(self.is_compared, likelihood, np.nan)

    @property
    def _limits(self) -> FloatArray:
        dofs = range(1, int(self.dof.max(initial=0)) + 1)
        return np.array([np.nan, *map(_limit, dofs)])[self.dof]

    @property
    def fits(self) -> NDArray[np.bool_]:
        """Whether it is none of the outliers."""
        return self.is_late & self.is_usable

    @property
    def is_usable(self) -> NDArray[np.bool_]:
        """Whether it is none of the outliers, or one of the first second that is none."""
        return (self.dof > 0) & (self.nis <= self._limits)


def drive_of(config: RunConfig, log: Log) -> Drive:
    """Prepare a log; what particles or a detector make of its scans is made once."""
    recorded, log = log, with_cylinders(log, config)
    if config.scan_odometry is not None:
        log = with_odometry(log, config)
    if config.mcl is not None:
        log = with_poses_of(localize(config, log), log, config.mcl.poses_hz or 2.0)
    made = _moved(config, log)
    messages = to_messages(made, config)
    started = started_ekf(config, made, messages, None)
    has_gyro = uses_gyro(config) and "imu" in log
    of_wheels = ("odometry" in log and "odometry" in config.use and not has_gyro
                 and config.estimator.filter in ("pose", "landmark_slam"))  # fmt: skip
    steps = steps_of(log["odometry"], config) if of_wheels else None
    ekf = started.filter
    return Drive(recorded, log, ekf.current(), ekf.config.start_height, started.used_until, steps)


@dataclass(frozen=True)
class Ready:
    """The messages of a drive, and which are of each table but odometry."""

    log: Log
    messages: Messages
    of: dict[str, NDArray[np.intp]]


def key_of_messages(config: RunConfig) -> object:
    """Return what messages of a drive depend on: equal keys, equal messages."""
    return (config.estimator.odometry.model_dump_json(), config.imu.model_dump_json(),
            *config.latency_s.values())  # fmt: skip


def ready(config: RunConfig, drive: Drive, *, by_steps: bool = False) -> Ready:
    """Return the messages of a drive, with the corrections of a configuration.

    With `by_steps` odometry has variances of its own, see `Steps`.
    """
    if by_steps and drive.steps is not None:
        wheels = config.estimator.odometry
        tables = {**drive.log.tables, "odometry": drive.steps.table(wheels)}
        log = replace(drive.log, tables=tables)
        right = {name: Odometry.model_fields[name].default for name in OF_MESSAGES
                 if name != "latency_s"}  # fmt: skip
        estimator = config.estimator.model_copy(
            update={"odometry": wheels.model_copy(update=right)}
        )
        config = config.model_copy(update={"estimator": estimator})
    else:
        log = _moved(config, drive.log)
    messages = to_messages(log, config)
    sources = [source for source in drive.log.tables
               if source in config.use and source not in ("odometry", "imu")]  # fmt: skip
    of = {source: np.flatnonzero(messages.source == source) for source in sources}
    return Ready(log, messages, {source: rows for source, rows in of.items() if len(rows)})


def compared(config: RunConfig, drive: Drive, made: Ready | None = None) -> dict[str, Compared]:
    """Fuse a drive with a configuration, and return how each table but odometry fits.

    `made` are its messages, if they are `ready`.
    """
    made = ready(config, drive) if made is None else made
    record = _core.replay(
        _filter(config, made, drive), made.messages.log,
        history=round(max(config.history_s, HISTORY_S) * NANOSECONDS),
        used_until=drive.used_until,
        clock_jump=_core.ClockJump[config.clock_jump.upper()],
        max_messages=config.history_messages,
    )  # fmt: skip
    if record.jumps:
        raise LogError("tune needs stamps of one clock, but the log's goes back; cut the log")
    found = {}
    columns = {"nis": record.nis, "dof": record.dof, "residual": record.residual,
               "log_likelihood": record.log_likelihood}  # fmt: skip
    for source, of in made.of.items():
        row, stamp = made.messages.row[of], drive.log[source]["stamp_ns"]
        table: dict[str, NDArray[Any]] = {}
        for name, column in columns.items():
            table[name] = np.full(len(stamp), 0 if name == "dof" else np.nan, column.dtype)
            table[name][row] = column[of]
        is_late = stamp >= drive.start.stamp + NANOSECONDS
        found[source] = Compared(stamp, is_late, **table)
    return found


@dataclass(frozen=True)
class Driven:
    """How an estimator drives a recording: position RMSE, NaN without truth, and restarts."""

    position_rmse_m: float
    restarts: int


def driven(config: RunConfig, drive: Drive) -> Driven:
    """Run a drive as a user does; what particles have made of its scans is not made again."""
    log = drive.recorded
    if config.mcl is not None:
        made = {"mcl": None, "cylinders": None, "scan_odometry": None}
        config, log = config.model_copy(update=made), drive.log
    metrics = run(config, log).metrics
    rmse = metrics["position_rmse_m"]
    return Driven(np.nan if rmse is None else rmse, metrics["health"]["restarts"])


def without_gates(config: RunConfig) -> RunConfig:
    """Return a configuration that fuses every message as if its errors were Gaussian and white.

    A filter that maps keeps its gates: they say which landmark is seen.
    """
    return _with_noise(config, "gaussian", 1.0)


def robust(config: RunConfig) -> RunConfig:
    """Return a configuration that outliers do little to, and that tells them by their NIS."""
    return _with_noise(config, "cauchy", GATE)


def _with_noise(config: RunConfig, noise: str, gate: float) -> RunConfig:
    """Return a configuration with one noise; the gate is of the sensors that have no other."""
    estimator = config.estimator
    changed: dict[str, object] = {"correlation_s": 0.0}
    changed["adaptive"] = estimator.adaptive.model_copy(update={"messages": 0.0})
    if estimator.filter in ("pose", "air"):
        for name in _SENSORS:
            sensor = getattr(estimator, name)
            of_noise = {"gate": 1.0, "noise": noise}
            known = of_noise if "noise" in type(sensor).model_fields else {"gate": gate}
            changed[name] = sensor.model_copy(update=known)
        altitude = estimator.air.altitude.model_copy(update={"gate": gate})
        changed["air"] = estimator.air.model_copy(update={"altitude": altitude})
    return config.model_copy(update={"estimator": estimator.model_copy(update=changed),
                                     "when_lost": "go_on"})  # fmt: skip


def _moved(config: RunConfig, log: Log) -> Log:
    """Return the log with the odometry of gyro and wheels, which their noise changes."""
    return with_odometry(log, config) if uses_gyro(config) and not _is_made(log) else log


def _is_made(log: Log) -> bool:
    return "origin" in log.tables.get("odometry", {})


def _filter(config: RunConfig, made: Ready, drive: Drive) -> _core.PoseEkf | _core.RecoveringEkf:
    log, messages = made.log, made.messages
    anchors, tags = radios_of(log, messages, config)
    if config.estimator.filter == "pose" and config.tag_conditioner is None:
        world = _core.World(anchors, tags, landmarks_of(log, messages))
        return _core.PoseEkf(build_estimator_config(config.estimator), world, drive.start)
    ekf = recovering_ekf(config, log, messages.landmark_names, anchors, tags, matches_scans=False,
                         start_height=drive.height_m)  # fmt: skip
    ekf.start_at(drive.start)
    return ekf


@lru_cache
def _limit(dof: int) -> float:
    return _core.chi_squared_quantile(dof, FITS)
