# SPDX-License-Identifier: Apache-2.0
"""The node `simulate_uwb`: topics in and out around `locfuse.ros.uwb_simulator.UwbSystem`."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from locfuse.io.rosbag.decode import MessageError
from locfuse.ros.uwb_simulator import PARAMETERS, TOPIC, TRUTH, TRUTH_TYPES, UwbSystem
from locfuse_ros.declare import options
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.hear import LOOK_S, In
from locfuse_ros.qos import to_hear, to_tell
from locfuse_ros.start import run


class UwbNode(Node):
    """Hears the truth and publishes ranges."""

    def __init__(self) -> None:
        super().__init__("simulate_uwb", automatically_declare_parameters_from_overrides=True)
        self._system = UwbSystem(options(self, PARAMETERS))
        self._out = self.create_publisher(
            message_class(self._system.type), TOPIC, to_tell(latched=False)
        )
        advice = f"remap {TRUTH} to the topic of the true pose"
        truth = In(self, TRUTH, TRUTH_TYPES, to_hear(False, 100), self._heard, advice)
        self.create_timer(LOOK_S, truth.look)

    def _heard(self, message: Any, _: Any) -> None:
        try:
            told = self._system.on(message, self.get_clock().now().nanoseconds)
        except MessageError as error:
            self.get_logger().warning(f"{TRUTH}: {error}", throttle_duration_sec=5.0)
            return
        if told is not None:
            self._out.publish(message_of(told.type, told.fields))


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run(UwbNode)
