# SPDX-License-Identifier: Apache-2.0
"""The messages of a log as a robot publishes them: for bags and for the node that replays a log."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, repeat, starmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.ros import Ros, Topics, plain
from locfuse.io.log_folder import FORCES, MESSAGES, RATES
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import FixRow, ImuRow, RangeRow, ScanRow, SightingRow, TruthRow
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.increments import poses_of
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, LogError, wrap_angle

LASER_FRAME, SIGHT_FRAME = "laser", "landmark_sensor"


class Arrival(NamedTuple):
    """A message of a log, and when it reaches who listens."""

    arrival_ns: int
    publication: Publication


@dataclass
class Stream:
    """Publications in order of the times at which they arrive [ns]."""

    times: NDArray[np.int64]
    publications: Iterator[Publication]


def in_order(streams: Sequence[Stream]) -> Iterator[Arrival]:
    """Yield the publications of all streams by time; of one time those of an earlier stream."""
    if not streams:
        return
    times = np.concatenate([stream.times for stream in streams])
    which = np.repeat(np.arange(len(streams)), [len(stream.times) for stream in streams])
    order = np.argsort(times, kind="stable")
    for time_ns, stream in zip(times[order].tolist(), which[order].tolist(), strict=True):
        yield Arrival(time_ns, next(streams[stream].publications))


def in_order_of_arrival(log: Log, ros: Ros, shift_ns: int = 0) -> Iterator[Arrival]:
    """Yield the messages of a log as a robot would publish them, all stamps later by `shift_ns`.

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
    yield from in_order(LogPublications(log, ros, shift_ns).messages())


def world_of(log: Log, ros: Ros) -> list[Publication]:
    """Return what a log knows from the start, latched: mounts, map, anchors, landmarks.

    A tag's frame has the name of the tag; those of laser and landmark sensor are called ``laser``
    and ``landmark_sensor``. What has no topic is left out.
    """
    return list(LogPublications(log, ros).world(0))


class LogPublications:
    """The publications of a log, all stamps later by `shift_ns`.

    What `ros` gives no topic is left out, or with `everything` published where it would be by
    default.
    """

    def __init__(self, log: Log, ros: Ros, shift_ns: int = 0, everything: bool = False) -> None:
        self._log, self._topics, self._shift_ns = log, ros.topics, shift_ns
        self._everything = everything
        self._turned = math.radians(ros.gps_origin[2]) if ros.gps_origin else 0.0  # from east
        self.map, self.odom = plain(ros.frames.map), plain(ros.frames.odom)
        self._base = plain(ros.frames.base)
        taken = {self.map, self.odom, self._base, LASER_FRAME, SIGHT_FRAME, *log.lasers}
        # A tag's frame is its name, if no other frame is called so.
        self._tags = {tag: f"tag/{tag}" if plain(tag) in taken or not plain(tag) else plain(tag)
                      for tag in log.tags}  # fmt: skip
        self.driven = driven(log["odometry"]) if "odometry" in log else {}

    def _topic(self, key: str) -> str | None:
        names = getattr(self._topics, key)
        if names is None and self._everything:
            names = getattr(Topics(), key)
        topic: str | None = names[0] if isinstance(names, list) else names
        return topic

    def messages(self) -> list[Stream]:
        """Return a stream of each table; messages of one time are in this order.

        Raises LogError where scans have no geometry.
        """
        streams: dict[str, Callable[[str, Columns], Iterator[Stream]]] = {
            "imu": self._imu, "odometry": self._odometry, "ranges": self._ranges,
            "positions": self._positions, "poses": self._poses,
            "landmark_sightings": self._sightings, "altitudes": self._altitudes,
            "headings": self._headings,
            "scans": self._scans, "truth": self._truth,
        }  # fmt: skip
        found: list[Stream] = []
        for stem, make in streams.items():
            topic = self._topic(stem)
            if topic is not None and stem in self._log and len(self._log[stem]["stamp_ns"]):
                more = self.driven if stem == "odometry" else {}
                found += make(topic, self._timed(stem, {**self._log[stem], **more}))
        return found

    def _timed(self, stem: str, table: dict[str, NDArray[Any]]) -> Columns:
        """Return a table in the time of ROS and in order of `record_ns`, its arrival there."""
        stamp = table["stamp_ns"] + self._shift_ns
        arrival = table.pop("arrival_ns", None) if stem in MESSAGES else None
        record = stamp if arrival is None else arrival + self._shift_ns
        table |= {"stamp_ns": stamp, "record_ns": record}
        if (np.diff(record) < 0).any():
            order = np.argsort(record, kind="stable")
            table = {name: values[order] for name, values in table.items()}
        return table

    def world(self, stamp_ns: int) -> Iterator[Publication]:
        """Yield mounts, map, anchors and landmarks, latched."""
        if mounts := self._mounts(stamp_ns):
            yield encode.transforms(mounts, static=True)
        topic = self._topic("map")
        if self._log.grid is not None and topic is not None:
            yield encode.occupancy_grid(topic, self._log.grid, self.map, stamp_ns)
        for stem, name in (("anchors", "anchor"), ("landmarks", "landmark")):
            topic = self._topic(stem)
            if stem in self._log and topic is not None:
                table = self._log[stem]
                z = table.get("z_m", np.zeros(len(table["x_m"])))
                yield encode.named_points(topic, table[name].tolist(),
                                          np.column_stack([table["x_m"], table["y_m"], z]),
                                          table.get("radius_m"), self.map, stamp_ns)  # fmt: skip

    def _mounts(self, stamp_ns: int) -> list[encode.Fields]:
        base = self._base
        found = [encode.transform(stamp_ns, base, self._tags[tag], (x, y, 0.0), z)
                 for tag, (x, y, z) in self._log.tags.items()]  # fmt: skip
        for frame, sensor in ((LASER_FRAME, self._log.laser), *self._log.lasers.items(),
                              (SIGHT_FRAME, self._log.landmark_sensor)):  # fmt: skip
            if sensor is not None:
                found.append(encode.transform(stamp_ns, base, frame, sensor["pose_in_body"]))
        return found

    def _odometry(self, topic: str, table: Columns) -> Iterator[Stream]:
        yield Stream(table["record_ns"], (
            encode.odometry(topic, stamp, (x, y, heading), (v, omega, left), self.odom,
                            self._base)
            for stamp, x, y, heading, v, omega, left in
            _rows(table, "x", "y", "heading", "v", "omega", "left")
        ))  # fmt: skip
        poses = np.column_stack([table["x"], table["y"], table["heading"]])
        yield transforms(table["record_ns"], table["stamp_ns"], self.odom, self._base,
                         poses)  # fmt: skip

    def _ranges(self, topic: str, table: Columns) -> Iterator[Stream]:
        table = {"sigma_m": np.zeros(len(table["tag"])), **table}
        rows = (RangeRow._make((*row, self._tags.get(row[1], "")))
                for row in _rows(table, "tag", "anchor", "range_m", "sigma_m"))  # fmt: skip
        yield _together(table["record_ns"], partial(encode.uwb_ranges, topic), rows)

    def _positions(self, topic: str, table: Columns) -> Iterator[Stream]:
        table = {"tag": np.full(len(table["x_m"]), ""), **table}
        yield Stream(table["record_ns"], (
            encode.tag_position(topic, FixRow._make((*row, self.map)))
            for row in _rows(table, "x_m", "y_m", "sigma_m", "tag")
        ))  # fmt: skip

    def _poses(self, topic: str, table: Columns) -> Iterator[Stream]:
        xy, turn = table["sigma_xy_m"], table["sigma_heading_rad"]
        covariance = np.zeros((len(xy), 3, 3))
        variances = np.column_stack([xy * xy, xy * xy, turn * turn])
        variances[xy == -1.0] = -1.0, 0.0, 0.0
        covariance[:, range(3), range(3)] = variances
        poses = np.column_stack([table["x_m"], table["y_m"], table["heading_rad"]])
        yield with_covariance(topic, self.map, table["record_ns"], table["stamp_ns"], poses,
                              covariance)  # fmt: skip

    def _sightings(self, topic: str, table: Columns) -> Iterator[Stream]:
        frame = SIGHT_FRAME if self._log.landmark_sensor else self._base
        none = np.zeros(len(table["stamp_ns"]))
        table = {"sigma_range_m": none, "sigma_bearing_rad": none, "sigma_elevation_rad": none,
                 **table}  # fmt: skip
        names = ("landmark", "range_m", "bearing_rad", "sigma_range_m", "sigma_bearing_rad")
        up = ("elevation_rad", "sigma_elevation_rad") if "elevation_rad" in table else ()
        rows = (SightingRow._make((*row[:6], frame, *(row[6:] or (None, None))))
                for row in _rows(table, *names, *up))  # fmt: skip
        yield _together(table["record_ns"], partial(encode.landmark_sightings, topic), rows)

    def _altitudes(self, topic: str, table: Columns) -> Iterator[Stream]:
        sigmas = table["sigma_m"].tolist() if "sigma_m" in table else repeat(None)
        rows = zip(_rows(table, "height_m"), sigmas, strict=False)
        yield Stream(table["record_ns"], (encode.altitude(topic, stamp, height, sigma, self.map)
                                          for (stamp, height), sigma in rows))  # fmt: skip

    def _headings(self, topic: str, table: Columns) -> Iterator[Stream]:
        """Return headings, and on a topic of their own courses."""
        n = len(table["stamp_ns"])
        table = {"sigma_rad": np.full(n, math.nan), "is_course": np.zeros(n), **table}
        is_course = table["is_course"] != 0
        table["heading_rad"] = wrap_angle(table["heading_rad"] + self._turned)
        for name, make, chosen in ((topic, encode.heading, ~is_course),
                                   (self._topic("courses"), encode.course, is_course)):  # fmt: skip
            if name is not None and chosen.any():
                some = {key: values[chosen] for key, values in table.items()}
                rows = _rows(some, "heading_rad", "sigma_rad")
                messages = starmap(partial(make, name, frame=self._base), rows)
                yield Stream(some["record_ns"], messages)

    def _scans(self, topic: str, table: Columns) -> Iterator[Stream]:
        if not self._log.has_laser:
            raise LogError("the log has scans without laser, so their geometry cannot be published")
        bright = table.get("intensities")
        frames = table["laser"].tolist() if "laser" in table else repeat(LASER_FRAME)
        names, lasers = self._topics.scans, list(self._log.lasers)
        topics: dict[str, str] = {}  # of one topic the frames say which laser it is
        if isinstance(names, list) and len(names) == len(lasers):
            topics = dict(zip(lasers, names, strict=True))

        def scan(row: int, stamp: int, frame: str) -> encode.Publication:
            laser, beams = self._log.scan_geometry(row)
            return encode.laser_scan(topics.get(frame, topic), ScanRow(
                stamp, frame, laser["angle_min_rad"], laser["angle_increment_rad"],
                laser["range_min_m"], laser["range_max_m"], table["ranges_m"][row, :beams],
                None if bright is None else bright[row, :beams], None,
                laser.get("time_increment_s", 0.0),
            ))  # fmt: skip

        rows = zip(range(len(table["stamp_ns"])), table["stamp_ns"].tolist(), frames, strict=False)
        yield Stream(table["record_ns"], starmap(scan, rows))

    def _imu(self, topic: str, table: Columns) -> Iterator[Stream]:
        force = FORCES if FORCES[0] in table else ()
        yield Stream(table["record_ns"], (
            encode.imu(topic, ImuRow(stamp, tuple(row[:3]), tuple(row[3:]) or None), self._base)
            for stamp, *row in _rows(table, *RATES, *force)
        ))  # fmt: skip

    def _truth(self, topic: str, table: Columns) -> Iterator[Stream]:
        n = len(table["x_m"])
        table = {"z_m": np.zeros(n), "heading_rad": np.full(n, math.nan), **table}
        yield Stream(table["stamp_ns"], (
            encode.truth(topic, TruthRow._make((*row, self.map)), self._base)
            for row in _rows(table, "x_m", "y_m", "z_m", "heading_rad")
        ))  # fmt: skip


def with_covariance(
    topic: str, frame: str, times: NDArray[np.int64], stamps: NDArray[np.int64], poses: FloatArray,
    covariances: FloatArray, heights: Iterable[tuple[float, float]] | None = None,
    attitudes: Iterable[tuple[FloatArray, FloatArray]] | None = None,
) -> Stream:  # fmt: skip
    """Return poses (n, 3) in `frame` with covariances (n, 3, 3).

    Heights come with variances, attitudes as unit quaternions (w, x, y, z) with covariances (3, 3),
    if any.
    """
    flat = repeat(None, len(stamps)) if heights is None else heights
    level = repeat(None, len(stamps)) if attitudes is None else attitudes
    rows = zip(stamps.tolist(), poses.tolist(), covariances, flat, level, strict=True)
    return Stream(times, (
        encode.pose_with_covariance(topic, stamp, pose, covariance, frame, height=height,
                                    attitude=attitude)
        for stamp, pose, covariance, height, attitude in rows
    ))  # fmt: skip


def _rows(table: Columns, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return the stamps and some columns of a table row by row."""
    return zip(*(table[name].tolist() for name in ("stamp_ns", *names)), strict=True)


def transforms(
    times: NDArray[np.int64], stamps: NDArray[np.int64], parent: str, child: str, poses: FloatArray
) -> Stream:  # fmt: skip
    """Return transforms of `child` at poses (n, 3) in `parent`."""
    rows = zip(stamps.tolist(), poses.tolist(), strict=True)
    return Stream(times, (encode.transforms([encode.transform(stamp, parent, child, pose)])
                           for stamp, pose in rows))  # fmt: skip


def _together(
    times: NDArray[np.int64], publish: Callable[[list[Any]], Publication], rows: Iterator[Any]
) -> Stream:
    """Return a message for all rows that are recorded at once."""
    at, counts = np.unique(times, return_counts=True)
    return Stream(at, (publish(list(islice(rows, count))) for count in counts.tolist()))


def driven(odometry: Columns) -> dict[str, NDArray[Any]]:
    """Return pose in odom, speeds forward and left, and turn rate (n,) at odometry's stamps."""
    left = odometry.get("v_left_mps", np.zeros(len(odometry["stamp_ns"])))
    seconds = np.diff(odometry["stamp_ns"]) / NANOSECONDS
    if "dx_m" in odometry:
        names = ("dx_m", "dy_m", "dheading_rad")
        poses = poses_of(np.column_stack([odometry[name] for name in names]))
        v, omega = (np.concatenate([[0.0], odometry[name][1:] / seconds])
                    for name in ("dx_m", "dheading_rad"))  # fmt: skip
    else:
        v, omega = odometry["v_mps"], odometry["omega_radps"]
        poses = _arcs(np.column_stack([v, left, omega]), seconds)
    return {"x": poses[:, 0], "y": poses[:, 1], "heading": poses[:, 2], "v": v, "omega": omega,
            "left": left}  # fmt: skip


def _arcs(velocity: FloatArray, seconds: FloatArray) -> FloatArray:
    """Return the poses (n, 3) that velocities lead to, each held until the next one's stamp."""
    pose, found = _core.Pose2(), [(0.0, 0.0, 0.0)]
    for motion in (velocity[:-1] * seconds[:, None]).tolist():
        pose = pose * _core.arc(*motion)
        found.append((pose.x, pose.y, pose.heading))
    return np.array(found)
