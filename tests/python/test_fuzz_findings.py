# SPDX-License-Identifier: Apache-2.0
"""Files that readers once met with an error of another library, found while they were fuzzed.

Each is refused in the reader's own words now, so that the command line says one sentence.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from locfuse.config.load import load_config
from locfuse.io.log_yaml import read_log_yaml
from locfuse.io.maps import read_map
from locfuse.types import ConfigError, LogError

MAP = """\
image: map.pgm
resolution: 0.05
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


@pytest.mark.parametrize(
    "text",
    [
        "a: !!bool x",  # PyYAML: KeyError
        "a: !!int ''",  # IndexError
        "a: !!float _",  # IndexError
        "a: !!timestamp x",  # AttributeError
        "!!map [a]",  # TypeError
        "a: " + "[" * 2000,  # RecursionError
        "tags: " + "{a: " * 1500,  # RecursionError, once it was parsed
        "estimator: {gate_range: 0x" + "f" * 4000 + "}",  # ValueError where its text was made
    ],
)
@pytest.mark.parametrize(("read", "error"), [(load_config, ConfigError), (read_log_yaml, LogError)])
def test_yaml_that_its_parser_stumbles_over_is_refused(
    read: Callable[[Path], Any], error: type[ValueError], text: str, tmp_path: Path
) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(text)
    with pytest.raises(error, match=r"file\.yaml"):
        read(path)


def png_of(width: int, height: int) -> bytes:
    """Return a PNG that promises so many pixels and holds none of them."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    "image",
    [
        png_of(20_000, 20_000),  # Pillow: DecompressionBombError
        b"P5 " + b"9" * 5000 + b" 1 255 \0",  # more digits than Python makes an integer of
        b"P2 1 1 255 " + b"9" * 5000,  # likewise
        b"P2 1 1 255 " + b"9" * 400,  # an integer that is no float
    ],
)
def test_a_picture_with_impossible_numbers_is_refused(image: bytes, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / "map.pgm").write_bytes(image)
    with pytest.raises(LogError, match=r"map\.pgm"):
        read_map(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("map.pgm", '"a\\0b"'),  # no name of a file: ValueError
        ("0.05", "1" + "0" * 400),  # an integer that is no float: OverflowError
        ("0.05", "0x" + "f" * 4000),  # and one without a text
    ],
)
def test_a_map_of_impossible_settings_is_refused(old: str, new: str, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace(old, new))
    with pytest.raises(LogError, match=r"cannot be read|out of bounds"):
        read_map(tmp_path / "map.yaml")
