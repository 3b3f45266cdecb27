# SPDX-License-Identifier: Apache-2.0
"""Logs for the tests of ROS 1 and ROS 2."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.io.rosbag.decode import decimal, decimals
from locfuse.types import Log

BETWEEN_NS = 7_000_000


def as_messages_hold_it(log: Log) -> Log:
    """Return a log with scans in float32, as in ROS, and between odometry messages."""
    assert log.laser is not None
    laser = {
        key: decimal(value) if isinstance(value, float) else value
        for key, value in log.laser.items()
    }
    ranges = decimals(log["scans"]["ranges_m"].astype(np.float32))
    # On a robot a scan at the stamp of odometry is processed before the motion that begins there;
    # in a log that motion comes first.
    stamps = log["scans"]["stamp_ns"] + BETWEEN_NS
    scans = {**log["scans"], "ranges_m": ranges, "stamp_ns": stamps}
    return replace(log, laser=laser, tables={**log.tables, "scans": scans})
