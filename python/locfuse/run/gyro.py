# SPDX-License-Identifier: Apache-2.0
"""Odometry whose turn a gyro measures, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse import _core
from locfuse.config.build import build_gyro_config
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import FORCES, RATES
from locfuse.run.scan_odometry import wheels_of
from locfuse.types import NANOSECONDS, Columns, Log, LogError


def uses_gyro(config: RunConfig) -> bool:
    """Return whether a run takes the samples of an IMU, where there are any."""
    return "imu" in config.use and "odometry" in config.use


def with_gyro(log: Log, config: RunConfig) -> Log:
    """Return the log with odometry whose turn is by wheels and gyro, if it has both.

    Samples and odometry count in order of arrival, odometry without one at its stamp, samples
    first. The table has columns that a file has not: ``begin_ns``, ``slipped``, and ``variance``,
    shape (n, 3), NaN where no sample was near; that of the wheels alone is called ``wheels``.
    Raises LogError if a value cannot be.
    """
    if not uses_gyro(config) or not len(log.tables.get("imu", {}).get("stamp_ns", ())):
        return log
    imu, gyro = log["imu"], _core.GyroOdometry(build_gyro_config(config))
    late = config.latency_s["imu"] - config.latency_of_tables_s["odometry"]
    arrived = imu.get("arrival_ns", imu["stamp_ns"])
    order = np.argsort(arrived, kind="stable")
    stamp = imu["stamp_ns"][order] - round(late * NANOSECONDS)
    rates = np.column_stack([imu[name][order] for name in RATES])
    forces = np.column_stack([imu[name][order] for name in FORCES]) if FORCES[0] in imu else None
    wheels = sorted(((max(at, one.stamp), one) for at, one in wheels_of(log)), key=lambda w: w[0])
    ends = np.searchsorted(arrived[order], [at for at, _ in wheels], side="right").tolist()
    rows: list[tuple[int, _core.GyroMotion]] = []
    begin = 0
    for (at, message), end in zip(wheels, ends, strict=True):
        try:
            gyro.add(stamp[begin:end], rates[begin:end],
                     None if forces is None else forces[begin:end])  # fmt: skip
        except ValueError as problem:
            raise LogError(f"imu: {problem}") from problem
        begin = end
        moved = gyro.on(message)
        if moved is not None:
            rows.append((at, moved))
    if not rows:
        return log
    motions, unknown = [moved.increment for _, moved in rows], np.full(3, np.nan)
    odometry: Columns = {
        "begin_ns": np.array([u.begin for u in motions]),
        "stamp_ns": np.array([u.stamp for u in motions]),
        "dx_m": np.array([u.motion.x for u in motions]),
        "dy_m": np.array([u.motion.y for u in motions]),
        "dheading_rad": np.array([u.motion.heading for u in motions]),
        "variance": np.array([unknown if u.variance is None else u.variance for u in motions]),
        "slipped": np.array([m.verdict is _core.GyroVerdict.SLIPPED for _, m in rows]),
        "arrival_ns": np.array([at for at, _ in rows]),
    }
    return replace(log, tables={**log.tables, "wheels": log["odometry"], "odometry": odometry})


def without_gyro(log: Log) -> Log:
    """Return a log as it was before `with_gyro`."""
    tables = dict(log.tables)
    if "wheels" in tables:
        tables["odometry"] = tables.pop("wheels")
    return replace(log, tables=tables)
