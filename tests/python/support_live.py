# SPDX-License-Identifier: Apache-2.0
"""Logs as messages that arrive one by one, and runs on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from locfuse.config.schema import SOURCES, RunConfig
from locfuse.live import LivePose, LiveRun
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import run
from locfuse.run.start import start_of
from locfuse.types import Log


def arrivals(log: Log) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of a log in order of arrival: messages before scans, as `run` takes them."""
    rows = []
    for order, source in enumerate(("imu", *SOURCES, "scans")):
        if source not in log:
            continue
        table = log[source]
        effective = table["stamp_ns"]
        if source == "odometry" and "dx_m" in table:
            effective = np.concatenate([effective[:1], effective[:-1]])
        arrival = table.get("arrival_ns", effective)
        rows += [(int(arrival[i]), order, i, source) for i in range(len(arrival))]
    for _, _, i, source in sorted(rows):
        yield source, {key: values[i] for key, values in log[source].items()}


def live_of(
    config: RunConfig, log: Log, start: LivePose | None = None
) -> tuple[LiveRun, dict[int, LivePose]]:
    """Return a live run that has received a log, and its last pose of each stamp."""
    live, poses = LiveRun(config, replace(log, tables=world_of(log))), {}
    if start is not None:
        live.start_at(start)
    for source, row in arrivals(log):
        live.on(source, row)
        pose = live.fused()
        if pose is not None:
            poses[pose.stamp_ns] = pose
    return live, poses


def world_of(log: Log) -> dict[str, Any]:
    return {name: log[name] for name in ("anchors", "landmarks") if name in log}


def assert_same(config: RunConfig, log: Log, least: float = 0.9) -> None:
    """Compare the poses of a live run with those of `run` at the same stamps."""
    given = None
    if config.start == "truth":
        start = start_of(config, truth_of(log), to_messages(log, config))
        at = np.array([start.pose.x, start.pose.y, start.pose.heading])
        given = LivePose(start.stamp, at, start.covariance)
        estimate = run(config, log, start=start).estimate
        config = config.model_copy(update={"start": "auto"})
    else:
        estimate = run(config, log).estimate
    assert estimate.heading is not None
    assert estimate.covariance is not None
    _, poses = live_of(config, log, given)
    rows = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in poses]
    assert len(rows) >= least * len(estimate)
    for row in rows:
        pose = poses[int(estimate.stamp_ns[row])]
        assert pose.pose[:2].tolist() == estimate.position[row].tolist()
        assert pose.pose[2] == estimate.heading[row]
        assert pose.height == (None if estimate.height is None else estimate.height[row])
        assert np.array_equal(pose.covariance, estimate.covariance[row])
