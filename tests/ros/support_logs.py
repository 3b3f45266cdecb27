# SPDX-License-Identifier: Apache-2.0
"""Logs as the tests of either ROS need them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.ros.decode import decimal, decimals
from locfuse.types import Log


def as_messages_hold_it(log: Log) -> Log:
    """Return a log whose scans fit into float32, as every scan of ROS does."""
    assert log.laser is not None
    laser = {
        key: decimal(value) if isinstance(value, float) else value
        for key, value in log.laser.items()
    }
    ranges = decimals(log["scans"]["ranges_m"].astype(np.float32))
    scans = {**log["scans"], "ranges_m": ranges}
    return replace(log, laser=laser, tables={**log.tables, "scans": scans})
