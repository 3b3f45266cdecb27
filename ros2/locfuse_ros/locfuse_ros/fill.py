# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages from the plain fields of a publication."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time

NANOSECONDS = 1_000_000_000


@cache
def message_class(type_name: str) -> Any:
    """Return the class of a type such as "nav_msgs/Path" or "nav_msgs/msg/Path".

    Raises
    ------
    LookupError
        If its package is not installed or has no such message.
    """
    package, _, name = type_name.replace("/msg/", "/").partition("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except ImportError:
        raise LookupError(
            f"messages of type {type_name} cannot be made: no Python package {package!r}; "
            "install or build it, and source the workspace that holds it"
        ) from None
    except AttributeError:
        raise LookupError(
            f"the package {package!r} has no message {name!r}; is it of another version?"
        ) from None


def message_of(type_name: str, fields: Mapping[str, Any]) -> Any:
    """Return a message with these fields; stamps are ``{"ns": int}``, the default is zero.

    Raises
    ------
    AttributeError
        If the message has no such field.
    LookupError
        As `message_class`.
    ValueError
        If a stamp is outside the limits of ROS 2.

    Examples
    --------
    >>> message_of("std_msgs/Header", {"stamp": {"ns": 1_500_000_000}, "frame_id": "map"}).stamp
    builtin_interfaces.msg.Time(sec=1, nanosec=500000000)
    """
    return _fill(message_class(type_name)(), fields)


def time_of(stamp_ns: int) -> Time:
    """Return a time of ROS 2, whose seconds are int32.

    Raises
    ------
    ValueError
        If it is before 1901 or after 2038, the limits of ROS 2.
    """
    seconds, rest = divmod(int(stamp_ns), NANOSECONDS)
    if not -(2**31) <= seconds < 2**31:
        raise ValueError(f"stamp of {stamp_ns} ns does not fit into ROS 2, expected 1901 to 2038")
    return Time(sec=seconds, nanosec=rest)


def _fill(message: Any, fields: Mapping[str, Any]) -> Any:
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        if name not in types:
            raise AttributeError(f"{type(message).__name__} has no field {name!r}")
        if isinstance(value, Mapping):
            filled = time_of(value["ns"]) if "ns" in value else _fill(getattr(message, name), value)
            setattr(message, name, filled)
        else:
            setattr(message, name, _value(types[name], value))
    return message


def _value(kind: str, value: Any) -> Any:
    """Return a value for a field of a type such as ``sequence<geometry_msgs/Point>``."""
    if kind == "octet":  # a byte, like the level of diagnostics
        return bytes([value])
    if isinstance(value, np.ndarray):
        return value.tolist() if kind.startswith("sequence<string") else value
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        return value
    if value and isinstance(value[0], Mapping):
        element = kind.partition("<")[2].partition(">")[0].partition(",")[0]
        return [_element(element, one) for one in value]
    return list(value)


def _element(kind: str, fields: Mapping[str, Any]) -> Any:
    return time_of(fields["ns"]) if "ns" in fields else _fill(message_class(kind)(), fields)
