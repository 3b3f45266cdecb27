# SPDX-License-Identifier: Apache-2.0
"""From a log, or a run along it, to a bag that tools of either ROS open."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.ros import Ros, Topics, plain
from locfuse.io.log_folder import MESSAGES
from locfuse.io.rosbag import bag_settings, encode, encode_many
from locfuse.io.rosbag.bag_files import Sink, bag_sink
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.increments import poses_of
from locfuse.io.rosbag.pack import Values
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, LogError, RunResult

Progress = Callable[[int, int], None]

LAST_S = 2**31  # seconds since 1970 that a stamp of ROS can tell
TELL_EVERY = 1000  # messages between two calls of progress
BLOCK = 1024  # messages of a topic that are packed at once
TRANSFORMS = "tf2_msgs/TFMessage"
LASER_FRAME, SIGHT_FRAME = "laser", "landmark_sensor"


def write_bag(
    source: Log | RunResult, path: str | Path, ros: Ros | None = None,
    progress: Progress | None = None,
) -> None:  # fmt: skip
    """Write a log as a bag that `read_bag` reads back, and what a run made of it.

    Poses of odometry come back within an ulp, and ranges of scans as float32; what was read from a
    bag comes back bit for bit, as does the rest. Of a run there are besides the pose with its
    covariance, the path, the transform from map to odom, and health as diagnostics.

    Parameters
    ----------
    source : Log or RunResult
    path : str or Path
        Ends in ``.bag`` (ROS 1) or ``.mcap`` (ROS 2); a file of that name is replaced.
    ros : Ros, optional
        What is said on which topic; by default the usual names.
    progress : callable, optional
        Told (messages written, messages in all).

    Raises
    ------
    LogError
        If the path ends in something else, a stamp is beyond the year 2038, or rosbags is missing.
    """
    streams = _Telling(source, Ros() if ros is None else ros).streams()
    times = np.concatenate([stream.times for stream in streams])
    which = np.repeat(np.arange(len(streams)), [len(stream.times) for stream in streams])
    order = np.argsort(times, kind="stable")
    tell = progress or (lambda done, of: None)
    with bag_sink(Path(path)) as sink:
        told = [stream.told(sink) for stream in streams]
        for done in range(0, len(order), TELL_EVERY):
            tell(done, len(order))
            rows = order[done : done + TELL_EVERY]
            for time_ns, stream in zip(times[rows].tolist(), which[rows].tolist(), strict=True):
                connection, data = next(told[stream])
                sink.put(connection, time_ns, data)
    tell(len(order), len(order))


class _Stream(Protocol):
    """Messages in order of the times at which they are told [ns]."""

    times: NDArray[np.int64]

    def told(self, sink: Sink) -> Iterator[tuple[Any, bytes]]:
        """Yield each with what it is put under."""


@dataclass
class _Few:
    """Messages that are made one by one."""

    times: NDArray[np.int64]
    publications: Iterable[Publication]

    def told(self, sink: Sink) -> Iterator[tuple[Any, bytes]]:
        for one in self.publications:
            yield sink.connection(one.topic, one.type, one.latched), sink.made(one)


@dataclass
class _Many:
    """Messages of a table: `tell` makes values to pack of some rows, and of how many each has."""

    topic: str
    kind: str
    table: Columns
    times: NDArray[np.int64]
    tell: Callable[[Columns, NDArray[np.int64]], Values]
    firsts: NDArray[np.int64]  # rows at which messages begin, and the end of the last one

    def told(self, sink: Sink) -> Iterator[tuple[Any, bytes]]:
        connection = sink.connection(self.topic, self.kind)
        for begin in range(0, len(self.times), BLOCK):
            firsts = self.firsts[begin : begin + BLOCK + 1]
            part = {name: values[firsts[0] : firsts[-1]] for name, values in self.table.items()}
            values = self.tell(part, np.diff(firsts))
            for data in sink.packed(self.kind, len(firsts) - 1, values):
                yield connection, data


# What is told ----------------------------------------------------------------------------------


@dataclass
class _Telling:
    """A log, and perhaps a run along it, as publications in order of time."""

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
        if (last + self.shift) // NANOSECONDS >= LAST_S:
            raise LogError(f"a stamp of {last // NANOSECONDS} s cannot be told by ROS, whose time "
                           f"ends {LAST_S} s after it began")  # fmt: skip
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

    def streams(self) -> list[_Stream]:
        """Return all that is told; at one time in this order."""
        head = list(self._head())
        found: list[_Stream] = [_Few(np.full(len(head), self.begin), head)]
        tell: dict[str, Callable[[Columns], Iterator[_Stream]]] = {
            "odometry": self._odometry, "ranges": self._ranges, "positions": self._positions,
            "poses": self._poses, "landmark_sightings": self._sightings, "scans": self._scans,
            "truth": self._truth,
        }  # fmt: skip
        for stem, teller in tell.items():
            if stem in self.log and len(self.log[stem]["stamp_ns"]):
                more = self._driven if stem == "odometry" else {}
                found += teller(self._heard(stem, {**self.log[stem], **more}))
        if self.result is not None:
            found += [*self._estimates(self.result), *self._health(self.result)]
        return found

    def _heard(self, stem: str, table: dict[str, NDArray[Any]]) -> Columns:
        """Return a table in the bag's time and in order of `received_ns`, its arrival there."""
        stamp = table["stamp_ns"] + self.shift
        arrival = table.pop("arrival_ns", None) if stem in MESSAGES else None
        heard = stamp if arrival is None else arrival + self.shift
        table |= {"stamp_ns": stamp, "received_ns": heard}
        if (np.diff(heard) < 0).any():
            order = np.argsort(heard, kind="stable")
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
        odom, base = plain(self.ros.frames.odom), plain(self.ros.frames.base)
        yield _each(self._topic("odometry"), "nav_msgs/Odometry", table,
                    lambda part: encode_many.odometry(part, odom, base))  # fmt: skip
        yield _each("tf", TRANSFORMS, table, lambda part: encode_many.transforms(part, odom, base))

    def _ranges(self, table: Columns) -> Iterator[_Stream]:
        yield _together(
            self._topic("ranges"), "locfuse_msgs/UwbRanges", table,
            lambda part, counts: encode_many.ranges(part, counts, self.frames),
        )  # fmt: skip

    def _positions(self, table: Columns) -> Iterator[_Stream]:
        frame = plain(self.ros.frames.map)
        yield _each(self._topic("positions"), "locfuse_msgs/TagPosition", table,
                    lambda part: encode_many.positions(part, frame))  # fmt: skip

    def _poses(self, table: Columns) -> Iterator[_Stream]:
        xy, turn = table["sigma_xy_m"], table["sigma_heading_rad"]
        covariance = np.zeros((len(xy), 3, 3))
        variances = np.column_stack([xy * xy, xy * xy, turn * turn])
        variances[xy == -1.0] = -1.0, 0.0, 0.0
        covariance[:, range(3), range(3)] = variances
        yield self._with_covariance(self._topic("poses"), {
            "stamp_ns": table["stamp_ns"], "received_ns": table["received_ns"], "x": table["x_m"],
            "y": table["y_m"], "heading": table["heading_rad"],
            "covariance": covariance})  # fmt: skip

    def _with_covariance(self, topic: str, table: Columns) -> _Stream:
        return _each(topic, "geometry_msgs/PoseWithCovarianceStamped", table,
                     lambda part: encode_many.poses(part, plain(self.ros.frames.map)))  # fmt: skip

    def _sightings(self, table: Columns) -> Iterator[_Stream]:
        frame = SIGHT_FRAME if self.log.landmark_sensor else plain(self.ros.frames.base)
        yield _together(
            self._topic("landmark_sightings"), "locfuse_msgs/LandmarkSightings", table,
            lambda part, counts: encode_many.sightings(part, counts, frame),
        )  # fmt: skip

    def _scans(self, table: Columns) -> Iterator[_Stream]:
        laser = self.log.laser
        if laser is None:
            raise LogError("the log has scans without laser, so a bag cannot tell their geometry")
        geometry = (laser["angle_min_rad"], laser["angle_increment_rad"], laser["range_min_m"],
                    laser["range_max_m"])  # fmt: skip
        yield _each(self._topic("scans"), "sensor_msgs/LaserScan", table,
                    lambda part: encode_many.scans(part, geometry, LASER_FRAME))  # fmt: skip

    def _truth(self, table: Columns) -> Iterator[_Stream]:
        topic, frame = self._topic("truth"), plain(self.ros.frames.map)
        unknown = np.full(len(table["x_m"]), math.nan)
        told = {"stamp_ns": table["stamp_ns"], "received_ns": table["stamp_ns"], "x": table["x_m"],
                "y": table["y_m"], "z": table.get("z_m", np.zeros(len(unknown))),
                "heading": table.get("heading_rad", unknown)}  # fmt: skip
        turned = ~np.isnan(told["heading"])
        base = plain(self.ros.frames.base)
        yield _each(topic, "nav_msgs/Odometry", {name: v[turned] for name, v in told.items()},
                    lambda part: encode_many.odometry(part, frame, base))  # fmt: skip
        yield _each(topic, "geometry_msgs/PointStamped",
                    {name: values[~turned] for name, values in told.items()},
                    lambda part: encode_many.points(part, frame))  # fmt: skip

    # What the run made of it

    def _estimates(self, result: RunResult) -> Iterator[_Stream]:
        track, frames = result.estimate, self.ros.frames
        stamp, heading = track.stamp_ns + self.shift, _headings(result)
        poses = np.column_stack([track.position, heading])
        if self.ros.topics.estimate is not None:
            none = np.zeros((len(stamp), 3, 3))
            yield self._with_covariance(plain(self.ros.topics.estimate), {
                "stamp_ns": stamp, "received_ns": stamp, "x": poses[:, 0], "y": poses[:, 1],
                "heading": heading,
                "covariance": none if track.covariance is None else track.covariance,
            })  # fmt: skip
        in_odom = self._in_odom(track.stamp_ns)
        moved = np.array(list(map(encode.map_to_odom, poses.tolist(), in_odom))).reshape(-1, 3)
        table = {"stamp_ns": stamp, "received_ns": stamp, "x": moved[:, 0], "y": moved[:, 1],
                 "heading": moved[:, 2]}  # fmt: skip
        yield _each("tf", TRANSFORMS, table, lambda part: encode_many.transforms(
            part, plain(frames.map), plain(frames.odom)))  # fmt: skip

    def _in_odom(self, stamps: NDArray[np.int64]) -> list[list[float]]:
        """Return the body's pose in odom at other stamps; without odometry it stays at 0."""
        found = np.zeros((len(stamps), 3))
        if self._driven:
            at = self.log["odometry"]["stamp_ns"]
            after = (stamps - at[0]).astype(float), (at - at[0]).astype(float)
            found[:, 0] = np.interp(*after, self._driven["x"])
            found[:, 1] = np.interp(*after, self._driven["y"])
            found[:, 2] = np.interp(*after, np.unwrap(self._driven["heading"]))
        told: list[list[float]] = found.tolist()
        return told

    def _health(self, result: RunResult) -> Iterator[_Stream]:
        health = result.health
        if health is None:
            return
        stamps = health.stamp_ns + self.shift

        def told() -> Iterator[Publication]:
            for row, stamp in enumerate(stamps.tolist()):
                status = encode.health_status(str(health.state[row]), str(health.reason[row]),
                                              float(health.within[row]), float(health.wrong[row]),
                                              health.protection[row].tolist())  # fmt: skip
                yield encode.diagnostics(stamp, [status])

        yield _Few(stamps, told())


def _each(topic: str, kind: str, table: Columns, tell: Callable[[Columns], Values]) -> _Many:
    """Return a message for each row."""
    heard = table["received_ns"]
    return _Many(topic, kind, table, heard, lambda part, _: tell(part), np.arange(len(heard) + 1))


def _together(
    topic: str, kind: str, table: Columns,
    tell: Callable[[Columns, NDArray[np.int64]], Values],
) -> _Many:  # fmt: skip
    """Return a message for all rows that are heard at once."""
    heard = table["received_ns"]
    firsts = np.flatnonzero(np.diff(heard, prepend=heard[0] - 1, append=heard[-1] + 1))
    return _Many(topic, kind, table, heard[firsts[:-1]], tell, firsts)


def _headings(result: RunResult) -> FloatArray:
    found = result.estimate.heading
    return np.zeros(len(result.estimate)) if found is None else found


def _driven(odometry: Columns) -> dict[str, NDArray[Any]]:
    """Return pose in odom, forward speed and turn rate (n,) at the stamps of odometry."""
    seconds = np.diff(odometry["stamp_ns"]) / NANOSECONDS
    if "dx_m" in odometry:
        names = ("dx_m", "dy_m", "dheading_rad")
        poses = poses_of(np.column_stack([odometry[name] for name in names]))
        v, omega = (np.concatenate([[0.0], odometry[name][1:] / seconds])
                    for name in ("dx_m", "dheading_rad"))  # fmt: skip
    else:
        v, omega = odometry["v_mps"], odometry["omega_radps"]
        poses = _arcs(v, omega, seconds)
    return {"x": poses[:, 0], "y": poses[:, 1], "heading": poses[:, 2], "v": v, "omega": omega}


def _arcs(v: FloatArray, omega: FloatArray, seconds: FloatArray) -> FloatArray:
    """Return the poses (n, 3) that velocities lead to, each held until the next one's stamp."""
    pose, found = _core.Pose2(), [(0.0, 0.0, 0.0)]
    for forward, turn in zip((v[:-1] * seconds).tolist(), (omega[:-1] * seconds).tolist(),
                             strict=True):  # fmt: skip
        pose = pose * _core.arc(forward, 0.0, turn)
        found.append((pose.x, pose.y, pose.heading))
    return np.array(found)
