# SPDX-License-Identifier: Apache-2.0
"""Topics that are heard in whichever of several types their publisher has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

from locfuse_ros.fill import message_class
from locfuse_ros.qos import does_not_hear

LOOK_S = 0.1  # between two calls of `In.look`
AT_ONCE = 8  # messages of a topic that are taken before the others, and /clock, have their turn
ABSOLUTE = ("tf", "tf_static", "diagnostics")  # topics that everybody shares, whatever namespace


class Once:
    """Warns of what stays as it is, each sentence once."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._told: set[str] = set()

    def say(self, sentence: str) -> None:
        """Warn, if that has not been said."""
        if sentence not in self._told:
            self._told.add(sentence)
            self._node.get_logger().warning(sentence)


class In:
    """A topic that is heard, in the type that its publisher has.

    Parameters
    ----------
    node : Node
    topic : str
    types : sequence of str
        That it may have; the first is the usual one.
    qos : QoSProfile
    heard : callable
        Called with a message and what rclpy says of it.
    advice : str
        What to do if its publisher has another type.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        types: Sequence[str],
        qos: QoSProfile,
        heard: Callable[[Any, Any], None],
        advice: str,
    ) -> None:
        self.topic = topic
        self._node, self._types, self._qos, self._tell = node, types, qos, heard
        self._advice = advice
        self._name = resolved(node, topic)
        self._kind = types[0]
        self._once = Once(node)
        self.publishers = 0
        self._heard = self._subscribe()

    def look(self) -> None:
        """Until somebody is heard, see who else speaks, and in what type."""
        if self.publishers:
            return
        spoken = {
            told.topic_type.replace("/msg/", "/")
            for told in self._node.get_publishers_info_by_topic(self._name)
            if told.node_name != self._node.get_name()
        }
        ours = [kind for kind in self._types if kind in spoken]
        if ours and self._kind not in spoken:
            self._kind = ours[0]
            self._node.destroy_subscription(self._heard)
            self._heard = self._subscribe()
        elif spoken and not ours:
            expected = " or ".join(self._types)
            self._once.say(
                f"{self._name} has messages of type {', '.join(sorted(spoken))}, which are not "
                f"heard; expected {expected}, or {self._advice}"
            )

    def _subscribe(self) -> Any:
        def heard(message: Any, info: Any) -> None:
            self._tell(message, info)
            self._take_more()

        events = SubscriptionEventCallbacks(
            incompatible_qos=self._mismatch, matched=self._match, use_default_callbacks=False
        )
        return self._node.create_subscription(
            message_class(self._kind), self._name, heard, self._qos, event_callbacks=events
        )

    def _take_more(self) -> None:
        """Take what waits behind a message: one by one rclpy asks every topic before each."""
        heard = self._heard
        for _ in range(AT_ONCE):
            with heard.handle:
                taken = heard.handle.take_message(heard.msg_type, heard.raw)
            if taken is None:
                return
            self._tell(*taken)

    def _match(self, event: Any) -> None:
        self.publishers = event.current_count

    def _mismatch(self, event: Any) -> None:
        if event.total_count:
            self._once.say(does_not_hear(self._name, event.last_policy_kind, self._qos))


def resolved(node: Node, topic: str) -> str:
    """Return the full name of a topic, by the namespace and the remappings of a node."""
    return str(node.resolve_topic_name(f"/{topic}" if topic in ABSOLUTE else topic))
