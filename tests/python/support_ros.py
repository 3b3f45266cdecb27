# SPDX-License-Identifier: Apache-2.0
"""Messages as rospy and rclpy make them, of the fields that `encode` returns; no ROS needed."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

from locfuse.io.rosbag.encode import Fields, Publication
from locfuse.types import NANOSECONDS

TIMES = {"ros1": ("secs", "nsecs"), "ros2": ("sec", "nanosec")}


def message(given: Publication | Fields, ros: str = "ros2", **changes: Any) -> Any:
    """Return a message of some fields; a change is named by its path, as ``pose__position``."""
    made = _filled(given.fields if isinstance(given, Publication) else given, ros)
    for path, value in changes.items():
        *parents, name = path.split("__")
        holder = made
        for parent in parents:
            holder = getattr(holder, parent)
        if isinstance(value, Mapping):
            value = _filled(value, ros)
        setattr(holder, name, value)
    return made


def _filled(fields: Any, ros: str) -> Any:
    if isinstance(fields, Mapping):
        if set(fields) == {"ns"}:
            whole, rest = divmod(fields["ns"], NANOSECONDS)
            return SimpleNamespace(**dict(zip(TIMES[ros], (whole, rest), strict=True)))
        return SimpleNamespace(**{key: _filled(value, ros) for key, value in fields.items()})
    if isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        return [_filled(one, ros) for one in fields]
    return fields
