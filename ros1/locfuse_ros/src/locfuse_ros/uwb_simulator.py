# SPDX-License-Identifier: Apache-2.0
"""Node `simulate_uwb`: connects topics to `locfuse.ros.uwb_simulator.UwbSystem`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rospy

from locfuse.io.rosbag.decode import MessageError
from locfuse.ros.parameters import values_of
from locfuse.ros.uwb_simulator import PARAMETERS, TOPIC, TRUTH, UwbSystem
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.node import run_node
from locfuse_ros.subscriptions import subscribe


class UwbNode:
    """Subscribes to the true pose and publishes ranges."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self._system = UwbSystem(parameters)
        self._out = rospy.Publisher(TOPIC, message_class(self._system.type), queue_size=100)
        self._in = subscribe(TRUTH, self._on_truth)

    def _on_truth(self, topic: str, _: str, message: Any) -> None:
        try:
            publication = self._system.on(message, rospy.get_rostime().to_nsec())
        except MessageError as error:
            rospy.logwarn_throttle(5.0, f"{topic}: {error}")
            return
        if publication is not None:
            self._out.publish(message_of(publication.type, publication.fields))


def simulate(given: Mapping[str, Any]) -> None:
    """Measure ranges until the node is shut down."""
    UwbNode(values_of(PARAMETERS, given, rospy.get_name()))
    rospy.spin()


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""
    return run_node("simulate_uwb", PARAMETERS, simulate)
