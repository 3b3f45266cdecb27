# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to any message type, whether or not its package is installed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import rospy
from genpy.dynamic import generate_dynamic

from locfuse.types import ConfigError
from locfuse_ros.fill import message_class


@cache
def class_from_publisher(type_name: str, md5sum: str, definition: str) -> Any:
    """Return the message class of a publisher, from its own definition if that differs from ours.

    So a driver's `uwb_data` with other integer types is decoded without its package.
    """
    try:
        known = message_class(type_name)
    except ConfigError:
        known = None
    if known is not None and known._md5sum == md5sum:
        return known
    return generate_dynamic(type_name, definition)[type_name]


def decoded(raw: Any) -> Any:
    """Return the message of a `rospy.AnyMsg`.

    Raises
    ------
    genpy.DeserializationError, genpy.MsgGenerationException
        If the bytes or the definition of its type are damaged.
    """
    header = raw._connection_header
    made = class_from_publisher(header["type"], header["md5sum"], header["message_definition"])()
    made.deserialize(raw._buff)
    return made


def subscribe(topic: str, callback: Callable[[str, str, Any], None]) -> Any:
    """Subscribe to a topic; every message calls ``callback(topic, publisher, message)``.

    No message is dropped on this side: messages that the node cannot process in time wait in the
    socket, and those that a publisher drops show in the sequence numbers.
    """

    def receive(raw: Any) -> None:
        callback(topic, raw._connection_header["callerid"], decoded(raw))

    # Must exceed any message: otherwise rospy lags permanently after a larger one.
    return rospy.Subscriber(topic, rospy.AnyMsg, receive, buff_size=2**24, tcp_nodelay=True)
