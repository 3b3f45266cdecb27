# SPDX-License-Identifier: Apache-2.0
"""From a log, or a run along it, to a bag that tools of either ROS open."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, repeat, starmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.ros import Ros, Topics, plain
from locfuse.io.log_folder import MESSAGES
from locfuse.io.rosbag import bag_settings, encode
from locfuse.io.rosbag.bag_files import bag_sink
from locfuse.io.rosbag.decode import FixRow, RangeRow, ScanRow, SightingRow, TruthRow
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.increments import poses_of
from locfuse.io.whole import naming
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, LogError, RunResult

Progress = Callable[[int, int], None]

END_S = 2**31  # seconds since 1970 at which the time of ROS ends
PROGRESS_EVERY = 1000  # messages between two calls of progress
LASER_FRAME, SIGHT_FRAME = "laser", "landmark_sensor"


def write_bag(
    source: Log | RunResult, path: str | Path, ros: Ros | None = None,
    progress: Progress | None = None,
) -> None:  # fmt: skip
    """Write a log, or a run with its log, as a bag that `read_bag` reads back.

    Poses of odometry come back within an ulp, and ranges of scans as float32; what was read from a
    bag comes back bit for bit, as does the rest. A run adds the pose with its covariance, the path,
    the transform from map to odom, health as diagnostics, and the landmarks that it mapped.

    Parameters
    ----------
    source : Log or RunResult
    path : str or Path
        Ends in ``.bag`` (ROS 1) or ``.mcap`` (ROS 2); a file of that name is replaced.
    ros : Ros, optional
        Topics and frames; by default the usual names.
    progress : callable, optional
        Called with (messages written, total messages).

    Raises
    ------
    LogError
        If the path ends in something else, a stamp is beyond the year 2038, or rosbags is missing.
    """
    streams = _BagStreams(source, Ros() if ros is None else ros).all()
    times = np.concatenate([stream.times for stream in streams])
    which = np.repeat(np.arange(len(streams)), [len(stream.times) for stream in streams])
    order = np.argsort(times, kind="stable")
    report = progress or (lambda done, total: None)
    with naming(Path(path)), bag_sink(Path(path)) as sink:
        for done in range(0, len(order), PROGRESS_EVERY):
            report(done, len(order))
            rows = order[done : done + PROGRESS_EVERY]
            for time_ns, stream in zip(times[rows].tolist(), which[rows].tolist(), strict=True):
                sink.write(time_ns, next(streams[stream].publications))
    report(len(order), len(order))


@dataclass
class _Stream:
    """Publications in order of the times at which they are recorded [ns]."""

    times: NDArray[np.int64]
    publications: Iterator[Publication]


@dataclass
class _BagStreams:
    """The publications of a log, and perhaps of a run on it."""

    source: Log | RunResult
    ros: Ros
    log: Log = field(init=False)
    shift: int = field(init=False)
    begin: int = field(init=False)

    def __post_init__(self) -> None:
        self.log = self.source.log if isinstance(self.source, RunResult) else self.source
        self.result = self.source if isinstance(self.source, RunResult) else None
        tables = self.log.tables.values()
        spans = [values for table in tables for name, values in table.items()
                 if name.endswith("_ns") and len(values)]  # fmt: skip
        if self.result is not None:
            spans.append(self.result.estimate.stamp_ns)
        first = min(int(values.min()) for values in spans)
        last = max(int(values.max()) for values in spans)
        self.shift = 0 if first >= NANOSECONDS else (1 - first // NANOSECONDS) * NANOSECONDS
        if (last + self.shift) // NANOSECONDS >= END_S:
            raise LogError(f"a stamp of {last // NANOSECONDS} s is beyond the time of ROS, which "
                           f"ends {END_S} s after it began")  # fmt: skip
        self.begin = first + self.shift
        self.frames = self._sensor_frames()
        self._driven = _driven(self.log["odometry"]) if "odometry" in self.log else {}

    def _sensor_frames(self) -> dict[str, str]:
        """Return the frame of each tag: its name, if no other frame is called so."""
        frames = self.ros.frames
        taken = {
            plain(frames.map),
            plain(frames.odom),
            plain(frames.base),
            LASER_FRAME,
            SIGHT_FRAME,
        }
        return {tag: f"tag/{tag}" if plain(tag) in taken or not plain(tag) else plain(tag)
                for tag in self.log.tags}  # fmt: skip

    def all(self) -> list[_Stream]:
        """Return all streams; messages of one time are written in this order."""
        head = list(self._head())
        found = [_Stream(np.full(len(head), self.begin), iter(head))]
        streams: dict[str, Callable[[Columns], Iterator[_Stream]]] = {
            "odometry": self._odometry, "ranges": self._ranges, "positions": self._positions,
            "poses": self._poses, "landmark_sightings": self._sightings, "scans": self._scans,
            "truth": self._truth,
        }  # fmt: skip
        for stem, make in streams.items():
            if stem in self.log and len(self.log[stem]["stamp_ns"]):
                more = self._driven if stem == "odometry" else {}
                found += make(self._timed(stem, {**self.log[stem], **more}))
        if self.result is not None:
            found += [*self._estimates(self.result), *self._health(self.result)]
        return found

    def _timed(self, stem: str, table: dict[str, NDArray[Any]]) -> Columns:
        """Return a table in the bag's time and in order of `record_ns`, its arrival there."""
        stamp = table["stamp_ns"] + self.shift
        arrival = table.pop("arrival_ns", None) if stem in MESSAGES else None
        record = stamp if arrival is None else arrival + self.shift
        table |= {"stamp_ns": stamp, "record_ns": record}
        if (np.diff(record) < 0).any():
            order = np.argsort(record, kind="stable")
            table = {name: values[order] for name, values in table.items()}
        return table

    def _topic(self, key: str) -> str:
        """Return where a table goes: where it is expected, or where it would be by default."""
        return plain(getattr(self.ros.topics, key) or getattr(Topics(), key))

    # At the beginning

    def _head(self) -> Iterator[Publication]:
        frame = plain(self.ros.frames.map)
        yield encode.text(bag_settings.TOPIC, bag_settings.text_of(self.log, self.shift))
        if mounts := self._mounts():
            yield encode.transforms(mounts, static=True)
        if self.log.grid is not None:
            yield encode.occupancy_grid(self._topic("map"), self.log.grid, frame,
                                        self.begin)  # fmt: skip
        for stem, name in (("anchors", "anchor"), ("landmarks", "landmark")):
            if stem in self.log:
                yield self._points(stem, name, frame)
        if "relations" in self.log:
            columns = (values.tolist() for values in self.log["relations"].values())
            for row in zip(*columns, strict=True):
                yield self._relation(row, frame)
        if self.result is not None and self.ros.topics.path is not None:
            yield self._path(self.result, frame)
        if self.result is not None and self.result.landmarks is not None and self.ros.topics.mapped:
            yield encode.mapped_landmarks(plain(self.ros.topics.mapped), self.result.landmarks,
                                          frame, self.begin)  # fmt: skip

    def _mounts(self) -> list[encode.Fields]:
        base = plain(self.ros.frames.base)
        found = [encode.transform(self.begin, base, self.frames[tag], (x, y, 0.0), z)
                 for tag, (x, y, z) in self.log.tags.items()]  # fmt: skip
        for frame, sensor in (
            (LASER_FRAME, self.log.laser),
            (SIGHT_FRAME, self.log.landmark_sensor),
        ):
            if sensor is not None:
                found.append(encode.transform(self.begin, base, frame, sensor["pose_in_body"]))
        return found

    def _points(self, stem: str, name: str, frame: str) -> Publication:
        table = self.log[stem]
        at = np.column_stack([table["x_m"], table["y_m"],
                              table.get("z_m", np.zeros(len(table["x_m"])))])  # fmt: skip
        return encode.named_points(self._topic(stem), table[name].tolist(), at,
                                   table.get("radius_m"), frame, self.begin)  # fmt: skip

    def _relation(self, row: tuple[Any, ...], frame: str) -> Publication:
        begin, end, *motion = row
        return encode.path(bag_settings.RELATIONS, frame, (begin + self.shift, end + self.shift),
                           [(0.0, 0.0, 0.0), motion])  # fmt: skip

    def _path(self, result: RunResult, frame: str) -> Publication:
        """Return the whole path, so that it is there wherever in the bag somebody looks."""
        track = result.estimate
        rows, last = [], -math.inf
        for row, stamp in enumerate(track.stamp_ns.tolist()):
            if stamp - last >= NANOSECONDS / self.ros.path_hz:
                rows.append(row)
                last = stamp
        poses = np.column_stack([track.position, _headings(result)])[rows]
        stamps = track.stamp_ns[rows] + self.shift
        return encode.path(plain(self.ros.topics.path or ""), frame, stamps.tolist(),
                           poses.tolist())  # fmt: skip

    # Sensors

    def _odometry(self, table: Columns) -> Iterator[_Stream]:
        topic = self._topic("odometry")
        odom, base = plain(self.ros.frames.odom), plain(self.ros.frames.base)
        yield _Stream(table["record_ns"], (
            encode.odometry(topic, stamp, (x, y, heading), (v, omega, left), odom, base)
            for stamp, x, y, heading, v, omega, left in
            _rows(table, "x", "y", "heading", "v", "omega", "left")
        ))  # fmt: skip
        poses = np.column_stack([table["x"], table["y"], table["heading"]])
        yield _transforms(table["record_ns"], table["stamp_ns"], odom, base, poses)

    def _ranges(self, table: Columns) -> Iterator[_Stream]:
        topic = self._topic("ranges")
        table = {"sigma_m": np.zeros(len(table["tag"])), **table}
        rows = (RangeRow._make((*row, self.frames.get(row[1], "")))
                for row in _rows(table, "tag", "anchor", "range_m", "sigma_m"))  # fmt: skip
        yield _together(table["record_ns"], partial(encode.uwb_ranges, topic), rows)

    def _positions(self, table: Columns) -> Iterator[_Stream]:
        topic, frame = self._topic("positions"), plain(self.ros.frames.map)
        table = {"tag": np.full(len(table["x_m"]), ""), **table}
        yield _Stream(table["record_ns"], (
            encode.tag_position(topic, FixRow._make((*row, frame)))
            for row in _rows(table, "x_m", "y_m", "sigma_m", "tag")
        ))  # fmt: skip

    def _poses(self, table: Columns) -> Iterator[_Stream]:
        xy, turn = table["sigma_xy_m"], table["sigma_heading_rad"]
        covariance = np.zeros((len(xy), 3, 3))
        variances = np.column_stack([xy * xy, xy * xy, turn * turn])
        variances[xy == -1.0] = -1.0, 0.0, 0.0
        covariance[:, range(3), range(3)] = variances
        poses = np.column_stack([table["x_m"], table["y_m"], table["heading_rad"]])
        yield self._with_covariance(self._topic("poses"), table["record_ns"], table["stamp_ns"],
                                    poses, covariance)  # fmt: skip

    def _with_covariance(
        self, topic: str, times: NDArray[np.int64], stamps: NDArray[np.int64], poses: FloatArray,
        covariances: FloatArray, heights: Iterable[tuple[float, float]] | None = None,
    ) -> _Stream:  # fmt: skip
        frame = plain(self.ros.frames.map)
        flat = repeat(None, len(stamps)) if heights is None else heights
        rows = zip(stamps.tolist(), poses.tolist(), covariances, flat, strict=True)
        return _Stream(times, (
            encode.pose_with_covariance(topic, stamp, pose, covariance, frame, height=height)
            for stamp, pose, covariance, height in rows
        ))  # fmt: skip

    def _sightings(self, table: Columns) -> Iterator[_Stream]:
        topic = self._topic("landmark_sightings")
        frame = SIGHT_FRAME if self.log.landmark_sensor else plain(self.ros.frames.base)
        none = np.zeros(len(table["stamp_ns"]))
        table = {"sigma_range_m": none, "sigma_bearing_rad": none, **table}
        names = ("landmark", "range_m", "bearing_rad", "sigma_range_m", "sigma_bearing_rad")
        rows = (SightingRow._make((*row, frame)) for row in _rows(table, *names))
        yield _together(table["record_ns"], partial(encode.landmark_sightings, topic), rows)

    def _scans(self, table: Columns) -> Iterator[_Stream]:
        if self.log.laser is None:
            raise LogError("the log has scans without laser, so a bag cannot have their geometry")
        topic, bright = self._topic("scans"), table.get("intensities")

        def scan(row: int, stamp: int) -> encode.Publication:
            laser, beams = self.log.scan_geometry(row)
            return encode.laser_scan(topic, ScanRow(
                stamp, LASER_FRAME, laser["angle_min_rad"], laser["angle_increment_rad"],
                laser["range_min_m"], laser["range_max_m"], table["ranges_m"][row, :beams],
                None if bright is None else bright[row, :beams], None,
                laser.get("time_increment_s", 0.0),
            ))  # fmt: skip

        yield _Stream(table["record_ns"], starmap(scan, enumerate(table["stamp_ns"].tolist())))

    def _truth(self, table: Columns) -> Iterator[_Stream]:
        topic, n = self._topic("truth"), len(table["x_m"])
        frame, base = plain(self.ros.frames.map), plain(self.ros.frames.base)
        table = {"z_m": np.zeros(n), "heading_rad": np.full(n, math.nan), **table}
        yield _Stream(table["stamp_ns"], (
            encode.truth(topic, TruthRow._make((*row, frame)), base)
            for row in _rows(table, "x_m", "y_m", "z_m", "heading_rad")
        ))  # fmt: skip

    # What the run made of it

    def _estimates(self, result: RunResult) -> Iterator[_Stream]:
        track, frames = result.estimate, self.ros.frames
        stamp, heading = track.stamp_ns + self.shift, _headings(result)
        poses = np.column_stack([track.position, heading])
        if self.ros.topics.estimate is not None:
            none = np.zeros((len(stamp), 3, 3))
            yield self._with_covariance(
                plain(self.ros.topics.estimate), stamp, stamp, poses,
                none if track.covariance is None else track.covariance,
                None if track.height is None or track.height_variance is None
                else zip(track.height.tolist(), track.height_variance.tolist(), strict=True),
            )  # fmt: skip
        in_odom = self._in_odom(track.stamp_ns)
        moved = np.array(list(map(encode.map_to_odom, poses.tolist(), in_odom))).reshape(-1, 3)
        yield _transforms(stamp, stamp, plain(frames.map), plain(frames.odom), moved)

    def _in_odom(self, stamps: NDArray[np.int64]) -> list[list[float]]:
        """Return the body's pose in odom at other stamps; without odometry it stays at 0."""
        found = np.zeros((len(stamps), 3))
        if self._driven:
            at = self.log["odometry"]["stamp_ns"]
            after = (stamps - at[0]).astype(float), (at - at[0]).astype(float)
            found[:, 0] = np.interp(*after, self._driven["x"])
            found[:, 1] = np.interp(*after, self._driven["y"])
            found[:, 2] = np.interp(*after, np.unwrap(self._driven["heading"]))
        poses: list[list[float]] = found.tolist()
        return poses

    def _health(self, result: RunResult) -> Iterator[_Stream]:
        health = result.health
        if health is None:
            return
        stamps = health.stamp_ns + self.shift

        def publications() -> Iterator[Publication]:
            for row, stamp in enumerate(stamps.tolist()):
                status = encode.health_status(str(health.state[row]), str(health.reason[row]),
                                              float(health.within[row]), float(health.wrong[row]),
                                              health.protection[row].tolist())  # fmt: skip
                yield encode.diagnostics(stamp, [status])

        yield _Stream(stamps, publications())


def _rows(table: Columns, *names: str) -> Iterator[tuple[Any, ...]]:
    """Return the stamps and some columns of a table row by row."""
    return zip(*(table[name].tolist() for name in ("stamp_ns", *names)), strict=True)


def _transforms(
    times: NDArray[np.int64], stamps: NDArray[np.int64], parent: str, child: str, poses: FloatArray
) -> _Stream:  # fmt: skip
    rows = zip(stamps.tolist(), poses.tolist(), strict=True)
    return _Stream(times, (encode.transforms([encode.transform(stamp, parent, child, pose)])
                           for stamp, pose in rows))  # fmt: skip


def _together(
    times: NDArray[np.int64], publish: Callable[[list[Any]], Publication], rows: Iterator[Any]
) -> _Stream:
    """Return a message for all rows that are recorded at once."""
    at, counts = np.unique(times, return_counts=True)
    return _Stream(at, (publish(list(islice(rows, count))) for count in counts.tolist()))


def _headings(result: RunResult) -> FloatArray:
    found = result.estimate.heading
    return np.zeros(len(result.estimate)) if found is None else found


def _driven(odometry: Columns) -> dict[str, NDArray[Any]]:
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
