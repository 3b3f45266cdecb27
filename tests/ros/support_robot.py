# SPDX-License-Identifier: Apache-2.0
"""A simulated robot that publishes on topics, and the evaluation of the node's output."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.publications import Arrival, in_order_of_arrival, world_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, Log, Trajectory
from support_ros2 import Peer, Process

EPOCH_NS = 1_000 * NANOSECONDS  # start of simulated time: a stamp of 0 is rejected
BEHIND_NS = NANOSECONDS // 4  # maximum lag of a node behind the log
SILENT_S = 3.0
IN_ORDER_S = 0.005
NOISE = {"range": {"sigma_m": 0.02, "sigma_relative": 0.015}}
HALL = {
    "path": {"shape": "eight"},
    "duration_s": 20.0,
    "poses": None,
    "laser": {"range_max_m": 12.0},
    "map": {"walls": [[2.0, 0.0, 2.0, 3.0], [10.0, 7.0, 7.5, 7.0], [0.0, 6.0, 1.5, 6.0]]},
}
POSE = "geometry_msgs/PoseWithCovarianceStamped"
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
STARTED = {"start": "auto", "estimator": NOISE}


def config_of(simulation: Mapping[str, Any], **more: Any) -> RunConfig:
    """Return the configuration of a run in a hall."""
    return parse_config({"simulation": dict(simulation), **STARTED, **more})


def simulated(seed: int, simulation: Mapping[str, Any] = HALL) -> Log:
    """Return a drive from the epoch on, whose messages arrive at their stamps."""
    log = load_log(config_of(simulation), None, seed)
    return shifted(log, EPOCH_NS)


def shifted(log: Log, by_ns: int) -> Log:
    """Return a log with shifted stamps."""
    moved = {
        stem: {k: v + by_ns if k.endswith("_ns") else v for k, v in table.items()}
        for stem, table in log.tables.items()
    }
    return replace(log, tables=moved)


def between(log: Log, begin_s: float, end_s: float) -> Callable[[Arrival], bool]:
    """Return a predicate: whether an arrival is within a part of a log [s from the epoch]."""
    begin, end = (EPOCH_NS + round(s * NANOSECONDS) for s in (begin_s, end_s))
    return lambda one: begin <= one.arrival_ns < end


class Robot:
    """Replays a log on topics and publishes its time.

    Parameters
    ----------
    peer : Peer
    log : Log
    ros : Ros
    rate : float
        Speed relative to the log.
    in_order : bool
        Whether to wait until each message is processed before the next one: on a busy machine
        topics arrive out of order, and a pose is published without a range that comes after it.
    """

    def __init__(
        self,
        peer: Peer,
        log: Log,
        ros: Ros | None = None,
        rate: float = 1.0,
        *,
        in_order: bool = False,
    ) -> None:
        self.peer, self.log, self.rate, self.in_order = peer, log, rate, in_order
        self.ros = Ros() if ros is None else ros
        self.poses = peer.subscribe("locfuse/pose", POSE)
        self.diagnostics = peer.subscribe("/diagnostics", DIAGNOSTICS)
        self.transforms = peer.subscribe("/tf", "tf2_msgs/TFMessage")
        self.first: dict[str, float] = {}  # first publication of each topic by the wall clock
        self.behind_ns = BEHIND_NS
        self._announced = False
        self._silent_at = 0  # number of poses when the node stopped responding

    def publish_world(self) -> None:
        """Publish mounts, anchors and map, latched."""
        for publication in world_of(self.log, self.ros):
            self.peer.publish(publication)

    def drive(
        self,
        begin_s: float = 0.0,
        end_s: float = 1e9,
        *,
        without: Iterable[str] = (),
        until: Callable[[], object] = lambda: False,
        change: Callable[[Arrival], Arrival] = lambda one: one,
    ) -> None:
        """Publish a part of the log in real time; stop when `until` is true."""
        silent, wanted = set(without), between(self.log, begin_s, end_s)
        self._announce()
        began = time.monotonic()
        start_ns = EPOCH_NS + round(begin_s * NANOSECONDS)
        for one in map(change, in_order_of_arrival(self.log, self.ros)):
            if not wanted(one) or one.publication.topic in {"tf", *silent}:
                continue
            due = began + (one.arrival_ns - start_ns) / NANOSECONDS / self.rate
            self.peer.spin(max(0.0, due - time.monotonic()))
            self.peer.executor.spin_once(timeout_sec=0.0)
            if until():
                return
            self.set_time(one.arrival_ns)
            self.peer.publish(one.publication)
            self.first.setdefault(one.publication.topic, time.monotonic())
            self._keep_pace(one.arrival_ns)

    def _announce(self) -> None:
        """Create the publishers and wait for matches, as earlier messages are lost in ROS 2."""
        if self._announced:
            return
        self._announced = True
        self.set_time(EPOCH_NS)
        kinds = {one.publication.topic: one.publication.type
                 for one in in_order_of_arrival(self.log, self.ros)
                 if one.publication.topic != "tf"}  # fmt: skip
        for topic, kind in {"clock": "rosgraph_msgs/Clock", **kinds}.items():
            self.peer.wait_until_matched(topic, kind)

    def _keep_pace(self, now_ns: int) -> None:
        """Wait for a node that cannot keep up, as on a shared machine.

        A node that does not respond at all, such as a killed one, is not waited for until it does.
        """
        if self.in_order:
            self._wait_until_taken()
        if len(self.poses) == self._silent_at:
            return
        until = time.monotonic() + SILENT_S
        while decode.stamp_ns(self.poses[-1].header.stamp) < now_ns - self.behind_ns:
            if time.monotonic() > until:
                self._silent_at = len(self.poses)
                return
            self.peer.executor.spin_once(timeout_sec=0.01)

    def _wait_until_taken(self) -> None:
        """Wait until the nodes are idle in three consecutive checks."""
        self.peer.wait_until_received()
        idle = 0
        while idle < 3:
            self.peer.spin(IN_ORDER_S)
            idle = 0 if any(one.works() for one in self.peer.processes) else idle + 1

    def set_time(self, now_ns: int) -> None:
        """Publish simulated time."""
        clock = encode.Publication("clock", "rosgraph_msgs/Clock", {"clock": {"ns": now_ns}})
        self.peer.publish(clock)

    def state(self) -> str:
        """Return the last state of the diagnostics."""
        return self.status("locfuse: localization").get("state", "")

    def wait_for_state(self, state: str) -> None:
        """Wait until the diagnostics, which come at 1 Hz, report a state."""
        self.peer.wait(f"the state {state}", lambda: self.state() == state)

    def status(self, name: str) -> dict[str, str]:
        """Return the last values and message of a status; empty if there is none."""
        for array in reversed(self.diagnostics):
            for status in array.status:
                if status.name == name:
                    values = {v.key: v.value for v in status.values}
                    return {**values, "message": status.message}
        return {}

    def estimate(self, begin: int = 0) -> Trajectory:
        """Return the received poses, the last one per stamp."""
        rows = {row.stamp_ns: row for row in map(decode.pose, self.poses[begin:])}
        stamps = sorted(rows)
        return Trajectory(
            np.array(stamps, np.int64),
            np.array([[rows[s].x, rows[s].y] for s in stamps]).reshape(-1, 2),
            np.array([rows[s].heading for s in stamps]),
        )

    def rmse_m(self, begin: int = 0) -> float:
        """Return the position RMSE of the received poses from an index on."""
        table = self.log["truth"]
        truth = Trajectory(
            table["stamp_ns"], np.column_stack([table["x_m"], table["y_m"]]), table["heading_rad"]
        )
        errors = errors_against(self.estimate(begin), truth)
        return float(np.sqrt(np.mean(np.sum(errors.position**2, axis=1))))


def write_config(folder: Path, **keys: Any) -> str:
    """Write a run's YAML; return its path."""
    path = folder / "run.yaml"
    path.write_text(yaml.safe_dump(keys))
    return str(path)


def start_localize(robot: Robot, folder: Path, *topics: str, **keys: Any) -> Process:
    """Start the node and wait for its subscriptions."""
    config = write_config(folder, **{**STARTED, **keys})
    process = robot.peer.start("localize", {"config": config, "use_sim_time": True})
    robot.peer.wait_for_subscriber(*(topics or ("odom", "uwb")))
    return process
