# SPDX-License-Identifier: Apache-2.0
"""The messages of a .bag of ROS 1."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

from locfuse.config.ros import plain
from locfuse.io.rosbag.container import (
    BROKEN,
    Connection,
    CutError,
    Message,
    Reading,
    Wanted,
    chunk,
    exactly,
    left,
    text,
)
from locfuse.types import LogError, words

MAGIC = b"#ROSBAG V"
LONGEST_HEADER = 1 << 24  # bytes of a record's header; more is damage

Known = dict[int, Connection]  # by their numbers
Fields = dict[bytes, bytes]  # of the header of a record, by their names

_U32 = struct.Struct("<I").unpack_from
_TIME = struct.Struct("<II").unpack
MESSAGE, BAG_HEADER, CHUNK, CONNECTION = 2, 3, 5, 7


def messages(bag: Reading, path: Path, file: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    """Yield the messages of a file that are wanted."""
    version = file.readline(32).strip()
    if version != b"#ROSBAG V2.0":
        raise LogError(f"{path}: {version.decode('ascii', 'replace')}, expected #ROSBAG V2.0")
    known: Known = {}
    closed = False
    at = file.tell()
    try:
        while head := file.read(4):
            at = file.tell() - len(head)
            bag.at(at)
            fields = _fields(_header(file, head))
            op = _number(fields, b"op")
            (length,) = _U32(exactly(file, 4))
            if op == CHUNK:
                packing = fields[b"compression"].decode("ascii", "replace")
                records = partial(_records, bag, known, wanted, packing)
                yield from chunk(bag, path, file, length, records)
            elif op in (MESSAGE, CONNECTION):
                yield from _record(bag, known, wanted, fields, exactly(file, length))
            elif length > left(file):
                raise CutError(f"{length} bytes were to follow, there are {left(file)}")
            else:
                if op == BAG_HEADER:
                    closed = 0 < _number(fields, b"index_pos") <= path.stat().st_size
                file.seek(length, 1)
    except BROKEN as error:
        bag.damaged(path, at, words(error))
        return
    if not closed:
        bag.damaged(path, "at its end", "it was never closed")


def _header(file: BinaryIO, head: bytes) -> bytes:
    if len(head) < 4:
        raise CutError("a record has no length")
    (length,) = _U32(head)
    if length > LONGEST_HEADER:
        raise CutError(f"a record's header of {length} bytes")
    return exactly(file, length)


def _fields(data: bytes) -> Fields:
    found: Fields = {}
    at = 0
    while at < len(data):
        (length,) = _U32(data, at)
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        at += 4 + length
        if not equals or at > len(data):
            raise CutError("a record's header is none")
        found[name] = value
    return found


def _number(fields: Fields, name: bytes) -> int:
    return int.from_bytes(fields[name], "little")


def _records(
    bag: Reading, known: Known, wanted: Wanted, packing: str, data: bytes, whole: bool
) -> Iterator[Message]:
    """Yield the messages of a chunk; what is left of a packed one cannot be unpacked."""
    if not whole and packing != "none":
        return
    at, data = 0, bag.unpack(data, packing)
    while at < len(data):
        (length,) = _U32(data, at)
        end = at + 4 + length
        fields = _fields(data[at + 4 : end])
        (size,) = _U32(data, end)
        if end + 4 + size > len(data):
            raise CutError(f"{size} bytes were to follow, there are {len(data) - end - 4}")
        body = data[end + 4 : end + 4 + size]
        at = end + 4 + size
        yield from _record(bag, known, wanted, fields, body)


def _record(
    bag: Reading, known: Known, wanted: Wanted, fields: Fields, body: bytes
) -> Iterator[Message]:
    op = _number(fields, b"op")
    if op == CONNECTION:
        given = _fields(body)
        topic = given.get(b"topic", fields[b"topic"])
        bag.connect(known, _number(fields, b"conn"), Connection(
            plain(text(topic)), text(given[b"type"]), text(given[b"message_definition"]), "ros1",
            publisher=text(given.get(b"callerid", b"")),
        ))  # fmt: skip
    elif op == MESSAGE:
        connection = known.get(_number(fields, b"conn"))
        if connection is None:
            raise CutError("a message of no connection")
        seconds, rest = _TIME(fields[b"time"])
        bag.counts[connection] += 1
        if wanted(connection):
            yield connection, seconds * 1_000_000_000 + rest, body
