# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to topics in whichever of several types their publisher has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

from locfuse_ros.fill import message_class
from locfuse_ros.qos import publisher_mismatch

LOOK_S = 0.1  # interval of `In.look`
AT_ONCE = 8  # maximum messages of a topic processed before other topics and /clock
ABSOLUTE = ("tf", "tf_static", "diagnostics")  # global topics, regardless of the namespace


class Once:
    """Logs each warning once."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._logged: set[str] = set()

    def say(self, sentence: str) -> None:
        """Log a warning unless it was logged before."""
        if sentence not in self._logged:
            self._logged.add(sentence)
            self._node.get_logger().warning(sentence)


class In:
    """Subscription to a topic in the type of its publisher.

    Parameters
    ----------
    node : Node
    topic : str
    types : sequence of str
        Possible types; the first is the default. None: the type of the first publisher.
    qos : QoSProfile
    callback : callable
        Called with a message and its info from rclpy.
    advice : str
        What to do if the publisher has another type.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        types: Sequence[str],
        qos: QoSProfile,
        callback: Callable[[Any, Any], None],
        advice: str,
    ) -> None:
        self.topic = topic
        self._node, self._types, self._qos, self._callback = node, types, qos, callback
        self._advice = advice
        self._name = resolved(node, topic)
        self._kind = types[0] if types else ""
        self._once = Once(node)
        self.publishers = 0
        self._subscription = self._subscribe(self._kind) if types else None

    def look(self) -> None:
        """Without a matched publisher, look for publishers and switch to their type."""
        if self.publishers:
            return
        offered = {
            info.topic_type.replace("/msg/", "/")
            for info in self._node.get_publishers_info_by_topic(self._name)
            if info.node_name != self._node.get_name()
        }
        ours = [kind for kind in self._types or sorted(offered) if kind in offered]
        if ours and self._kind not in offered:
            for kind in ours:
                try:
                    message_class(kind)
                except LookupError as error:
                    self._once.say(f"{self._name}: {error}")
                    continue
                if self._subscription is not None:  # one name has one type
                    self._node.destroy_subscription(self._subscription)
                self._kind, self._subscription = kind, self._subscribe(kind)
                return
        elif offered and not ours:
            expected = " or ".join(self._types[:3])
            self._once.say(
                f"{self._name} has messages of type {', '.join(sorted(offered))}, which "
                f"cannot be used; expected {expected}, or {self._advice}"
            )

    def _subscribe(self, kind: str) -> Any:
        def receive(message: Any, info: Any) -> None:
            self._callback(message, info)
            self._take_more()

        events = SubscriptionEventCallbacks(
            incompatible_qos=self._mismatch, matched=self._match, use_default_callbacks=False
        )
        return self._node.create_subscription(
            message_class(kind), self._name, receive, self._qos, event_callbacks=events
        )

    def _take_more(self) -> None:
        """Take queued messages at once; rclpy polls every topic before each single one."""
        subscription = self._subscription
        for _ in range(AT_ONCE):
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            self._callback(*taken)

    def _match(self, event: Any) -> None:
        self.publishers = event.current_count

    def _mismatch(self, event: Any) -> None:
        if event.total_count:
            self._once.say(publisher_mismatch(self._name, event.last_policy_kind, self._qos))


def resolved(node: Node, topic: str) -> str:
    """Return the full name of a topic with the namespace and remappings of a node."""
    return str(node.resolve_topic_name(f"/{topic}" if topic in ABSOLUTE else topic))
