# SPDX-License-Identifier: Apache-2.0
"""Soak test: drive for minutes at 3,000 messages/s and print memory and losses.

In the environment of ``./dev test-ros``: ``python tests/ros/soak_ros2.py MINUTES``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from namespace import is_isolated
from support_load import FastRobot, lap
from support_ros2 import peer_in

BETWEEN_S = 60.0


def main(minutes: float) -> None:
    """Print a line per minute."""
    if not is_isolated():
        sys.exit("run this in an isolated network: python tests/ros/namespace.py python ...")
    with tempfile.TemporaryDirectory() as folder, peer_in(Path(folder)) as peer:
        robot = FastRobot(peer, lap(ranges={"rate_hz": 120}, laser={"rate_hz": 20}), singly=True)
        process = robot.start_with_world("localize")
        print(
            "minutes  wall_s  sent  received  lost  memory_MB  work_median_ms  work_99_ms",
            flush=True,
        )
        took = 0.0
        for minute in range(1, round(minutes) + 1):
            took += robot.drive(BETWEEN_S)
            counted = robot.counted()
            received = sum(counted[topic][0] for topic in robot.sent)
            lost = sum(counted[topic][1] for topic in robot.sent)
            topics = robot.statuses["locfuse: topics"]
            print(f"{minute:7d}  {took:6.0f}  {sum(robot.sent.values())}  {received}  {lost}  "
                  f"{process.memory_mb():.1f}  {topics['work [ms] median']}  "
                  f"{topics['work [ms] 99 %']}", flush=True)  # fmt: skip
        robot.settle()
        print("neither received nor reported lost:", robot.unaccounted())
        print(process.log()[-3000:])


if __name__ == "__main__":
    main(float(sys.argv[1]))
