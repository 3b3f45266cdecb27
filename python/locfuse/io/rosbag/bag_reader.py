# SPDX-License-Identifier: Apache-2.0
"""From the messages of a bag to a log."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from locfuse.config.ros import Ros, plain
from locfuse.io.log_folder import MAX_STAMP_NS
from locfuse.io.rosbag import bag_checks as checks
from locfuse.io.rosbag import bag_settings, decode, decode_many
from locfuse.io.rosbag.bag_contents import Heard, logger
from locfuse.io.rosbag.bag_log import log_of
from locfuse.io.rosbag.bag_stream import Bag
from locfuse.io.rosbag.bag_tables import tables_of
from locfuse.io.rosbag.bag_warnings import nothing, say
from locfuse.io.rosbag.columns import Blocks
from locfuse.io.rosbag.container import Connection
from locfuse.io.rosbag.decode import MessageError
from locfuse.io.rosbag.decode_many import Said
from locfuse.io.rosbag.frames import check_frame
from locfuse.io.rosbag.optional_rosbags import NeedError
from locfuse.io.rosbag.unpack import MisfitError, Structure, Unpacked, unpack
from locfuse.io.rosbag.wire import broken, deserializer, structure
from locfuse.types import Columns, Log, LogError

Progress = Callable[[int, int], None]

BLOCK_MESSAGES, BLOCK_BYTES = 8192, 1 << 22  # that are unpacked at once
NO_TIME = "it was recorded at {} ns, which is no time"
NO_MESSAGE = "it cannot be unpacked ({})"
MOST_TRANSFORMS = 20_000  # messages on tf that are looked through for a mount that tf_static lacks


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
    heard = Heard(Path(path), Ros() if ros is None else ros,
                  Log(tables={}) if world is None else world)  # fmt: skip
    bag = Bag(heard.path, progress)
    reading = _Reading(heard)
    reading.read(bag)
    reading.find_mounts(bag)
    for sentence in bag.damage:
        logger.warning(sentence)
    log = log_of(heard, tables_of(heard))
    if log is None:
        raise LogError(nothing(heard, bag))
    say(heard, bag)
    return log


class _Table(NamedTuple):
    """A topic whose messages become rows: those of many at once, and why one of them does not."""

    stem: str
    said: Callable[[Unpacked], Said]
    check: Callable[[Any, Heard], None]


@dataclass
class _Sender:
    """A connection, how its messages are read, and those that wait for others to be unpacked with.

    They wait as (number, record time [ns], bytes).
    """

    connection: Connection
    structure: Structure
    waiting: list[tuple[int, int, bytes]] = field(default_factory=list)


class _LeftOut(NamedTuple):
    """A message, or one of the things that it says, of which no row is made."""

    number: int
    topic: str
    sender: _Sender
    data: bytes


@dataclass
class _Block:
    """What messages that waited together say: parts of tables, frames of tags, what is left out."""

    tables: dict[str, list[Columns]] = field(default_factory=dict)
    frames: list[tuple[int, str, str]] = field(default_factory=list)
    left_out: list[_LeftOut] = field(default_factory=list)


class _Reading:
    """The messages of a bag on their way into tables.

    Those that become rows wait until there are many; what is said of the world is taken at once.
    """

    def __init__(self, heard: Heard) -> None:
        self.heard = heard
        self.senders: dict[Connection, _Sender | None] = {}
        topics = {key: plain(topic) for key, topic in vars(heard.ros.topics).items() if topic}
        self.world: dict[str, Callable[[Any], None]] = {
            "tf_static": self._transforms,
            bag_settings.TOPIC: self._settings,
            bag_settings.RELATIONS: self._relation,
        }
        self.tables = {
            plain(topic): _Table("ranges", partial(self._range_of, anchor),
                                 partial(checks.range_of, anchor))
            for topic, anchor in heard.ros.range_topics.items()
        }  # fmt: skip
        for table in (
            _Table("odometry", self._odometry, checks.odometry),
            _Table("scans", self._scans, checks.scan),
            _Table("ranges", self._ranges, checks.ranges),
            _Table("poses", self._poses, checks.pose),
            _Table("positions", self._positions, checks.position),
            _Table("truth", self._truth, checks.truth),
            _Table("landmark_sightings", self._sightings, checks.sightings),
        ):
            if table.stem in topics:
                self.tables[topics[table.stem]] = table
        for key, take in (
            ("map", self._map),
            ("anchors", partial(self._points, "anchors")),
            ("landmarks", partial(self._points, "landmarks")),
        ):
            if key in topics:
                self.world[topics[key]] = take

    def read(self, bag: Bag) -> None:
        """Take all messages of the topics that count."""
        number, full, room = 0, BLOCK_MESSAGES, BLOCK_BYTES
        for connection, time_ns, data in bag.messages(self._wanted):
            sender = self._sender(connection)
            if sender is None:
                continue
            if not 0 <= time_ns < MAX_STAMP_NS:
                self.heard.left_out(connection.topic, partial(NO_TIME.format, time_ns))
            elif connection.topic not in self.tables:
                self._take(sender, data)
            else:
                sender.waiting.append((number, time_ns, data))
                number, room = number + 1, room - len(data)
                if number == full or room <= 0:
                    self._unpack()
                    full, room = number + BLOCK_MESSAGES, BLOCK_BYTES
        self._unpack()

    def find_mounts(self, bag: Bag) -> None:
        """Look through tf for mounts that tf_static does not tell: ROS 1 may tell them there."""
        heard = self.heard
        frames = {heard.sight_frame, *heard.tag_frames.values()}
        if heard.laser is not None:
            frames.add(heard.laser.frame)
        missing = {frame for frame in frames if frame and frame not in heard.tree}
        if not missing or heard.settings or not any(c.topic == "tf" for c in bag.counts):
            return
        moving = plain(heard.ros.frames.odom), plain(heard.ros.frames.map)
        unusable: tuple[type[Exception], ...] = (MessageError, *broken())
        again = Bag(heard.path).messages(lambda connection: connection.topic == "tf")
        for connection, _, data in islice(again, MOST_TRANSFORMS):
            sender = self._sender(connection)
            if sender is None or all(frame in heard.tree for frame in missing):
                return
            with suppress(*unusable):
                rows = decode.transforms(deserializer(connection)(data))
                heard.tree.add(row for row in rows if row.parent not in moving)

    def _wanted(self, connection: Connection) -> bool:
        return connection.topic in self.tables or connection.topic in self.world

    def _sender(self, connection: Connection) -> _Sender | None:
        """Return a connection; None, which is told, where nobody can read its messages."""
        if connection not in self.senders:
            self.senders[connection] = None
            try:
                self.senders[connection] = _Sender(connection, structure(connection))
            except NeedError:
                raise
            except LogError as error:
                self.heard.left_out(connection.topic, partial(str, error))
        return self.senders[connection]

    # Messages that become rows ---------------------------------------------------------------

    def _unpack(self) -> None:
        """Make rows of the messages that wait, in the order of the bag."""
        block = _Block()
        for sender in self.senders.values():
            if sender is not None and sender.waiting:
                with np.errstate(all="ignore"):  # what overflows is refused for what it becomes
                    self._rows(sender, block)
                sender.waiting = []
        for stem, parts in block.tables.items():
            self.heard.tables.setdefault(stem, Blocks()).add(_in_order(parts))
        for _, tag, frame in sorted(block.frames, key=itemgetter(0)):
            self.heard.tag_frames.setdefault(tag, frame)
        for one in sorted(block.left_out, key=attrgetter("number")):
            self.heard.left_out(one.topic, partial(self._why, one))

    def _rows(self, sender: _Sender, block: _Block) -> None:
        """Add what the messages of a connection say."""
        numbers, times, data = zip(*sender.waiting, strict=True)
        topic = sender.connection.topic
        table, singly = self.tables[topic], f"{topic}, singly,"
        useless = np.ones(len(data), bool)
        for messages in unpack(sender.structure, sender.connection.encoding, data):
            try:
                said = table.said(messages)
            except MisfitError:
                continue
            useless[messages.rows[said.good]] = False
            self.heard.count(topic, int(said.good.sum()))
            self.heard.count(singly, len(said.rows))
            block.left_out += [_LeftOut(numbers[row], singly, sender, data[row])
                               for row in messages.rows[said.spoilt].tolist()]  # fmt: skip
            block.frames += [(numbers[messages.rows[row]], tag, frame)
                             for row, tag, frame in said.frames]  # fmt: skip
            if len(said.rows):
                rows = messages.rows[said.rows]
                came = {"number": np.array(numbers)[rows], "record_ns": np.array(times)[rows]}
                block.tables.setdefault(table.stem, []).append(came | said.columns)
        block.left_out += [_LeftOut(numbers[row], topic, sender, data[row])
                           for row in np.flatnonzero(useless).tolist()]  # fmt: skip

    def _why(self, one: _LeftOut) -> str:
        """Return why a message means nothing."""
        try:
            message = deserializer(one.sender.connection)(one.data)
        except LogError as error:
            return str(error)
        except broken() as error:
            return NO_MESSAGE.format(error)
        try:
            self.tables[one.sender.connection.topic].check(message, self.heard)
        except (ValueError, TypeError) as error:  # also MessageError
            return str(error)
        return f"its fields are of other kinds than {one.sender.connection.type} should have"

    def _odometry(self, messages: Unpacked) -> Said:
        bodies = messages.text("child_frame_id").names
        self.heard.bodies.update(plain(name) for name in bodies if name)
        return decode_many.odometry(messages, self.heard.odometry_from())

    def _scans(self, messages: Unpacked) -> Said:
        said = decode_many.scans(messages, self.heard.laser)
        self.heard.laser = said.first
        return said

    def _ranges(self, messages: Unpacked) -> Said:
        ros = self.heard.ros
        return decode_many.ranges(messages, ros.uwb_unit, ros.uwb_tag)

    def _range_of(self, anchor: str, messages: Unpacked) -> Said:
        return decode_many.range_of(messages, self.heard.ros.uwb_tag, anchor)

    def _poses(self, messages: Unpacked) -> Said:
        return decode_many.poses(messages, self.heard.ros.frames.map)

    def _positions(self, messages: Unpacked) -> Said:
        heard = self.heard
        said = decode_many.positions(messages, heard.ros.frames.map, heard.origin)
        if heard.origin is None and said.first is not None:
            heard.tell(f"the map's origin is the first fix, at latitude {said.first[0]!r} and "
                       f"longitude {said.first[1]!r}; ros.gps_origin says where it is")  # fmt: skip
            heard.origin = said.first
        return said

    def _truth(self, messages: Unpacked) -> Said:
        return decode_many.truth(messages, self.heard.ros.frames.map)

    def _sightings(self, messages: Unpacked) -> Said:
        said = decode_many.sightings(messages, self.heard.sight_frame)
        self.heard.sight_frame = said.first
        return said

    # What is said of the world ---------------------------------------------------------------

    def _take(self, sender: _Sender, data: bytes) -> None:
        topic = sender.connection.topic
        try:
            self.world[topic](deserializer(sender.connection)(data))
        except (MessageError, LogError) as error:
            self.heard.left_out(topic, partial(str, error))
        except broken() as error:
            self.heard.left_out(topic, partial(NO_MESSAGE.format, error))
        else:
            self.heard.count(topic, 1)

    def _transforms(self, message: Any) -> None:
        self.heard.tree.add(decode.transforms(message))

    def _settings(self, message: Any) -> None:
        self.heard.settings = bag_settings.settings_of(str(getattr(message, "data", "")))

    def _map(self, message: Any) -> None:
        grid = decode.grid(message)
        check_frame("maps", decode.frame_of(message), self.heard.ros.frames.map)
        self.heard.grid = grid

    def _points(self, stem: str, message: Any) -> None:
        """Take points; those of a name that came before are replaced."""
        names, at, radii = decode.points(message)
        check_frame(stem, decode.frame_of(message), self.heard.ros.frames.map)
        points = self.heard.tables[stem] = Blocks()
        points.add({"name": np.array(names, np.str_), "x_m": at[:, 0], "y_m": at[:, 1],
                    "z_m": at[:, 2],
                    "radius_m": np.full(len(at), np.nan) if radii is None else radii})  # fmt: skip

    def _relation(self, message: Any) -> None:
        begin, end, *moved = decode.relation(message)
        row = {"begin_ns": np.array([begin]), "end_ns": np.array([end])}
        motion = zip(("dx_m", "dy_m", "dheading_rad"), moved, strict=True)
        row |= {name: np.array([value]) for name, value in motion}
        self.heard.tables.setdefault("relations", Blocks()).add(row)


def _in_order(parts: list[Columns]) -> Columns:
    """Return rows of several connections in the order of their messages."""
    if len(parts) > 1:
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        order = np.argsort(joined["number"], kind="stable")
        parts = [{name: values[order] for name, values in joined.items()}]
    return {name: values for name, values in parts[0].items() if name != "number"}
