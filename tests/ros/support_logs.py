# SPDX-License-Identifier: Apache-2.0
"""Logs as the tests of either ROS need them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.io.rosbag.decode import decimal, decimals
from locfuse.types import Log

BETWEEN_NS = 7_000_000


def as_messages_hold_it(log: Log) -> Log:
    """Return a log whose scans fit into float32, as every scan of ROS does, between odometry."""
    assert log.laser is not None
    laser = {
        key: decimal(value) if isinstance(value, float) else value
        for key, value in log.laser.items()
    }
    ranges = decimals(log["scans"]["ranges_m"].astype(np.float32))
    # A scan at the very stamp of odometry is weighed before the motion that begins there, which a
    # robot does not know yet, and which a log has before it.
    stamps = log["scans"]["stamp_ns"] + BETWEEN_NS
    scans = {**log["scans"], "ranges_m": ranges, "stamp_ns": stamps}
    return replace(log, laser=laser, tables={**log.tables, "scans": scans})
