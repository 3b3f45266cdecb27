# SPDX-License-Identifier: Apache-2.0
"""A robot with high message rates: 24 anchors and odometry at 100 Hz, scans at 40 Hz."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from locfuse_ros.qos import subscriber_qos
from rclpy.qos import QoSProfile, ReliabilityPolicy

from locfuse import _core
from locfuse.config.ros import Ros
from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, Log
from locfuse_ros.fill import message_class, message_of, time_of
from support_robot import DIAGNOSTICS, EPOCH_NS, POSE, STARTED, config_of, shifted, write_config
from support_ros2 import Peer, Process

ANCHORS = {f"A{i}": (2.0 * (i % 6), 3.0 * (i // 6), 2.0) for i in range(24)}
LAP_S = 2.0 * math.pi * 3.0 / 0.5  # duration of one lap
FAST: dict[str, Any] = {
    "path": {"shape": "circle", "radius_m": 3.0, "speed_mps": 0.5},
    "anchors": ANCHORS,
    "duration_s": LAP_S,
    "odometry": {"rate_hz": 100},
    "ranges": {"rate_hz": 100},
    "poses": None,
    "laser": {"rate_hz": 40, "range_max_m": 12.0},
    "map": {"walls": [[2.0, 0.0, 2.0, 3.0], [10.0, 7.0, 7.5, 7.0], [0.0, 6.0, 1.5, 6.0]]},
}


@dataclass
class Answers:
    """Latency from each odometry message to the pose of its stamp."""

    sent: dict[int, float] = field(default_factory=dict)  # stamp: time by perf_counter
    waited_ms: list[float] = field(default_factory=list)
    poses: int = 0

    def on_pose(self, message: Any) -> None:
        """Record a pose."""
        now = time.perf_counter()
        self.poses += 1
        began = self.sent.pop(decode.stamp_ns(message.header.stamp), None)
        if began is not None:
            self.waited_ms.append(1e3 * (now - began))

    def percentiles(self) -> tuple[float, float]:
        """Return median and 99 % [ms]."""
        low, high = np.percentile(self.waited_ms, [50, 99])
        return float(low), float(high)


class FastRobot:
    """Drives laps with messages prepared in advance.

    Parameters
    ----------
    peer : Peer
    log : Log
        One lap.
    singly : bool
        Whether each range is a message of its own.
    """

    def __init__(self, peer: Peer, log: Log, *, singly: bool = False) -> None:
        self.peer, self.log, self.answers, self.sent = peer, log, Answers(), Counter[str]()
        self.statuses: dict[str, dict[str, str]] = {}
        self._lap = _lap_of(log, singly)
        self._laps = 0
        self._driven = _core.Pose2(0.0, 0.0, 0.0)
        self._messages = self._on_laps()
        self._next = next(self._messages)
        self._clock = peer.publisher("clock", "rosgraph_msgs/Clock", QoSProfile(depth=10))
        reliable = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        kinds = {
            "odom": "nav_msgs/Odometry",
            "scan": "sensor_msgs/LaserScan",
            "uwb": "locfuse_msgs/UwbRange" if singly else "locfuse_msgs/UwbRanges",
        }
        self._out = {topic: peer.publisher(topic, kind, reliable) for topic, kind in kinds.items()}
        listen = peer.node.create_subscription
        listen(
            message_class(POSE), "locfuse/pose", self.answers.on_pose, subscriber_qos(False, 1000)
        )
        listen(
            message_class(DIAGNOSTICS), "/diagnostics", self._on_status, subscriber_qos(False, 100)
        )

    def publish_world(self) -> None:
        """Publish mounts, anchors and map, latched."""
        for publication in world_of(self.log, Ros()):
            self.peer.publish(publication)

    def drive(self, seconds: float) -> float:
        """Drive for some time; return the duration by the wall clock [s]."""
        began, end_ns = time.perf_counter(), round(seconds * NANOSECONDS)
        first_ns = self._next[0]
        while self._next[0] - first_ns <= end_ns:
            now_ns, topic, message, pose = self._next
            self._wait_until(began + (now_ns - first_ns) / NANOSECONDS)
            if topic == "odom":
                self._clock.publish(message_of("rosgraph_msgs/Clock", {"clock": {"ns": now_ns}}))
            self._publish(topic, message, now_ns, pose)
            self._next = next(self._messages)
        return time.perf_counter() - began

    def _on_laps(self) -> Iterator[tuple[int, str, Any, _core.Pose2]]:
        """Yield time, topic, message, and the odometry pose at that time."""
        while True:
            shift_ns = self._laps * round(LAP_S * NANOSECONDS)
            pose = self._driven
            for at_ns, topic, message, driven in self._lap:
                pose = pose if driven is None else self._driven * driven
                yield at_ns + shift_ns, topic, message, pose
            self._laps, self._driven = self._laps + 1, pose

    def settle(self) -> None:
        """Wait until the node has reported the counts of all messages.

        A loss is detected by the next received message of the topic, so one more message per
        topic is sent, and again if that one is lost, too.
        """
        self.peer.spin(1.0)
        end_ns = self._lap[-1][0] + self._laps * round(LAP_S * NANOSECONDS)
        for _ in range(10):
            for topic in self.sent:
                message = next(m for _, name, m, _ in reversed(self._lap) if name == topic)
                self._publish(topic, message, end_ns, self._driven)
            self.peer.spin(2.5)
            if not any(self.unaccounted().values()):
                return
            end_ns += NANOSECONDS // 100

    def _wait_until(self, due: float) -> None:
        while (left := due - time.perf_counter()) > 0.0:
            self.peer.executor.spin_once(timeout_sec=left)

    def _publish(self, topic: str, message: Any, now_ns: int, pose: _core.Pose2) -> None:
        message.header.stamp = time_of(now_ns)
        if topic == "odom":
            at = message.pose.pose
            at.position.x, at.position.y = pose.x, pose.y
            turned = encode.quaternion(pose.heading)
            at.orientation.z, at.orientation.w = turned["z"], turned["w"]
            self.answers.sent[now_ns] = time.perf_counter()
        elif topic == "uwb" and hasattr(message, "ranges"):
            for one in message.ranges:
                one.header.stamp = message.header.stamp
        self._out[topic].publish(message)
        self.sent[topic] += 1

    def _on_status(self, message: Any) -> None:
        for status in message.status:
            self.statuses[status.name] = {v.key: v.value for v in status.values}

    def start_with_world(self, node: str, **keys: Any) -> Process:
        """Start a node and wait until it has received the world."""
        self.publish_world()
        config = write_config(self.peer.folder, **{**STARTED, **keys})
        process = self.peer.start(node, {"config": config, "use_sim_time": True})
        self.peer.wait_for_subscriber("odom", "uwb", "scan")
        for out in self._out.values():  # the node discovers the published type
            self.peer.wait("a match", out.get_subscription_count)
        known = {"map", "anchors", "/tf_static"}
        self.peer.wait("the world", lambda: known <= set(self.counted()), 60.0)
        self._greet()
        return process

    def _greet(self) -> None:
        """Publish on each topic before the lap until the node has received it; count from there.

        A publisher discovers a subscriber before the reverse: messages sent in between are lost
        without being detected.
        """
        early_ns = EPOCH_NS - 5 * NANOSECONDS
        while not set(self._out) <= set(self.counted()):
            for topic in set(self._out) - set(self.counted()):
                self._publish(topic, self._first(topic), early_ns, self._driven)
            early_ns += NANOSECONDS // 100
            self.peer.spin(0.1)
        self.peer.spin(1.5)  # until messages still under way are counted
        for topic in self._out:
            self.sent[topic] = sum(self.counted()[topic])

    def _first(self, topic: str) -> Any:
        return next(message for _, name, message, _ in self._lap if name == topic)

    def unaccounted(self) -> dict[str, int]:
        """Return the number of messages per topic neither received nor reported lost."""
        counted = self.counted()
        return {topic: sent - sum(counted[topic]) for topic, sent in self.sent.items()}

    def counted(self) -> dict[str, tuple[int, int]]:
        """Return how many messages of each topic the node reports as received and lost."""
        values = self.statuses.get("locfuse: topics", {})
        found = {}
        for key, value in values.items():
            if " from " in key:
                received, lost = (int(word.split()[0]) for word in value.split(", "))
                found[key.split(" from ")[0]] = received, lost
        return found


def lap(seed: int = 0, **more: Any) -> Log:
    """Return one lap of a simulated drive."""
    return shifted(load_log(config_of({**FAST, **more}), None, seed), EPOCH_NS)


def _lap_of(log: Log, singly: bool) -> list[tuple[int, str, Any, _core.Pose2 | None]]:
    """Return arrival, topic, message and, for odometry, the pose since the start of the lap."""
    found = []
    for at_ns, publication in in_order_of_arrival(log, Ros()):
        if publication.topic in ("ground_truth", "tf"):
            continue
        if publication.topic == "uwb" and singly:
            found += [(at_ns, "uwb", message_of("locfuse_msgs/UwbRange", one), None)
                      for one in publication.fields["ranges"]]  # fmt: skip
            continue
        driven = None
        message = message_of(publication.type, publication.fields)
        if publication.topic == "odom":
            row = decode.odometry(message)
            driven = _core.Pose2(row.x, row.y, row.heading)
        found.append((at_ns, publication.topic, message, driven))
    return found
