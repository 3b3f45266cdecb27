# SPDX-License-Identifier: Apache-2.0
"""Node `localize`: connects topics to `locfuse.ros.adapter.Adapter`."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from std_srvs.srv import SetBool, Trigger

from locfuse.config.schema import SOURCES
from locfuse.ros.adapter import Adapter, Subscription
from locfuse.ros.dropped_messages import SequenceGaps
from locfuse.types import ConfigError
from locfuse_ros.declare import configure
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.qos import publisher_qos, subscriber_mismatch, subscriber_qos
from locfuse_ros.start import run
from locfuse_ros.subscriptions import LOOK_S, In, Once, resolved

REPORT_S = 1.0
LOSSES_S = 60.0  # interval of log messages about losses; diagnostics report them at once
SINGLE_PUBLISHER = ("odometry", "scans")  # sources with at most one publisher
ADVICE = "the network or this computer is too slow for them, or a queue too small"


class Localizer(Node):
    """Passes messages to the adapter one at a time and publishes its results."""

    def __init__(self) -> None:
        super().__init__("locfuse", automatically_declare_parameters_from_overrides=True)
        config, base = configure(self)
        self._adapter = Adapter(config, base=base)
        self._lines = SequenceGaps(ADVICE)
        self._names: dict[str, str] = {}
        self.once = Once(self)
        self._work: list[float] = []  # [ms] per message since the last report
        # Advertised before the first message, so that subscribers are connected by then.
        self._outs: dict[str, Out] = {}
        for topic, kind, latched in self._adapter.announced:
            self._out(topic, kind, latched)
        self._ins = {s: self._in(s) for s in self._adapter.subscriptions}
        self._offer_services()
        wall = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(LOOK_S, self._tick, clock=wall)
        self.create_timer(REPORT_S, self._report, clock=wall)

    def _in(self, subscription: Subscription) -> In:
        source, topic = subscription.source, subscription.topic

        def receive(message: Any, info: Any) -> None:
            self._receive(source, topic, message, info)

        qos = subscriber_qos(subscription.latched, subscription.queue)
        advice = f"another topic for ros.topics.{source}"
        return In(self, topic, subscription.types, qos, receive, advice)

    def _receive(self, source: str, topic: str, message: Any, info: Any) -> None:
        """Process a message of a topic."""
        # Without a gid, as before Kilted, sequence numbers cannot be assigned to publishers.
        publisher = info.get("publisher_gid", {}).get("data", b"").hex()
        number = info["publication_sequence_number"] if publisher else None
        self._lines.record(topic, publisher, number)
        began = time.perf_counter()
        self._handle(lambda now_ns: self._adapter.on(source, topic, message, now_ns))
        self._work.append(1e3 * (time.perf_counter() - began))

    def _handle(self, work: Callable[[int], Iterable[Any]]) -> None:
        for p in work(self.get_clock().now().nanoseconds):
            self._out(p.topic, p.type, p.latched).publish(p.fields)
        for problem in self._adapter.problems():
            self.get_logger().warning(problem)

    def _out(self, topic: str, kind: str, latched: bool) -> Out:
        if topic not in self._outs:
            self._outs[topic] = Out(self, topic, kind, latched)
        return self._outs[topic]

    def _tick(self) -> None:
        for one in self._ins.values():
            one.look()
        self._handle(self._adapter.tick)

    def _name_of(self, topic: str, publisher: str) -> str:
        """Return the name of the node of a publisher, if discovered."""
        if publisher not in self._names:
            for info in self.get_publishers_info_by_topic(resolved(self, topic)):
                if "UNKNOWN" not in info.node_name:  # not discovered yet
                    namespace = info.node_namespace.rstrip("/")
                    name = f"{namespace}/{info.node_name}"
                    self._names[bytes(info.endpoint_gid).hex()] = name
        return self._names.get(publisher, "an unnamed publisher")

    def _publisher_names(self, topic: str) -> str:
        publishers = self._lines.publishers(topic)
        return " and ".join(self._name_of(topic, publisher) for publisher in publishers)

    def _report(self) -> None:
        """Report lost messages in the log and as diagnostics."""
        losses = self._lines.new_losses(self._name_of)
        if losses:
            self.get_logger().warning("; ".join(losses), throttle_duration_sec=LOSSES_S)
        for subscription, one in self._ins.items():
            if subscription.source in SINGLE_PUBLISHER and one.publishers > 1:
                self.once.say(
                    f"{one.topic} has {one.publishers} publishers, "
                    f"{self._publisher_names(one.topic)}, whose messages are treated as one "
                    "sensor's; stop all but one, or give each its own topic"
                )
        values = [
            {
                "key": f"{topic} from {self._name_of(topic, publisher)}",
                "value": f"{n.received} received, {n.lost} lost",
            }
            for (topic, publisher), n in self._lines.lines.items()
        ]
        values += self._worked()
        status = {
            "level": 1 if losses else 0,
            "name": "locfuse: topics",
            "message": losses[0] if losses else "no message was lost since the last report",
            "hardware_id": "locfuse",
            "values": values,
        }
        stamp = {"ns": self.get_clock().now().nanoseconds}
        out = self._out("diagnostics", "diagnostic_msgs/DiagnosticArray", False)
        out.publish({"header": {"stamp": stamp}, "status": [status]})

    def _worked(self) -> list[dict[str, str]]:
        """Return processing times of the messages of the last second, up to publication."""
        work, self._work = sorted(self._work), []
        if not work:
            return []
        work_ms = {"median": work[len(work) // 2], "99 %": work[len(work) * 99 // 100],
                   "longest": work[-1]}  # fmt: skip
        return [{"key": f"work [ms] {name}", "value": f"{ms:.3f}"} for name, ms in work_ms.items()]

    def _offer_services(self) -> None:
        def calls(work: Callable[[], None], done: str) -> Callable[[Any, Any], Any]:
            def answer(_: Any, response: Any) -> Any:
                work()
                response.success, response.message = True, done
                return response

            return answer

        def switches(source: str) -> Callable[[Any, Any], Any]:
            def answer(request: Any, response: Any) -> Any:
                try:
                    self._adapter.enable(source, request.data)
                except ConfigError as error:
                    response.message = str(error)
                    return response
                response.success = True
                response.message = f"{source} is {'on' if request.data else 'off'}"
                return response

            return answer

        reset = calls(self._adapter.reset, "the estimator was reset")
        relocalize = calls(self._adapter.relocalize, "the pose is searched again")
        self.create_service(Trigger, "~/reset", reset)
        self.create_service(Trigger, "~/relocalize", relocalize)
        subscribed = {one.source for one in self._ins}
        for source in (*SOURCES, "scans"):
            if source in subscribed:
                self.create_service(SetBool, f"~/enable/{source}", switches(source))
        if self._adapter.is_on_earth:
            self._offer_degrees()

    def _offer_degrees(self) -> None:
        """Offer the services of navsat_transform_node, where their types are installed."""
        try:
            from robot_localization.srv import FromLL, SetDatum, ToLL
        except ImportError:
            self.get_logger().info("robot_localization is not installed: no fromLL, toLL and datum")
            return

        def from_degrees(request: Any, response: Any) -> Any:
            at, point = request.ll_point, response.map_point
            point.x, point.y = self._asked(self._adapter.from_degrees, at.latitude, at.longitude)
            return response

        def to_degrees(request: Any, response: Any) -> Any:
            at, point = request.map_point, response.ll_point
            point.latitude, point.longitude = self._asked(self._adapter.to_degrees, at.x, at.y)
            point.altitude = math.nan  # not known
            return response

        def set_datum(request: Any, response: Any) -> Any:
            try:
                self._adapter.set_datum(request.geo_pose)
            except ConfigError as error:  # which such a service cannot answer
                self.get_logger().error(str(error))
            return response

        self.create_service(FromLL, "fromLL", from_degrees)
        self.create_service(ToLL, "toLL", to_degrees)
        self.create_service(SetDatum, "datum", set_datum)

    def _asked(self, question: Callable[[float, float], Any], *given: float) -> Any:
        """Return an answer, or two NaN with an error in the log: such a service cannot refuse."""
        try:
            return question(*given)
        except ConfigError as error:
            self.get_logger().error(str(error))
            return math.nan, math.nan


class Out:
    """Publisher of a topic; if latched, also for subscribers that come later."""

    def __init__(self, node: Localizer, topic: str, kind: str, latched: bool) -> None:
        self._node, self._kind, self._latched = node, kind, latched
        self._name, self._qos = resolved(node, topic), publisher_qos(latched)
        self._last: Any = None
        events = PublisherEventCallbacks(
            incompatible_qos=self._mismatch,
            matched=self._match if latched else None,
            use_default_callbacks=False,
        )
        self._publisher = node.create_publisher(
            message_class(kind), self._name, self._qos, event_callbacks=events
        )

    def publish(self, fields: Any) -> None:
        """Publish a message with these fields."""
        message = message_of(self._kind, fields)
        if self._latched:
            self._last = message
        self._publisher.publish(message)

    def _match(self, event: Any) -> None:
        """Publish again for a late subscriber with volatile durability, such as AMCL."""
        if self._last is None or event.current_count_change <= 0:
            return
        others = self._node.get_subscriptions_info_by_topic(self._name)
        if any(
            info.qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL
            and info.node_name != self._node.get_name()
            for info in others
        ):
            self._publisher.publish(self._last)

    def _mismatch(self, event: Any) -> None:
        if event.total_count:
            self._node.once.say(subscriber_mismatch(self._name, event.last_policy_kind, self._qos))


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""

    def made() -> Localizer:
        node = Localizer()
        gc.freeze()  # spares the collector objects that live as long as the node
        return node

    return run(made)
