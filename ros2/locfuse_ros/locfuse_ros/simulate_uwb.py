# SPDX-License-Identifier: Apache-2.0
"""The node `simulate_uwb`: a true pose in, noisy ranges to known anchors out."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from locfuse.io.log_folder import read_world
from locfuse.ros import decode, encode
from locfuse.ros.parameters import Parameter
from locfuse.ros.peers import uwb_of
from locfuse_ros.declare import options
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.qos import to_hear, to_tell
from locfuse_ros.start import run

FAR = 1e6
PARAMETERS = (
    Parameter("world", "text", "", None, None, "log folder with anchors.csv and tags"),
    Parameter("truth", "text", "ground_truth", None, None, "topic of true poses, Odometry"),
    Parameter("ranges", "text", "uwb", None, None, "topic of ranges"),
    Parameter("rate_hz", "float", 10.0, 1e-3, 1e4, "ranges to all anchors per second, at most"),
    Parameter("sigma_m", "float", 0.1, 0.0, 1e3, "standard deviation of the noise"),
    Parameter("offset_m", "float", 0.0, -1e3, 1e3, "by how much ranges are too long"),
    Parameter("reach_m", "float", FAR, 0.0, FAR, "anchors further away do not answer"),
    Parameter("loss", "float", 0.0, 0.0, 1.0, "share of rangings that fail"),
    Parameter("seed", "int", 0, 0, 2**63 - 1, "of noise and failures"),
)


class UwbNode(Node):
    """Measures ranges whenever a true pose comes, but not more often than it may."""

    def __init__(self) -> None:
        super().__init__("uwb_simulator", automatically_declare_parameters_from_overrides=True)
        told = options(self, PARAMETERS)
        keys = ("sigma_m", "offset_m", "reach_m", "loss", "seed")
        self._uwb = uwb_of(read_world(told["world"]), **{key: told[key] for key in keys})
        self._between_ns = 0.999 * 1e9 / told["rate_hz"]
        self._last_ns: int | None = None
        self._topic = told["ranges"]
        self._out = self.create_publisher(
            message_class("locfuse_msgs/UwbRanges"), self._topic, to_tell(latched=False)
        )
        self.create_subscription(
            message_class("nav_msgs/Odometry"), told["truth"], self._on, to_hear(False, 100)
        )

    def _on(self, message: Any) -> None:
        try:
            row = decode.odometry(message)
        except decode.MessageError as error:
            self.get_logger().warning(
                f"a true pose is left out: {error}", throttle_duration_sec=5.0
            )
            return
        last = self._last_ns
        if last is not None and 0 <= row.stamp_ns - last < self._between_ns:
            return
        self._last_ns = row.stamp_ns
        rows = self._uwb.ranges(row.stamp_ns, row.x, row.y, row.heading, row.z)
        if rows:
            told = encode.uwb_ranges(self._topic, rows)
            self._out.publish(message_of(told.type, told.fields))


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run(UwbNode)
