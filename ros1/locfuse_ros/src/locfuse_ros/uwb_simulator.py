# SPDX-License-Identifier: Apache-2.0
"""The node `simulate_uwb`: topics in and out around `locfuse.ros.uwb_simulator.UwbSystem`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import rospy

from locfuse.io.rosbag.decode import MessageError
from locfuse.ros.parameters import values_of
from locfuse.ros.uwb_simulator import PARAMETERS, TOPIC, TRUTH, UwbSystem
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.hear import hear
from locfuse_ros.node import run_node


class UwbNode:
    """Hears the truth and publishes ranges."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._system = UwbSystem(told)
        self._out = rospy.Publisher(TOPIC, message_class(self._system.type), queue_size=100)
        self._in = hear(TRUTH, self._heard)

    def _heard(self, topic: str, _: str, message: Any) -> None:
        try:
            told = self._system.on(message, rospy.get_rostime().to_nsec())
        except MessageError as error:
            rospy.logwarn_throttle(5.0, f"{topic}: {error}")
            return
        if told is not None:
            self._out.publish(message_of(told.type, told.fields))


def simulate(given: Mapping[str, Any]) -> None:
    """Measure ranges until the node is told to end."""
    UwbNode(values_of(PARAMETERS, given, rospy.get_name()))
    rospy.spin()


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run_node("simulate_uwb", PARAMETERS, simulate)
