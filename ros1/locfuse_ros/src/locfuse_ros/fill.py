# SPDX-License-Identifier: Apache-2.0
"""ROS 1 messages from the plain fields of a publication."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import genpy
import roslib.message

from locfuse.types import ConfigError

# Full names of ROS 1's built-in types.
_BUILTIN = {"Header": "std_msgs/Header"}


@cache
def message_class(type_name: str) -> Any:
    """Return the class of a type such as "nav_msgs/Path".

    Raises
    ------
    ConfigError
        If its package is not installed.
    """
    found = roslib.message.get_message_class(type_name)
    if found is None:
        package = type_name.split("/")[0]
        raise ConfigError(
            f"messages of type {type_name} cannot be made: no Python package {package!r}; "
            "install or build it, and source the workspace that holds it"
        )
    return found


def message_of(type_name: str, fields: Mapping[str, Any]) -> Any:
    """Return a message with these fields; stamps are ``{"ns": int}``, the default is zero.

    Raises
    ------
    AttributeError
        If the message has no such field.
    ConfigError
        As `message_class`.

    Examples
    --------
    >>> message_of("std_msgs/Header", {"stamp": {"ns": 1_500_000_000}, "frame_id": "map"}).stamp
    genpy.Time[1500000000]
    """
    return _fill(message_class(type_name)(), fields)


def _fill(message: Any, fields: Mapping[str, Any]) -> Any:
    for name, value in fields.items():
        if isinstance(value, Mapping):
            if "ns" in value:
                setattr(message, name, time_of(int(value["ns"])))
            else:
                _fill(getattr(message, name), value)
        elif isinstance(value, list | tuple) and len(value) and isinstance(value[0], Mapping):
            setattr(message, name, _rows(message, name, value))
        else:
            setattr(message, name, value)
    return message


def _rows(message: Any, name: str, rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    element = message._slot_types[message.__slots__.index(name)].split("[")[0]
    if element == "time":
        return [time_of(int(row["ns"])) for row in rows]
    made = message_class(_BUILTIN.get(element, element))
    return [_fill(made(), row) for row in rows]


def time_of(stamp_ns: int) -> Any:
    """Return a time of ROS 1, whose seconds are unsigned.

    Raises
    ------
    ValueError
        If it is before 1970 or after 2106, the limits of ROS 1.
    """
    if not 0 <= stamp_ns < 2**32 * 1_000_000_000:
        raise ValueError(f"stamp of {stamp_ns} ns does not fit into ROS 1, expected 1970 to 2106")
    return genpy.Time(*divmod(stamp_ns, 1_000_000_000))
