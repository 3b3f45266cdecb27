# SPDX-License-Identifier: Apache-2.0
"""Odometry from a laser without a map: each scan is fitted to those before it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import RunConfig
from locfuse.run.messages import undelayed
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import scans_of
from locfuse.types import Columns, Log, LogError

Wheels = _core.Velocity | _core.Increment
Item = tuple[int, int, Wheels | _core.LaserScan]  # time, rank, and what comes then


def with_scan_odometry(log: Log, config: RunConfig) -> Log:
    """Return the log with odometry of its scans, if the configuration asks for it.

    It replaces that of wheels, which only shows where each fit begins. Raises LogError where the
    log has no scans.
    """
    if config.scan_odometry is None:
        return log
    tables = dict(log.tables)
    if "odometry" in tables:
        late = config.latency_s["odometry"]
        tables["odometry"] = undelayed("odometry", tables["odometry"], late)
    made = _odometry_of(replace(log, tables=tables), scan_drive(config))
    return replace(log, tables={**log.tables, "odometry": made})


def scan_drive(config: RunConfig) -> _core.ScanDrive:
    """Return what makes odometry of scans for a run."""
    assert config.scan_odometry is not None
    noise = build_estimator_config(config.estimator).odometry
    local = _core.LocalMapConfig(sigma_range_m=config.scan_odometry.sigma_range_m)
    return _core.ScanDrive(_core.ScanOdometryConfig(map=local), noise)


def wheels_of(log: Log) -> Iterator[tuple[int, Wheels]]:
    """Yield the odometry of a log with its times of arrival."""
    table: Columns = log.tables.get("odometry", {})
    if not table:
        return
    stamps = table["stamp_ns"].tolist()
    if "v_mps" in table:
        arrived = table.get("arrival_ns", table["stamp_ns"]).tolist()
        left = table.get("v_left_mps", np.zeros(len(stamps)))
        velocities = (column.tolist() for column in (table["v_mps"], table["omega_radps"], left))
        for stamp, arrival, *velocity in zip(stamps, arrived, *velocities, strict=True):
            yield arrival, _core.Velocity(stamp, *velocity)
        return
    begins = [*stamps[:1], *stamps[:-1]]
    arrived = table["arrival_ns"].tolist() if "arrival_ns" in table else begins
    columns = (table[name].tolist() for name in ("dx_m", "dy_m", "dheading_rad"))
    for row, (begin, stamp, arrival, *motion) in enumerate(
        zip(begins, stamps, arrived, *columns, strict=True)
    ):
        moved = _core.Pose2(*motion) if row > 0 else _core.Pose2()
        yield arrival, _core.Increment(begin, stamp, moved)


def _odometry_of(log: Log, drive: _core.ScanDrive) -> Columns:
    """Return the table of odometry that the scans of a log make, in order of arrival."""
    scans = scans_of(log)
    if not scans:
        raise LogError("odometry of scans needs scans and a laser, but the log has none; "
                       f"{how_to_add(log, 'scans')}, or leave 'scan_odometry' out")  # fmt: skip
    arrived = log["scans"].get("arrival_ns", log["scans"]["stamp_ns"]).tolist()
    items: list[Item] = [(arrival, 0, wheels) for arrival, wheels in wheels_of(log)]
    items += [(arrival, 1, scan) for arrival, scan in zip(arrived, scans, strict=True)]
    rows: list[tuple[int, int, float, float, float]] = []
    for arrival, _, item in sorted(items, key=lambda entry: entry[:2]):
        try:
            if not isinstance(item, _core.LaserScan):
                drive.on(item)
                continue
            u = drive.on(item)
        except ValueError as problem:
            raise LogError(f"scan_odometry: {problem}") from problem
        if u is not None:
            rows.append((u.stamp, arrival, u.motion.x, u.motion.y, u.motion.heading))
        elif not rows:
            rows.append((item.stamp, arrival, 0.0, 0.0, 0.0))
    stamp, arrival_ns, dx, dy, turn = (np.array(column) for column in zip(*rows, strict=True))
    odometry = {"stamp_ns": stamp, "dx_m": dx, "dy_m": dy, "dheading_rad": turn}
    return odometry | ({"arrival_ns": arrival_ns} if "arrival_ns" in log["scans"] else {})
