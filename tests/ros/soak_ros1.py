# SPDX-License-Identifier: Apache-2.0
"""Drive for minutes at 3,000 messages/s; say memory and losses on the way.

Inside what ``./dev test-ros`` makes: ``python tests/ros/soak_ros1.py MINUTES``.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from namespace import is_isolated
from ros1_peer import Ear, node, roscore, wait_for
from support_process import memory_mb
from test_ros1_load import Hall, counts, of_topics, world

BETWEEN_S = 60.0
HZ = {"odom": 100.0, "uwb": 122.0, "scan": 20.0}  # with 24 anchors, each range a message


def drive(minutes: float, folder: Path) -> None:
    """Print a line a minute, and in the end what was neither heard nor told."""
    from diagnostic_msgs.msg import DiagnosticArray

    told = {"config": str(world(folder / "world"))}
    with node("locfuse_ros", "localize", folder / "log.txt", told, "locfuse") as process:
        diagnostics = Ear("/diagnostics", DiagnosticArray)
        hall = Hall(HZ, singly=True)
        began = time.monotonic()
        print(
            "minutes  wall_s  sent  heard  lost  memory_MB  work_median_ms  work_99_ms", flush=True
        )
        for minute in range(1, round(minutes) + 1):
            hall.run(BETWEEN_S)
            hall.odometry_s.clear()
            values = of_topics(diagnostics)
            del diagnostics.messages[:-10], diagnostics.heard_s[:-10]
            heard, lost = (sum(counts(values, topic)[i] for topic in HZ) for i in (0, 1))
            print(f"{minute:7d}  {time.monotonic() - began:6.0f}  {sum(hall.sent.values())}  "
                  f"{heard}  {lost}  {memory_mb(process.process.pid):.1f}  "
                  f"{values['work_ms_median']}  {values['work_ms_99_percent']}", flush=True
                  )  # fmt: skip

        def settled() -> bool:
            """Return whether it adds up: a loss shows by the next message that is heard."""
            for topic in HZ:
                hall.say(topic)
            time.sleep(2.5)
            values = of_topics(diagnostics)
            return all(sum(counts(values, t)) == n for t, n in hall.sent.items())

        wait_for("that all is heard or told to be lost", settled, 60.0)
        print("all that was sent was heard, or told to be lost")
        hall.close()
        diagnostics.close()
        print(process.said()[-3000:])


def main(minutes: float) -> None:
    """Drive beside a roscore of its own."""
    if not is_isolated():
        sys.exit("run this where there is no network: python tests/ros/namespace.py python ...")
    with tempfile.TemporaryDirectory() as folder, roscore(Path(folder)):
        drive(minutes, Path(folder))


if __name__ == "__main__":
    main(float(sys.argv[1]))
