# SPDX-License-Identifier: Apache-2.0
"""Prints libFuzzer's dictionary of a target that reads files: ``dictionary.py config|log|map|bag``.

Its words are those of the code that reads them: keys and choices of the schema, columns, types of
messages, marks of formats.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import Any

from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import SCHEMA
from locfuse.io.log_yaml import KEYS, LANDMARK_SENSOR_KEYS, LASER_KEYS
from locfuse.io.maps import KEYS as MAP_KEYS
from locfuse.io.rosbag.bag_warnings import TYPES
from locfuse.io.rosbag.wire import NO_PACKAGE, definitions

YAML_WORDS = ("{", "}", "[", "]", ": ", "\n- ", "&a ", "*a", "<<: ", "!!int ", "!!binary ", "|\n",
              "null", "true", "false", "1e400", "-.inf", ".nan", "0x7f", "1_000")  # fmt: skip
NUMBERS = ("nan", "inf", "-inf", "1e308", "1e-320", "-0.0", "9223372036854775807", '"', "\r\n", ",")
PICTURES = (b"P2\n", b"P5\n", b"255\n", b"65535\n", b"\x89PNG\r\n\x1a\n", b"IHDR", b"PLTE",
            b"IDAT", b"IEND", b"\0")  # fmt: skip
BAGS = (b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"SQLite format 3\0", b"op=\x02", b"op=\x05",
        b"op=\x07", b"compression=bz2", b"compression=lz4", b"none", b"lz4", b"zstd", b"cdr",
        b"ros1", b"ros2msg", b"topics", b"messages", b"CREATE VIEW ", b"WITH RECURSIVE ",
        )  # fmt: skip


def words_of(schema: Any) -> Iterator[str]:
    """Yield the keys and the choices of a JSON schema."""
    if isinstance(schema, list):
        for part in schema:
            yield from words_of(part)
    elif isinstance(schema, dict):
        yield from schema.get("properties", {})
        choices = (*schema.get("enum", ()), schema.get("const"))
        yield from (choice for choice in choices if isinstance(choice, str))
        for part in schema.values():
            yield from words_of(part)


def words(target: str) -> Iterable[str | bytes]:
    """Return the words of a target."""
    if target == "config":
        return (*words_of(RunConfig.model_json_schema()), *YAML_WORDS)
    if target == "log":
        columns = (column for forms in SCHEMA.values() for form in forms for column in form)
        return (*SCHEMA, *columns, *KEYS, *LASER_KEYS, *LANDMARK_SENSOR_KEYS, *NUMBERS, *YAML_WORDS)
    if target == "map":
        return (*MAP_KEYS, "mode", "trinary", "scale", "raw", *YAML_WORDS, *PICTURES)
    kinds = {kind.replace("/msg/", "/") for kind in (*TYPES.values(), *NO_PACKAGE, *definitions())}
    return (*sorted(kinds), *sorted(kind.replace("/", "/msg/") for kind in kinds), *BAGS)


def dictionary(target: str) -> str:
    """Return the words of a target in the form of libFuzzer, each once."""
    lines = []
    for word in dict.fromkeys(words(target)):
        data = word.encode() if isinstance(word, str) else word
        plain = (chr(b) if 32 <= b < 127 and chr(b) not in '"\\' else f"\\x{b:02x}" for b in data)
        lines.append(f'"{"".join(plain)}"\n')
    return "".join(lines)


if __name__ == "__main__":
    print(dictionary(sys.argv[1]), end="")
