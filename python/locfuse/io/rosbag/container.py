# SPDX-License-Identifier: Apache-2.0
"""What all kinds of bags have in common: packages, connections, progress, damage, chunks."""

from __future__ import annotations

import bz2
import importlib
import os
import re
import struct
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from locfuse.io.csv_table import MAX_UNPACKED
from locfuse.types import LogError, words

BLOCK = 1 << 20
MAX_TIMES = 100  # that a bag which is larger than MAX_UNPACKED may grow when it is unpacked
LONGEST_NAME = 1000  # letters of a topic, type, encoding or publisher
MAX_DESCRIBED = 1 << 28  # letters of all connections, each counted with 1000 more
MAX_DAMAGES = 10  # that are reported


class NeedError(LogError):
    """A package is missing; the text names the extra that brings it."""


def need(module: str) -> Any:
    """Import a module of rosbags, or one that comes with it.

    Raises NeedError if it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise NeedError(f"bags need the package rosbags: pip install 'locfuse[bags]' "
                        f"(there is no module {error.name})") from error  # fmt: skip


class Connection(NamedTuple):
    """What a bag says of the messages of a topic.

    `topic` has no leading slash; `type` is as ``nav_msgs/Odometry``; `definition` is the text that
    defines the type, empty where the bag has none; `encoding` is ``ros1`` or ``cdr``; `publisher`
    is the node that published them, empty where the bag does not say, as those of ROS 2.
    """

    topic: str
    type: str
    definition: str
    encoding: str
    is_idl: bool = False
    publisher: str = ""


Wanted = Callable[[Connection], bool]
Message = tuple[Connection, int, bytes]
Records = Callable[[bytes, bool], Iterator[Message]]


@dataclass
class Reading:
    """A bag that is being read.

    `progress` is called with (bytes read, total bytes); `size` is in bytes. `counts` are messages
    seen, wanted or not; `damage` has a sentence for each thing that could not be read. `before` are
    bytes of the files before the one that is read, of whose bytes a `share` are the bag's;
    `unpacked` bytes and `described` letters of connections count as in `MAX_DESCRIBED`.
    """

    progress: Callable[[int, int], None] | None = None
    size: int = 0
    counts: Counter[Connection] = field(default_factory=Counter)
    damage: list[str] = field(default_factory=list)
    before: int = 0
    share: float = 1.0
    unpacked: int = 0
    described: int = 0
    _reported: int = 0

    def at(self, position: int) -> None:
        """Report how far in its file the reader is."""
        done = self.before + int(self.share * position)
        if self.progress is not None and (done >= self._reported + BLOCK or done == self.size):
            self._reported = done
            self.progress(done, self.size)

    def damaged(self, path: Path, where: int | str, what: str) -> None:
        """Remember that something could not be read."""
        at = f"at byte {where} of {path.stat().st_size}" if isinstance(where, int) else where
        read = sum(self.counts.values())
        if len(self.damage) < MAX_DAMAGES:
            self.damage.append(f"{path} is damaged {at} ({what}); the {read} messages before are "
                               "kept")  # fmt: skip

    def may_unpack(self) -> int:
        """Return to how many bytes all of a bag may unpack."""
        return max(MAX_UNPACKED, MAX_TIMES * self.size)

    def unpack(self, data: bytes, packing: str, size: int | None = None) -> bytes:
        """Return an unpacked chunk; `size` is that which it must have."""
        found, left = data, self.may_unpack() - self.unpacked
        if packing not in ("none", ""):
            most = max(0, min(MAX_UNPACKED, left, left if size is None else size))
            found = decompressed(data, packing, most)
            self.unpacked += len(found)
            if len(found) > left:
                raise CutError(f"the bag unpacks to more than {self.may_unpack()} bytes")
            if len(found) > most:
                raise CutError(f"a chunk of more than {most} bytes")
        if size is not None and len(found) != size:
            raise CutError(f"a chunk of {len(found)} bytes, expected {size}")
        return found

    def connect(self, known: dict[int, Connection], number: int, found: Connection) -> None:
        """Remember the connection of a number; CutError where names or connections are endless."""
        if known.get(number) == found:
            return
        names = (found.topic, found.type, found.encoding, found.publisher)
        if max(map(len, names)) > LONGEST_NAME:
            raise CutError(f"a name of {max(map(len, names))} letters")
        self.described += 1000 + sum(map(len, names)) + len(found.definition)
        if self.described > MAX_DESCRIBED:
            raise CutError(f"more than {MAX_DESCRIBED} letters of connections")
        known[number] = found


class CutError(Exception):
    """A record ends before its end, or cannot be one."""


BROKEN = (CutError, KeyError, IndexError, struct.error)  # what reading damaged records raises


def left(file: BinaryIO) -> int:
    """Return how many bytes follow: a length that is damaged may be any."""
    return os.fstat(file.fileno()).st_size - file.tell()


def exactly(file: BinaryIO, size: int) -> bytes:
    """Return so many bytes; CutError where there are less, or more than `MAX_UNPACKED`."""
    if size > MAX_UNPACKED:
        raise CutError(f"a record of {size} bytes")
    if left(file) < size:
        raise CutError(f"{size} bytes were to follow, there are {left(file)}")
    return file.read(size)


def chunk(bag: Reading, path: Path, file: BinaryIO, size: int, read: Records) -> Iterator[Message]:
    """Yield the messages of a chunk; one that is damaged is left, and the next one read.

    `read` yields those of its bytes, of which it also gets whether they are all.
    """
    at, whole = file.tell(), size <= left(file)
    data = exactly(file, min(size, left(file)))
    try:
        yield from read(data, whole)
    except BROKEN as error:
        if whole:
            bag.damaged(path, at, words(error))
            return
    if not whole:
        raise CutError(f"a chunk of {size} bytes was to follow, there are {len(data)}")


def text(data: bytes) -> str:
    """Return a text, whatever its bytes are."""
    return data.decode("utf-8", "replace")


def decompressed(data: bytes, packing: str, most: int) -> bytes:
    """Return a chunk, or its first ``most + 1`` bytes."""
    if packing == "bz2":
        unpacker: Any = bz2.BZ2Decompressor()
    elif packing == "lz4":
        unpacker = need("lz4.frame").LZ4FrameDecompressor()
    elif packing == "zstd":
        unpacker = zstd().ZstdDecompressor()
    else:
        raise CutError(f"a chunk is packed by {packing}, expected bz2, lz4 or zstd")
    found, given = BytesIO(), data
    try:  # in blocks, as lz4 takes the memory of all that it may return
        while not unpacker.eof and found.tell() <= most:
            room = min(BLOCK, most + 1 - found.tell())
            block = unpacker.decompress(given, max_length=room)
            if not block and not unpacker.eof and (unpacker.needs_input or not given):
                raise CutError("a chunk cannot be unpacked: it ends too early")
            found.write(block)
            given = b""
    except (OSError, EOFError, ValueError, RuntimeError, zstd().ZstdError) as error:
        raise CutError(f"a chunk cannot be unpacked: {error}") from error
    return found.getvalue()


def zstd() -> Any:
    """Return the module that unpacks zstd: Python's own from 3.14 on, before that rosbags' one."""
    return need("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")


def short(name: str) -> str:
    """Return the name of a type without the ``msg`` in its middle.

    Examples
    --------
    >>> short("nav_msgs/msg/Odometry")
    'nav_msgs/Odometry'
    """
    return re.sub(r"^(\w+)/msg/(\w+)$", r"\1/\2", name)
