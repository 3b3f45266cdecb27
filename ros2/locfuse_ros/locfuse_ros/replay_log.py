# SPDX-License-Identifier: Apache-2.0
"""Node `replay_log`: publishes the messages of `locfuse.ros.log_player.LogPlayer`."""

from __future__ import annotations

import time
from typing import Any

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage

from locfuse.io.rosbag.encode import Publication
from locfuse.ros.log_player import PARAMETERS, SETTLE_S, LogPlayer, Patience
from locfuse_ros.declare import options
from locfuse_ros.fill import message_class, message_of, time_of
from locfuse_ros.qos import publisher_qos
from locfuse_ros.start import run
from locfuse_ros.subscriptions import resolved

ACKNOWLEDGED_S = 5.0  # for subscribers to acknowledge the last messages, lost with the process
MAX_WORK_S = 0.005  # maximum work per call, so that services and signals are handled


class LogNode(Node):
    """Publishes due messages; ends the process after the last."""

    def __init__(self) -> None:
        super().__init__("replay_log", automatically_declare_parameters_from_overrides=True)
        parameters = options(self, PARAMETERS)
        self._player = LogPlayer(parameters, self.get_logger().warning)
        self._outs = {p.topic: self._publisher(p) for p in self._player.topics}
        self._clock = None
        if parameters["clock"]:
            self._clock = self.create_publisher(ClockMessage, "/clock", QoSProfile(depth=10))
        self._patience: Patience | None = Patience(parameters["wait_s"], time.monotonic())
        self._began = 0.0
        self._steps = self._player.steps()
        self._next = next(self._steps, None)
        self.create_timer(0.001, self._work, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _work(self) -> None:
        now = time.monotonic()
        if self._patience is not None:
            listeners = sum(out.get_subscription_count() for out in self._outs.values())
            if self._patience.is_over(listeners, now):
                self._patience = None
                self._began = now + SETTLE_S
                for publication in self._player.world:
                    self._publish(publication)
            return
        while self._next is not None and self._began + self._next.due_s <= time.monotonic():
            self._step(self._next.clock_ns, self._next.publication)
            self._next = next(self._steps, None)
            if time.monotonic() > now + MAX_WORK_S:
                return
        if self._next is None:
            until = time.monotonic() + ACKNOWLEDGED_S
            for out in [*self._outs.values(), *([self._clock] if self._clock else [])]:
                left = max(until - time.monotonic(), 0.0)
                out.wait_for_all_acked(Duration(seconds=left))
            self.get_logger().info("the log has ended")
            rclpy.try_shutdown()

    def _step(self, clock_ns: int, publication: Publication | None) -> None:
        if publication is not None:
            self._publish(publication)
        elif self._clock is not None:
            self._clock.publish(ClockMessage(clock=time_of(clock_ns)))

    def _publisher(self, p: Publication) -> Any:
        return self.create_publisher(
            message_class(p.type), resolved(self, p.topic), publisher_qos(p.latched)
        )

    def _publish(self, p: Publication) -> None:
        self._outs[p.topic].publish(message_of(p.type, p.fields))


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""
    return run(LogNode)
