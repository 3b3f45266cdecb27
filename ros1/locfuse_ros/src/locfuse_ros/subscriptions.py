# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that take any type of message, whether its package is installed or not."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import rospy
from genpy.dynamic import generate_dynamic

from locfuse.types import ConfigError
from locfuse_ros.fill import message_class


@cache
def class_told(type_name: str, md5sum: str, definition: str) -> Any:
    """Return the class of what a publisher sends, by its own definition where ours is another.

    A driver's `uwb_data` with other integers is read so, without its package.
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
    made = class_told(header["type"], header["md5sum"], header["message_definition"])()
    made.deserialize(raw._buff)
    return made


def hear(topic: str, heard: Callable[[str, str, Any], None]) -> Any:
    """Subscribe to a topic; ``heard(topic, publisher, message)`` is called with every message.

    Nothing is thrown away on this side: what the node cannot take in time waits in the socket,
    and what a publisher throws away shows in the sequence numbers.
    """

    def take(raw: Any) -> None:
        heard(topic, raw._connection_header["callerid"], decoded(raw))

    # Larger than any message: else rospy falls behind for good after one that was.
    return rospy.Subscriber(topic, rospy.AnyMsg, take, buff_size=2**24, tcp_nodelay=True)
