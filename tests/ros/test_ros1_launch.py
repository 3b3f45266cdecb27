# SPDX-License-Identifier: Apache-2.0
"""The launch files: the system of ekim2020 with simulated ranges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag.decode import stamp_ns
from locfuse.run.run import load_log
from ros1_peer import Listener, Robot, simulated_time, started

pytestmark = pytest.mark.usefixtures("ros1")

ROOT = Path(__file__).resolve().parents[2]
SIMULATION = {
    "room_m": [10, 10],
    "map": {"generate": "rooms", "seed": 1},
    "path": {"shape": "roam"},
    "duration_s": 15.0,
    "laser": {},
    "odometry": {"rate_hz": 30},
    "ranges": None,  # from simulate_uwb
    "poses": {"rate_hz": 2},
    "anchors": {"1": [0, 0, 2], "2": [10, 0, 2], "3": [10, 10, 2], "4": [0, 10, 2], "5": [5, 5, 3]},
    "tags": {"tag": [0.1, 0.0, 0.5]},
}


def test_the_system_of_the_paper_starts_by_itself(tmp_path: Path) -> None:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from locfuse_msgs.msg import UwbData

    log = load_log(parse_config({"simulation": SIMULATION}), None, seed=3)
    write_log(log, tmp_path / "world")
    ros = load_config(ROOT / "ros1" / "locfuse_ros" / "config" / "ekim2020.yaml").ros
    topics = ros.topics.model_copy(update={"truth": "ground_truth"})
    robot = Robot(log, ros.model_copy(update={"topics": topics}))
    launch = ["roslaunch", "locfuse_ros", "ekim2020.launch", f"world:={tmp_path / 'world'}",
              "simulation:=true", "truth:=ground_truth"]  # fmt: skip
    try:
        with simulated_time(), started(launch, tmp_path / "launch.log"):
            estimates = Listener("localization_data_topic", PoseWithCovarianceStamped)
            ranges = Listener("uwb_data_topic", UwbData)
            starts = Listener("initialpose", PoseWithCovarianceStamped)
            robot.meet(["odom", "scan", "amcl_pose", "ground_truth"])
            robot.drive(speed=3.0)
            estimates.wait(100)
            for listener in (estimates, ranges, starts):
                listener.close()
    finally:
        robot.close()
    assert len(starts.messages) == 1
    assert 60 <= len(ranges.messages) <= 76  # 5 Hz
    assert list(ranges.messages[0].destination_id) == [1, 2, 3, 4, 5]
    truth = log["truth"]
    rows = {stamp: row for row, stamp in enumerate(truth["stamp_ns"].tolist())}
    errors = []
    for message in estimates.messages:
        stamp = stamp_ns(message.header.stamp) - Robot.FIRST_NS
        if stamp in rows and stamp > 3e9:
            row, at = rows[stamp], message.pose.pose.position
            errors.append(np.hypot(at.x - truth["x_m"][row], at.y - truth["y_m"][row]))
    assert len(errors) > 200
    assert np.sqrt(np.mean(np.square(errors))) < 0.06  # the AMCL of the paper's simulation
