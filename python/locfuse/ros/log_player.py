# SPDX-License-Identifier: Apache-2.0
"""A log that speaks again: its messages on topics, in the order in which they arrived."""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from locfuse import _core
from locfuse.config.load import load_config
from locfuse.config.ros import Ros
from locfuse.config.schema import RunConfig
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import FixRow, RangeRow, ScanRow, SightingRow
from locfuse.io.rosbag.encode import Publication
from locfuse.ros.parameters import LARGEST, Parameter, folder_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, ConfigError, FloatArray, Log

# Frames of sensors that a log has no names for.
LASER, LANDMARK_SENSOR = "laser", "landmark_sensor"

PARAMETERS = (
    Parameter("config", "text", "", None, None, "path of a run's YAML: its log, topics and frames"),
    Parameter("log", "text", "", None, None, "log folder or bag instead of what the YAML names"),
    Parameter("speed", "float", 1.0, 0.0, LARGEST, "times as fast as recorded; 0: as all can"),
    Parameter("clock", "bool", True, None, None, "stamps as recorded, and /clock; else of today"),
    Parameter("loop", "bool", False, None, None, "begin anew at the end: the clock goes back"),
    Parameter("wait_s", "float", 10.0, 0.0, LARGEST, "at most, for somebody who listens [s]"),
)
QUIET_S = 1.0  # without another listener, after which it begins
SETTLE_S = 0.3  # the world is known before the first message comes
TICK_NS = 5_000_000  # /clock ticks so often in the log's time,
TICK_S = 0.002  # or in real time where that is longer
FIRST_NS = 1000 * NANOSECONDS  # where a log begins that begins at 0: to ROS, 0 is no time


class Step(NamedTuple):
    """What to publish next: `due_s` seconds after the begin, by a clock that shows `clock_ns`.

    Without a publication it is the clock itself.
    """

    due_s: float
    clock_ns: int
    publication: Publication | None


class LogPlayer:
    """Says what is to be published when: the node without its ROS.

    `given` are values of the `PARAMETERS`; `warn` is called with a sentence where stamps are not
    those of the log. `world` is known from the start, latched; `topics` has one of each topic.
    Raises ConfigError or LogError if neither configuration nor log is named, or one cannot be read.
    """

    def __init__(self, given: Mapping[str, Any], warn: Callable[[str], object]) -> None:
        if not (given["config"] or given["log"]):
            raise ConfigError("nothing to play; set log to a log folder, or config to a YAML that "
                              "names one")  # fmt: skip
        config = load_config(given["config"]) if given["config"] else RunConfig()
        if given["log"]:
            config = config.model_copy(update={"log": given["log"], "simulation": None})
        log = load_log(config, folder_of(given["config"]), config.seed)
        self._speed, self._loop = given["speed"], given["loop"]
        self._arrivals = list(with_transforms(in_order_of_arrival(log, config.ros), config.ros))
        if not self._arrivals:
            raise ConfigError("the log has no message that ros.topics has a topic for")
        self.world = static_of(log, config.ros)
        by_topic = {p.topic: p for _, p in self._arrivals} | {p.topic: p for p in self.world}
        self.topics = list(by_topic.values())
        self._shift_ns = self._shift(given["clock"], warn)

    def _shift(self, clock: bool, warn: Callable[[str], object]) -> int:
        first_ns = self._arrivals[0].arrival_ns
        if not clock:
            return time.time_ns() - first_ns
        if first_ns >= NANOSECONDS:
            return 0
        warn(f"the log begins at {first_ns / NANOSECONDS:g} s, which is no time to ROS; all stamps "
             f"are {FIRST_NS // NANOSECONDS} s later")  # fmt: skip
        return FIRST_NS

    def steps(self) -> Iterator[Step]:
        """Yield what to publish: the clock up to a message, then it; once, or for ever."""
        tick_ns = max(TICK_NS, round(self._speed * TICK_S * NANOSECONDS))
        before_s = 0.0
        while True:
            first_ns = now_ns = self._arrivals[0].arrival_ns
            due_s = before_s
            for arrival_ns, publication in self._arrivals:
                while now_ns < arrival_ns:  # silence: the clock goes on
                    now_ns = min(now_ns + tick_ns, arrival_ns)
                    if self._speed > 0.0:
                        due_s = before_s + (now_ns - first_ns) / NANOSECONDS / self._speed
                    yield Step(due_s, now_ns + self._shift_ns, None)
                given = later(publication, self._shift_ns)
                yield Step(due_s, now_ns + self._shift_ns, given)
            if not self._loop:
                return
            before_s = due_s


class Patience:
    """Waits until somebody listens, and for a second nobody more does; but not for ever.

    Examples
    --------
    >>> patience = Patience(10.0, now_s=0.0)
    >>> [patience.is_over(2, now_s=s) for s in (0.1, 0.9, 1.2)]
    [False, False, True]
    """

    def __init__(self, most_s: float, now_s: float) -> None:
        self._end_s = now_s + most_s
        self._listeners, self._since_s = 0, now_s

    def is_over(self, listeners: int, now_s: float) -> bool:
        """Return whether to begin, with as many listeners now."""
        if listeners != self._listeners:
            self._listeners, self._since_s = listeners, now_s
        return now_s >= self._end_s or (listeners > 0 and now_s - self._since_s >= QUIET_S)


class Arrival(NamedTuple):
    """A message of a log, and when it reaches who listens."""

    arrival_ns: int
    publication: Publication


def static_of(log: Log, ros: Ros) -> list[Publication]:
    """Return what a log knows from the start, latched: mounts, anchors, landmarks, map.

    A tag's frame has the name of the tag; those of laser and landmark sensor are called ``laser``
    and ``landmark_sensor``.
    """
    base, map_frame, topics = ros.frames.base, ros.frames.map, ros.topics
    mounts = [encode.transform(0, base, tag, (at[0], at[1], 0.0), at[2])
              for tag, at in log.tags.items()]  # fmt: skip
    for frame, sensor in ((LASER, log.laser), (LANDMARK_SENSOR, log.landmark_sensor)):
        if sensor is not None:
            mounts.append(encode.transform(0, base, frame, tuple(sensor["pose_in_body"])))
    given = [encode.transforms(mounts, static=True)] if mounts else []
    for stem, key, topic in (("anchors", "anchor", topics.anchors),
                             ("landmarks", "landmark", topics.landmarks)):  # fmt: skip
        if stem in log and topic is not None:
            table = log[stem]
            z = table.get("z_m", np.zeros(len(table["x_m"])))
            at = np.column_stack([table["x_m"], table["y_m"], z])
            given.append(encode.named_points(topic, [str(name) for name in table[key]], at,
                                            table.get("radius_m"), map_frame))  # fmt: skip
    if log.grid is not None and topics.map is not None:
        given.append(encode.occupancy_grid(topics.map, log.grid, map_frame))
    return given


def in_order_of_arrival(log: Log, ros: Ros) -> Iterator[Arrival]:
    """Yield the messages of a log as a robot would publish them.

    A message without an arrival of its own arrives at its stamp; of those that arrive at once
    odometry comes first. Increments of odometry are published as the poses they add up to, from
    zero. What has no topic is left out.

    Examples
    --------
    >>> stamp_ns = np.array([0, 10]) + 10**9
    >>> log = Log({"ranges": {"stamp_ns": stamp_ns, "tag": np.array(["t", "t"]),
    ...     "anchor": np.array(["A", "B"]), "range_m": np.array([1.0, 2.0])}})
    >>> [(a.arrival_ns, a.publication.topic) for a in in_order_of_arrival(log, Ros())]
    [(1000000000, 'uwb'), (1000000010, 'uwb')]
    """
    of_source = {
        "odometry": (ros.topics.odometry, _odometry),
        "ranges": (ros.topics.ranges, _ranges),
        "positions": (ros.topics.positions, _positions),
        "poses": (ros.topics.poses, _poses),
        "landmark_sightings": (ros.topics.landmark_sightings, _sightings),
        "scans": (ros.topics.scans, _scans),
        "truth": (ros.topics.truth, _truth),
    }
    lines = [_sorted(given(log, topic, ros)) for stem, (topic, given) in of_source.items()
             if stem in log and topic is not None]  # fmt: skip
    yield from heapq.merge(*lines, key=lambda arrival: arrival.arrival_ns)


def _sorted(arrivals: Iterator[Arrival]) -> list[Arrival]:
    return sorted(arrivals, key=lambda arrival: arrival.arrival_ns)


def _rows(log: Log, stem: str) -> Iterator[tuple[int, int, int]]:
    """Yield row, stamp and arrival."""
    stamps = log[stem]["stamp_ns"].tolist()
    arrivals = log[stem].get("arrival_ns", log[stem]["stamp_ns"]).tolist()
    yield from zip(range(len(stamps)), stamps, arrivals, strict=True)


def _odometry(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table, frames = log["odometry"], ros.frames
    pose, velocity = _core.Pose2(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    left = table.get("v_left_mps")
    for row, stamp, arrival in _rows(log, "odometry"):
        if "dx_m" not in table:
            velocity = (float(table["v_mps"][row]), float(table["omega_radps"][row]),
                        0.0 if left is None else float(left[row]))  # fmt: skip
        elif row > 0:
            pose = pose * _core.Pose2(float(table["dx_m"][row]), float(table["dy_m"][row]),
                                      float(table["dheading_rad"][row]))  # fmt: skip
        given = encode.odometry(topic, stamp, (pose.x, pose.y, pose.heading), velocity, frames.odom,
                               frames.base)  # fmt: skip
        yield Arrival(arrival, given)


def _ranges(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["ranges"]
    sigma = table.get("sigma_m")
    together: list[RangeRow] = []
    when = 0
    for row, stamp, arrival in _rows(log, "ranges"):
        if together and (arrival, stamp) != (when, together[0].stamp_ns):
            yield Arrival(when, encode.uwb_ranges(topic, together))
            together = []
        when = arrival
        together.append(RangeRow(stamp, str(table["tag"][row]), str(table["anchor"][row]),
                                 float(table["range_m"][row]),
                                 None if sigma is None else float(sigma[row]), ""))  # fmt: skip
    if together:
        yield Arrival(when, encode.uwb_ranges(topic, together))


def _positions(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["positions"]
    tag = table.get("tag")
    for row, stamp, arrival in _rows(log, "positions"):
        given = FixRow(stamp, float(table["x_m"][row]), float(table["y_m"][row]),
                      float(table["sigma_m"][row]), "" if tag is None else str(tag[row]),
                      ros.frames.map)  # fmt: skip
        yield Arrival(arrival, encode.tag_position(topic, given))


def _poses(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["poses"]
    for row, stamp, arrival in _rows(log, "poses"):
        xy, heading = float(table["sigma_xy_m"][row]), float(table["sigma_heading_rad"][row])
        pose = (float(table["x_m"][row]), float(table["y_m"][row]),
                float(table["heading_rad"][row]))  # fmt: skip
        given = encode.pose_with_covariance(topic, stamp, pose, _variances(xy, heading),
                                           ros.frames.map)  # fmt: skip
        yield Arrival(arrival, given)


def _variances(xy: float, heading: float) -> FloatArray:
    """Return a covariance (3, 3); of -1, which says that a sigma is not known, the sign stays."""
    return np.diag([math.copysign(xy * xy, xy)] * 2 + [math.copysign(heading * heading, heading)])


def _sightings(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["landmark_sightings"]
    frame = ros.frames.base if log.landmark_sensor is None else LANDMARK_SENSOR
    far, aside = table.get("sigma_range_m"), table.get("sigma_bearing_rad")
    for row, stamp, arrival in _rows(log, "landmark_sightings"):
        given = SightingRow(stamp, str(table["landmark"][row]), float(table["range_m"][row]),
                           float(table["bearing_rad"][row]),
                           None if far is None else float(far[row]),
                           None if aside is None else float(aside[row]), frame)  # fmt: skip
        yield Arrival(arrival, encode.landmark_sightings(topic, [given]))


def _scans(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table, laser = log["scans"], log.laser
    if laser is None:
        return
    bright = table.get("intensities")
    for row, stamp, arrival in _rows(log, "scans"):
        own, beams = log.scan_geometry(row)
        given = ScanRow(stamp, LASER, own["angle_min_rad"], own["angle_increment_rad"],
                       own["range_min_m"], own["range_max_m"], table["ranges_m"][row, :beams],
                       None if bright is None else bright[row, :beams], None,
                       own.get("time_increment_s", 0.0))  # fmt: skip
        yield Arrival(arrival, encode.laser_scan(topic, given))


def _truth(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table, frames = log["truth"], ros.frames
    heading, z = table.get("heading_rad"), table.get("z_m")
    for row, stamp, arrival in _rows(log, "truth"):
        pose = (float(table["x_m"][row]), float(table["y_m"][row]),
                0.0 if heading is None else float(heading[row]))  # fmt: skip
        given = encode.odometry(topic, stamp, pose, (0.0, 0.0), frames.map, frames.base,
                               0.0 if z is None else float(z[row]))  # fmt: skip
        yield Arrival(arrival, given)


def with_transforms(arrivals: Iterable[Arrival], ros: Ros) -> Iterator[Arrival]:
    """Add what drivers of wheels say beside odometry: the transform from odom to the body."""
    for arrival in arrivals:
        yield arrival
        if arrival.publication.topic != ros.topics.odometry:
            continue
        fields = arrival.publication.fields
        pose = fields["pose"]["pose"]
        moved = {"translation": pose["position"], "rotation": pose["orientation"]}
        given = {"header": fields["header"], "child_frame_id": ros.frames.base, "transform": moved}
        yield Arrival(arrival.arrival_ns, encode.transforms([given]))


def later(publication: Publication, shift_ns: int) -> Publication:
    """Return a publication with every stamp later."""
    return replace(publication, fields=_later(publication.fields, shift_ns))


def _later(fields: Any, shift_ns: int) -> Any:
    if isinstance(fields, Mapping):
        if "ns" in fields:
            return {"ns": fields["ns"] + shift_ns}
        return {key: _later(value, shift_ns) for key, value in fields.items()}
    if isinstance(fields, list) and fields and isinstance(fields[0], Mapping):
        return [_later(value, shift_ns) for value in fields]
    return fields
