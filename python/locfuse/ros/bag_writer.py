# SPDX-License-Identifier: Apache-2.0
"""From a log, or a run along it, to a bag that tools of either ROS open."""

from __future__ import annotations

import heapq
import math
import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from tempfile import mkdtemp
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.ros import Ros, Topics, plain
from locfuse.io.log_folder import MESSAGES
from locfuse.ros import bag_settings, encode
from locfuse.ros.decode import FixRow, RangeRow, ScanRow, SightingRow, TruthRow
from locfuse.ros.encode import Publication
from locfuse.ros.increments import poses_of
from locfuse.ros.needs import need
from locfuse.ros.wire import defined, long, serializer, store
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, LogError, RunResult

Told = tuple[int, Publication]
Progress = Callable[[int, int], None]

LAST_S = 2**31  # seconds since 1970 that a stamp of ROS can tell
TELL_EVERY = 1000  # messages between two calls of progress
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
    path = Path(path)
    told = _Telling(source, Ros() if ros is None else ros)
    total = told.count()
    with bag_sink(path) as sink:
        for number, (time_ns, publication) in enumerate(told.messages()):
            sink.write(time_ns, publication)
            if progress is not None and number % TELL_EVERY == 0:
                progress(min(number, total), total)
    if progress is not None:
        progress(total, total)


# Files -----------------------------------------------------------------------------------------


class Sink(Protocol):
    """What takes publications, and when they were made [ns]."""

    def write(self, time_ns: int, publication: Publication) -> None: ...


def check_bag(path: Path) -> None:
    """Refuse a name of a bag that cannot be written, before the work and not after it.

    Raises
    ------
    LogError
        If it ends neither in ``.bag`` nor in ``.mcap``, or rosbags is missing.
    """
    if path.suffix not in (".bag", ".mcap"):
        raise LogError(f"{path}: ends in {path.suffix!r}; a bag is written as .bag (ROS 1) or "
                       ".mcap (ROS 2)")  # fmt: skip
    need("rosbags")


def bag_sink(path: Path) -> AbstractContextManager[Sink]:
    """Return what writes publications into a bag, which is there once its block has ended.

    Raises
    ------
    LogError
        As `check_bag`.
    """
    check_bag(path)
    return _Ros1Sink(path) if path.suffix == ".bag" else _McapSink(path)


class _FileSink(ABC):
    """Writes beside the file and moves it there when it is whole."""

    encoding = ""

    def __init__(self, path: Path) -> None:
        store(self.encoding)  # says what is missing before anything is made
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.folder = Path(mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        self.known: dict[tuple[str, str], tuple[Any, Callable[[Any], bytes]]] = {}
        self.writer: Any = None

    def __enter__(self) -> _FileSink:
        self.writer = self._open()
        self.writer.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.writer.close()
            if kind is None:
                os.replace(self._made(), self.path)
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)

    def write(self, time_ns: int, publication: Publication) -> None:
        key = (publication.topic, publication.type)
        if key not in self.known:
            topic = f"/{plain(publication.topic)}"
            connection = self._connect(topic, publication.type, publication.latched)
            self.known[key] = (connection, serializer(self.encoding, publication.type))
        connection, made = self.known[key]
        self.writer.write(connection, time_ns, made(publication.fields))

    @abstractmethod
    def _open(self) -> Any: ...

    @abstractmethod
    def _made(self) -> Path: ...

    @abstractmethod
    def _connect(self, topic: str, kind: str, latched: bool) -> Any: ...


class _Ros1Sink(_FileSink):
    encoding = "ros1"

    def _open(self) -> Any:
        return need("rosbags.rosbag1").Writer(self._made())

    def _made(self) -> Path:
        return self.folder / "made.bag"

    def _connect(self, topic: str, kind: str, latched: bool) -> Any:
        text, digest = defined(self.encoding, kind)
        return self.writer.add_connection(topic, long(kind), msgdef=text, md5sum=digest,
                                          callerid="/locfuse", latching=int(latched))  # fmt: skip


class _McapSink(_FileSink):
    encoding = "cdr"

    def _open(self) -> Any:
        rosbag2 = need("rosbags.rosbag2")
        writer = rosbag2.Writer(self.folder / "made", version=rosbag2.Writer.VERSION_LATEST,
                                storage_plugin=rosbag2.StoragePlugin.MCAP)  # fmt: skip
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        return writer

    def _made(self) -> Path:
        return self.folder / "made" / "made.mcap"

    def _connect(self, topic: str, kind: str, latched: bool) -> Any:
        return self.writer.add_connection(
            topic, long(kind), typestore=store(self.encoding),
            offered_qos_profiles=[_quality(latched)],
        )  # fmt: skip


def _quality(latched: bool) -> Any:
    """Return what a publisher of ROS 2 offers: reliable, and kept for who comes late if latched."""
    said = need("rosbags.interfaces")
    ever = said.QosTime(2147483647, 4294967295)
    durability = said.QosDurability
    return said.Qos(
        said.QosHistory.KEEP_LAST, 1 if latched else 10, said.QosReliability.RELIABLE,
        durability.TRANSIENT_LOCAL if latched else durability.VOLATILE, ever, ever,
        said.QosLiveliness.AUTOMATIC, ever, False,
    )  # fmt: skip


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

    def count(self) -> int:
        """Return about how many messages there will be."""
        rows = sum(len(t["stamp_ns"]) for t in self.log.tables.values() if "stamp_ns" in t)
        return rows if self.result is None else rows + 2 * len(self.result.estimate)

    def messages(self) -> Iterator[Told]:
        streams = [self._head()]
        tell: dict[str, Callable[[Columns], Iterator[Told]]] = {
            "odometry": self._odometry, "ranges": self._ranges, "positions": self._positions,
            "poses": self._poses, "landmark_sightings": self._sightings, "scans": self._scans,
            "truth": self._truth,
        }  # fmt: skip
        for stem, teller in tell.items():
            if stem in self.log and len(self.log[stem]["stamp_ns"]):
                more = self._driven if stem == "odometry" else {}
                streams.append(teller(self._heard(stem, {**self.log[stem], **more})))
        if self.result is not None:
            streams += [self._estimates(self.result), self._health(self.result)]
        return heapq.merge(*streams, key=lambda told: told[0])

    def _heard(self, stem: str, table: dict[str, NDArray[Any]]) -> Columns:
        """Return a table in the bag's time and in order of `heard_ns`, its arrival there."""
        stamp = table["stamp_ns"] + self.shift
        arrival = table.pop("arrival_ns", None) if stem in MESSAGES else None
        heard = stamp if arrival is None else arrival + self.shift
        table |= {"stamp_ns": stamp, "heard_ns": heard}
        if (np.diff(heard) < 0).any():
            order = np.argsort(heard, kind="stable")
            table = {name: values[order] for name, values in table.items()}
        return table

    def _topic(self, key: str) -> str:
        """Return where a table goes: where it is expected, or where it would be by default."""
        return plain(getattr(self.ros.topics, key) or getattr(Topics(), key))

    # At the beginning

    def _head(self) -> Iterator[Told]:
        frame = plain(self.ros.frames.map)
        yield (
            self.begin,
            encode.text(bag_settings.TOPIC, bag_settings.text_of(self.log, self.shift)),
        )
        if mounts := self._mounts():
            yield self.begin, encode.transforms(mounts, static=True)
        if self.log.grid is not None:
            yield self.begin, encode.occupancy_grid(self._topic("map"), self.log.grid, frame,
                                                    self.begin)  # fmt: skip
        for stem, name in (("anchors", "anchor"), ("landmarks", "landmark")):
            if stem in self.log:
                yield self.begin, self._points(stem, name, frame)
        if "relations" in self.log:
            for row in _rows(self.log["relations"]):
                yield self.begin, self._relation(row, frame)
        if self.result is not None and self.ros.topics.path is not None:
            yield self.begin, self._path(self.result, frame)

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

    def _odometry(self, table: Columns) -> Iterator[Told]:
        odom, base = plain(self.ros.frames.odom), plain(self.ros.frames.base)
        topic = self._topic("odometry")
        names = ("heard_ns", "stamp_ns", "x", "y", "heading", "v", "omega")
        for heard, stamp, x, y, heading, v, omega in _rows(table, names):
            pose = (x, y, heading)
            yield heard, encode.odometry(topic, stamp, pose, (v, omega), odom, base)
            yield heard, encode.transforms([encode.transform(stamp, odom, base, pose)])

    def _ranges(self, table: Columns) -> Iterator[Told]:
        topic = self._topic("ranges")
        names = ("heard_ns", "stamp_ns", "tag", "anchor", "range_m", "sigma_m")
        for heard, rows in groupby(_rows(table, names), key=lambda row: row[0]):
            told = [RangeRow(stamp, tag, anchor, distance, sigma, self.frames.get(tag, ""))
                    for _, stamp, tag, anchor, distance, sigma in rows]  # fmt: skip
            yield heard, encode.uwb_ranges(topic, told)

    def _positions(self, table: Columns) -> Iterator[Told]:
        topic, frame = self._topic("positions"), plain(self.ros.frames.map)
        for heard, stamp, x, y, sigma, tag in _rows(
            table, ("heard_ns", "stamp_ns", "x_m", "y_m", "sigma_m", "tag")
        ):
            row = FixRow(stamp, x, y, sigma, tag or "", frame)
            yield heard, encode.tag_position(topic, row)

    def _poses(self, table: Columns) -> Iterator[Told]:
        topic, frame = self._topic("poses"), plain(self.ros.frames.map)
        names = ("heard_ns", "stamp_ns", "x_m", "y_m", "heading_rad", "sigma_xy_m",
                 "sigma_heading_rad")  # fmt: skip
        for heard, stamp, x, y, heading, xy, turn in _rows(table, names):
            covariance = np.diag(
                [-1.0, 0.0, 0.0] if xy == -1.0 else [xy * xy, xy * xy, turn * turn]
            )
            yield heard, encode.pose_with_covariance(topic, stamp, (x, y, heading), covariance,
                                                     frame)  # fmt: skip

    def _sightings(self, table: Columns) -> Iterator[Told]:
        topic = self._topic("landmark_sightings")
        frame = SIGHT_FRAME if self.log.landmark_sensor else plain(self.ros.frames.base)
        names = ("heard_ns", "stamp_ns", "landmark", "range_m", "bearing_rad", "sigma_range_m",
                 "sigma_bearing_rad")  # fmt: skip
        for heard, rows in groupby(_rows(table, names), key=lambda row: row[0]):
            told = [
                SightingRow(stamp, name, distance, bearing, of_range, of_bearing, frame)
                for _, stamp, name, distance, bearing, of_range, of_bearing in rows
            ]
            yield heard, encode.landmark_sightings(topic, told)

    def _scans(self, table: Columns) -> Iterator[Told]:
        laser, topic = self.log.laser, self._topic("scans")
        if laser is None:
            raise LogError("the log has scans without laser, so a bag cannot tell their geometry")
        geometry = (laser["angle_min_rad"], laser["angle_increment_rad"], laser["range_min_m"],
                    laser["range_max_m"])  # fmt: skip
        bright = table.get("intensities")
        for row, (heard, stamp) in enumerate(_rows(table, ("heard_ns", "stamp_ns"))):
            told = ScanRow(stamp, LASER_FRAME, *geometry, table["ranges_m"][row],
                           None if bright is None else bright[row])  # fmt: skip
            yield heard, encode.laser_scan(topic, told)

    def _truth(self, table: Columns) -> Iterator[Told]:
        topic, frame = self._topic("truth"), plain(self.ros.frames.map)
        child = plain(self.ros.frames.base)
        for stamp, x, y, z, heading in _rows(
            table, ("stamp_ns", "x_m", "y_m", "z_m", "heading_rad")
        ):
            row = TruthRow(stamp, x, y, z or 0.0, math.nan if heading is None else heading, frame)
            yield stamp, encode.truth(topic, row, child)

    # What the run made of it

    def _estimates(self, result: RunResult) -> Iterator[Told]:
        track, topic = result.estimate, self.ros.topics.estimate
        frame, odom = plain(self.ros.frames.map), plain(self.ros.frames.odom)
        headings, in_odom = _headings(result).tolist(), self._in_odom(track.stamp_ns)
        unknown = np.zeros((3, 3))
        for row, stamp in enumerate((track.stamp_ns + self.shift).tolist()):
            pose = (*track.position[row].tolist(), headings[row])
            if topic is not None:
                covariance = unknown if track.covariance is None else track.covariance[row]
                yield stamp, encode.pose_with_covariance(plain(topic), stamp, pose, covariance,
                                                         frame)  # fmt: skip
            moved = encode.map_to_odom(pose, in_odom[row])
            yield stamp, encode.transforms([encode.transform(stamp, frame, odom, moved)])

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

    def _health(self, result: RunResult) -> Iterator[Told]:
        health = result.health
        if health is None:
            return
        for row, stamp in enumerate((health.stamp_ns + self.shift).tolist()):
            status = encode.health_status(str(health.state[row]), str(health.reason[row]),
                                          float(health.within[row]), float(health.wrong[row]),
                                          health.protection[row].tolist())  # fmt: skip
            yield stamp, encode.diagnostics(stamp, [status])


def _rows(table: Columns, names: Sequence[str] | None = None) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a table as plain values; None where it has no such column."""
    length = len(next(iter(table.values())))
    columns = [table[name].tolist() if name in table else [None] * length
               for name in (names or table)]  # fmt: skip
    return zip(*columns, strict=True)


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
