# SPDX-License-Identifier: Apache-2.0
"""The node `replay_log`: a log becomes topics, in the order in which its messages arrived."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import rospy

from locfuse.config.load import load_config
from locfuse.config.ros import Ros
from locfuse.config.schema import RunConfig
from locfuse.ros.encode import Publication, transforms
from locfuse.ros.parameters import LARGEST, Parameter, values_of
from locfuse.ros.peers import Arrival, in_order_of_arrival, static_of
from locfuse.run import load_log
from locfuse.types import NANOSECONDS
from locfuse_ros.fill import message_class, message_of, time_of
from locfuse_ros.node import folder_of, run_node

PARAMETERS = (
    Parameter("config", "text", "", None, None, "path of a run's YAML: its log, topics and frames"),
    Parameter("log", "text", "", None, None, "log folder instead of what the YAML names"),
    Parameter("speed", "float", 1.0, 0.0, LARGEST, "times as fast as recorded; 0: as all can"),
    Parameter("clock", "bool", True, None, None, "stamps as recorded, and /clock; else of today"),
    Parameter("loop", "bool", False, None, None, "begin anew at the end: the clock goes back"),
    Parameter("wait_s", "float", 10.0, 0.0, LARGEST, "at most, for somebody who listens [s]"),
)
QUIET_S = 1.0
SETTLE_S = 0.3  # the world is known before the first message comes
CLOCK_NS = 5_000_000  # /clock ticks so often
FIRST_NS = 1000 * NANOSECONDS  # where a log begins that begins at 0: to ROS, 0 is no time


class LogPlayer:
    """Publishes a log."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._speed, self._loop = told["speed"], told["loop"]
        config = load_config(told["config"]) if told["config"] else RunConfig()
        if told["log"]:
            config = config.model_copy(update={"log": told["log"], "simulation": None})
        log = load_log(config, folder_of(told["config"]), config.seed)
        self._arrivals = list(with_transforms(in_order_of_arrival(log, config.ros), config.ros))
        world = static_of(log, config.ros)
        self._shift_ns = self._shift(told["clock"])
        told_topics = {p.topic: p for _, p in self._arrivals} | {p.topic: p for p in world}
        self._publishers = {topic: self._publisher(p) for topic, p in told_topics.items()}
        self._clock = None
        if told["clock"]:
            self._clock = self._publisher(Publication("/clock", "rosgraph_msgs/Clock", {}))
        self._wait(told["wait_s"])
        for publication in world:
            self._publish(publication, 0)
        time.sleep(SETTLE_S)

    def _shift(self, clock: bool) -> int:
        first_ns = self._arrivals[0][0]
        if not clock:
            return time.time_ns() - first_ns
        if first_ns >= NANOSECONDS:
            return 0
        rospy.logwarn(
            f"the log begins at {first_ns / NANOSECONDS:g} s, which is no time to ROS; all stamps "
            f"are {FIRST_NS // NANOSECONDS} s later"
        )
        return FIRST_NS

    @staticmethod
    def _publisher(p: Publication) -> Any:
        with warnings.catch_warnings():
            # Without a queue a subscriber who is slow slows the log down, and loses nothing.
            warnings.simplefilter("ignore", SyntaxWarning)
            return rospy.Publisher(p.topic, message_class(p.type), latch=p.latched, queue_size=None)

    def _wait(self, patience_s: float) -> None:
        """Wait until somebody listens, and for a second nobody more does."""
        end = time.monotonic() + patience_s
        listeners, since = 0, time.monotonic()
        while time.monotonic() < end and not rospy.is_shutdown():
            now = sum(p.get_num_connections() for p in self._publishers.values())
            if now != listeners:
                listeners, since = now, time.monotonic()
            if listeners and time.monotonic() - since >= QUIET_S:
                return
            time.sleep(0.01)

    def _publish(self, p: Publication, shift_ns: int) -> None:
        message = message_of(p.type, later(p.fields, shift_ns))
        self._publishers[p.topic].publish(message)

    def play(self) -> None:
        """Publish all, once or for ever."""
        while not rospy.is_shutdown():
            self._play_once()
            if not self._loop:
                break

    def _play_once(self) -> None:
        first_ns, began = self._arrivals[0][0], time.monotonic_ns()
        now_ns = first_ns
        for arrival_ns, publication in self._arrivals:
            while now_ns < arrival_ns:  # silence: the clock goes on
                now_ns = min(now_ns + CLOCK_NS, arrival_ns)
                if self._speed > 0.0:
                    due_ns = began + int((now_ns - first_ns) / self._speed)
                    time.sleep(max(0, due_ns - time.monotonic_ns()) / NANOSECONDS)
                self._tell_clock(now_ns)
            if rospy.is_shutdown():
                return
            self._publish(publication, self._shift_ns)

    def _tell_clock(self, now_ns: int) -> None:
        if self._clock is not None:
            stamp = time_of(now_ns + self._shift_ns)
            self._clock.publish(message_class("rosgraph_msgs/Clock")(clock=stamp))


def with_transforms(arrivals: Iterable[Arrival], ros: Ros) -> Iterator[Arrival]:
    """Add what drivers of wheels say beside odometry: the transform from odom to the body."""
    for arrival in arrivals:
        yield arrival
        if arrival.publication.topic != ros.topics.odometry:
            continue
        fields = arrival.publication.fields
        pose = fields["pose"]["pose"]
        moved = {"translation": pose["position"], "rotation": pose["orientation"]}
        told = {"header": fields["header"], "child_frame_id": ros.frames.base, "transform": moved}
        yield Arrival(arrival.arrival_ns, transforms([told]))


def later(fields: Any, shift_ns: int) -> Any:
    """Return fields with every stamp later."""
    if isinstance(fields, Mapping):
        if "ns" in fields:
            return {"ns": fields["ns"] + shift_ns}
        return {key: later(value, shift_ns) for key, value in fields.items()}
    if isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        return [later(value, shift_ns) for value in fields]
    return fields


def play(given: Mapping[str, Any]) -> None:
    """Publish a log until it, or the node, ends."""
    player = LogPlayer(values_of(PARAMETERS, given, rospy.get_name()))
    player.play()


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run_node("replay_log", PARAMETERS, play)
