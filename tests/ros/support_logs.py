# SPDX-License-Identifier: Apache-2.0
"""Logs for the tests of ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from locfuse.io.rosbag.decode import decimal, decimals
from locfuse.types import Log

BETWEEN_NS = 7_000_000
HALF: Mapping[str, Any] = {"field_of_view_deg": 180.0, "beams": 181, "range_max_m": 12.0}
SCANNERS: Mapping[str, Any] = {
    "front": {**HALF, "pose_in_body": [0.2, 0.1, 20]},
    "rear": {**HALF, "pose_in_body": [-0.2, 0, 180], "beams": 121, "mounting": "upside_down"},
}
SCANNER_TOPICS = ("front/scan", "rear/scan")


def as_messages_hold_it(log: Log) -> Log:
    """Return a log with scans in float32, as in ROS, and between odometry messages."""
    scans = log["scans"]
    ranges = decimals(scans["ranges_m"].astype(np.float32).ravel()).reshape(scans["ranges_m"].shape)
    angles = {key: np.array([decimal(value) for value in scans[key]])
              for key in ("angle_min_rad", "angle_increment_rad") if key in scans}  # fmt: skip
    # On a robot a scan at the stamp of odometry is processed before the motion that begins there;
    # in a log that motion comes first.
    stamps = scans["stamp_ns"] + BETWEEN_NS
    table = {**scans, **angles, "ranges_m": ranges, "stamp_ns": stamps}
    return replace(log, laser=log.laser and single(log.laser),
                   lasers={name: single(laser) for name, laser in log.lasers.items()},
                   tables={**log.tables, "scans": table})  # fmt: skip


def single(laser: Mapping[str, Any]) -> dict[str, Any]:
    """Return a geometry in single precision, but for the mount."""
    return {key: decimal(value) if isinstance(value, float) else value
            for key, value in laser.items()}  # fmt: skip
