# SPDX-License-Identifier: Apache-2.0
"""From the messages of a bag to a log."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.config.ros import Ros, plain
from locfuse.io.log_folder import (
    INCREASING,
    MAX_RANGE_M,
    MAX_SPEED_MPS,
    MAX_TURN_RATE_RADPS,
    MAY_BE_EMPTY,
    MESSAGES,
)
from locfuse.ros import bag_settings, decode
from locfuse.ros.bag_settings import Settings
from locfuse.ros.columns import Rows
from locfuse.ros.decode import MessageError
from locfuse.ros.frames import FrameTree, check_frame
from locfuse.ros.increments import increments_of
from locfuse.ros.needs import NeedError
from locfuse.ros.storage import Bag, Connection
from locfuse.ros.wire import broken, deserializer
from locfuse.types import NANOSECONDS, FloatArray, GridMap, Log, LogError

logger = logging.getLogger(__name__)

Progress = Callable[[int, int], None]
Columns = dict[str, NDArray[Any]]

# What the standard messages of a topic are, for advice.
TYPES = {
    "odometry": "nav_msgs/Odometry",
    "scans": "sensor_msgs/LaserScan",
    "ranges": "locfuse_msgs/UwbRanges",
    "poses": "geometry_msgs/PoseWithCovarianceStamped",
    "positions": "sensor_msgs/NavSatFix",
    "landmark_sightings": "locfuse_msgs/LandmarkSightings",
    "map": "nav_msgs/OccupancyGrid",
}
OTHER_CLOCK_NS = 3600 * NANOSECONDS  # record times this far from stamps are of another clock
LONGEST = 300  # letters of a reason
LAST_NS = 2**62  # beyond it is no time
AHEAD_NS = NANOSECONDS  # stamps this far after the recording are said
MOST_TRANSFORMS = 20_000  # messages on tf that are looked through for a mount that tf_static lacks
NOT_MEASURED_M = 1e6  # a sigma of infinity, as a log can have it


def read_bag(
    path: str | Path, ros: Ros | None = None, world: Log | None = None,
    progress: Progress | None = None,
) -> Log:  # fmt: skip
    """Read a bag of either ROS as a log.

    What cannot be used is left out and said, one sentence each, on the logger ``locfuse``: a
    message that means nothing, a topic that was asked for and is not there, damage. Messages arrive
    when they were recorded, but never before their stamp; where record times and stamps count from
    other origins, they arrive at their stamps. ``docs/ros.md`` has the whole of it.

    Parameters
    ----------
    path : str or Path
        A ``.bag`` of ROS 1, a ``.mcap``, or a ``.db3`` or folder of ROS 2.
    ros : Ros, optional
        What is said on which topic; by default the usual names.
    world : Log, optional
        Anchors, landmarks, tags, mounts and map, which count more than what the bag says of them.
    progress : callable, optional
        Told (bytes read, bytes in all).

    Returns
    -------
    Log

    Raises
    ------
    LogError
        If there is no such bag, it holds no message that is asked for, or rosbags is missing.
    """
    reading = _Reading(Path(path), Ros() if ros is None else ros, world)
    return reading.read(progress)


@dataclass
class _Trouble:
    """Messages of a topic that were left out, and why the first was."""

    count: int
    first: str


@dataclass
class _Reading:
    """A bag on its way to a log."""

    path: Path
    ros: Ros
    world: Log | None
    tables: dict[str, Rows] = field(default_factory=dict)
    trouble: dict[str, _Trouble] = field(default_factory=dict)
    heard: dict[str, int] = field(default_factory=dict)
    settings: Settings | None = None
    grid: GridMap | None = None
    laser: tuple[Any, ...] | None = None
    tag_frames: dict[str, str] = field(default_factory=dict)
    sight_frame: str | None = None
    child_frame: str = ""
    origin: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        self.tree = FrameTree(self.ros.frames.base)
        self.origin = self.ros.gps_origin
        self.handlers = self._handlers()
        self.decoders: dict[Connection, Callable[[bytes], Any] | None] = {}

    # Hearing ---------------------------------------------------------------------------------

    def _handlers(self) -> dict[str, Callable[[Any, int], None]]:
        """Return what is done with the messages of each topic."""
        of_keys: dict[str, Callable[[Any, int], None]] = {
            "odometry": self._odometry, "scans": self._scan, "ranges": self._ranges,
            "poses": self._pose, "positions": self._position, "truth": self._truth,
            "landmark_sightings": self._sightings, "map": self._map,
            "anchors": self._anchors, "landmarks": self._landmarks,
        }  # fmt: skip
        found: dict[str, Callable[[Any, int], None]] = {
            "tf_static": self._transforms, bag_settings.TOPIC: self._settings,
            bag_settings.RELATIONS: self._relation,
        }  # fmt: skip
        for topic, anchor in self.ros.range_topics.items():
            found[plain(topic)] = self._range_of(anchor)
        for key, handler in of_keys.items():
            topic = getattr(self.ros.topics, key)
            if topic is not None:
                found[plain(topic)] = handler
        return found

    def read(self, progress: Progress | None) -> Log:
        bag = Bag(self.path, progress)
        for connection, time_ns, data in bag.messages(lambda c: c.topic in self.handlers):
            self._hear(connection, time_ns, data)
        self._find_mounts(bag)
        for sentence in bag.damage:
            logger.warning(sentence)
        log = self._log(bag)
        self._say(bag)
        return log

    def _hear(self, connection: Connection, time_ns: int, data: bytes) -> None:
        decoder = self._decoder(connection)
        if decoder is None:
            return
        if not 0 <= time_ns < LAST_NS:
            self._left_out(connection.topic, f"it was recorded at {time_ns} ns, which is no time")
            return
        try:
            message = decoder(data)
        except broken() as error:
            self._left_out(connection.topic, f"it cannot be unpacked ({error})")
            return
        try:
            self.handlers[connection.topic](message, time_ns)
        except MessageError as error:
            self._left_out(connection.topic, str(error))
        else:
            self.heard[connection.topic] = self.heard.get(connection.topic, 0) + 1

    def _decoder(self, connection: Connection) -> Callable[[bytes], Any] | None:
        if connection not in self.decoders:
            self.decoders[connection] = None
            try:
                self.decoders[connection] = deserializer(connection)
            except NeedError:
                raise
            except LogError as error:
                self._left_out(connection.topic, str(error))
        return self.decoders[connection]

    def _tell(self, sentence: str) -> None:
        logger.warning("%s: %s", self.path, " ".join(sentence.split()))

    def _left_out(self, topic: str, why: str, count: int = 1) -> None:
        if topic in self.trouble:
            self.trouble[topic].count += count
        else:
            why = " ".join(why.split())  # what others raise may be a page
            self.trouble[topic] = _Trouble(
                count, why if len(why) < LONGEST else f"{why[:LONGEST]}..."
            )

    def _rows(self, stem: str, **dtypes: Any) -> Rows:
        return self.tables.setdefault(stem, Rows(**dtypes))

    def _odometry(self, message: Any, time_ns: int) -> None:
        use = self._odometry_from()
        row = decode.odometry(message, use)
        if use == "twist" and (abs(row.v) > MAX_SPEED_MPS or abs(row.omega) > MAX_TURN_RATE_RADPS):
            raise MessageError(f"{row.v:g} m/s and {row.omega:g} rad/s, which no robot drives")
        self.child_frame = row.child_frame
        rows = self._rows("odometry", stamp_ns=np.int64, record_ns=np.int64, x=float, y=float,
                          heading=float, v_mps=float, omega_radps=float)  # fmt: skip
        rows.add(row.stamp_ns, time_ns, row.x, row.y, row.heading, row.v, row.omega)

    def _odometry_from(self) -> str:
        if self.settings is not None and "odometry" in self.settings.columns:
            return "twist" if "v_mps" in self.settings.columns["odometry"] else "pose"
        return self.ros.odometry_from

    def _scan(self, message: Any, time_ns: int) -> None:
        row = decode.scan(message)
        geometry = (*row[1:6], len(row.ranges), row.intensities is not None)
        if self.laser is None:
            self.laser = geometry
        elif geometry != self.laser:
            raise MessageError("the scan has another frame, geometry or number of beams than the "
                               "first: a log has one laser")  # fmt: skip
        known = {} if row.intensities is None else {"intensities": np.float64}
        rows = self._rows("scans", stamp_ns=np.int64, record_ns=np.int64, ranges_m=np.float64,
                          **known)  # fmt: skip
        rows.add(row.stamp_ns, time_ns, row.ranges, *([row.intensities] if known else []))

    def _ranges(self, message: Any, time_ns: int) -> None:
        errors: list[MessageError] = []
        good = []
        for row in decode.ranges(message, self.ros.uwb_unit, self.ros.uwb_tag, errors.append):
            try:
                _check_range(row)
            except MessageError as error:
                errors.append(error)
            else:
                good.append(row)
        if errors and not good:
            raise errors[0]
        singly = f"{self.ros.topics.ranges}, singly,"
        for one in errors:
            self._left_out(singly, str(one))
        self.heard[singly] = self.heard.get(singly, 0) + len(good)
        for row in good:
            self._range(row, time_ns)

    def _range_of(self, anchor: str) -> Callable[[Any, int], None]:
        def handler(message: Any, time_ns: int) -> None:
            row = decode.range_of(message, self.ros.uwb_tag, anchor)
            if row is not None:
                _check_range(row)
                self._range(row, time_ns)

        return handler

    def _range(self, row: decode.RangeRow, time_ns: int) -> None:
        self.tag_frames.setdefault(row.tag, row.frame)
        rows = self._rows("ranges", stamp_ns=np.int64, record_ns=np.int64, tag=np.str_,
                          anchor=np.str_, range_m=float, sigma_m=float)  # fmt: skip
        sigma = math.nan if row.sigma_m is None else row.sigma_m
        rows.add(row.stamp_ns, time_ns, row.tag, row.anchor, row.range_m, sigma)

    def _pose(self, message: Any, time_ns: int) -> None:
        row = decode.pose(message)
        check_frame("poses", row.frame, self.ros.frames.map)
        sigma_xy, sigma_heading = _sigmas(row.covariance)
        rows = self._rows("poses", stamp_ns=np.int64, record_ns=np.int64, x_m=float, y_m=float,
                          heading_rad=float, sigma_xy_m=float, sigma_heading_rad=float)  # fmt: skip
        rows.add(row.stamp_ns, time_ns, row.x, row.y, row.heading, sigma_xy, sigma_heading)

    def _position(self, message: Any, time_ns: int) -> None:
        if self.origin is None and hasattr(message, "latitude"):
            self._first_origin(message)
        row = decode.fix(message, self.origin)
        if row is None:
            return
        if not hasattr(message, "latitude"):
            check_frame("positions", row.frame, self.ros.frames.map)
        rows = self._rows("positions", stamp_ns=np.int64, record_ns=np.int64, tag=np.str_,
                          x_m=float, y_m=float, sigma_m=float)  # fmt: skip
        rows.add(row.stamp_ns, time_ns, row.tag, row.x, row.y, row.sigma_m)

    def _first_origin(self, message: Any) -> None:
        origin = (float(message.latitude), float(message.longitude), 0.0)
        if decode.fix(message, origin) is not None:
            self.origin = origin
            self._tell(f"the map's origin is the first fix, at latitude "
                           f"{origin[0]!r} and longitude {origin[1]!r}; ros.gps_origin says where "
                           "it is")  # fmt: skip

    def _sightings(self, message: Any, time_ns: int) -> None:
        rows = self._rows("landmark_sightings", stamp_ns=np.int64, record_ns=np.int64,
                          landmark=np.str_, range_m=float, bearing_rad=float,
                          sigma_range_m=float, sigma_bearing_rad=float)  # fmt: skip
        for row in decode.sightings(message):
            if self.sight_frame is None:
                self.sight_frame = row.frame
            elif row.frame != self.sight_frame:
                raise MessageError(f"a sighting is in frame {row.frame!r}, the first in "
                                   f"{self.sight_frame!r}: a log has one such sensor")  # fmt: skip
            sigmas = (math.nan if s is None else s for s in row[4:6])
            rows.add(row.stamp_ns, time_ns, *row[1:4], *sigmas)

    def _truth(self, message: Any, time_ns: int) -> None:
        row = decode.truth(message)
        check_frame("poses of the reference", row.frame, self.ros.frames.map)
        rows = self._rows("truth", stamp_ns=np.int64, record_ns=np.int64, x_m=float, y_m=float,
                          z_m=float, heading_rad=float)  # fmt: skip
        rows.add(row.stamp_ns, time_ns, *row[1:5])

    def _map(self, message: Any, _: int) -> None:
        grid = decode.grid(message)
        check_frame("maps", message.header.frame_id, self.ros.frames.map)
        self.grid = grid

    def _anchors(self, message: Any, time_ns: int) -> None:
        self._points("anchors", message)

    def _landmarks(self, message: Any, time_ns: int) -> None:
        self._points("landmarks", message)

    def _points(self, stem: str, message: Any) -> None:
        """Take points; those of a name that came before are replaced."""
        names, at, radii = decode.points(message)
        check_frame(stem, message.header.frame_id, self.ros.frames.map)
        rows = self.tables[stem] = Rows(name=np.str_, x_m=float, y_m=float, z_m=float,
                                        radius_m=float)  # fmt: skip
        for index, name in enumerate(names):
            rows.add(name, *at[index].tolist(), math.nan if radii is None else radii[index])

    def _relation(self, message: Any, _: int) -> None:
        rows = self._rows("relations", begin_ns=np.int64, end_ns=np.int64, dx_m=float, dy_m=float,
                          dheading_rad=float)  # fmt: skip
        rows.add(*decode.relation(message))

    def _transforms(self, message: Any, _: int) -> None:
        self.tree.add(decode.transforms(message))

    def _settings(self, message: Any, _: int) -> None:
        self.settings = bag_settings.settings_of(str(getattr(message, "data", "")))

    # Making a log of it ----------------------------------------------------------------------

    def _find_mounts(self, bag: Bag) -> None:
        """Look through tf for mounts that tf_static does not tell: ROS 1 may tell them there."""
        wanted = {self.laser[0]} if self.laser else set()
        wanted |= {frame for frame in self.tag_frames.values() if frame}
        wanted |= {self.sight_frame} if self.sight_frame else set()
        wanted = {str(frame) for frame in wanted if str(frame) not in self.tree}
        if not wanted or self.settings or not any(c.topic == "tf" for c in bag.counts):
            return
        moving = plain(self.ros.frames.odom), plain(self.ros.frames.map)
        again = Bag(self.path)
        unusable: tuple[type[Exception], ...] = (MessageError, *broken())
        for number, (connection, _, data) in enumerate(again.messages(lambda c: c.topic == "tf")):
            decoder = self._decoder(connection)
            if number == MOST_TRANSFORMS or decoder is None or all(f in self.tree for f in wanted):
                return
            try:
                rows = decode.transforms(decoder(data))
            except unusable:
                continue
            self.tree.add(row for row in rows if row.parent not in moving)

    def _log(self, bag: Bag) -> Log:
        own_clock = self._own_clock()
        tables: dict[str, Columns] = {}
        for stem in [stem for stem in ORDER if stem in self.tables]:
            raw = self.tables.pop(stem).columns()
            if "record_ns" in raw:
                raw = self._timed(stem, raw, own_clock)
            tables[stem] = getattr(self, f"_table_{stem}", _as_it_is)(raw)
        told = self.settings.columns if self.settings else {}
        for stem, names in told.items():
            if stem in tables:
                tables[stem] = {name: tables[stem][name] for name in names if name in tables[stem]}
            elif stem in MAY_BE_EMPTY:
                tables[stem] = _empty(names)
        filled = [stem for stem in tables if stem in MAY_BE_EMPTY or _length(tables[stem])]
        tables = {stem: tables[stem] for stem in [*told, *filled] if stem in filled}
        return self._with_world(tables, bag)

    def _own_clock(self) -> bool:
        """Return whether record times count from the origin of the stamps."""
        if self.settings is not None:
            return True
        lags = [
            rows.lag_ns() for stem, rows in self.tables.items() if stem in MESSAGES and len(rows)
        ]
        lag = float(np.median(lags)) if lags else 0.0
        if abs(lag) <= OTHER_CLOCK_NS:
            return True
        self._tell(f"was recorded {lag / NANOSECONDS:.6g} s after the stamps of its messages, by "
                   "another clock; so messages arrive at their stamps")  # fmt: skip
        return False

    def _timed(self, stem: str, raw: Columns, own_clock: bool) -> Columns:
        """Return a table with stamps and arrivals of the log, in order; `record_ns` is gone."""
        record = raw.pop("record_ns")
        if own_clock:
            raw, record = self._without_future(stem, raw, record)
        shift = self.settings.shift_ns if self.settings else 0
        raw["stamp_ns"] = stamp = raw["stamp_ns"] - shift
        arrival = np.maximum(record - shift, stamp) if own_clock else stamp
        keeps = bool((arrival != stamp).any())
        if self.settings is not None and stem in self.settings.columns:
            keeps = "arrival_ns" in self.settings.columns[stem]
        if stem in MESSAGES and keeps:
            raw["arrival_ns"] = arrival
        by = stamp if stem in INCREASING or not keeps else arrival
        if (np.diff(by) < 0).any():
            order = np.argsort(by, kind="stable")
            raw = {name: values[order] for name, values in raw.items()}
        return self._increasing(stem, raw) if stem in INCREASING else raw

    def _without_future(
        self, stem: str, raw: Columns, record: NDArray[Any]
    ) -> tuple[Columns, NDArray[Any]]:
        ahead = raw["stamp_ns"] - record
        if not (ahead > AHEAD_NS).any():
            return raw, record
        far = ahead > OTHER_CLOCK_NS
        near = int((ahead > AHEAD_NS).sum() - far.sum())
        if near:
            most = ahead[~far].max() / NANOSECONDS
            self._tell(f"{near} of the {stem} are stamped up to {most:.3g} s after they were "
                       "recorded; they arrive when stamped. Do the clocks agree?")  # fmt: skip
        if far.any():
            self._tell(f"{int(far.sum())} of the {stem} are stamped more than an hour after they "
                       "were recorded and are left out")  # fmt: skip
        return {name: values[~far] for name, values in raw.items()}, record[~far]

    def _increasing(self, stem: str, raw: Columns) -> Columns:
        repeats = np.concatenate([[False], np.diff(raw["stamp_ns"]) == 0])
        if not repeats.any():
            return raw
        self._tell(f"{int(repeats.sum())} messages of {stem} have the stamp of "
                       "another and are left out")  # fmt: skip
        return {name: values[~repeats] for name, values in raw.items()}

    def _table_odometry(self, raw: Columns) -> Columns:
        stamp = raw["stamp_ns"]
        times = {"arrival_ns": raw["arrival_ns"]} if "arrival_ns" in raw else {}
        if self._odometry_from() == "twist":
            return {"stamp_ns": stamp, "v_mps": raw["v_mps"], "omega_radps": raw["omega_radps"],
                    **times}  # fmt: skip
        motion = self._without_jumps(stamp, np.column_stack([raw["x"], raw["y"], raw["heading"]]))
        return {"stamp_ns": stamp, "dx_m": motion[:, 0].copy(), "dy_m": motion[:, 1].copy(),
                "dheading_rad": motion[:, 2].copy(), **times}  # fmt: skip

    def _without_jumps(self, stamp: NDArray[Any], poses: FloatArray) -> FloatArray:
        """Return increments; where odometry was set anew the body did not move."""
        motion = increments_of(poses)
        seconds = np.maximum(np.diff(stamp, prepend=stamp[0] - NANOSECONDS) / NANOSECONDS, 1e-9)
        fast = np.hypot(motion[:, 0], motion[:, 1]) / seconds > MAX_SPEED_MPS
        fast |= np.abs(motion[:, 2]) / seconds > MAX_TURN_RATE_RADPS
        fast[0] = False
        if fast.any():
            first = int(np.argmax(fast))
            self._tell(f"odometry jumps {int(fast.sum())} times, first by "
                       f"{np.hypot(*motion[first, :2]):.3g} m at "
                       f"{stamp[first] / NANOSECONDS:.3f} s; it was set anew, so no motion is "
                       "taken there")  # fmt: skip
            motion[fast] = 0.0
        return motion

    def _table_ranges(self, raw: Columns) -> Columns:
        return self._known_sigmas("ranges", raw, ("sigma_m",))

    def _table_landmark_sightings(self, raw: Columns) -> Columns:
        names = ("sigma_range_m", "sigma_bearing_rad")
        return self._known_sigmas("landmark_sightings", raw, names)

    def _known_sigmas(self, stem: str, raw: Columns, names: tuple[str, ...]) -> Columns:
        """Return a table with sigmas where all rows have them, else without."""
        unknown = np.isnan(raw[names[0]])
        if not unknown.any():
            return raw
        if not unknown.all():
            self._tell(f"{int(unknown.sum())} of {len(unknown)} {stem} bring no "
                           "sigma; those of the others are left out, too")  # fmt: skip
        return {name: values for name, values in raw.items() if name not in names}

    def _table_positions(self, raw: Columns) -> Columns:
        if (raw["tag"] == "").all() and not self._told("positions", "tag"):
            raw.pop("tag")
        return raw

    def _table_truth(self, raw: Columns) -> Columns:
        if np.isnan(raw["heading_rad"]).any():
            raw.pop("heading_rad")
        if not raw["z_m"].any() and not self._told("truth", "z_m"):
            raw.pop("z_m")
        return raw

    def _table_anchors(self, raw: Columns) -> Columns:
        return {"anchor": raw["name"], **{key: raw[key] for key in ("x_m", "y_m", "z_m")}}

    def _table_landmarks(self, raw: Columns) -> Columns:
        table = {"landmark": raw["name"], "x_m": raw["x_m"], "y_m": raw["y_m"]}
        if raw["z_m"].any() or self._told("landmarks", "z_m"):
            table["z_m"] = raw["z_m"]
        if not np.isnan(raw["radius_m"]).any():
            table["radius_m"] = raw["radius_m"]
        return table

    def _table_relations(self, raw: Columns) -> Columns:
        shift = self.settings.shift_ns if self.settings else 0
        return {**raw, "begin_ns": raw["begin_ns"] - shift, "end_ns": raw["end_ns"] - shift}

    def _told(self, stem: str, column: str) -> bool:
        return self.settings is not None and column in self.settings.columns.get(stem, ())

    # The world -------------------------------------------------------------------------------

    def _with_world(self, tables: dict[str, Columns], bag: Bag) -> Log:
        told = dict(self.settings.log) if self.settings else {}
        world = self.world or Log(tables={})
        for stem in ("anchors", "landmarks"):
            if stem in world:
                tables[stem] = dict(world[stem])
        tags = {**self._tags(told.get("tags", {}), world), **world.tags}
        laser = self._laser(told.get("laser"), world)
        if laser is None and "scans" in tables:
            tables.pop("scans")
        if not any(len(tables[stem]["stamp_ns"]) for stem in MESSAGES if stem in tables):
            raise LogError(self._nothing(bag))
        grid = world.grid or self.grid
        name = world.map if world.grid is not None else told.get("map") or "map.yaml"
        return Log(
            tables=tables,
            tags=tags,
            laser=laser,
            map=name if grid is not None else None,
            grid=grid,
            description=told.get("description", ""),
            licence=told.get("licence", ""),
            landmark_sensor=self._landmark_sensor(told.get("landmark_sensor"), world),
        )

    def _laser(self, told: Any, world: Log) -> Any:
        if self.laser is None:
            return told or world.laser
        frame, start, increment, nearest, farthest, *_ = self.laser
        geometry = {"angle_min_rad": start, "angle_increment_rad": increment,
                    "range_min_m": nearest, "range_max_m": farthest}  # fmt: skip
        if told is not None and all(decode.decimal(told[key]) == value
                                    for key, value in geometry.items()):  # fmt: skip
            return dict(told)
        try:
            if world.laser is not None:
                pose = list(world.laser["pose_in_body"])
                flipped = frame in self.tree and self.tree.upside_down(frame)
            else:
                x, y, _, heading = self.tree.mount(frame)
                pose, flipped = [x, y, heading], self.tree.upside_down(frame)
        except MessageError as error:
            self._lost("scans", f"{error}")
            return None
        if flipped:
            geometry |= {"angle_min_rad": -start, "angle_increment_rad": -increment}
        return {"pose_in_body": pose, **geometry}

    def _tags(self, told: Any, world: Log) -> dict[str, tuple[float, float, float]]:
        found = {name: tuple(at) for name, at in told.items()}
        for tag, frame in self.tag_frames.items():
            if tag in found or tag in world.tags:
                continue
            try:
                mount = self.tree.mount(frame or tag)
                found[tag] = (mount.x, mount.y, mount.z)
            except MessageError as error:
                self._tell(f"where the tag {tag!r} sits is not known: {error}")
        return found

    def _landmark_sensor(self, told: Any, world: Log) -> Any:
        if world.landmark_sensor is not None:
            return world.landmark_sensor
        if told is not None or not self.sight_frame or self.settings is not None:
            return told
        try:
            x, y, _, heading = self.tree.mount(self.sight_frame)
        except MessageError as error:
            logger.warning(
                f"{self.path}: landmarks are taken as seen from the body's origin: {error}"
            )
            return None
        return {"pose_in_body": [x, y, heading]}

    # Saying what is missing ------------------------------------------------------------------

    def _lost(self, key: str, why: str) -> None:
        topic = plain(getattr(self.ros.topics, key) or key)
        self._left_out(topic, why, self.heard.pop(topic, 1))

    def _say(self, bag: Bag) -> None:
        """Say what was left out, and which topics were asked for by name but are not there."""
        for topic, trouble in self.trouble.items():
            total = trouble.count + self.heard.get(topic, 0)
            self._tell(f"{trouble.count} of {total} messages on {topic} are left "
                           f"out: {trouble.first}")  # fmt: skip
        for key, topic in self._silent(bag):
            if key in self.ros.topics.model_fields_set:
                advice = self._advice(key, bag) or f"; {_named(bag)}"
                self._tell(f"nothing on {topic}, where ros.topics.{key} is expected{advice}")
            elif advice := self._advice(key, bag):
                self._tell(f"nothing on {topic}{advice}")
        for topic in self.ros.range_topics:
            if not any(c.topic == plain(topic) for c in bag.counts):
                self._tell(f"nothing on {plain(topic)}, where ros.range_topics "
                               f"expects an anchor; {_named(bag)}")  # fmt: skip

    def _silent(self, bag: Bag) -> Iterator[tuple[str, str]]:
        there = {connection.topic for connection in bag.counts}
        for key in (*TYPES, "anchors", "landmarks", "truth"):
            topic = getattr(self.ros.topics, key)
            if topic is not None and plain(topic) not in there:
                yield key, plain(topic)

    def _advice(self, key: str, bag: Bag) -> str:
        """Return which topics have the type that one without messages should have."""
        told = {plain(t) for t in vars(self.ros.topics).values() if t is not None}
        others = sorted(c.topic for c in bag.counts
                        if c.type == TYPES.get(key) and c.topic not in told)  # fmt: skip
        if not others:
            return ""
        return f"; {' and '.join(others)} of that type ({TYPES[key]}) may be meant: " \
               f"set ros.topics.{key}"  # fmt: skip

    def _nothing(self, bag: Bag) -> str:
        """Return why there is no log, in a sentence."""
        for topic, trouble in self.trouble.items():
            return (f"{self.path}: no message can be used; {trouble.count} on {topic} are left "
                    f"out: {trouble.first}")  # fmt: skip
        for sentence in bag.damage:
            return sentence
        for key, topic in self._silent(bag):
            if advice := self._advice(key, bag):
                return f"{self.path}: nothing on {topic}{advice}"
        return f"{self.path}: no message on a topic that ros.topics names; {_named(bag)}"


ORDER = ("odometry", "ranges", "positions", "poses", "landmark_sightings", "scans", "truth",
         "relations", "anchors", "landmarks")  # fmt: skip


def _named(bag: Bag) -> str:
    """Return which topics there are."""
    there = sorted({f"{c.topic} ({c.type})" for c in bag.counts})
    return f"the bag has {', '.join(there)}" if there else "the bag is empty"


def _length(table: Columns) -> int:
    return len(next(iter(table.values())))


def _check_range(row: decode.RangeRow) -> None:
    if row.range_m > MAX_RANGE_M:
        raise MessageError(f"a range of {row.range_m:g} m; are distances in mm? ros.uwb_unit says "
                           "what they are")  # fmt: skip


def _as_it_is(raw: Columns) -> Columns:
    return raw


def _empty(names: Iterable[str]) -> Columns:
    """Return the columns of a message table without rows."""
    texts = ("tag", "anchor", "landmark")
    return {
        name: np.zeros((0, 1) if name in ("ranges_m", "intensities") else 0,
                       np.int64 if name.endswith("_ns") else np.str_ if name in texts else float)
        for name in names
    }  # fmt: skip


def _sigmas(covariance: FloatArray) -> tuple[float, float]:
    """Return sigmas of position and heading; -1 or 0 where a driver says that it knows none."""
    if covariance[0, 0] == -1.0:
        return -1.0, -1.0
    if not covariance.any():
        return 0.0, 0.0
    xy, heading = 0.5 * (covariance[0, 0] + covariance[1, 1]), covariance[2, 2]
    if not (xy > 0.0 and heading > 0.0):
        raise MessageError(f"the variances of x, y and heading are {covariance[0, 0]:g}, "
                           f"{covariance[1, 1]:g} and {heading:g}; expected > 0, or all 0 or -1 "
                           "first where they are not known")  # fmt: skip
    return min(math.sqrt(xy), NOT_MEASURED_M), min(math.sqrt(heading), NOT_MEASURED_M)
