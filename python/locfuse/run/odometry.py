# SPDX-License-Identifier: Apache-2.0
"""Odometry that wheels, a gyro and scans make together, before anything is fused."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from locfuse import _core
from locfuse.config.build import build_estimator_config, build_gyro_config
from locfuse.config.schema import RunConfig
from locfuse.run.messages import add_odometry, add_samples, as_measured
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import scans_of
from locfuse.types import NANOSECONDS, Columns, Log, LogError

_logger = logging.getLogger(__name__)


def uses_gyro(config: RunConfig) -> bool:
    """Return whether odometry takes the samples of an IMU, where there are any."""
    return "imu" in config.use and "odometry" in config.use and not config.is_inertial


def odometry_timeline(config: RunConfig, gyro: bool) -> _core.OdometryTimeline:
    """Return what makes the odometry of a run, with a gyro or without."""
    return _core.OdometryTimeline(
        build_gyro_config(config) if gyro else None,
        None if config.scan_odometry is None else scan_odometry_of(config),
        build_estimator_config(config.estimator).odometry,
        round(config.history_s * NANOSECONDS),
        _core.ClockJump[config.clock_jump.upper()],
        config.history_messages,
    )


def scan_odometry_of(config: RunConfig) -> _core.ScanOdometryConfig:
    """Return how scans are fitted to one another; by defaults without ``scan_odometry``."""
    made = config.scan_odometry
    if made is None:
        return _core.ScanOdometryConfig()
    return _core.ScanOdometryConfig(map=_core.LocalMapConfig(sigma_range_m=made.sigma_range_m))


def with_odometry(log: Log, config: RunConfig, *, gyro: bool = True) -> Log:
    """Return the log with odometry of scans or gyro, if the configuration and the log have them.

    It replaces that of wheels, which is then called ``wheels`` unless scans make the odometry. The
    table has columns that a file has not: ``begin_ns``; ``variance``, shape (n, 3), NaN where that
    of the model holds; ``slipped``, where gyro and wheels contradict; ``origin`` and ``again`` as
    of `MadeOdometry`. Without `gyro` an IMU is left out. Raises LogError where scans are missing,
    or a value cannot be.
    """
    gyro = gyro and uses_gyro(config) and len(log.tables.get("imu", {}).get("stamp_ns", ())) > 0
    by_scans = config.scan_odometry is not None
    wheels = log.tables.get("odometry")
    if not by_scans and (not gyro or wheels is None):
        return log
    messages = _core.MessageLog()
    try:
        if gyro:
            table = as_measured("imu", log["imu"], config, config.latency_s["imu"])
            add_samples(messages, {"arrival_ns": log["imu"]["stamp_ns"], **table})
        if wheels is not None:
            table = as_measured("odometry", wheels, config, config.latency_s["odometry"])
            arrival = wheels.get("arrival_ns", wheels["stamp_ns"])
            add_odometry(messages, {**table, "arrival_ns": arrival})
        if by_scans:
            scans = scans_of(log)
            if not scans:
                raise LogError("odometry of scans needs scans and a laser, but the log has none; "
                               f"{how_to_add(log, 'scans')}, or leave 'scan_odometry' out"
                               )  # fmt: skip
            messages.add_scans(scans, log["scans"].get("arrival_ns"))
        messages.sort()
        made = odometry_timeline(config, gyro).of_log(messages)
    except LogError:
        raise
    except ValueError as problem:
        raise LogError(f"odometry of wheels, gyro or scans: {problem}") from problem
    if gyro and len(made) > 0 and np.isfinite(made.variance).mean() < 0.05:
        _logger.warning("hardly a motion of odometry has samples of imu near it; do their stamps "
                        "count from the same origin?")  # fmt: skip
    is_timed = gyro or "arrival_ns" in log["scans"]
    if len(made) > 0:
        odometry = _table_of(made, is_timed)
    elif by_scans:  # a single one
        odometry = {"stamp_ns": log["scans"]["stamp_ns"][:1], "dx_m": np.zeros(1),
                    "dy_m": np.zeros(1), "dheading_rad": np.zeros(1)}  # fmt: skip
    else:
        return log
    kept = {} if by_scans else {"wheels": log["odometry"]}
    return replace(log, tables={**log.tables, **kept, "odometry": odometry})


def as_recorded(log: Log, history_s: float) -> Log:
    """Return a log as it was before `with_odometry`; odometry of scans stays, as it was at the end.

    Its first row is a motion from before the log, as in a file. What is late by more than
    `history_s` shows that the clock went back, and stays behind what came before.
    """
    tables = dict(log.tables)
    odometry, wheels = tables.get("odometry", {}), tables.pop("wheels", None)
    if "origin" not in odometry:
        return log
    tables["odometry"] = wheels or _without_replaced(odometry, round(history_s * NANOSECONDS))
    return replace(log, tables=tables)


def _table_of(made: _core.MadeOdometry, is_timed: bool) -> Columns:
    """Return motions as a table; without arrivals where each is known when it begins."""
    dx, dy, turn = made.motion.T
    table = {
        "begin_ns": made.begin_ns,
        "stamp_ns": made.stamp_ns,
        "dx_m": dx,
        "dy_m": dy,
        "dheading_rad": turn,
        "variance": made.variance,
        "slipped": made.slipped,
        "origin": made.origin,
        "again": made.again,
    }
    return {**table, "arrival_ns": made.arrival_ns} if is_timed else table


def _without_replaced(odometry: Columns, history_ns: int) -> Columns:
    """Return motions as they were at the end, in order of stamps, with the columns of a file."""
    _, from_behind = np.unique(odometry["origin"][::-1], return_index=True)
    rows = len(odometry["origin"]) - 1 - from_behind
    rows = rows[odometry["begin_ns"][rows] < odometry["stamp_ns"][rows]]
    stamp = odometry["stamp_ns"][rows]  # by order of origins
    clock = np.cumsum(stamp < np.maximum.accumulate(stamp) - history_ns)
    rows = rows[np.lexsort((stamp, clock))]
    names = ("stamp_ns", "dx_m", "dy_m", "dheading_rad", "arrival_ns")
    table: Columns = {name: odometry[name][rows] for name in names if name in odometry}
    first = {"stamp_ns": odometry["begin_ns"][rows[:1]]}
    first["arrival_ns"] = first["stamp_ns"]
    return {name: np.concatenate([first.get(name, np.zeros(1)), column])
            for name, column in table.items()}  # fmt: skip
