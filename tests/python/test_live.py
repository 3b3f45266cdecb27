# SPDX-License-Identifier: Apache-2.0
"""A run on messages as they arrive is the run of their log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.capsule import read_capsule
from locfuse.config.load import parse_config
from locfuse.config.schema import SOURCES, RunConfig
from locfuse.io.log_folder import read_log
from locfuse.live import LivePose, LiveRun
from locfuse.run import load_log, run
from locfuse.types import ConfigError, Log

ROOM: dict[str, Any] = {
    "simulation": {"path": {"shape": "eight", "radius_m": 2.0}, "duration_s": 30.0},
    "start": "auto",
    "seed": 3,
}


def arrivals(log: Log) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the rows of a log in order of arrival: messages before scans, as `run` takes them."""
    rows = []
    for order, source in enumerate((*SOURCES, "scans")):
        if source not in log:
            continue
        table = log[source]
        effective = table["stamp_ns"]
        if source == "odometry" and "dx_m" in table:
            effective = np.concatenate([effective[:1], effective[:-1]])
        heard = table.get("arrival_ns", effective)
        rows += [(int(heard[i]), order, i, source) for i in range(len(heard))]
    for _, _, i, source in sorted(rows):
        yield source, {key: values[i] for key, values in log[source].items()}


def live_of(config: RunConfig, log: Log) -> tuple[LiveRun, dict[int, LivePose]]:
    """Return a live run that has heard a log, and its last pose of each stamp."""
    live, poses = LiveRun(config, replace(log, tables=world_of(log))), {}
    for source, row in arrivals(log):
        live.on(source, row)
        pose = live.fused()
        if pose is not None:
            poses[pose.stamp_ns] = pose
    return live, poses


def world_of(log: Log) -> dict[str, Any]:
    return {name: log[name] for name in ("anchors", "landmarks") if name in log}


def assert_same(config: RunConfig, log: Log, least: float = 0.9) -> None:
    """The poses of a live run are those of `run` at the same stamps."""
    estimate = run(config, log).estimate
    assert estimate.heading is not None
    assert estimate.covariance is not None
    _, poses = live_of(config, log)
    rows = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in poses]
    assert len(rows) >= least * len(estimate)
    for row in rows:
        pose = poses[int(estimate.stamp_ns[row])]
        assert pose.pose[:2].tolist() == estimate.position[row].tolist()
        assert pose.pose[2] == estimate.heading[row]
        assert np.array_equal(pose.covariance, estimate.covariance[row])


@pytest.mark.parametrize("start", ["auto", [5.0, 5.0, 0.0]])
def test_poses_are_those_of_the_run(start: Any) -> None:
    config = parse_config({**ROOM, "start": start})
    assert_same(config, load_log(config, None, config.seed))


def test_late_messages_are_fused_where_they_belong() -> None:
    config = parse_config(ROOM | {"simulation": ROOM["simulation"] | {"faults": [
        {"kind": "latency", "source": "ranges", "delay_s": 0.05, "jitter_s": 0.1},
        {"kind": "latency", "source": "odometry", "delay_s": 0.02},
    ]}})  # fmt: skip
    assert_same(config, load_log(config, None, config.seed), least=0.5)
