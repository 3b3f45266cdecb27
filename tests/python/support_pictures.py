# SPDX-License-Identifier: Apache-2.0
"""Maps and pictures made by hand, as no program writes them."""

from __future__ import annotations

import struct
import zlib

MAP = """\
image: map.pgm
resolution: 0.05
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def png_of(width: int, height: int, depth: int, rows: bytes, *more: tuple[bytes, bytes]) -> bytes:
    """Return a grey PNG that promises so many pixels of so many bits and holds these rows.

    Each row begins with the byte 0. `more` are names and bodies of chunks behind them.
    """

    def chunk(name: bytes, body: bytes) -> bytes:
        crc = struct.pack(">I", zlib.crc32(name + body))
        return struct.pack(">I", len(body)) + name + body + crc

    header = struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows)), *more, (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*each) for each in chunks)
