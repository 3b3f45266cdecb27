# SPDX-License-Identifier: Apache-2.0
"""A UWB system where there is none: true poses in, noisy ranges out.

As the simulator of ekim2020, section 2.3, subscribed to ``gazebo/model_states``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from locfuse.io.log_folder import read_world
from locfuse.io.rosbag.decode import UNIT_M, MessageError, RangeRow, heading_of, stamp_ns
from locfuse.io.rosbag.encode import Publication, uwb_ranges
from locfuse.ros.parameters import LARGEST, Parameter
from locfuse.types import NANOSECONDS, ConfigError, Log, nearest

Pose = tuple[float, float, float, float]  # x, y, z, heading

TOPIC, TRUTH = "uwb", "ground_truth"
TRUTH_TYPES = ("nav_msgs/Odometry", "geometry_msgs/PoseStamped",
               "geometry_msgs/PoseWithCovarianceStamped", "gazebo_msgs/ModelStates")  # fmt: skip
PARAMETERS = (
    Parameter("world", "text", "", None, None, "folder of anchors.csv and log.yaml with the tags"),
    Parameter("model", "text", "", None, None, "name of the robot where truth has several"),
    Parameter("rate_hz", "float", 5.0, 0.01, 1000.0, "epochs per second"),
    Parameter("sigma_relative", "float", 0.015, 0.0, 1.0, "noise of a range, a share of it"),
    Parameter("sigma_m", "float", 0.0, 0.0, 1e3, "noise of any range [m], on top of that"),
    Parameter("offset_m", "float", 0.0, -1e3, 1e3, "by how much ranges are too long [m]"),
    Parameter("loss", "float", 0.0, 0.0, 1.0, "share of rangings that fail"),
    Parameter("reach_m", "float", 1000.0, 0.0, LARGEST, "anchors beyond it do not answer [m]"),
    Parameter("format", "text", "ranges", None, None, "UwbRanges or UwbData", ("ranges", "data")),
    Parameter("unit", "text", "m", None, None, "of UwbData", ("m", "mm")),
    Parameter("seed", "int", 0, 0, 2**63 - 1, "of the noise: same seed and truth, same ranges"),
)


class UwbSimulator:
    """Noisy ranges from a true pose, as a UWB system at known places measures them.

    `anchors` are in the map, `tags` in the body, (x, y, z) in metres. Noise has the standard
    deviation hypot(sigma_m, sigma_relative * distance); ranges are `offset_m` too long, anchors
    beyond `reach_m` do not answer, a share `loss` fails. The same `seed` and poses give the same
    ranges. Raises ConfigError if there is no anchor or no tag.

    Examples
    --------
    >>> uwb = UwbSimulator({"A": (3.0, 4.0, 0.0)}, {"tag": (0.0, 0.0, 0.0)}, sigma_m=0.0)
    >>> [row] = uwb.ranges(1_000_000_000, 0.0, 0.0, 0.0)
    >>> row.anchor, row.range_m
    ('A', 5.0)
    """

    def __init__(
        self,
        anchors: Mapping[str, Sequence[float]],
        tags: Mapping[str, Sequence[float]],
        *,
        sigma_m: float = 0.1,
        sigma_relative: float = 0.0,
        offset_m: float = 0.0,
        reach_m: float = math.inf,
        loss: float = 0.0,
        seed: int = 0,
    ) -> None:
        for name, points in (("anchors", anchors), ("tags", tags)):
            if not points:
                raise ConfigError(f"a UWB system without {name}; the world must say where they are")
        self._anchors = {name: np.asarray(at, np.float64) for name, at in anchors.items()}
        self._tags = {name: np.asarray(at, np.float64) for name, at in tags.items()}
        self._sigma, self._relative = sigma_m, sigma_relative
        self._offset = offset_m
        self._reach, self._loss = reach_m, loss
        self._rng = np.random.default_rng(seed)

    def ranges(
        self, stamp_ns: int, x: float, y: float, heading: float, z: float = 0.0
    ) -> list[RangeRow]:
        """Return what is measured at a true pose [m, rad]: one row per tag and anchor in reach."""
        c, s = math.cos(heading), math.sin(heading)
        rows = []
        for tag, mount in self._tags.items():
            at = np.array([x + c * mount[0] - s * mount[1], y + s * mount[0] + c * mount[1],
                           z + mount[2]])  # fmt: skip
            for anchor, there in self._anchors.items():
                distance = float(np.linalg.norm(there - at))
                sigma = math.hypot(self._sigma, self._relative * distance)
                error, fails = self._rng.normal(0.0, sigma), self._rng.random() < self._loss
                if distance <= self._reach and not fails:
                    received = max(0.0, distance + self._offset + float(error))
                    rows.append(RangeRow(stamp_ns, tag, anchor, received, sigma or None, ""))
        return rows


def true_pose(message: Any, model: str, now_ns: int) -> tuple[int, Pose]:
    """Return the stamp [ns] and the pose (x, y, z, heading) of a message of the truth.

    `message` is a nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped, or a
    gazebo_msgs/ModelStates, in which the robot is `model`; it has no stamp, so `now_ns` is taken.
    Raises MessageError if the message has no pose, or none of that model.
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
            raise MessageError(f"{type(message).__name__} has no pose ({error})") from None
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


class UwbSystem:
    """Receives the truth and returns messages of ranges: the node without its ROS.

    `given` are values of the `PARAMETERS`; `type` is that of its messages. Raises ConfigError or
    LogError if there is no world, or it has no anchors or tags, or others than ``UwbData`` can
    name.
    """

    def __init__(self, given: Mapping[str, Any]) -> None:
        if not given["world"]:
            raise ConfigError("world names no folder; expected one with anchors.csv and log.yaml")
        world = read_world(given["world"])
        keys = ("sigma_m", "sigma_relative", "offset_m", "reach_m", "loss", "seed")
        names = ("anchor", "x_m", "y_m", "z_m")
        columns = [world["anchors"][n].tolist() for n in names] if "anchors" in world else []
        anchors = {name: at for name, *at in zip(*columns, strict=True)}
        self._uwb = UwbSimulator(anchors, world.tags, **{key: given[key] for key in keys})
        self._epochs = Epochs(given["rate_hz"])
        self._model = given["model"]
        self._as_data, self._unit_m = given["format"] == "data", UNIT_M[given["unit"]]
        if self._as_data:
            _check_for_data(world)
        self.type = "locfuse_msgs/UwbData" if self._as_data else "locfuse_msgs/UwbRanges"

    def on(self, message: Any, now_ns: int) -> Publication | None:
        """Take a message of the truth; return ranges if it is time and an anchor answers.

        `now_ns` is the clock of the node. Raises MessageError as `true_pose`.
        """
        stamp, (x, y, z, heading) = true_pose(message, self._model, now_ns)
        if stamp <= 0 or not self._epochs.is_due(stamp):
            return None
        rows = self._uwb.ranges(stamp, x, y, heading, z)
        return self._message(rows) if rows else None

    def _message(self, rows: list[RangeRow]) -> Publication:
        if not self._as_data:
            return uwb_ranges(TOPIC, rows)
        return Publication(TOPIC, self.type, {
            "destination_id": [int(row.anchor) for row in rows],
            "distance": [row.range_m / self._unit_m for row in rows],
            "stamp": [{"ns": row.stamp_ns} for row in rows],
        })  # fmt: skip


def _check_for_data(world: Log) -> None:
    names = [str(name) for name in world["anchors"]["anchor"]]
    odd = [name for name in names if not name.removeprefix("-").isdecimal()]
    if odd or len(world.tags) > 1:
        what = f"anchor {odd[0]!r}" if odd else f"{len(world.tags)} tags"
        raise ConfigError(f"format is data, but the world has {what}; UwbData knows anchors by "
                          "whole numbers, and one tag")  # fmt: skip
