# SPDX-License-Identifier: Apache-2.0
"""Node `simulate_uwb`: connects topics to `locfuse.ros.uwb_simulator.UwbSystem`."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from locfuse.io.rosbag.decode import MessageError
from locfuse.ros.uwb_simulator import PARAMETERS, TOPIC, TRUTH, TRUTH_TYPES, UwbSystem
from locfuse_ros.declare import options
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.qos import publisher_qos, subscriber_qos
from locfuse_ros.start import run
from locfuse_ros.subscriptions import LOOK_S, In


class UwbNode(Node):
    """Subscribes to the true pose and publishes ranges."""

    def __init__(self) -> None:
        super().__init__("simulate_uwb", automatically_declare_parameters_from_overrides=True)
        self._system = UwbSystem(options(self, PARAMETERS))
        self._out = self.create_publisher(
            message_class(self._system.type), TOPIC, publisher_qos(latched=False)
        )
        advice = f"remap {TRUTH} to the topic of the true pose"
        truth = In(self, TRUTH, TRUTH_TYPES, subscriber_qos(False, 100), self._on_truth, advice)
        self.create_timer(LOOK_S, truth.look)

    def _on_truth(self, message: Any, _: Any) -> None:
        try:
            publication = self._system.on(message, self.get_clock().now().nanoseconds)
        except MessageError as error:
            self.get_logger().warning(f"{TRUTH}: {error}", throttle_duration_sec=5.0)
            return
        if publication is not None:
            self._out.publish(message_of(publication.type, publication.fields))


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""
    return run(UwbNode)
