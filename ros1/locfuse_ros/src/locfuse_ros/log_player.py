# SPDX-License-Identifier: Apache-2.0
"""Node `replay_log`: publishes the messages of `locfuse.ros.log_player.LogPlayer`."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from typing import Any

import rospy

from locfuse.io.rosbag.encode import Publication
from locfuse.ros.log_player import PARAMETERS, SETTLE_S, LogPlayer, Patience
from locfuse.ros.parameters import values_of
from locfuse_ros.fill import message_class, message_of, time_of
from locfuse_ros.node import run_node


class LogNode:
    """Publishes a log."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self._player = LogPlayer(parameters, rospy.logwarn)
        self._publishers = {p.topic: self._publisher(p) for p in self._player.topics}
        self._clock = None
        if parameters["clock"]:
            self._clock = self._publisher(Publication("/clock", "rosgraph_msgs/Clock", {}))
        self._wait(parameters["wait_s"])
        for publication in self._player.world:
            self._publish(publication)
        time.sleep(SETTLE_S)

    @staticmethod
    def _publisher(p: Publication) -> Any:
        with warnings.catch_warnings():
            # Without a queue a slow subscriber slows the replay down instead of losing messages.
            warnings.simplefilter("ignore", SyntaxWarning)
            return rospy.Publisher(p.topic, message_class(p.type), latch=p.latched, queue_size=None)

    def _wait(self, max_s: float) -> None:
        patience = Patience(max_s, time.monotonic())
        while not rospy.is_shutdown():
            listeners = sum(p.get_num_connections() for p in self._publishers.values())
            if patience.is_over(listeners, time.monotonic()):
                return
            time.sleep(0.01)

    def _publish(self, p: Publication) -> None:
        self._publishers[p.topic].publish(message_of(p.type, p.fields))

    def play(self) -> None:
        """Publish all messages, once or in a loop."""
        began = time.monotonic()
        for due_s, clock_ns, publication in self._player.steps():
            time.sleep(max(0.0, began + due_s - time.monotonic()))
            if rospy.is_shutdown():
                return
            if publication is not None:
                self._publish(publication)
            elif self._clock is not None:
                clock = time_of(clock_ns)
                self._clock.publish(message_class("rosgraph_msgs/Clock")(clock=clock))


def play(given: Mapping[str, Any]) -> None:
    """Publish a log until its end or the shutdown of the node."""
    LogNode(values_of(PARAMETERS, given, rospy.get_name())).play()


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""
    return run_node("replay_log", PARAMETERS, play)
