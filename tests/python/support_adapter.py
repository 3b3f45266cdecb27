# SPDX-License-Identifier: Apache-2.0
"""A ROS adapter that receives a log, with messages as rospy and rclpy make them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from locfuse.config.schema import RunConfig
from locfuse.io.rosbag.decode import heading_of
from locfuse.io.rosbag.encode import Fields, Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros.adapter import Adapter
from locfuse.types import NANOSECONDS, Columns, Log, Trajectory
from support_ros import message

LATER = 1000 * NANOSECONDS  # drivers stamp with a clock that has begun long ago


def later(log: Log) -> Log:
    """Return a log by that clock."""
    tables = {name: _later(table) for name, table in log.tables.items()}
    return replace(log, tables=tables)


def _later(table: Columns) -> Columns:
    return {key: values + LATER if key.endswith("_ns") else values for key, values in table.items()}


class Robot:
    """An adapter that receives a log, and what it published."""

    def __init__(self, config: RunConfig, log: Log, ros: str = "ros2", **options: Any) -> None:
        self.adapter = Adapter(config, **options)
        self.config, self.log, self.ros = config, log, ros
        self.of = {s.topic.lstrip("/"): s.source for s in self.adapter.subscriptions}
        self.published: list[Publication] = []
        self.problems: list[str] = []

    def receive(self, published: Publication, now_ns: int, **changes: Any) -> None:
        topic = published.topic.lstrip("/")
        if topic in self.of:
            made = message(published, self.ros, **changes)
            self.published += self.adapter.on(self.of[topic], topic, made, now_ns)
            self.problems += self.adapter.problems()

    def learn(self) -> None:
        """Receive anchors, map and mounts."""
        for published in world_of(self.log, self.config.ros):
            self.receive(published, LATER)

    def drive(self, begin_s: float = 0.0, end_s: float = 1e9, later_s: float = 0.0) -> None:
        """Receive the messages of a part of the log, by a clock that ticks along."""
        tick = 0
        for arrival in in_order_of_arrival(self.log, self.config.ros):
            if begin_s <= (arrival.arrival_ns - LATER) / NANOSECONDS < end_s:
                now = arrival.arrival_ns + round(later_s * NANOSECONDS)
                self.receive(arrival.publication, now)
                if now >= tick:
                    tick = now + NANOSECONDS // 10
                    self.tick(now)

    def tick(self, now_ns: int) -> None:
        self.published += self.adapter.tick(now_ns)
        self.problems += self.adapter.problems()

    def said(self, topic: str) -> list[Fields]:
        return [one.fields for one in self.published if one.topic == topic]

    def counts(self) -> Any:
        return self.said("diagnostics")[-1]["status"][-1]["values"]

    def health(self) -> Fields:
        return dict(self.said("diagnostics")[-1]["status"][0])


def stamps(published: list[Fields]) -> list[int]:
    return [one["header"]["stamp"]["ns"] for one in published]


def pose_of(fields: Fields) -> list[float]:
    made = message(fields)
    at = made.pose.pose
    return [at.position.x, at.position.y, heading_of(at.orientation)]


def assert_poses_are(robot: Robot, estimate: Trajectory, least: float) -> None:
    """Compare the poses published with a run's; `least` of its stamps must have one."""
    assert estimate.heading is not None
    last = {stamp: one for one in robot.said("locfuse/pose") for stamp in stamps([one])}
    same = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in last]
    assert len(same) > least * len(estimate)
    for row in same:
        x, y, heading = pose_of(last[int(estimate.stamp_ns[row])])
        assert [x, y] == pytest.approx(estimate.position[row].tolist(), abs=1e-9)
        assert heading == pytest.approx(estimate.heading[row], abs=1e-9)
        z = last[int(estimate.stamp_ns[row])]["pose"]["pose"]["position"]["z"]
        height = 0.0 if estimate.height is None else estimate.height[row]
        assert z == pytest.approx(height, abs=1e-9)
    assert not robot.problems
