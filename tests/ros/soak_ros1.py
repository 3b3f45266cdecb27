# SPDX-License-Identifier: Apache-2.0
"""Soak test: drive for minutes at 3,000 messages/s and print memory and losses.

In the environment of ``./dev test-ros``: ``python tests/ros/soak_ros1.py MINUTES``.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from namespace import is_isolated
from ros1_peer import Listener, node, roscore, wait_for
from support_process import memory_mb
from test_ros1_load import Hall, counts, of_topics, world

BETWEEN_S = 60.0
HZ = {"odom": 100.0, "uwb": 122.0, "scan": 20.0}  # with 24 anchors, each range a message


def drive(minutes: float, folder: Path) -> None:
    """Print a line per minute, and in the end the messages not accounted for."""
    from diagnostic_msgs.msg import DiagnosticArray

    parameters = {"config": str(world(folder / "world"))}
    with node("locfuse_ros", "localize", folder / "log.txt", parameters, "locfuse") as process:
        diagnostics = Listener("/diagnostics", DiagnosticArray)
        hall = Hall(HZ, singly=True)
        began = time.monotonic()
        print(
            "minutes  wall_s  sent  received  lost  memory_MB  work_median_ms  work_99_ms",
            flush=True,
        )
        for minute in range(1, round(minutes) + 1):
            hall.run(BETWEEN_S)
            hall.odometry_s.clear()
            values = of_topics(diagnostics)
            del diagnostics.messages[:-10], diagnostics.received_s[:-10]
            received, lost = (sum(counts(values, topic)[i] for topic in HZ) for i in (0, 1))
            print(f"{minute:7d}  {time.monotonic() - began:6.0f}  {sum(hall.sent.values())}  "
                  f"{received}  {lost}  {memory_mb(process.process.pid):.1f}  "
                  f"{values['work_ms_median']}  {values['work_ms_99_percent']}", flush=True
                  )  # fmt: skip

        def settled() -> bool:
            """Return whether all messages are accounted for: the next message reveals a loss."""
            for topic in HZ:
                hall.publish(topic)
            time.sleep(2.5)
            values = of_topics(diagnostics)
            return all(sum(counts(values, t)) == n for t, n in hall.sent.items())

        wait_for("all messages received or reported lost", settled, 60.0)
        print("all messages were received or reported lost")
        hall.close()
        diagnostics.close()
        print(process.output()[-3000:])


def main(minutes: float) -> None:
    """Drive with a separate roscore."""
    if not is_isolated():
        sys.exit("run this in an isolated network: python tests/ros/namespace.py python ...")
    with tempfile.TemporaryDirectory() as folder, roscore(Path(folder)):
        drive(minutes, Path(folder))


if __name__ == "__main__":
    main(float(sys.argv[1]))
