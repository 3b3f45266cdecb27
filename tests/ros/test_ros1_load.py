# SPDX-License-Identifier: Apache-2.0
"""Throughput of the node `localize` and latency of its estimates.

``./dev test-ros -k ros1_load -s`` prints the figures.
"""

from __future__ import annotations

import math
import os
import signal
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from ros1_peer import Listener, connected_publisher, node, wait_for

pytestmark = pytest.mark.usefixtures("ros1")

ANCHORS = {str(i): (4.0 * (i % 6), 4.0 * (i // 6), 2.0 + 0.1 * i) for i in range(24)}
BEAMS, SECONDS = 360, 8.0
HZ = {"odom": 100, "uwb": 100, "scan": 40}


def world(folder: Path) -> Path:
    """Write a world of 24 anchors, a tag, a laser and an empty hall; return its configuration."""
    folder.mkdir()
    rows = "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in ANCHORS.items())
    (folder / "anchors.csv").write_text("anchor,x_m,y_m,z_m\n" + rows)
    laser = {"pose_in_body": [0.0, 0.0, 0.0], "angle_min_rad": -3.14, "angle_increment_rad": 0.0175,
             "range_min_m": 0.1, "range_max_m": 12.0}  # fmt: skip
    (folder / "log.yaml").write_text(
        yaml.safe_dump({"tags": {"tag": [0.0, 0.0, 0.5]}, "laser": laser})
    )
    path = folder / "run.yaml"
    path.write_text(yaml.safe_dump({"start": "auto", "use": ["odometry", "ranges"],
                                    "ros": {"world": "."}}))  # fmt: skip
    return path


class Hall:
    """A robot on a circle in a hall, whose messages are stamped on publication.

    Parameters
    ----------
    hz : mapping
        Rate of each topic.
    singly : bool
        Whether each range is a message of its own.
    """

    def __init__(self, hz: Mapping[str, float] = HZ, *, singly: bool = False) -> None:
        from locfuse_msgs.msg import UwbRange, UwbRanges
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import LaserScan

        self._hz, self._singly = hz, singly
        self._publishers = {
            "odom": connected_publisher("odom", Odometry),
            "uwb": connected_publisher("uwb", UwbRange if singly else UwbRanges),
            "scan": connected_publisher("scan", LaserScan),
        }
        self._began = time.time()
        self._rng = np.random.default_rng(1)
        self.sent: Counter[str] = Counter()
        self.odometry_s: list[float] = []

    def _pose(self) -> tuple[float, float, float]:
        turned = 0.2 * (time.time() - self._began)
        return 10.0 + 3.0 * math.sin(turned), 6.0 - 3.0 * math.cos(turned), turned

    def publish(self, topic: str) -> None:
        """Publish the current measurement of a topic."""
        made = getattr(self, f"_{topic}")()
        for message in made.ranges if topic == "uwb" and self._singly else [made]:
            self._publishers[topic].publish(message)
            self.sent[topic] += 1

    def _odom(self) -> Any:
        import rospy
        from nav_msgs.msg import Odometry

        x, y, heading = self._pose()
        message = Odometry(child_frame_id="base_link")
        message.header.stamp = rospy.Time.from_sec(time.time())
        message.header.frame_id = "odom"
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z = math.sin(0.5 * heading)
        message.pose.pose.orientation.w = math.cos(0.5 * heading)
        self.odometry_s.append(message.header.stamp.to_sec())
        return message

    def _uwb(self) -> Any:
        import rospy
        from locfuse_msgs.msg import UwbRange, UwbRanges

        x, y, _ = self._pose()
        message = UwbRanges()
        message.header.stamp = rospy.Time.from_sec(time.time())
        noise = self._rng.normal(0.0, 0.1, len(ANCHORS))
        for error, (name, (ax, ay, az)) in zip(noise, ANCHORS.items(), strict=True):
            distance = math.sqrt((ax - x) ** 2 + (ay - y) ** 2 + (az - 0.5) ** 2)
            one = UwbRange(tag="tag", anchor=name, range=distance + error)
            one.header.stamp = message.header.stamp
            message.ranges.append(one)
        return message

    def _scan(self) -> Any:
        import rospy
        from sensor_msgs.msg import LaserScan

        message = LaserScan(angle_min=-3.14, angle_increment=0.0175, range_min=0.1, range_max=12.0)
        message.header.stamp = rospy.Time.from_sec(time.time())
        message.header.frame_id = "laser"
        message.ranges = [5.0] * BEAMS
        return message

    def run(self, seconds: float) -> None:
        """Publish all topics at their rates."""
        due = dict.fromkeys(self._hz, 0.0)
        began = time.monotonic()
        while (now := time.monotonic() - began) < seconds:
            for topic, hz in self._hz.items():
                if now >= due[topic]:
                    due[topic] += 1.0 / hz
                    self.publish(topic)
            time.sleep(max(0.0, min(due.values()) - (time.monotonic() - began)))

    def close(self) -> None:
        for one in self._publishers.values():
            one.unregister()


def of_topics(diagnostics: Listener) -> dict[str, str]:
    """Return the last values of the status of the topics."""
    for message in reversed(diagnostics.messages):
        for status in message.status:
            if status.name == "locfuse: topics":
                return {value.key: value.value for value in status.values}
    return {}


def counts(values: dict[str, str], topic: str) -> tuple[int, int]:
    """Return how many messages of this process were received on a topic, and how many lost."""
    text = values.get(f"{topic} from /peer", "0 received, 0 lost")
    received, lost = (int(part.split()[0]) for part in text.split(","))
    return received, lost


def test_nothing_is_lost_and_estimates_follow_at_once(tmp_path: Path) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import PoseWithCovarianceStamped

    parameters = {"config": str(world(tmp_path / "world"))}
    with node("locfuse_ros", "localize", tmp_path / "log.txt", parameters, "locfuse") as process:
        poses, diagnostics = (
            Listener("locfuse/pose", PoseWithCovarianceStamped),
            Listener("/diagnostics", DiagnosticArray),
        )
        hall = Hall()
        try:
            hall.run(SECONDS)
            wait_for("all odometry", lambda: counts(of_topics(diagnostics), "odom")[0]
                     == hall.sent["odom"])  # fmt: skip
            values = of_topics(diagnostics)
            for topic, sent in hall.sent.items():
                assert counts(values, topic) == (sent, 0)
            assert "lost" not in process.output()
        finally:
            hall.close()
            poses.close()
            diagnostics.close()
    latency_ms = 1000.0 * latencies(poses, hall.odometry_s)
    assert len(latency_ms) > 0.9 * (SECONDS - 3.0) * HZ["odom"]
    median, high = np.percentile(latency_ms, (50, 99))
    rates = ", ".join(f"{topic} {hz} Hz" for topic, hz in HZ.items())
    print(f"\n{len(ANCHORS)} anchors; {rates}; {os.cpu_count()} cores")
    print(f"odometry in -> estimate out: median {median:.2f} ms, 99 % {high:.2f} ms")
    print(f"of that the node itself, per message: median {values['work_ms_median']} ms, "
          f"99 % {values['work_ms_99_percent']} ms")  # fmt: skip
    assert median <= 20.0  # on a shared machine; docs/ros.md has figures of a quiet one


def latencies(poses: Listener, odometry_s: list[float]) -> np.ndarray:
    """Return the latency from each odometry message to the first pose of its stamp [s]."""
    first: dict[int, float] = {}
    for message, received_s in zip(poses.messages, poses.received_s, strict=True):
        first.setdefault(message.header.stamp.to_nsec() // 1000, received_s)
    keys = [(round(sent * 1e6), sent) for sent in odometry_s]
    found = [first[k] - sent for key, sent in keys for k in (key - 1, key, key + 1) if k in first]
    return np.array(found)


def test_lost_messages_are_reported(tmp_path: Path) -> None:
    """A node that is stopped for a second reports afterwards how many messages it lost."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rospy import Publisher
    from sensor_msgs.msg import LaserScan

    parameters = {"config": str(world(tmp_path / "world"))}
    with node("locfuse_ros", "localize", tmp_path / "log.txt", parameters, "locfuse") as process:
        diagnostics = Listener("/diagnostics", DiagnosticArray)
        out = Publisher("scan", LaserScan, queue_size=2)
        wait_for("the node", out.get_num_connections)
        scan = LaserScan(ranges=[1.0] * 200_000)  # fills the buffers of the kernel
        sent = 0
        try:
            for stopped in (False, True, False):
                os.killpg(process.process.pid, signal.SIGSTOP if stopped else signal.SIGCONT)
                for _ in range(40):
                    out.publish(scan)
                    sent += 1
                    time.sleep(0.02)
            output = process.wait_for_output("messages of scan from /peer were lost on the way")
            wait_for("the sum", lambda: sum(counts(of_topics(diagnostics), "scan")) == sent)
            assert counts(of_topics(diagnostics), "scan")[1] > 0
            assert "queue_size of their publisher too small" in output
        finally:
            os.killpg(process.process.pid, signal.SIGCONT)
            out.unregister()
            diagnostics.close()
