# SPDX-License-Identifier: Apache-2.0
"""Cost of the adapter per message, compared to a replay of the same messages."""

from __future__ import annotations

from typing import Any

import pytest

from locfuse.config.load import parse_config
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros.adapter import Adapter
from locfuse.run.run import load_log, run
from support_ros import message

RATES = {"odometry": {"rate_hz": 100}, "ranges": {"rate_hz": 100}, "poses": None}
ANCHORS = {f"A{i}": (float(i % 6) * 2.0, float(i // 6) * 3.0, 2.0) for i in range(24)}


def drive() -> tuple[Any, Any]:
    """Return configuration and log of 10 s with 24 anchors and odometry at 100 Hz."""
    config = parse_config({
        "simulation": {"path": {"shape": "eight", "radius_m": 2.0}, "duration_s": 10.0,
                       "anchors": ANCHORS, **RATES},
        "start": "auto", "seed": 1,
    })  # fmt: skip
    return config, load_log(config, None, 1)


@pytest.mark.benchmark(group="10 s of 24 anchors and odometry at 100 Hz")
def test_through_the_adapter(benchmark: Any) -> None:
    config, log = drive()
    later = 10**12
    received = [(a.arrival_ns, a.publication.topic, message(a.publication))
             for a in in_order_of_arrival(log, config.ros)]  # fmt: skip

    def setup() -> tuple[tuple[Adapter], dict[str, Any]]:
        adapter = Adapter(config)
        of = {s.topic.lstrip("/"): s.source for s in adapter.subscriptions}
        for static in world_of(log, config.ros):
            adapter.on(of[static.topic.lstrip("/")], static.topic, message(static), later)
        return (adapter,), {}

    def feed(adapter: Adapter) -> None:
        of = {s.topic.lstrip("/"): s.source for s in adapter.subscriptions}
        for now, topic, one in received:
            if topic in of:
                adapter.on(of[topic], topic, one, now)

    benchmark.extra_info["seconds_driven"] = 10.0
    benchmark.pedantic(feed, setup=setup, rounds=5)


@pytest.mark.benchmark(group="10 s of 24 anchors and odometry at 100 Hz")
def test_by_run(benchmark: Any) -> None:
    config, log = drive()
    benchmark.extra_info["ranges"] = len(log["ranges"]["stamp_ns"])
    benchmark(lambda: run(config, log))
