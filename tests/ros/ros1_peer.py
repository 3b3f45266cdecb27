# SPDX-License-Identifier: Apache-2.0
"""A ROS 1 for tests: a real roscore, nodes as processes of their own, and this process a peer."""

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
from locfuse.ros.log_player import in_order_of_arrival, later, static_of
from locfuse.types import Log

T = TypeVar("T")

PATIENCE_S = 20.0


def wait_for(what: str, found: Callable[[], T], patience_s: float = PATIENCE_S) -> T:
    """Return the first true answer; fail with `what` if none comes in time."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        answer = found()
        if answer:
            return answer
        time.sleep(0.01)
    raise AssertionError(f"{what}: not within {patience_s} s")


class Process:
    """A program that was started, what it said, and its end."""

    def __init__(self, command: list[str], log: Path) -> None:
        self.log = log
        with log.open("ab") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=out, start_new_session=True)

    def said(self) -> str:
        """Return all it said so far, without colours."""
        return self.log.read_text(errors="replace").replace("\x1b[33m", "").replace("\x1b[0m", "")

    def wait_until_said(self, words: str, patience_s: float = PATIENCE_S) -> str:
        """Return what it said once that holds some words."""
        wait_for(f"{words!r} in {self.log}", lambda: words in self.said(), patience_s)
        return self.said()

    def end(self, how: int = signal.SIGINT) -> int:
        """Return its exit status, having told it and all it started to end."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, how)
            try:
                self.process.wait(10.0)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
        return self.process.wait(10.0)


@contextmanager
def started(command: list[str], log: Path) -> Iterator[Process]:
    """Run a program for the time of a block."""
    process = Process(command, log)
    try:
        yield process
    finally:
        process.end()


@contextmanager
def roscore(folder: Path) -> Iterator[None]:
    """Run a roscore for the time of a block, and make this process the node ``/peer`` beside it."""
    import rospy

    os.environ |= {
        "ROS_MASTER_URI": "http://127.0.0.1:11311",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(folder),
        "ROSCONSOLE_FORMAT": "${severity}: ${message}",
    }
    with started(["roscore"], folder / "roscore.log") as core:
        core.wait_until_said("started core service [/rosout]")
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
    """Run a node for the time of a block, as rosrun does, with parameters of its own."""
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


class Ear:
    """Messages heard on a topic, with when they came by this process's clock [s]."""

    def __init__(self, topic: str, kind: Any, speakers: int = 1) -> None:
        import rospy

        self.messages: list[Any] = []
        self.heard_s: list[float] = []
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(
            topic, kind, self._take, tcp_nodelay=True, buff_size=2**24
        )
        heard = self._subscriber.get_num_connections
        wait_for(f"a publisher of {topic}", lambda: heard() >= speakers)

    def _take(self, message: Any) -> None:
        with self._lock:
            self.heard_s.append(time.time())
            self.messages.append(message)

    def wait(self, count: int = 1, patience_s: float = PATIENCE_S) -> list[Any]:
        """Return at least so many messages."""
        topic = self._subscriber.resolved_name
        what = f"{count} messages on {topic}"
        wait_for(what, lambda: len(self.messages) >= count, patience_s)
        return list(self.messages)

    def close(self) -> None:
        """Hear no more."""
        self._subscriber.unregister()


def mouth(topic: str, kind: Any, listeners: int = 1, latch: bool = False) -> Any:
    """Return a publisher that somebody listens to."""
    import rospy

    made = rospy.Publisher(topic, kind, queue_size=1000, latch=latch, tcp_nodelay=True)
    wait_for(f"a subscriber of {topic}", lambda: made.get_num_connections() >= listeners)
    return made


class Robot:
    """Says on its topics what a log holds, as fast as it is told to.

    Parameters
    ----------
    log : Log
        Shifted by `FIRST_NS` if it begins at 0, which is no time to ROS.
    ros : Ros
    world : bool
        Whether it says, latched, where anchors, map and mounts are.
    """

    FIRST_NS = 1000 * 10**9

    def __init__(self, log: Log, ros: Ros, world: bool = True) -> None:
        from rosgraph_msgs.msg import Clock

        self.arrivals = list(in_order_of_arrival(log, ros))
        self._world = static_of(log, ros) if world else []
        self._mouths: dict[str, Any] = {}
        self._clock = self._mouth("/clock", Clock, latch=False)
        for told in self._world:
            self.say(told, 0)
        self.now_ns = self.FIRST_NS
        self.tell_clock(self.now_ns)

    @staticmethod
    def _mouth(topic: str, kind: Any, latch: bool) -> Any:
        import rospy

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # no queue: nothing is lost here
            return rospy.Publisher(topic, kind, latch=latch, queue_size=None, tcp_nodelay=True)

    def say(self, told: Publication, shift_ns: int = FIRST_NS) -> None:
        """Publish what a log holds, later by so much."""
        from locfuse_ros.fill import message_class, message_of

        if told.topic not in self._mouths:
            kind = message_class(told.type)
            self._mouths[told.topic] = self._mouth(told.topic, kind, told.latched)
        self._mouths[told.topic].publish(message_of(told.type, later(told, shift_ns).fields))

    def say_message(self, topic: str, message: Any) -> None:
        """Publish a message on a topic on which it has spoken."""
        self._mouths[topic].publish(message)

    def tell_clock(self, now_ns: int) -> None:
        """Let simulated time be that."""
        from rosgraph_msgs.msg import Clock

        from locfuse_ros.fill import time_of

        self.now_ns = now_ns
        self._clock.publish(Clock(clock=time_of(now_ns)))

    def meet(self, topics: Sequence[str]) -> None:
        """Wait until somebody listens to each topic."""
        from locfuse_ros.fill import message_class

        kinds = {told.topic: told.type for _, told in self.arrivals}
        for topic in topics:
            if topic not in self._mouths:
                self._mouths[topic] = self._mouth(topic, message_class(kinds[topic]), latch=False)
            wait_for(f"a subscriber of {topic}", self._mouths[topic].get_num_connections)
        time.sleep(0.3)

    def drive(
        self,
        begin_s: float = 0.0,
        end_s: float = math.inf,
        speed: float = 6.0,
        silent: Sequence[str] = (),
        shift_s: float = 0.0,
    ) -> None:
        """Say what arrives in [begin_s, end_s), but for topics that are silent."""
        shift_ns = self.FIRST_NS + round(shift_s * 1e9)
        began, first = time.monotonic(), None
        for arrival_ns, told in self.arrivals:
            if not begin_s * 1e9 <= arrival_ns < end_s * 1e9:
                continue
            first = arrival_ns if first is None else first
            due = began + (arrival_ns - first) / 1e9 / speed
            time.sleep(max(0.0, due - time.monotonic()))
            if arrival_ns + shift_ns != self.now_ns:
                self.tell_clock(arrival_ns + shift_ns)
            if told.topic not in silent:
                self.say(told, shift_ns)

    def close(self) -> None:
        """Say no more."""
        for mouth_of in (*self._mouths.values(), self._clock):
            mouth_of.unregister()


@contextmanager
def simulated_time() -> Iterator[None]:
    """Nodes that are started in this block go by /clock."""
    import rospy

    rospy.set_param("/use_sim_time", True)
    try:
        yield
    finally:
        rospy.delete_param("/use_sim_time")
