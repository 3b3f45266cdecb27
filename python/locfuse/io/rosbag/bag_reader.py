# SPDX-License-Identifier: Apache-2.0
"""From the messages of a bag to a log."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.ros import Ros, plain
from locfuse.io.log_folder import MAX_LASERS, MAX_RANGE_M, MAX_STAMP_NS, MAX_TURN_RATE_RADPS
from locfuse.io.rosbag import bag_settings, clouds, decode, rows
from locfuse.io.rosbag.bag_contents import BagContents, Laser, logger
from locfuse.io.rosbag.bag_log import log_of
from locfuse.io.rosbag.bag_stream import Bag
from locfuse.io.rosbag.bag_tables import tables_of
from locfuse.io.rosbag.bag_warnings import nothing, say
from locfuse.io.rosbag.columns import Blocks
from locfuse.io.rosbag.container import Connection, NeedError
from locfuse.io.rosbag.decode import MessageError, RangeRow, ScanRow
from locfuse.io.rosbag.fields import OtherMessages
from locfuse.io.rosbag.frames import check_frame, sensor_pose
from locfuse.io.rosbag.rows import Row
from locfuse.io.rosbag.wire import broken, deserializer
from locfuse.types import MAX_SPEED_MPS, Log, LogError

Progress = Callable[[int, int], None]
Reader = Callable[[Any, str], Sequence[Row]]  # rows of a message on a topic

MAX_DEFINITIONS = 1 << 17  # letters of all that are used: 15,000 fields take 20 s
MAX_TRANSFORMS = 20_000  # messages on tf that are searched for a mount that tf_static lacks


def read_bag(
    path: str | Path, ros: Ros | None = None, world: Log | None = None,
    progress: Progress | None = None, *, antennas: bool = True,
) -> Log:  # fmt: skip
    """Read a bag of either ROS as a log.

    What cannot be used is left out with a warning on the logger ``locfuse``: an invalid message,
    a configured topic that is missing, damage. Messages arrive when they were recorded, but never
    before their stamp; where record times and stamps come from different clocks, they arrive at
    their stamps. See ``docs/ros.md``.

    Parameters
    ----------
    path : str or Path
        A ``.bag`` of ROS 1, a ``.mcap``, or a ``.db3`` or folder of ROS 2.
    ros : Ros, optional
        Topics and frames; by default the usual names.
    world : Log, optional
        Anchors, landmarks, tags, mounts and map, which override those of the bag.
    progress : callable, optional
        Called with (bytes read, total bytes).
    antennas : bool
        Whether fixes of an antenna that static transforms place beside the body's origin become
        those of a tag of its frame's name.

    Returns
    -------
    Log

    Raises
    ------
    LogError
        If the bag does not exist or holds no usable message, or rosbags is missing.
    """
    contents = BagContents(Path(path), Ros() if ros is None else ros,
                           Log(tables={}) if world is None else world,
                           places_antennas=antennas)  # fmt: skip
    bag = Bag(contents.path, progress)
    reader = _BagReader(contents)
    with np.errstate(all="ignore"):  # what overflows is rejected for the value it becomes
        reader.read(bag)
    reader.finish_positions()
    reader.find_mounts(bag)
    for sentence in bag.damage:
        logger.warning(sentence)
    log = log_of(contents, tables_of(contents))
    if log is None:
        raise LogError(nothing(contents, bag))
    say(contents, bag)
    return log


class _BagReader:
    """Decodes the messages of a bag into rows of tables and into what is known of the world."""

    def __init__(self, contents: BagContents) -> None:
        self.contents = contents
        self.deserializers: dict[Connection, Callable[[bytes], Any] | None] = {}
        self.letters = 0  # of definitions
        self.searched: set[str] = set()  # frames of clouds and of IMUs
        ros = contents.ros
        self.others = OtherMessages(ros)
        self.single_ranges = set(map(plain, ros.range_topics))
        self.readers: dict[str, tuple[str, Reader]] = {  # table and reader by topic
            "tf_static": ("", self._transforms),
            bag_settings.TOPIC: ("", self._settings),
            bag_settings.RELATIONS: ("relations", self._relation),
        }
        world: dict[str, Reader] = {"map": self._map, "anchors": partial(self._points, "anchors"),
                                    "landmarks": partial(self._points, "landmarks")}  # fmt: skip
        for key, reader in world.items():
            self.readers |= dict.fromkeys(ros.topics.of(key), ("", reader))
        for topic, anchor in ros.range_topics.items():
            self.readers[plain(topic)] = "ranges", partial(self._range_of, anchor)
        for key, reader in (
            ("odometry", self._odometry),
            ("imu", self._imu),
            ("scans", self._scan),
            ("ranges", self._ranges),
            ("poses", self._pose),
            ("positions", self._position),
            ("truth", self._truth),
            ("landmark_sightings", self._sightings),
            ("altitudes", self._altitude),
        ):
            self.readers |= dict.fromkeys(ros.topics.of(key), (key, reader))
        self.readers |= dict.fromkeys(ros.topics.of("courses"), ("headings", self._course))
        headings = dict.fromkeys(ros.topics.of("headings"), ("headings", self._heading))
        self.orientations = set(headings) & set(self.readers)  # of an IMU that is read anyway
        self.readers = headings | self.readers

    def read(self, bag: Bag) -> None:
        """Read all messages of the topics that have a reader."""
        unusable = broken()
        for connection, time_ns, data in bag.messages(lambda c: c.topic in self.readers):
            topic = connection.topic
            deserialize = self._deserializer(connection)
            if deserialize is None:
                continue
            if not 0 <= time_ns < MAX_STAMP_NS:
                self.contents.skip(topic, f"it was recorded at {time_ns} ns, which is no time")
                continue
            try:
                message = deserialize(data)
            except unusable as error:
                self.contents.skip(topic, f"it cannot be unpacked ({error})")
                continue
            try:
                if topic not in self.single_ranges:
                    message = self.others.shaped(
                        self.readers[topic][0],
                        message,
                        connection.type,
                        time_ns,
                        partial(self._skip_one, topic),
                    )
                if message is not None:
                    self._read(topic, time_ns, message)
            except (MessageError, LogError) as error:
                self.contents.skip(topic, str(error))

    def _read(self, topic: str, time_ns: int, message: Any) -> None:
        found = self._rows_of(topic, message)
        for _, row in found:
            if row.get("stamp_ns", 0) >= MAX_STAMP_NS:
                raise MessageError(f"the stamp is {row['stamp_ns']} ns, which is beyond any time")
        self.contents.count(topic, 1)
        for stem, row in found:
            record = {} if stem == "relations" else {"record_ns": time_ns}
            self.contents.tables.setdefault(stem, Blocks()).append({**record, **row})

    def _rows_of(self, topic: str, message: Any) -> list[tuple[str, Row]]:
        """Return rows, each with its table; of an IMU gyro and orientation where they are there.

        Raises MessageError if nothing of a message can be used.
        """
        stem, reader = self.readers[topic]
        if topic not in self.orientations:
            return [(stem, row) for row in reader(message, topic)]
        found: list[tuple[str, Row]] = []
        refused: list[MessageError] = []
        for one, read in ((stem, reader), ("headings", self._heading)):
            try:
                found += [(one, row) for row in read(message, topic)]
            except MessageError as error:
                refused.append(error)
        if len(refused) > 1:
            raise refused[0]
        return found

    def _skip_one(self, topic: str, error: MessageError) -> None:
        """Leave out one measurement of several in a message."""
        self.contents.skip(f"{topic}, singly,", str(error))

    def finish_positions(self) -> None:
        """Take the fix that waited for another, and say where the map begins."""
        for sentence in self.others.problems():
            self.contents.warn(sentence)
        fixes = self.contents.fixes
        for row in fixes.last_row():
            found = {"record_ns": row.stamp_ns, **rows.position_row(row), "frame": row.frame}
            self.contents.tables.setdefault("positions", Blocks()).append(found)
        if fixes.sentence:
            self.contents.warn(fixes.sentence)

    def find_mounts(self, bag: Bag) -> None:
        """Search tf for mounts that tf_static does not have: ROS 1 may publish them there."""
        contents = self.contents
        frames = {
            contents.sight_frame,
            *contents.tag_frames.values(),
            *contents.antennas,
            *(frame for frame, laser in contents.lasers.items() if laser.mount is None),
        }
        missing = {frame for frame in frames if frame and frame not in contents.tree}
        if missing and not contents.settings and any(c.topic == "tf" for c in bag.counts):
            self._search_transforms(missing, ("tf",))

    def _search_transforms(self, missing: set[str], topics: tuple[str, ...]) -> None:
        """Take transforms from anywhere in the bag until they place all these frames."""
        contents = self.contents
        moving = plain(contents.ros.frames.odom), plain(contents.ros.frames.map)
        unusable: tuple[type[Exception], ...] = (MessageError, *broken())
        again = Bag(contents.path).messages(lambda connection: connection.topic in topics)
        for connection, _, data in islice(again, MAX_TRANSFORMS):
            deserialize = self._deserializer(connection)
            if deserialize is None or all(frame in contents.tree for frame in missing):
                return
            with suppress(*unusable):
                found = decode.transforms(deserialize(data))
                contents.tree.add(row for row in found if row.parent not in moving)

    def _deserializer(self, connection: Connection) -> Callable[[bytes], Any] | None:
        """Return the deserializer of a connection; None, with a warning, where there is none."""
        kind = connection._replace(topic="", publisher="")
        if kind not in self.deserializers:
            self.deserializers[kind] = None
            try:
                self.letters += len(kind.definition)
                if self.letters > MAX_DEFINITIONS:
                    raise LogError(f"types are defined by more than {MAX_DEFINITIONS} letters")
                self.deserializers[kind] = deserializer(kind)
            except NeedError:
                raise
            except LogError as error:
                self.contents.skip(connection.topic, str(error))
        return self.deserializers[kind]

    def _odometry(self, message: Any, _: str) -> list[Row]:
        use = self.contents.odometry_from()
        row = decode.odometry(message, use)
        if row.child_frame:
            self.contents.bodies.add(row.child_frame)
        speed = math.hypot(row.v, row.left)
        if use == "twist" and (speed > MAX_SPEED_MPS or abs(row.omega) > MAX_TURN_RATE_RADPS):
            raise MessageError(f"{speed:g} m/s and {row.omega:g} rad/s, which no robot drives")
        return [{"stamp_ns": row.stamp_ns, "x": row.x, "y": row.y, "heading": row.heading,
                 "v_mps": row.v, "v_left_mps": row.left, "omega_radps": row.omega}]  # fmt: skip

    def _scan(self, message: Any, _: str) -> list[Row]:
        row = self._cloud(message) if clouds.is_cloud(message) else decode.scan(message)
        lasers = self.contents.lasers
        if row.frame not in lasers and len(lasers) == MAX_LASERS:
            raise MessageError(f"the scan is in frame {row.frame!r}, but {MAX_LASERS} other lasers "
                               "have come before")  # fmt: skip
        before = lasers.setdefault(row.frame, Laser(*row[2:6], row.time_increment, row.mount))
        lasers[row.frame] = before._replace(
            range_min=min(before.range_min, row.range_min),
            range_max=max(before.range_max, row.range_max),
        )
        if self.contents.bright is None:
            self.contents.bright = row.intensities is not None
        if row.saturated is not None:
            self.contents.saturated.add(row.saturated)
        found: Row = {"stamp_ns": row.stamp_ns, "laser": row.frame,
                      "beams": float(len(row.ranges)), "angle_min_rad": row.angle_min,
                      "angle_increment_rad": row.angle_increment,
                      "ranges_m": row.ranges}  # fmt: skip
        if self.contents.bright:
            unknown = np.full(len(row.ranges), np.nan)
            found["intensities"] = unknown if row.intensities is None else row.intensities
        return [found]

    def _cloud(self, message: Any) -> ScanRow:
        frame, contents = plain(decode.frame_of(message)), self.contents
        is_new = frame not in contents.tree and frame not in self.searched
        if is_new and len(self.searched) < MAX_LASERS:  # transforms may come after the first cloud
            self.searched.add(frame)
            self._search_transforms({frame}, ("tf_static", "tf"))
        pose = sensor_pose(contents.world, contents.tree, frame)
        return clouds.scan_of(message, pose, contents.ros.cloud_heights_m)

    def _ranges(self, message: Any, topic: str) -> list[Row]:
        ros, errors = self.contents.ros, list[MessageError]()
        found = decode.ranges(message, ros.uwb_unit, ros.uwb_tag, errors.append)
        return self._range_rows(topic, found, errors)

    def _range_of(self, anchor: str, message: Any, topic: str) -> list[Row]:
        row = decode.range_of(message, self.contents.ros.uwb_tag, anchor)
        return self._range_rows(topic, [] if row is None else [row], [])

    def _range_rows(
        self, topic: str, found: list[RangeRow], errors: list[MessageError]
    ) -> list[Row]:
        """Return the usable ranges of a message; raise if there are only others."""
        near = [row for row in found if row.range_m <= MAX_RANGE_M]
        errors += [MessageError(f"a range of {row.range_m:g} m; are distances in mm? ros.uwb_unit "
                                "says what they are, or ros.fields, as range_mm")
                   for row in found if row.range_m > MAX_RANGE_M]  # fmt: skip
        if errors and not near:
            raise errors[0]
        single = f"{topic}, singly,"
        for error in errors:
            self.contents.skip(single, str(error))
        self.contents.count(single, len(near))
        for row in near:
            self.contents.tag_frames.setdefault(row.tag, row.frame)
        return [rows.range_row(row) | ({"sigma_m": np.nan} if row.sigma_m is None else {})
                for row in near]  # fmt: skip

    def _pose(self, message: Any, _: str) -> list[Row]:
        row = decode.pose(message)
        check_frame("poses", row.frame, self.contents.ros.frames.map)
        return [rows.pose_row(row)]

    def _position(self, message: Any, _: str) -> list[Row]:
        contents = self.contents
        found = contents.fixes.rows(message)
        if hasattr(message, "latitude"):
            contents.antennas.add(plain(message.header.frame_id))
        else:
            check_frame("positions", message.header.frame_id, contents.ros.frames.map)
        return [rows.position_row(row) | {"frame": row.frame} for row in found]

    def _truth(self, message: Any, _: str) -> list[Row]:
        row = decode.truth(message)
        check_frame("poses of the reference", row.frame, self.contents.ros.frames.map)
        return [{"stamp_ns": row.stamp_ns, "x_m": row.x, "y_m": row.y, "z_m": row.z,
                 "heading_rad": row.heading}]  # fmt: skip

    def _sightings(self, message: Any, topic: str) -> list[Row]:
        found = decode.sightings(message)
        for row in found:
            if self.contents.sight_frame is None:
                self.contents.sight_frame = row.frame
            if row.frame != self.contents.sight_frame:
                raise MessageError(
                    f"a sighting is in frame {row.frame!r}, the first in "
                    f"{self.contents.sight_frame!r}: a log has one such sensor"
                )
        self.contents.count(f"{topic}, singly,", len(found))
        unknown = dict.fromkeys(rows.SIGHTED, np.nan)
        return [unknown | rows.sighting_row(row) for row in found]

    def _altitude(self, message: Any, _: str) -> list[Row]:
        row = decode.altitude(message)
        if row is None:
            return []
        check_frame("altitudes", row.frame, self.contents.ros.frames.map)
        return [{"sigma_m": np.nan, **rows.altitude_row(row)}]

    def _heading(self, message: Any, _: str) -> list[Row]:
        return [rows.heading_row(decode.heading(message, self.contents.ros.gps_origin))]

    def _course(self, message: Any, _: str) -> list[Row]:
        row = decode.course(message, self.contents.ros.gps_origin)
        return [] if row is None else [rows.heading_row(row)]

    def _imu(self, message: Any, _: str) -> list[Row]:
        frame, tree = plain(decode.frame_of(message)), self.contents.tree
        is_new = frame and frame not in tree and frame not in self.searched
        if is_new and len(self.searched) < MAX_LASERS:  # transforms may come after the first sample
            self.searched.add(frame)
            self._search_transforms({frame}, ("tf_static", "tf"))
        return [rows.imu_row(decode.imu(message), tree.turn(frame))]

    def _transforms(self, message: Any, _: str) -> list[Row]:
        self.contents.tree.add(decode.transforms(message))
        return []

    def _settings(self, message: Any, _: str) -> list[Row]:
        self.contents.settings = bag_settings.settings_of(str(getattr(message, "data", "")))
        return []

    def _map(self, message: Any, _: str) -> list[Row]:
        grid = decode.grid(message)
        check_frame("maps", decode.frame_of(message), self.contents.ros.frames.map)
        self.contents.grid = grid
        return []

    def _points(self, stem: str, message: Any, _: str) -> list[Row]:
        """Read points, which replace those of an earlier message."""
        names, at, radii = decode.points(message)
        check_frame(stem, decode.frame_of(message), self.contents.ros.frames.map)
        points = self.contents.tables[stem] = Blocks()
        points.add({"name": np.array(names, np.str_), "x_m": at[:, 0], "y_m": at[:, 1],
                    "z_m": at[:, 2],
                    "radius_m": np.full(len(at), np.nan) if radii is None else radii})  # fmt: skip
        return []

    def _relation(self, message: Any, _: str) -> list[Row]:
        names = ("begin_ns", "end_ns", "dx_m", "dy_m", "dheading_rad")
        return [dict(zip(names, decode.relation(message), strict=True))]
