# SPDX-License-Identifier: Apache-2.0
"""ROS 2 for tests: peers in the process of the test, nodes in separate processes."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from locfuse_ros.qos import publisher_qos
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from locfuse.io.rosbag.encode import Publication
from locfuse_ros.fill import message_class, message_of
from support_process import memory_mb

DOMAINS = itertools.count(1)


class Peer:
    """Publishers, subscribers and service clients around a node.

    Each peer has a separate domain, so that tests do not interfere.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.domain = folder, next(DOMAINS) % 100
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = Node("peer", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[Process] = []
        self._publishers: dict[str, Any] = {}

    def close(self) -> None:
        """End the started processes and shut down."""
        for process in self.processes:
            process.end()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)

    def start(self, node: str, parameters: Mapping[str, Any] | None = None, *more: str) -> Process:
        """Start a node of locfuse_ros in a separate process."""
        arguments = [executable(node), "--ros-args", *more]
        for name, value in (parameters or {}).items():
            arguments += ["-p", f"{name}:={_yaml(value)}"]
        return self.run(node, arguments)

    def run(self, name: str, arguments: list[str]) -> Process:
        """Start any program in the domain of this peer."""
        process = Process(self.folder, name, self.domain, arguments)
        self.processes.append(process)
        return process

    def publisher(self, topic: str, kind: str, profile: QoSProfile) -> Any:
        """Return the publisher of a topic, created once."""
        if topic not in self._publishers:
            name = f"/{topic}" if topic in ("tf", "tf_static", "clock") else topic
            self._publishers[topic] = self.node.create_publisher(
                message_class(kind), name, profile, event_callbacks=PublisherEventCallbacks()
            )
        return self._publishers[topic]

    def publish(self, publication: Publication) -> None:
        """Publish a publication once all subscribers are matched; ROS 2 loses earlier messages."""
        if not publication.latched and publication.topic not in self._publishers:
            self.wait_until_matched(publication.topic, publication.type)
        publisher = self.publisher(
            publication.topic, publication.type, publisher_qos(publication.latched)
        )
        publisher.publish(message_of(publication.type, publication.fields))

    def subscribe(self, topic: str, kind: str, latched: bool = False) -> list[Any]:
        """Return a list to which received messages are appended."""
        received: list[Any] = []
        profile = publisher_qos(latched)
        profile.depth = 10_000
        self.node.create_subscription(message_class(kind), topic, received.append, profile)
        return received

    def spin(self, seconds: float) -> None:
        """Process messages for some time."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=min(left, 0.05))

    def wait(self, what: str, true: Callable[[], object], seconds: float = 60.0) -> None:
        """Spin until a condition holds; fail on timeout or if a process has ended."""
        until = time.monotonic() + seconds
        while not true():
            for process in self.processes:
                process.check()
            if time.monotonic() > until:
                logs = "\n".join(process.log() for process in self.processes)
                raise AssertionError(
                    f"{what}: not within {seconds} s; output of the nodes:\n{logs}"
                )
            self.executor.spin_once(timeout_sec=0.01)

    def wait_for_subscriber(self, *topics: str) -> None:
        """Spin until each topic has a subscriber."""
        for topic in topics:
            name = self.node.resolve_topic_name(topic)
            self.wait(f"a subscriber of {topic}", lambda n=name: self.node.count_subscribers(n))

    def wait_until_matched(self, topic: str, kind: str) -> None:
        """Spin until the publisher of a topic is matched with all its subscribers."""
        publisher = self.publisher(topic, kind, publisher_qos(latched=False))
        name = publisher.topic_name
        self.wait(
            f"matches of all subscribers of {topic}",
            lambda: publisher.get_subscription_count() >= self.node.count_subscribers(name),
        )

    def wait_until_received(self, seconds: float = 5.0) -> None:
        """Wait until all published messages have reached their subscribers."""
        for topic, publisher in self._publishers.items():
            assert publisher.wait_for_all_acked(Duration(seconds=seconds)), topic

    def call(self, service: str, kind: Any, **fields: Any) -> Any:
        """Call a service and return its response."""
        client = self.node.create_client(kind, service)
        self.wait(f"service {service}", client.service_is_ready)
        answer = client.call_async(kind.Request(**fields))
        self.wait(f"answer of {service}", answer.done)
        self.node.destroy_client(client)
        return answer.result()


class Process:
    """A node in a separate process, whose output goes to a file."""

    def __init__(self, folder: Path, name: str, domain: int, arguments: list[str]) -> None:
        self.node, self._ended = name, False
        self._file = folder / f"{name}{time.monotonic_ns()}.log"
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(folder)}
        with self._file.open("wb") as out:
            self.process = subprocess.Popen(
                arguments, stdout=out, stderr=subprocess.STDOUT, env=environment
            )

    def log(self) -> str:
        """Return its output."""
        return self._file.read_text(errors="replace")

    def check(self) -> None:
        """Fail if it ended unexpectedly."""
        code = self.process.poll()
        if code not in (None, 0) and not self._ended:
            self._ended = True
            raise AssertionError(f"{self.node} ended with {code}, output:\n{self.log()}")

    def wait(self, seconds: float = 60.0) -> int:
        """Wait for its end; return its exit status."""
        self._ended = True
        return self.process.wait(seconds)

    def kill(self) -> None:
        """Kill it, like a crash."""
        self._ended = True
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10.0)

    def end(self) -> int:
        """Interrupt it, like launch; return its exit status."""
        self._ended = True
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(10.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(10.0)
        return self.process.returncode

    def works(self) -> bool:
        """Return whether one of its threads is running or runnable."""
        tasks = Path(f"/proc/{self.process.pid}/task").iterdir()
        return any(_state(task / "stat") == "R" for task in tasks)

    def memory_mb(self) -> float:
        """Return its resident memory."""
        return memory_mb(self.process.pid)

    def cpu_s(self) -> float:
        """Return its CPU time."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _state(stat: Path) -> str:
    try:
        return stat.read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):  # a thread that has ended
        return ""


def executable(node: str) -> str:
    """Return the path of a node of locfuse_ros, as ``ros2 run`` finds it."""
    prefixes = os.environ["AMENT_PREFIX_PATH"].split(":")
    prefix = next(p for p in prefixes if p.endswith("locfuse_ros"))
    return str(Path(prefix) / "lib" / "locfuse_ros" / node)


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    return str(value) if not isinstance(value, str) else f"'{value}'"


@contextmanager
def peer_in(folder: Path) -> Iterator[Peer]:
    """Provide a peer during a block."""
    peer = Peer(folder)
    try:
        yield peer
    finally:
        peer.close()


def simulated_time() -> Parameter:
    """Return the parameter that makes a node use /clock."""
    return Parameter("use_sim_time", Parameter.Type.BOOL, True)
