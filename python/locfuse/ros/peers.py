# SPDX-License-Identifier: Apache-2.0
"""What stands around a node where there is no robot: a UWB system, and a log that speaks again."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from locfuse import _core
from locfuse.config.ros import Ros
from locfuse.ros import encode
from locfuse.ros.decode import FixRow, RangeRow, ScanRow, SightingRow
from locfuse.ros.encode import Publication
from locfuse.types import ConfigError, FloatArray, Log

Point = tuple[float, float, float]

# Frames of sensors that a log has no names for.
LASER, LANDMARK_SENSOR = "laser", "landmark_sensor"


class UwbSimulator:
    """Noisy ranges from a true pose, as a UWB system at known places measures them.

    Parameters
    ----------
    anchors, tags : mapping of name to (x, y, z)
        In the map and in the body, metres.
    sigma_m, sigma_relative : float
        Standard deviation of the noise: hypot(sigma_m, sigma_relative * distance).
    sigma_told_m : float, optional
        Of which ranges tell; 0 where they are to tell none. Else that of the noise.
    offset_m : float
        By how much ranges are too long.
    reach_m : float
        Anchors further away than this do not answer.
    loss : float
        Share of rangings that fail.
    seed : int
        Of noise and failures: the same poses give the same ranges.

    Raises
    ------
    ConfigError
        If there is no anchor or no tag, or a number is out of bounds.

    Examples
    --------
    >>> uwb = UwbSimulator({"A": (3.0, 4.0, 0.0)}, {"tag": (0.0, 0.0, 0.0)}, sigma_m=0.0)
    >>> [row] = uwb.ranges(1_000_000_000, 0.0, 0.0, 0.0)
    >>> row.anchor, row.range_m
    ('A', 5.0)
    """

    def __init__(
        self,
        anchors: Mapping[str, Sequence[float]],
        tags: Mapping[str, Sequence[float]],
        *,
        sigma_m: float = 0.1,
        sigma_relative: float = 0.0,
        sigma_told_m: float | None = None,
        offset_m: float = 0.0,
        reach_m: float = math.inf,
        loss: float = 0.0,
        seed: int = 0,
    ) -> None:
        for name, points in (("anchors", anchors), ("tags", tags)):
            if not points:
                raise ConfigError(f"a UWB system without {name}; the world must say where they are")
        told = sigma_m if sigma_told_m is None else sigma_told_m
        for name, value, high in (("sigma_m", sigma_m, 1e3), ("sigma_told_m", told, 1e3),
                                  ("sigma_relative", sigma_relative, 1.0),
                                  ("reach_m", reach_m, math.inf), ("loss", loss, 1.0)):  # fmt: skip
            if not 0.0 <= value <= high:
                raise ConfigError(f"{name} is {value:g}, expected 0 <= {name} <= {high:g}")
        if not math.isfinite(offset_m):
            raise ConfigError(f"offset_m is {offset_m:g}, expected a finite number")
        self._anchors = {name: np.asarray(at, np.float64) for name, at in anchors.items()}
        self._tags = {name: np.asarray(at, np.float64) for name, at in tags.items()}
        self._sigma, self._relative, self._told = sigma_m, sigma_relative, sigma_told_m
        self._offset = offset_m
        self._reach, self._loss = reach_m, loss
        self._rng = np.random.default_rng(seed)

    def ranges(
        self, stamp_ns: int, x: float, y: float, heading: float, z: float = 0.0
    ) -> list[RangeRow]:
        """Return what is measured at a true pose [m, rad]: one row per tag and anchor in reach."""
        c, s = math.cos(heading), math.sin(heading)
        rows = []
        for tag, mount in self._tags.items():
            at = np.array([x + c * mount[0] - s * mount[1], y + s * mount[0] + c * mount[1],
                           z + mount[2]])  # fmt: skip
            for anchor, there in self._anchors.items():
                distance = float(np.linalg.norm(there - at))
                sigma = math.hypot(self._sigma, self._relative * distance)
                error, fails = self._rng.normal(0.0, sigma), self._rng.random() < self._loss
                if distance <= self._reach and not fails:
                    heard = max(0.0, distance + self._offset + float(error))
                    told = sigma if self._told is None else self._told
                    rows.append(RangeRow(stamp_ns, tag, anchor, heard, told or None, ""))
        return rows


def uwb_of(log: Log, **options: Any) -> UwbSimulator:
    """Return the UWB system of a log's world; options are those of `UwbSimulator`.

    Raises
    ------
    ConfigError
        As `UwbSimulator`.
    """
    anchors: dict[str, Point] = {}
    if "anchors" in log:
        table = log["anchors"]
        places = np.column_stack([table["x_m"], table["y_m"], table["z_m"]]).tolist()
        anchors = dict(zip(map(str, table["anchor"]), map(tuple, places), strict=True))
    return UwbSimulator(anchors, log.tags, **options)


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
    told = [encode.transforms(mounts, static=True)] if mounts else []
    for stem, key, topic in (("anchors", "anchor", topics.anchors),
                             ("landmarks", "landmark", topics.landmarks)):  # fmt: skip
        if stem in log and topic is not None:
            table = log[stem]
            z = table.get("z_m", np.zeros(len(table["x_m"])))
            at = np.column_stack([table["x_m"], table["y_m"], z])
            told.append(encode.named_points(topic, [str(name) for name in table[key]], at,
                                            table.get("radius_m"), map_frame))  # fmt: skip
    if log.grid is not None and topics.map is not None:
        told.append(encode.occupancy_grid(topics.map, log.grid, map_frame))
    return told


def in_order_of_arrival(log: Log, ros: Ros) -> Iterator[Arrival]:
    """Yield the messages of a log as a robot would publish them.

    A message without an arrival of its own arrives at its stamp; of those that arrive at once
    odometry comes first. Increments of odometry are told as the poses that they add up to, from
    zero. What has no topic is left out.

    Parameters
    ----------
    log : Log
    ros : Ros
        Topics and frames.

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
    lines = [_sorted(told(log, topic, ros)) for stem, (topic, told) in of_source.items()
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
    pose, velocity = _core.Pose2(0.0, 0.0, 0.0), (0.0, 0.0)
    for row, stamp, arrival in _rows(log, "odometry"):
        if "dx_m" not in table:
            velocity = float(table["v_mps"][row]), float(table["omega_radps"][row])
        elif row > 0:
            pose = pose * _core.Pose2(float(table["dx_m"][row]), float(table["dy_m"][row]),
                                      float(table["dheading_rad"][row]))  # fmt: skip
        told = encode.odometry(topic, stamp, (pose.x, pose.y, pose.heading), velocity, frames.odom,
                               frames.base)  # fmt: skip
        yield Arrival(arrival, told)


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
        told = FixRow(stamp, float(table["x_m"][row]), float(table["y_m"][row]),
                      float(table["sigma_m"][row]), "" if tag is None else str(tag[row]),
                      ros.frames.map)  # fmt: skip
        yield Arrival(arrival, encode.tag_position(topic, told))


def _poses(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["poses"]
    for row, stamp, arrival in _rows(log, "poses"):
        xy, heading = float(table["sigma_xy_m"][row]), float(table["sigma_heading_rad"][row])
        pose = (float(table["x_m"][row]), float(table["y_m"][row]),
                float(table["heading_rad"][row]))  # fmt: skip
        told = encode.pose_with_covariance(topic, stamp, pose, _variances(xy, heading),
                                           ros.frames.map)  # fmt: skip
        yield Arrival(arrival, told)


def _variances(xy: float, heading: float) -> FloatArray:
    """Return a covariance (3, 3); of -1, which says that a sigma is not known, the sign stays."""
    return np.diag([math.copysign(xy * xy, xy)] * 2 + [math.copysign(heading * heading, heading)])


def _sightings(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table = log["landmark_sightings"]
    frame = ros.frames.base if log.landmark_sensor is None else LANDMARK_SENSOR
    far, aside = table.get("sigma_range_m"), table.get("sigma_bearing_rad")
    for row, stamp, arrival in _rows(log, "landmark_sightings"):
        told = SightingRow(stamp, str(table["landmark"][row]), float(table["range_m"][row]),
                           float(table["bearing_rad"][row]),
                           None if far is None else float(far[row]),
                           None if aside is None else float(aside[row]), frame)  # fmt: skip
        yield Arrival(arrival, encode.landmark_sightings(topic, [told]))


def _scans(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table, laser = log["scans"], log.laser
    if laser is None:
        return
    bright = table.get("intensities")
    for row, stamp, arrival in _rows(log, "scans"):
        told = ScanRow(stamp, LASER, laser["angle_min_rad"], laser["angle_increment_rad"],
                       laser["range_min_m"], laser["range_max_m"], table["ranges_m"][row],
                       None if bright is None else bright[row])  # fmt: skip
        yield Arrival(arrival, encode.laser_scan(topic, told))


def _truth(log: Log, topic: str, ros: Ros) -> Iterator[Arrival]:
    table, frames = log["truth"], ros.frames
    heading, z = table.get("heading_rad"), table.get("z_m")
    for row, stamp, arrival in _rows(log, "truth"):
        pose = (float(table["x_m"][row]), float(table["y_m"][row]),
                0.0 if heading is None else float(heading[row]))  # fmt: skip
        told = encode.odometry(topic, stamp, pose, (0.0, 0.0), frames.map, frames.base,
                               0.0 if z is None else float(z[row]))  # fmt: skip
        yield Arrival(arrival, told)
