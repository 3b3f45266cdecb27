# SPDX-License-Identifier: Apache-2.0
"""The C++ node `fuse_ranges`: odometry and ranges in, poses out."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.types import wrap_angle
from ros1_peer import Listener, connected_publisher, node

pytestmark = pytest.mark.usefixtures("ros1")

ANCHORS = {"a": [0, 0, 2], "b": [10, 0, 2.5], "c": [5, 8, 2]}
TAGS = {"tag": [0.2, 0.0, 1]}
PARAMETERS = {"anchors": ANCHORS, "tags": TAGS, "sigma_range_m": 0.05, "start": [7.0, 4.0, 90]}
RADIUS_M, SPEED_MPS, STEPS, STEP_S = 2.0, 0.5, 300, 0.1


def truth(t: float) -> tuple[float, float, float]:
    """Return the pose on a circle around (5, 4)."""
    turned = SPEED_MPS / RADIUS_M * t
    return (
        5.0 + RADIUS_M * math.cos(turned),
        4.0 + RADIUS_M * math.sin(turned),
        turned + math.pi / 2.0,
    )


def odometry_at(stamp: Any, t: float) -> Any:
    """Return odometry that starts at the origin and turns 3 % too much."""
    from nav_msgs.msg import Odometry

    turned = 1.03 * SPEED_MPS / RADIUS_M * t
    message = Odometry()
    message.header.stamp, message.header.frame_id, message.child_frame_id = (
        stamp,
        "odom",
        "base_link",
    )
    message.pose.pose.position.x = RADIUS_M * math.sin(turned)
    message.pose.pose.position.y = RADIUS_M * (1.0 - math.cos(turned))
    message.pose.pose.orientation.z = math.sin(0.5 * turned)
    message.pose.pose.orientation.w = math.cos(0.5 * turned)
    return message


def ranges_at(stamp: Any, t: float, rng: np.random.Generator, bias_m: float) -> Any:
    from locfuse_msgs.msg import UwbRange, UwbRanges

    x, y, heading = truth(t)
    tag = np.array([x + 0.2 * math.cos(heading), y + 0.2 * math.sin(heading), 1.0])
    message = UwbRanges()
    message.header.stamp = stamp
    for name, place in ANCHORS.items():
        one = UwbRange(tag="tag", anchor=name)
        one.range = float(np.linalg.norm(np.array(place) - tag) + rng.normal(bias_m, 0.05))
        message.ranges.append(one)
    message.ranges[0].anchor = message.ranges[0].anchor if t > 1.0 else "nobody"
    return message


def drive(bias_m: float, seed: int) -> np.ndarray:
    """Return the errors (n, 3) of the estimates of a drive."""
    import rospy
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from locfuse_msgs.msg import UwbRanges
    from nav_msgs.msg import Odometry

    rng = np.random.default_rng(seed)
    listener = Listener("locfuse/pose", PoseWithCovarianceStamped)
    odometry, ranges = connected_publisher("odom", Odometry), connected_publisher("uwb", UwbRanges)
    begin = 1_700_000_000.0
    try:
        for i in range(STEPS):
            t = i * STEP_S
            stamp = rospy.Time.from_sec(begin + t)
            odometry.publish(odometry_at(stamp, t))
            ranges.publish(ranges_at(stamp, t, rng, bias_m))
            time.sleep(0.002)
        poses = [m for m in listener.wait(STEPS) if m.header.stamp.to_sec() > begin + 5.0]
        return np.array([error_of(m, m.header.stamp.to_sec() - begin) for m in poses])
    finally:
        for end in (listener.close, odometry.unregister, ranges.unregister):
            end()


def error_of(message: Any, t: float) -> list[float]:
    pose, (x, y, heading) = message.pose.pose, truth(t)
    estimated = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
    return [pose.position.x - x, pose.position.y - y, float(wrap_angle(estimated - heading))]


def test_a_drive_is_followed_and_a_bias_of_the_ranges_shows(tmp_path: Path) -> None:
    rmse = {}
    for bias_m in (0.0, 0.5):
        with node("locfuse_ros", "fuse_ranges", tmp_path / "log", PARAMETERS) as process:
            errors = drive(bias_m, seed=1)
            output = process.output()
        rmse[bias_m] = np.sqrt(np.mean(errors**2, axis=0))
        assert "'nobody'" in output
    assert np.hypot(*rmse[0.0][:2]) < 0.06
    assert rmse[0.0][2] < 0.03
    assert np.hypot(*rmse[0.5][:2]) > 0.06


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"anchors": {"a": [1, 2]}}, "~anchors/a: expected a list of 3 numbers"),
        ({"start": None}, "~start: expected [x_m, y_m, heading_deg]"),
        ({"start": [1, 2, "north"]}, "~start: expected a list of numbers"),
        ({"tags": None}, "~tags: expected {NAME: [x, y, z]}"),
    ],
)
def test_parameters_that_are_wrong_end_it_with_a_sentence(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    parameters = {
        key: value for key, value in {**PARAMETERS, **change}.items() if value is not None
    }
    with node("locfuse_ros", "fuse_ranges", tmp_path / "log", parameters) as process:
        assert words in process.wait_for_output(words)
        assert process.process.wait(10.0) == 1
