# SPDX-License-Identifier: Apache-2.0
"""Latency of poses and losses at high message rates.

The assertions hold on a shared machine; the printed figures are for a quiet one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support_load import FastRobot, lap
from support_ros2 import Peer, peer_in

ECHO = Path(__file__).with_name("echo_ros2.py")


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    with peer_in(tmp_path) as made:
        yield made


def test_a_pose_answers_odometry_within_milliseconds(peer: Peer) -> None:
    robot = FastRobot(peer, lap(ranges={"rate_hz": 10}, laser={"rate_hz": 10}))
    process = robot.start_with_world("localize")
    robot.drive(3.0)
    robot.answers.waited_ms.clear()
    robot.drive(12.0)
    node = robot.answers.percentiles()
    work = {
        k: float(v) for k, v in robot.statuses["locfuse: topics"].items() if k.startswith("work")
    }
    process.end()
    echo = FastRobot(peer, robot.log)
    peer.run("echo", [sys.executable, str(ECHO)])
    peer.wait_for_subscriber("odom")
    peer.spin(1.0)
    echo.drive(12.0)
    bare = echo.answers.percentiles()
    print(f"pose after odometry: median {node[0]:.2f} ms, 99 % {node[1]:.2f} ms; by a node that")
    print(f"does nothing {bare[0]:.2f} and {bare[1]:.2f} ms; {work}")
    assert len(robot.answers.waited_ms) > 1_000
    assert work["work [ms] median"] <= 2.0
    # Otherwise the machine is slow or shared, which does not concern the node.
    if bare[0] <= 1.2 and bare[1] <= 5.0:
        assert node[0] <= 2.0
        assert node[1] <= 10.0


def test_no_message_is_dropped_unreported(peer: Peer) -> None:
    robot = FastRobot(peer, lap())
    process = robot.start_with_world("localize")
    before = process.cpu_s()
    took = robot.drive(15.0)
    used = process.cpu_s() - before
    robot.settle()
    print(f"sent {dict(robot.sent)} in {took:.1f} s, received and lost {robot.counted()}, "
          f"{100 * used / took:.0f} % of a core")  # fmt: skip
    assert min(robot.sent.values()) >= 595
    assert robot.unaccounted() == {"odom": 0, "uwb": 0, "scan": 0}


def test_memory_does_not_grow(peer: Peer) -> None:
    robot = FastRobot(peer, lap(ranges={"rate_hz": 120}, laser={"rate_hz": 20}), singly=True)
    process = robot.start_with_world("localize")
    robot.drive(20.0)
    before = process.memory_mb()
    took = robot.drive(20.0)
    after = process.memory_mb()
    robot.settle()
    rate = sum(robot.sent.values()) / 40.0
    print(f"{rate:.0f} messages/s: {before:.1f} MB, then {after:.1f} MB; received and lost "
          f"{robot.counted()}; 20 s took {took:.1f}")  # fmt: skip
    assert rate > 2_900
    assert robot.unaccounted() == {"odom": 0, "uwb": 0, "scan": 0}
    assert after - before < 3.0
