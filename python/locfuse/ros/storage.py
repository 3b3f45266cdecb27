# SPDX-License-Identifier: Apache-2.0
"""The messages that a bag holds, as bytes, one by one in the order of its file.

Bags are read from their beginning on, never by their index: so memory does not grow with them, and
of one that is damaged or was never closed everything before the damage is read.
"""

from __future__ import annotations

import bz2
import os
import re
import sqlite3
import struct
import sys
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

from locfuse.config.ros import plain
from locfuse.io.log_yaml import load_yaml
from locfuse.ros.needs import need
from locfuse.types import LogError

ROS1_MAGIC = b"#ROSBAG V"
MCAP_MAGIC = b"\x89MCAP0\r\n"
SQLITE_MAGIC = b"SQLite format 3\x00"
KINDS = "a .bag of ROS 1, a .mcap, or a .db3 or folder of ROS 2"

LONGEST_HEADER = 1 << 24  # bytes of a record's header; more is damage
BLOCK = 1 << 20
LONGEST_REASON = 200  # letters; some errors quote what they could not read


class Connection(NamedTuple):
    """What a bag says of the messages of a topic.

    `topic` has no leading slash; `type` is as ``nav_msgs/Odometry``; `definition` is the text that
    defines the type, empty where the bag has none; `encoding` is ``ros1`` or ``cdr``; `publisher`
    is the node that told them, empty where the bag does not say, as those of ROS 2.
    """

    topic: str
    type: str
    definition: str
    encoding: str
    is_idl: bool = False
    publisher: str = ""


Wanted = Callable[[Connection], bool]
Message = tuple[Connection, int, bytes]


@dataclass
class Bag:
    """A bag that is being read.

    Attributes
    ----------
    path : Path
        A file, or a folder of ROS 2.
    size : int
        Bytes it has.
    progress : callable, optional
        Told (bytes read, bytes in all).
    counts : Counter of Connection
        Messages seen, wanted or not.
    damage : list of str
        What could not be read, one sentence each.
    """

    path: Path
    progress: Callable[[int, int], None] | None = None
    size: int = 0
    counts: Counter[Connection] = field(default_factory=Counter)
    damage: list[str] = field(default_factory=list)
    _before: int = 0  # bytes of the files before this one
    _share: float = 1.0  # of the bytes of this file that are bytes of the bag
    _told: int = 0

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield connection, record time [ns] and bytes of the messages that are wanted.

        Raises
        ------
        LogError
            If there is no such bag, or it is none.
        """
        files = _files(self.path)
        self.size = sum(path.stat().st_size for path, _ in files)
        self._before = self._told = 0
        self.counts, self.damage = Counter(), []
        for path, packing in files:
            yield from _unpacked(self, path, packing, wanted)
            self._before += path.stat().st_size
            self._share = 0.0
            self.at(0)

    def at(self, position: int) -> None:
        """Tell how far in its file the reader is."""
        done = self._before + int(self._share * position)
        if self.progress is not None and (done >= self._told + BLOCK or done == self.size):
            self._told = done
            self.progress(done, self.size)

    def damaged(self, path: Path, where: int | str, what: str) -> None:
        """Remember that something could not be read."""
        at = f"at byte {where} of {path.stat().st_size}" if isinstance(where, int) else where
        read = sum(self.counts.values())
        self.damage.append(f"{path} is damaged {at} ({what}); the {read} messages before are kept")


def is_bag(path: Path) -> bool:
    """Return whether a path is not that of a log folder: a file, or a folder of a ROS 2 bag."""
    return path.is_file() or (path / "metadata.yaml").is_file()


def _files(path: Path) -> list[tuple[Path, str]]:
    """Return the files of a bag, and how they are packed: ``file``, ``message`` or not."""
    if not path.exists():
        raise LogError(f"{path}: no such bag; expected {KINDS}")
    if path.is_file():
        return [(path, "")]
    if not (path / "metadata.yaml").is_file():
        raise LogError(f"{path}: a folder without metadata.yaml is no bag; expected {KINDS}")
    told = load_yaml(path / "metadata.yaml")
    try:
        told = told["rosbag2_bagfile_information"]
        names = [str(name) for name in told["relative_file_paths"]]
        packing = str(told.get("compression_mode") or "").lower()
    except (KeyError, TypeError, AttributeError):
        raise LogError(f"{path / 'metadata.yaml'}: names no files, expected the "
                       "relative_file_paths of a ROS 2 bag") from None  # fmt: skip
    files = [path / Path(name).name for name in names]
    for file in files:
        if not file.is_file():
            raise LogError(f"{path}: {file.name}, which metadata.yaml names, is not there")
    return [(file, "" if packing == "none" else packing) for file in files]


def _unpacked(bag: Bag, path: Path, packing: str, wanted: Wanted) -> Iterator[Message]:
    if packing == "file":
        with TemporaryDirectory() as folder:
            file = Path(folder) / path.stem
            _unpack(path, file)
            yield from _of_file(bag, file, wanted, packed=path)
    elif packing == "message":
        for connection, time_ns, data in _of_file(bag, path, wanted):
            yield connection, time_ns, _decompressed(data, "zstd", None)
    else:
        yield from _of_file(bag, path, wanted)


def _unpack(packed: Path, file: Path) -> None:
    zstd = _zstd()
    try:
        with zstd.open(packed, "rb") as source, file.open("wb") as target:
            while block := source.read(BLOCK):
                target.write(block)
    except (EOFError, OSError, zstd.ZstdError) as error:
        raise LogError(f"{packed}: cannot be unpacked ({error})") from error


def _of_file(bag: Bag, path: Path, wanted: Wanted, packed: Path | None = None) -> Iterator[Message]:
    """Yield the messages of one file, whose kind its first bytes tell."""
    with path.open("rb") as file:
        magic = file.read(16)
        reader = next((r for start, r in READERS.items() if magic.startswith(start)), None)
        if reader is None:
            what = f"begins with {magic!r}" if magic else "is empty"
            raise LogError(f"{packed or path}: {what}; expected {KINDS}")
        size = path.stat().st_size
        bag._share = 1.0 if packed is None else packed.stat().st_size / size
        file.seek(0)
        yield from reader(bag, path, file, wanted)


class _CutError(Exception):
    """A record ends before its end, or cannot be one."""


def _left(file: BinaryIO) -> int:
    """Return how many bytes follow: a length that is damaged may be any."""
    return os.fstat(file.fileno()).st_size - file.tell()


def _exactly(file: BinaryIO, size: int) -> bytes:
    left = _left(file)
    if left < size:
        raise _CutError(f"{size} bytes were to follow, there are {left}")
    return file.read(size)


# ROS 1 -----------------------------------------------------------------------------------------

_U32 = struct.Struct("<I").unpack_from
_TIME = struct.Struct("<II").unpack
MESSAGE, BAG_HEADER, CHUNK, CONNECTION = 2, 3, 5, 7


def _ros1(bag: Bag, path: Path, file: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    version = file.readline(32).strip()
    if version != b"#ROSBAG V2.0":
        raise LogError(f"{path}: {version.decode('ascii', 'replace')}, expected #ROSBAG V2.0")
    known: dict[int, Connection] = {}
    closed = False
    at = file.tell()
    try:
        while head := file.read(4):
            at = file.tell() - len(head)
            bag.at(at)
            fields = _fields(_header(file, head))
            op = _number(fields, b"op")
            (length,) = _U32(_exactly(file, 4))
            if op == CHUNK:
                yield from _chunk_of_ros1(bag, path, file, fields, length, known, wanted)
            elif op in (MESSAGE, CONNECTION):
                yield from _record(bag, fields, op, _exactly(file, length), known, wanted)
            elif length > _left(file):
                raise _CutError(f"{length} bytes were to follow, there are {_left(file)}")
            else:
                if op == BAG_HEADER:
                    closed = 0 < _number(fields, b"index_pos") <= path.stat().st_size
                file.seek(length, 1)
    except (_CutError, KeyError, struct.error) as error:
        bag.damaged(path, at, _words(error))
        return
    if not closed:
        bag.damaged(path, "at its end", "it was never closed")


def _words(error: Exception) -> str:
    told = f"no field {error}" if isinstance(error, KeyError) else str(error)
    return " ".join(told.split())[:LONGEST_REASON]


def _header(file: BinaryIO, head: bytes) -> bytes:
    if len(head) < 4:
        raise _CutError("a record has no length")
    (length,) = _U32(head)
    if length > LONGEST_HEADER:
        raise _CutError(f"a record's header of {length} bytes")
    return _exactly(file, length)


def _fields(data: bytes) -> dict[bytes, bytes]:
    found: dict[bytes, bytes] = {}
    at = 0
    while at < len(data):
        (length,) = _U32(data, at)
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        at += 4 + length
        if not equals or at > len(data):
            raise _CutError("a record's header is none")
        found[name] = value
    return found


def _number(fields: dict[bytes, bytes], name: bytes) -> int:
    return int.from_bytes(fields[name], "little")


def _chunk_of_ros1(
    bag: Bag,
    path: Path,
    file: BinaryIO,
    fields: dict[bytes, bytes],
    length: int,
    known: dict[int, Connection],
    wanted: Wanted,
) -> Iterator[Message]:
    """Yield the messages of a chunk; one that is damaged is left, and the next one read."""
    at = file.tell()
    data = file.read(min(length, _left(file)))
    packing = fields[b"compression"].decode("ascii", "replace")
    try:
        if len(data) == length or packing == "none":
            yield from _records(bag, _decompressed(data, packing, None), known, wanted)
    except (_CutError, KeyError, struct.error) as error:
        if len(data) == length:
            bag.damaged(path, at, _words(error))
            return
    if len(data) < length:
        raise _CutError(f"a chunk of {length} bytes was to follow, there are {len(data)}")


def _records(
    bag: Bag, data: bytes, known: dict[int, Connection], wanted: Wanted
) -> Iterator[Message]:
    at = 0
    while at < len(data):
        (length,) = _U32(data, at)
        end = at + 4 + length
        fields = _fields(data[at + 4 : end])
        (size,) = _U32(data, end)
        if end + 4 + size > len(data):
            raise _CutError(f"{size} bytes were to follow, there are {len(data) - end - 4}")
        body = data[end + 4 : end + 4 + size]
        at = end + 4 + size
        yield from _record(bag, fields, _number(fields, b"op"), body, known, wanted)


def _record(
    bag: Bag,
    fields: dict[bytes, bytes],
    op: int,
    body: bytes,
    known: dict[int, Connection],
    wanted: Wanted,
) -> Iterator[Message]:
    if op == CONNECTION:
        told = _fields(body)
        topic = told.get(b"topic", fields[b"topic"])
        known[_number(fields, b"conn")] = Connection(
            plain(_text(topic)), _text(told[b"type"]), _text(told[b"message_definition"]), "ros1",
            publisher=_text(told.get(b"callerid", b"")),
        )  # fmt: skip
    elif op == MESSAGE:
        connection = known.get(_number(fields, b"conn"))
        if connection is None:
            raise _CutError("a message of no connection")
        seconds, rest = _TIME(fields[b"time"])
        bag.counts[connection] += 1
        if wanted(connection):
            yield connection, seconds * 1_000_000_000 + rest, body


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _decompressed(data: bytes, packing: str, size: int | None) -> bytes:
    """Return a chunk; `size` is that which it must have."""
    try:
        if packing in ("none", ""):
            found = data
        elif packing == "bz2":
            found = bz2.decompress(data)
        elif packing == "lz4":
            found = need("lz4.frame").decompress(data)
        elif packing == "zstd":
            found = _zstd().decompress(data)
        else:
            raise _CutError(f"a chunk is packed by {packing}, expected bz2, lz4 or zstd")
    except (OSError, EOFError, ValueError, RuntimeError, _zstd().ZstdError) as error:
        raise _CutError(f"a chunk cannot be unpacked: {error}") from error
    if size is not None and len(found) != size:
        raise _CutError(f"a chunk of {len(found)} bytes, expected {size}")
    return found


def _zstd() -> Any:
    """Return the module that unpacks zstd: Python's own from 3.14 on, before that rosbags' one."""
    return need("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")


# MCAP ------------------------------------------------------------------------------------------

SCHEMA, CHANNEL, MCAP_MESSAGE, MCAP_CHUNK, DATA_END = 3, 4, 5, 6, 15
_MCAP_HEAD = struct.Struct("<BQ").unpack_from
_MCAP_CHUNK = struct.Struct("<QQQI").unpack_from
_MCAP_TIMES = struct.Struct("<HIQQ").unpack_from
_U16 = struct.Struct("<H").unpack_from
_U64 = struct.Struct("<Q").unpack_from


@dataclass
class _Known:
    """Schemas (name, encoding, text) and channels of a file, by their number."""

    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    channels: dict[int, Connection] = field(default_factory=dict)


def _mcap(bag: Bag, path: Path, file: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    file.seek(len(MCAP_MAGIC))
    known = _Known()
    at = file.tell()
    try:
        while head := file.read(9):
            at = file.tell() - len(head)
            bag.at(at)
            if len(head) < 9:
                raise _CutError("a record has no length")
            op, length = _MCAP_HEAD(head)
            if op == DATA_END:
                return
            if op == MCAP_CHUNK:
                yield from _chunk_of_mcap(bag, path, file, length, known, wanted)
            elif op in (SCHEMA, CHANNEL, MCAP_MESSAGE):
                yield from _mcap_record(bag, op, _exactly(file, length), known, wanted)
            elif length > _left(file):
                raise _CutError(f"a record of {length} bytes")
            else:
                file.seek(length, 1)
    except (_CutError, struct.error, IndexError) as error:
        bag.damaged(path, at, _words(error))
        return
    bag.damaged(path, "at its end", "it was never closed")


def _chunk_of_mcap(
    bag: Bag, path: Path, file: BinaryIO, length: int, known: _Known, wanted: Wanted
) -> Iterator[Message]:
    """Yield the messages of a chunk; one that is damaged is left, and the next one read."""
    at = file.tell()
    whole = length <= _left(file)
    data = file.read(min(length, _left(file)))
    try:
        _, _, size, checksum = _MCAP_CHUNK(data)
        packing, rest = _string(data, 28)
        body = data[rest + 8 :]
        if whole or packing == "":
            found = _decompressed(body, packing, size if whole else None)
            if whole and checksum and zlib.crc32(found) != checksum:
                raise _CutError("a chunk's checksum is another")
            yield from _mcap_records(bag, found, known, wanted)
    except (_CutError, struct.error, IndexError) as error:
        if whole:
            bag.damaged(path, at, _words(error))
            return
    if not whole:
        raise _CutError(f"a chunk of {length} bytes was to follow, there are {len(data)}")


def _mcap_records(bag: Bag, data: bytes, known: _Known, wanted: Wanted) -> Iterator[Message]:
    at = 0
    while at < len(data):
        op, length = _MCAP_HEAD(data, at)
        at += 9
        if at + length > len(data):
            raise _CutError(f"{length} bytes were to follow, there are {len(data) - at}")
        if op in (SCHEMA, CHANNEL, MCAP_MESSAGE):
            yield from _mcap_record(bag, op, data[at : at + length], known, wanted)
        at += length


def _mcap_record(
    bag: Bag, op: int, data: bytes, known: _Known, wanted: Wanted
) -> Iterator[Message]:
    if op == MCAP_MESSAGE:
        channel, _, time_ns, _ = _MCAP_TIMES(data)
        connection = known.channels.get(channel)
        if connection is None:
            raise _CutError(f"a message of channel {channel}, which there is not")
        bag.counts[connection] += 1
        if wanted(connection):
            yield connection, time_ns, data[22:]
    elif op == SCHEMA:
        name, at = _string(data, 2)
        encoding, at = _string(data, at)
        text, _ = _string(data, at)
        known.schemas[_U16(data)[0]] = (name, encoding, text)
    else:
        number, schema = _U16(data)[0], _U16(data, 2)[0]
        topic, at = _string(data, 4)
        encoding, _ = _string(data, at)
        name, kind, text = known.schemas.get(schema, ("", "", ""))
        known.channels[number] = Connection(plain(topic), short(name), text, encoding,
                                            kind == "ros2idl")  # fmt: skip


def _string(data: bytes, at: int) -> tuple[str, int]:
    """Return a string and where it ends."""
    (length,) = _U32(data, at)
    if at + 4 + length > len(data):
        raise _CutError("a string is longer than its record")
    return _text(data[at + 4 : at + 4 + length]), at + 4 + length


def short(name: str) -> str:
    """Return the name of a type without the ``msg`` in its middle.

    Examples
    --------
    >>> short("nav_msgs/msg/Odometry")
    'nav_msgs/Odometry'
    """
    return re.sub(r"^(\w+)/msg/(\w+)$", r"\1/\2", name)


# SQLite ----------------------------------------------------------------------------------------


def _sqlite(bag: Bag, path: Path, _: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    size = path.stat().st_size
    opened = False
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as base:
            base.text_factory = _text
            topics = _sqlite_topics(base)
            bag.counts.update(dict.fromkeys(topics.values(), 0))
            chosen = [number for number, connection in topics.items() if wanted(connection)]
            last = base.execute("SELECT max(rowid) FROM messages").fetchone()[0] or 1
            opened = True
            for row, topic, time_ns, data in base.execute(
                "SELECT rowid, topic_id, timestamp, data FROM messages WHERE topic_id IN "
                f"({','.join('?' * len(chosen))})", chosen,
            ):  # fmt: skip
                bag.counts[topics[topic]] += 1
                bag.at(row * size // last)
                yield topics[topic], int(time_ns), bytes(data)
    except (sqlite3.Error, TypeError, ValueError) as error:  # also a value of another type
        if not opened:
            raise LogError(f"{path}: cannot be read ({_words(error)})") from error
        bag.damaged(path, "on the way", _words(error))


def _sqlite_topics(base: sqlite3.Connection) -> dict[int, Connection]:
    tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
    texts: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        texts = {
            kind: (encoding, text)
            for kind, encoding, text in base.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
        }
    rows = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
    return {
        number: Connection(plain(str(name)), short(str(kind)), str(texts.get(kind, ("", ""))[1]),
                           str(encoding), texts.get(kind, ("", ""))[0] == "ros2idl")
        for number, name, kind, encoding in rows
    }  # fmt: skip


READERS: dict[bytes, Callable[[Bag, Path, BinaryIO, Wanted], Iterator[Message]]] = {
    ROS1_MAGIC: _ros1,
    MCAP_MAGIC: _mcap,
    SQLITE_MAGIC: _sqlite,
}
