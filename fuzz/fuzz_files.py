# SPDX-License-Identifier: Apache-2.0
"""Fuzz target of the Python parsers: `fuzz_files.py config|log|map|bag` and libFuzzer's options.

Arbitrary bytes are either read or rejected with a ConfigError or a LogError.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["locfuse", "yaml"]):
    import yaml  # noqa: F401

    from locfuse.config.load import load_config
    from locfuse.io.log_folder import SCHEMA, read_log_file
    from locfuse.io.log_yaml import read_log_yaml
    from locfuse.io.maps import read_map
    from locfuse.io.rosbag import wire
    from locfuse.io.rosbag.bags import read_bag
    from locfuse.types import ConfigError, LogError

STEMS = ("log.yaml", *SCHEMA)


def read_config(data: bytes, folder: Path) -> None:
    """Read a configuration."""
    path = folder / "config.yaml"
    path.write_bytes(data)
    load_config(path)


def read_log_part(data: bytes, folder: Path) -> None:
    """Read one file of a log folder; the first byte says which."""
    stem = STEMS[data[0] % len(STEMS)] if data else "ranges"
    path = folder / "part"
    path.write_bytes(data[1:])
    if stem == "log.yaml":
        read_log_yaml(path)
    else:
        read_log_file(path, stem)


def read_picture(data: bytes, folder: Path) -> None:
    """Read a map: its YAML file, a zero byte, and its image."""
    text, _, picture = data.partition(b"\0")
    (folder / "map.yaml").write_bytes(text)
    (folder / "map.pgm").write_bytes(picture)
    read_map(folder / "map.yaml")


def read_bag_file(data: bytes, folder: Path) -> None:
    """Read a bag, whose first bytes give its format, and clear the caches of its types."""
    (folder / "bag").write_bytes(data)
    try:
        read_bag(folder / "bag")
    finally:
        for cached in TYPE_CACHES:
            cached.cache_clear()


TYPE_CACHES = (wire.deserializer, wire._definition)
TARGETS = {"config": read_config, "log": read_log_part, "map": read_picture, "bag": read_bag_file}


def main() -> None:
    """Run the target named by the first argument."""
    logging.disable()  # warnings about damaged files
    read = TARGETS[sys.argv.pop(1)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def try_one(data: bytes) -> None:
            with contextlib.suppress(ConfigError, LogError):
                read(data, folder)

        atheris.Setup(sys.argv, try_one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
