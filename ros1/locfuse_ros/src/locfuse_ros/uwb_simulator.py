# SPDX-License-Identifier: Apache-2.0
"""The node `simulate_uwb`: the true pose of a robot in, noisy ranges of its tags to anchors out.

As the simulator of ekim2020, section 2.3, which hears ``gazebo/model_states``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rospy

from locfuse.io.log_folder import read_world
from locfuse.ros.decode import UNIT_M, MessageError, RangeRow, heading_of, stamp_ns
from locfuse.ros.encode import uwb_ranges
from locfuse.ros.parameters import LARGEST, Parameter, values_of
from locfuse.ros.peers import uwb_of
from locfuse.types import NANOSECONDS, ConfigError, Log, nearest
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.hear import hear
from locfuse_ros.node import run_node

Pose = tuple[float, float, float, float]  # x, y, z, heading

PARAMETERS = (
    Parameter("world", "text", "", None, None, "folder of anchors.csv and log.yaml with the tags"),
    Parameter("model", "text", "", None, None, "name of the robot where truth tells of several"),
    Parameter("rate_hz", "float", 5.0, 0.01, 1000.0, "epochs per second"),
    Parameter("sigma_relative", "float", 0.015, 0.0, LARGEST, "noise of a range, a share of it"),
    Parameter("sigma_m", "float", 0.0, 0.0, LARGEST, "noise of any range [m], on top of that"),
    Parameter("loss", "float", 0.0, 0.0, 1.0, "share of rangings that fail"),
    Parameter("reach_m", "float", 1000.0, 0.0, LARGEST, "anchors beyond it do not answer [m]"),
    Parameter("format", "text", "ranges", None, None, "UwbRanges or UwbData", ("ranges", "data")),
    Parameter("unit", "text", "m", None, None, "of UwbData", ("m", "mm")),
    Parameter("seed", "int", 0, 0, None, "of the noise: same seed and truth, same ranges"),
)


def true_pose(message: Any, model: str, now_ns: int) -> tuple[int, Pose]:
    """Return the stamp [ns] and the pose (x, y, z, heading) that a message of the truth tells.

    Parameters
    ----------
    message : nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped, or
        gazebo_msgs/ModelStates, which has no stamp
    model : str
        Name of the robot among models.
    now_ns : int
        Stamp of what has none.

    Raises
    ------
    MessageError
        If the message tells no pose, or none of that model.
    """
    if hasattr(message, "name"):
        names = list(message.name)
        if model not in names:
            raise MessageError(f"no model {model!r} in the truth; {nearest(model, names)}")
        stamp, pose = now_ns, message.pose[names.index(model)]
    else:
        try:
            stamp, pose = stamp_ns(message.header.stamp), message.pose
            pose = getattr(pose, "pose", pose)
        except AttributeError as error:
            raise MessageError(f"{type(message).__name__} tells no pose ({error})") from None
    at = pose.position
    numbers = (float(at.x), float(at.y), float(at.z), heading_of(pose.orientation))
    if not np.all(np.isfinite(numbers)):
        raise MessageError(f"the true pose is {numbers}; expected finite numbers")
    return stamp, numbers


class Epochs:
    """Says when the next ranging is due; what runs anew from an earlier stamp begins anew."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(NANOSECONDS / rate_hz)
        self._next_ns: int | None = None
        self._last_ns = 0

    def is_due(self, stamp_ns: int) -> bool:
        """Return whether an epoch begins with this stamp."""
        if self._next_ns is None or stamp_ns < self._last_ns:
            self._next_ns = stamp_ns
        self._last_ns = stamp_ns
        if stamp_ns < self._next_ns:
            return False
        missed = (stamp_ns - self._next_ns) // self._period_ns
        self._next_ns += (missed + 1) * self._period_ns
        return True


class UwbNode:
    """Hears the truth and publishes ranges."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        if not told["world"]:
            raise ConfigError("~world names no folder; expected one with anchors.csv and log.yaml")
        world = read_world(told["world"])
        options = {name: told[name] for name in ("sigma_m", "sigma_relative", "reach_m", "loss")}
        self._uwb = uwb_of(world, sigma_told_m=0.0, seed=told["seed"], **options)
        self._epochs = Epochs(told["rate_hz"])
        self._model = told["model"]
        self._as_data, self._unit_m = told["format"] == "data", UNIT_M[told["unit"]]
        if self._as_data:
            _check_for_data(world)
        kind = "locfuse_msgs/UwbData" if self._as_data else "locfuse_msgs/UwbRanges"
        self._out = rospy.Publisher("uwb", message_class(kind), queue_size=100)
        self._in = hear("ground_truth", self._heard)

    def _heard(self, topic: str, _: str, message: Any) -> None:
        try:
            stamp, pose = true_pose(message, self._model, rospy.get_rostime().to_nsec())
        except MessageError as error:
            rospy.logwarn_throttle(5.0, f"{topic}: {error}")
            return
        if stamp > 0 and self._epochs.is_due(stamp):
            x, y, z, heading = pose
            self._out.publish(self._message(self._uwb.ranges(stamp, x, y, heading, z)))

    def _message(self, rows: list[RangeRow]) -> Any:
        if not self._as_data:
            told = uwb_ranges("", rows)
            return message_of(told.type, told.fields)
        fields = {
            "destination_id": [int(row.anchor) for row in rows],
            "distance": [row.range_m / self._unit_m for row in rows],
            "stamp": [{"ns": row.stamp_ns} for row in rows],
        }
        return message_of("locfuse_msgs/UwbData", fields)


def _check_for_data(world: Log) -> None:
    names = [str(name) for name in world["anchors"]["anchor"]]
    odd = [name for name in names if not name.removeprefix("-").isdecimal()]
    if odd or len(world.tags) > 1:
        what = f"anchor {odd[0]!r}" if odd else f"{len(world.tags)} tags"
        raise ConfigError(f"~format is data, but the world has {what}; UwbData knows anchors by "
                          "whole numbers, and one tag")  # fmt: skip


def simulate(given: Mapping[str, Any]) -> None:
    """Measure ranges until the node is told to end."""
    UwbNode(values_of(PARAMETERS, given, rospy.get_name()))
    rospy.spin()


def main() -> int:
    """Run the node; return 1 if it cannot start, having said why."""
    return run_node("simulate_uwb", PARAMETERS, simulate)
