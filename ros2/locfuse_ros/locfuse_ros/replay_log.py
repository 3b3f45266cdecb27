# SPDX-License-Identifier: Apache-2.0
"""The node `replay_log`: a log folder speaks again, in order of arrival, with simulated time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage

from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import read_log
from locfuse.ros.encode import Publication
from locfuse.ros.parameters import Parameter, config_of
from locfuse.ros.peers import Arrival, in_order_of_arrival, static_of
from locfuse_ros.declare import options
from locfuse_ros.fill import message_class, message_of, time_of
from locfuse_ros.qos import to_tell
from locfuse_ros.start import run

PARAMETERS = (
    Parameter("log", "text", "", None, None, "log folder"),
    Parameter("config", "text", "", None, None, "YAML of a run, whose block ros names the topics"),
    Parameter("rate", "float", 1.0, 1e-3, 1e3, "how many times as fast as it was recorded"),
    Parameter("wait_for", "text", "", None, None, "topic that must have a subscriber first"),
    Parameter("clock", "bool", True, None, None, "publish the log's time on /clock"),
)
CLOCK_S = 0.01
LONGEST_S = 0.005  # of work at once, so that services and signals get their turn


class Replayer(Node):
    """Publishes what is due; ends the process when all is said."""

    def __init__(self) -> None:
        super().__init__("log_player", automatically_declare_parameters_from_overrides=True)
        told = options(self, PARAMETERS)
        config = config_of({}, told["config"]) if told["config"] else RunConfig()
        log = read_log(Path(told["log"]))
        self._rate, self._wait_for, self._with_clock = told["rate"], told["wait_for"], told["clock"]
        self._outs: dict[str, Any] = {}
        self._clock = self.create_publisher(ClockMessage, "/clock", QoSProfile(depth=10))
        for publication in static_of(log, config.ros):
            self._publish(publication)
        self._arrivals: Iterator[Arrival] = in_order_of_arrival(log, config.ros)
        self._next = next(self._arrivals, None)
        self._log_ns = 0 if self._next is None else self._next.arrival_ns
        self._began: float | None = None
        self._clocked = 0.0
        self.create_timer(0.001, self._work, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _work(self) -> None:
        if self._began is None:
            if self._wait_for and not self.count_subscribers(self._wait_for):
                return
            self._began = time.monotonic()
        until = time.monotonic() + LONGEST_S
        while self._next is not None and time.monotonic() < until:
            now_ns = self._now_ns()
            if self._next.arrival_ns > now_ns:
                self._tell_time(now_ns)
                return
            self._tell_time(self._next.arrival_ns)
            self._publish(self._next.publication)
            self._next = next(self._arrivals, None)
        if self._next is None:
            self.get_logger().info("the log has ended")
            rclpy.try_shutdown()

    def _now_ns(self) -> int:
        assert self._began is not None
        return self._log_ns + round((time.monotonic() - self._began) * self._rate * 1e9)

    def _tell_time(self, now_ns: int) -> None:
        if self._with_clock and time.monotonic() - self._clocked >= CLOCK_S:
            self._clocked = time.monotonic()
            self._clock.publish(ClockMessage(clock=time_of(now_ns)))

    def _publish(self, told: Publication) -> None:
        if told.topic not in self._outs:
            name = f"/{told.topic}" if told.topic in ("tf", "tf_static") else told.topic
            self._outs[told.topic] = self.create_publisher(
                message_class(told.type), name, to_tell(told.latched)
            )
        self._outs[told.topic].publish(message_of(told.type, told.fields))


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run(Replayer)
