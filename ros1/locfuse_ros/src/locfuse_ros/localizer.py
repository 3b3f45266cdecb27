# SPDX-License-Identifier: Apache-2.0
"""Node `localize`: connects topics to `locfuse.ros.adapter.Adapter`."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from locfuse.config.schema import SOURCES, RunConfig
from locfuse.ros.adapter import Adapter
from locfuse.ros.dropped_messages import SequenceGaps
from locfuse.ros.parameters import Parameter, config_of, folder_of, parameters, values_of
from locfuse_ros.fill import message_class, message_of
from locfuse_ros.node import run_node
from locfuse_ros.subscriptions import subscribe

CONFIG = Parameter("config", "text", "", None, None,
                   "path of the YAML of a run; other parameters override it")  # fmt: skip
ADVICE = (
    "the network or this computer is too slow for them, or queue_size of their publisher too small"
)
TICK_S = 0.1
REPORT_S = 1.0
LOSSES_S = 60.0  # interval of log messages about losses; diagnostics report them at once
WORKED = 5000  # number of messages in the processing times of the diagnostics
QUEUE = 100  # outgoing messages queued for a slow subscriber
SINGLE_PUBLISHER = ("odometry", "scans")  # sources with at most one publisher
SWITCH_S = 0.0005  # Python's default of 5 ms delays messages behind other threads


class Localizer:
    """Passes messages to the adapter one at a time and publishes its results."""

    def __init__(self, adapter: Adapter) -> None:
        self._adapter = adapter
        self._lock = threading.RLock()  # rospy calls from a thread per connection
        self._lines = SequenceGaps(ADVICE)
        self._multiple_publishers: set[str] = set()
        self._work_s: deque[float] = deque(maxlen=WORKED)
        # Advertised before the first message, so that subscribers are connected by then.
        self._publishers = {
            topic: _publisher(topic, kind, latched) for topic, kind, latched in adapter.announced
        }
        self._services = list(self._offer_services())
        self._subscribers = [subscribe(s.topic, self._callback(s)) for s in adapter.subscriptions]

    def run(self) -> None:
        """Tick by the wall clock until shutdown; simulated time may stand still."""
        reported = time.monotonic()
        while not rospy.is_shutdown():
            time.sleep(TICK_S)
            self._handle(self._adapter.tick)
            if time.monotonic() - reported >= REPORT_S:
                reported = time.monotonic()
                self._report()

    def _callback(self, subscription: Any) -> Callable[[str, str, Any], None]:
        source = subscription.source

        def receive(topic: str, publisher: str, message: Any) -> None:
            number = getattr(getattr(message, "header", None), "seq", None)
            with self._lock:
                began = time.perf_counter()
                self._lines.record(topic, publisher, number)
                self._handle(lambda now_ns: self._adapter.on(source, topic, message, now_ns))
                if source in SINGLE_PUBLISHER:
                    self._expect_one_publisher(topic)
                self._work_s.append(time.perf_counter() - began)

        return receive

    def _handle(self, work: Callable[[int], Iterable[Any]]) -> None:
        with self._lock:
            for publication in work(rospy.get_rostime().to_nsec()):
                self._publish(publication)
            problems = self._adapter.problems()
        for problem in problems:
            rospy.logwarn(problem)

    def _publish(self, p: Any) -> None:
        if p.topic not in self._publishers:
            self._publishers[p.topic] = _publisher(p.topic, p.type, p.latched)
        self._publishers[p.topic].publish(message_of(p.type, p.fields))

    def _expect_one_publisher(self, topic: str) -> None:
        publishers = self._lines.publishers(topic)
        if len(publishers) > 1 and topic not in self._multiple_publishers:
            self._multiple_publishers.add(topic)
            rospy.logwarn(
                f"{topic} has {len(publishers)} publishers, {' and '.join(publishers)}, whose "
                "messages are treated as one sensor's; stop all but one, or give each its own topic"
            )

    def _report(self) -> None:
        """Report lost messages in the log and as diagnostics."""
        with self._lock:
            losses = self._lines.new_losses()
            values = [
                {
                    "key": f"{topic} from {publisher}",
                    "value": f"{n.received} received, {n.lost} lost",
                }
                for (topic, publisher), n in self._lines.lines.items()
            ]
            work_ms = 1000.0 * np.array(self._work_s or [0.0])
        values += [
            {"key": f"work_ms_{name}", "value": f"{np.percentile(work_ms, share):.3f}"}
            for name, share in (("median", 50), ("99_percent", 99))
        ]
        if losses:
            rospy.logwarn_throttle(LOSSES_S, "; ".join(losses))
        status = {
            "level": 1 if losses else 0,
            "name": "locfuse: topics",
            "message": losses[0] if losses else "no message was lost since the last report",
            "hardware_id": "locfuse",
            "values": values,
        }
        stamp = {"ns": rospy.get_rostime().to_nsec()}
        fields = {"header": {"stamp": stamp}, "status": [status]}
        self._publishers["diagnostics"].publish(
            message_of("diagnostic_msgs/DiagnosticArray", fields)
        )

    def _offer_services(self) -> Iterator[Any]:
        def calls(work: Callable[[], None], done: str) -> Callable[[Any], Any]:
            def answer(_: Any) -> Any:
                with self._lock:
                    work()
                return TriggerResponse(success=True, message=done)

            return answer

        def switches(source: str) -> Callable[[Any], Any]:
            def answer(request: Any) -> Any:
                with self._lock:
                    self._adapter.enable(source, request.data)
                return SetBoolResponse(True, f"{source} is {'on' if request.data else 'off'}")

            return answer

        reset = calls(self._adapter.reset, "the estimator was reset")
        relocalize = calls(self._adapter.relocalize, "the pose is searched again")
        yield rospy.Service("~reset", Trigger, reset)
        yield rospy.Service("~relocalize", Trigger, relocalize)
        subscribed = {s.source for s in self._adapter.subscriptions}
        for source in (s for s in (*SOURCES, "scans") if s in subscribed):
            yield rospy.Service(f"~enable/{source}", SetBool, switches(source))
        if self._adapter.is_on_earth:
            yield from self._offer_degrees()

    def _offer_degrees(self) -> Iterator[Any]:
        """Offer the services of navsat_transform_node, where their types are installed."""
        try:
            from geographic_msgs.msg import GeoPoint
            from robot_localization import srv
        except ImportError:
            rospy.loginfo("robot_localization is not installed: no fromLL, toLL and datum")
            return

        def from_degrees(request: Any) -> Any:
            at = request.ll_point
            with self._lock:
                x, y = self._adapter.from_degrees(at.latitude, at.longitude)
            return srv.FromLLResponse(Point(x, y, 0.0))

        def to_degrees(request: Any) -> Any:
            at = request.map_point
            with self._lock:
                latitude, longitude = self._adapter.to_degrees(at.x, at.y)
            return srv.ToLLResponse(GeoPoint(latitude, longitude, math.nan))

        def set_datum(request: Any) -> Any:
            with self._lock:
                self._adapter.set_datum(request.geo_pose)
            return srv.SetDatumResponse()

        yield rospy.Service("fromLL", srv.FromLL, from_degrees)
        yield rospy.Service("toLL", srv.ToLL, to_degrees)
        yield rospy.Service("datum", srv.SetDatum, set_datum)


def _publisher(topic: str, type_name: str, latched: bool) -> Any:
    name = f"/{topic}" if topic in ("tf", "diagnostics") else topic  # global by convention
    return rospy.Publisher(name, message_class(type_name), latch=latched, queue_size=QUEUE)


def localize(given: Mapping[str, Any]) -> None:
    """Localize until the node is shut down."""
    sys.setswitchinterval(SWITCH_S)
    name = rospy.get_name()
    path = values_of([CONFIG], {k: v for k, v in given.items() if k == "config"}, name)["config"]
    keys = {k: v for k, v in given.items() if k != "config"}
    config = config_of(keys, path or None, name)
    Localizer(Adapter(config, base=folder_of(path))).run()


def main() -> int:
    """Run the node; return 1 if it cannot start, after logging why."""
    return run_node("locfuse", [CONFIG, *parameters(RunConfig())], localize)
