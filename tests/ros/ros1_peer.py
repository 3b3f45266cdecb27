# SPDX-License-Identifier: Apache-2.0
"""ROS 1 for tests: a real roscore, nodes in separate processes, and this process as a peer."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import yaml

from locfuse.config.ros import Ros
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.types import Log

T = TypeVar("T")

PATIENCE_S = 20.0


def wait_for(what: str, found: Callable[[], T], patience_s: float = PATIENCE_S) -> T:
    """Return the first true result; fail with `what` on timeout."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        answer = found()
        if answer:
            return answer
        time.sleep(0.01)
    raise AssertionError(f"{what}: not within {patience_s} s")


class Process:
    """A started program and its output."""

    def __init__(self, command: list[str], log: Path) -> None:
        self.log = log
        with log.open("ab") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=out, start_new_session=True)

    def output(self) -> str:
        """Return its output so far, without colours."""
        return self.log.read_text(errors="replace").replace("\x1b[33m", "").replace("\x1b[0m", "")

    def wait_for_output(self, words: str, patience_s: float = PATIENCE_S) -> str:
        """Return its output once it contains some words."""
        wait_for(f"{words!r} in {self.log}", lambda: words in self.output(), patience_s)
        return self.output()

    def end(self, how: int = signal.SIGINT) -> int:
        """End it and its children; return its exit status."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, how)
            try:
                self.process.wait(10.0)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
        return self.process.wait(10.0)


@contextmanager
def started(command: list[str], log: Path) -> Iterator[Process]:
    """Run a program during a block."""
    process = Process(command, log)
    try:
        yield process
    finally:
        process.end()


@contextmanager
def roscore(folder: Path) -> Iterator[None]:
    """Run a roscore during a block and make this process the node ``/peer``."""
    import rospy

    os.environ |= {
        "ROS_MASTER_URI": "http://127.0.0.1:11311",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder),
        "ROSCONSOLE_FORMAT": "${severity}: ${message}",
    }
    with started(["roscore"], folder / "roscore.log") as core:
        core.wait_for_output("started core service [/rosout]")
        rospy.init_node("peer", disable_signals=True)
        yield
        rospy.signal_shutdown("the tests are over")


@contextmanager
def node(
    package: str,
    program: str,
    log: Path,
    parameters: Mapping[str, Any] | None = None,
    name: str | None = None,
    remap: Mapping[str, str] | None = None,
) -> Iterator[Process]:
    """Run a node during a block, like rosrun, with its own parameters."""
    import rospy

    name = name or program
    if parameters:
        rospy.set_param(f"/{name}", yaml.safe_load(yaml.safe_dump(dict(parameters))))
    remaps = [f"{old}:={new}" for old, new in (remap or {}).items()]
    try:
        with started(["rosrun", package, program, f"__name:={name}", *remaps], log) as process:
            yield process
    finally:
        if rospy.has_param(f"/{name}"):
            rospy.delete_param(f"/{name}")


class Listener:
    """Messages received on a topic, with their time of arrival by this process's clock [s]."""

    def __init__(self, topic: str, kind: Any, publishers: int = 1) -> None:
        import rospy

        self.messages: list[Any] = []
        self.received_s: list[float] = []
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(
            topic, kind, self._receive, tcp_nodelay=True, buff_size=2**24
        )
        connections = self._subscriber.get_num_connections
        wait_for(f"a publisher of {topic}", lambda: connections() >= publishers)

    def _receive(self, message: Any) -> None:
        with self._lock:
            self.received_s.append(time.time())
            self.messages.append(message)

    def wait(self, count: int = 1, patience_s: float = PATIENCE_S) -> list[Any]:
        """Return the messages once there are at least `count`."""
        topic = self._subscriber.resolved_name
        what = f"{count} messages on {topic}"
        wait_for(what, lambda: len(self.messages) >= count, patience_s)
        return list(self.messages)

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()


def connected_publisher(topic: str, kind: Any, listeners: int = 1, latch: bool = False) -> Any:
    """Return a publisher with at least `listeners` subscribers."""
    import rospy

    made = rospy.Publisher(topic, kind, queue_size=1000, latch=latch, tcp_nodelay=True)
    wait_for(f"a subscriber of {topic}", lambda: made.get_num_connections() >= listeners)
    return made


class Robot:
    """Publishes a log on its topics at a given speed.

    Parameters
    ----------
    log : Log
        Shifted by `FIRST_NS`, as stamp 0 is not valid in ROS.
    ros : Ros
    world : bool
        Whether it publishes anchors, map and mounts, latched.
    """

    FIRST_NS = 1000 * 10**9

    def __init__(self, log: Log, ros: Ros, world: bool = True) -> None:
        from rosgraph_msgs.msg import Clock

        self._log, self._ros = log, ros
        self._world = world_of(log, ros) if world else []
        self._publishers: dict[str, Any] = {}
        self._clock = self._publisher("/clock", Clock, latch=False)
        for publication in self._world:
            self.publish(publication)
        self.now_ns = self.FIRST_NS
        self.set_clock(self.now_ns)

    @staticmethod
    def _publisher(topic: str, kind: Any, latch: bool) -> Any:
        import rospy

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # no queue: no message is lost here
            return rospy.Publisher(topic, kind, latch=latch, queue_size=None, tcp_nodelay=True)

    def publish(self, publication: Publication) -> None:
        """Publish a message of a log."""
        from locfuse_ros.fill import message_class, message_of

        if publication.topic not in self._publishers:
            kind = message_class(publication.type)
            self._publishers[publication.topic] = self._publisher(
                publication.topic, kind, publication.latched
            )
        self._publishers[publication.topic].publish(
            message_of(publication.type, publication.fields)
        )

    def publish_message(self, topic: str, message: Any) -> None:
        """Publish a message on a topic that it has already used."""
        self._publishers[topic].publish(message)

    def set_clock(self, now_ns: int) -> None:
        """Set the simulated time."""
        from rosgraph_msgs.msg import Clock

        from locfuse_ros.fill import time_of

        self.now_ns = now_ns
        self._clock.publish(Clock(clock=time_of(now_ns)))

    def meet(self, topics: Sequence[str]) -> None:
        """Wait for a subscriber of each topic."""
        from locfuse_ros.fill import message_class

        kinds = {one.topic: one.type for _, one in in_order_of_arrival(self._log, self._ros)}
        for topic in topics:
            if topic not in self._publishers:
                self._publishers[topic] = self._publisher(
                    topic, message_class(kinds[topic]), latch=False
                )
            wait_for(f"a subscriber of {topic}", self._publishers[topic].get_num_connections)
        time.sleep(0.3)

    def drive(
        self,
        begin_s: float = 0.0,
        end_s: float = math.inf,
        speed: float = 6.0,
        silent: Sequence[str] = (),
        shift_s: float = 0.0,
    ) -> None:
        """Publish arrivals in [begin_s, end_s), except on silent topics."""
        shift_ns = self.FIRST_NS + round(shift_s * 1e9)
        arrivals = [one for one in in_order_of_arrival(self._log, self._ros, shift_ns)
                    if begin_s * 1e9 <= one.arrival_ns - shift_ns < end_s * 1e9
                    and one.publication.topic != "tf"]  # fmt: skip
        began, first = time.monotonic(), None
        for arrival_ns, publication in arrivals:
            first = arrival_ns if first is None else first
            due = began + (arrival_ns - first) / 1e9 / speed
            time.sleep(max(0.0, due - time.monotonic()))
            if arrival_ns != self.now_ns:
                self.set_clock(arrival_ns)
            if publication.topic not in silent:
                self.publish(publication)

    def close(self) -> None:
        """Unregister all publishers."""
        for publisher in (*self._publishers.values(), self._clock):
            publisher.unregister()


@contextmanager
def simulated_time() -> Iterator[None]:
    """Nodes started in this block use /clock."""
    import rospy

    rospy.set_param("/use_sim_time", True)
    try:
        yield
    finally:
        rospy.delete_param("/use_sim_time")
