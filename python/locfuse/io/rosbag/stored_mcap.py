# SPDX-License-Identifier: Apache-2.0
"""The messages of a .mcap."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
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
    short,
    text,
)
from locfuse.types import words

MAGIC = b"\x89MCAP0\r\n"
_U32 = struct.Struct("<I").unpack_from

SCHEMA, CHANNEL, MCAP_MESSAGE, MCAP_CHUNK, DATA_END = 3, 4, 5, 6, 15
_MCAP_HEAD = struct.Struct("<BQ").unpack_from
_MCAP_CHUNK = struct.Struct("<QQQI").unpack_from
_MCAP_TIMES = struct.Struct("<HIQQ").unpack_from
_U16 = struct.Struct("<H").unpack_from
_U64 = struct.Struct("<Q").unpack_from


@dataclass
class _Known:
    """Schemas (connections without a topic) and channels of a file, by their number."""

    schemas: dict[int, Connection] = field(default_factory=dict)
    channels: dict[int, Connection] = field(default_factory=dict)


def messages(bag: Reading, path: Path, file: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    """Yield the messages of a file that are wanted."""
    file.seek(len(MAGIC))
    known = _Known()
    at = file.tell()
    try:
        while head := file.read(9):
            at = file.tell() - len(head)
            bag.at(at)
            if len(head) < 9:
                raise CutError("a record has no length")
            op, length = _MCAP_HEAD(head)
            if op == DATA_END:
                return
            if op == MCAP_CHUNK:
                yield from chunk(bag, path, file, length, partial(_chunk, bag, known, wanted))
            elif op in (SCHEMA, CHANNEL, MCAP_MESSAGE):
                yield from _mcap_record(bag, op, exactly(file, length), known, wanted)
            elif length > left(file):
                raise CutError(f"a record of {length} bytes")
            else:
                file.seek(length, 1)
    except BROKEN as error:
        bag.damaged(path, at, words(error))
        return
    bag.damaged(path, "at its end", "it was never closed")


def _chunk(
    bag: Reading, known: _Known, wanted: Wanted, data: bytes, whole: bool
) -> Iterator[Message]:
    """Yield the messages of a chunk; what is left of a packed one cannot be unpacked."""
    _, _, size, checksum = _MCAP_CHUNK(data)
    packing, rest = _string(data, 28)
    if whole or packing == "":
        found = bag.unpack(data[rest + 8 :], packing, size if whole else None)
        if whole and checksum and zlib.crc32(found) != checksum:
            raise CutError("a chunk's checksum is another")
        yield from _mcap_records(bag, found, known, wanted)


def _mcap_records(bag: Reading, data: bytes, known: _Known, wanted: Wanted) -> Iterator[Message]:
    at = 0
    while at < len(data):
        op, length = _MCAP_HEAD(data, at)
        at += 9
        if at + length > len(data):
            raise CutError(f"{length} bytes were to follow, there are {len(data) - at}")
        if op in (SCHEMA, CHANNEL, MCAP_MESSAGE):
            yield from _mcap_record(bag, op, data[at : at + length], known, wanted)
        at += length


def _mcap_record(
    bag: Reading, op: int, data: bytes, known: _Known, wanted: Wanted
) -> Iterator[Message]:
    if op == MCAP_MESSAGE:
        channel, _, time_ns, _ = _MCAP_TIMES(data)
        connection = known.channels.get(channel)
        if connection is None:
            raise CutError(f"a message of channel {channel}, which there is not")
        bag.counts[connection] += 1
        if wanted(connection):
            yield connection, time_ns, data[22:]
    elif op == SCHEMA:
        name, at = _string(data, 2)
        encoding, at = _string(data, at)
        definition, _ = _string(data, at)
        found = Connection("", short(name), definition, "", encoding == "ros2idl")
        bag.connect(known.schemas, _U16(data)[0], found)
    else:
        number, schema = _U16(data)[0], _U16(data, 2)[0]
        topic, at = _string(data, 4)
        encoding, _ = _string(data, at)
        described = known.schemas.get(schema, Connection("", "", "", ""))
        found = described._replace(topic=plain(topic), encoding=encoding)
        bag.connect(known.channels, number, found)


def _string(data: bytes, at: int) -> tuple[str, int]:
    """Return a string and where it ends."""
    (length,) = _U32(data, at)
    if at + 4 + length > len(data):
        raise CutError("a string is longer than its record")
    return text(data[at + 4 : at + 4 + length]), at + 4 + length
