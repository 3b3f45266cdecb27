# SPDX-License-Identifier: Apache-2.0
"""What all kinds of bags have in common: connections, progress, damage, packed chunks."""

from __future__ import annotations

import bz2
import os
import re
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from locfuse.io.rosbag.optional_rosbags import need

BLOCK = 1 << 20
LONGEST_CHUNK = 1 << 30  # bytes that one may have when it is unpacked
LONGEST_REASON = 200  # letters; some errors quote what they could not read


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


@dataclass
class Reading:
    """A bag that is being read.

    Attributes
    ----------
    progress : callable, optional
        Called with (bytes read, total bytes).
    size : int
        Bytes it has.
    counts : Counter of Connection
        Messages seen, wanted or not.
    damage : list of str
        What could not be read, one sentence each.
    before : int
        Bytes of the files before the one that is read.
    share : float
        Of the bytes of that file that are bytes of the bag.
    """

    progress: Callable[[int, int], None] | None = None
    size: int = 0
    counts: Counter[Connection] = field(default_factory=Counter)
    damage: list[str] = field(default_factory=list)
    before: int = 0
    share: float = 1.0
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
        self.damage.append(f"{path} is damaged {at} ({what}); the {read} messages before are kept")


class CutError(Exception):
    """A record ends before its end, or cannot be one."""


def left(file: BinaryIO) -> int:
    """Return how many bytes follow: a length that is damaged may be any."""
    return os.fstat(file.fileno()).st_size - file.tell()


def exactly(file: BinaryIO, size: int) -> bytes:
    """Return so many bytes; CutError where there are less."""
    if left(file) < size:
        raise CutError(f"{size} bytes were to follow, there are {left(file)}")
    return file.read(size)


def words(error: Exception) -> str:
    """Return what an error says, on one line and not too long."""
    reason = f"no field {error}" if isinstance(error, KeyError) else str(error)
    return " ".join(reason.split())[:LONGEST_REASON]


def text(data: bytes) -> str:
    """Return a text, whatever its bytes are."""
    return data.decode("utf-8", "replace")


def decompressed(data: bytes, packing: str, size: int | None) -> bytes:
    """Return a chunk; `size` is that which it must have."""
    if packing in ("none", ""):
        return _whole(data, size)
    if packing == "bz2":
        unpacker: Any = bz2.BZ2Decompressor()
    elif packing == "lz4":
        unpacker = need("lz4.frame").LZ4FrameDecompressor()
    elif packing == "zstd":
        unpacker = zstd().ZstdDecompressor()
    else:
        raise CutError(f"a chunk is packed by {packing}, expected bz2, lz4 or zstd")
    most = LONGEST_CHUNK if size is None else min(size, LONGEST_CHUNK)
    try:
        found = bytes(unpacker.decompress(data, max_length=most + 1))
    except (OSError, EOFError, ValueError, RuntimeError, zstd().ZstdError) as error:
        raise CutError(f"a chunk cannot be unpacked: {error}") from error
    if len(found) <= most and not unpacker.eof:
        raise CutError("a chunk cannot be unpacked: it ends too early")
    if len(found) > most:
        raise CutError(f"a chunk of more than {most} bytes")
    return _whole(found, size)


def _whole(found: bytes, size: int | None) -> bytes:
    if size is not None and len(found) != size:
        raise CutError(f"a chunk of {len(found)} bytes, expected {size}")
    return found


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
