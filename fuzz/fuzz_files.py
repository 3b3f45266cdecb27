# SPDX-License-Identifier: Apache-2.0
"""Fuzz target of what Python parses: `fuzz_files.py config|log|map|bag` and libFuzzer's options.

Any bytes are a file: it is read, or refused by a ConfigError or a LogError.
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
    """Read a map: its YAML file, a zero, and its picture."""
    text, _, picture = data.partition(b"\0")
    (folder / "map.yaml").write_bytes(text)
    (folder / "map.pgm").write_bytes(picture)
    read_map(folder / "map.yaml")


def read_bag_file(data: bytes, folder: Path) -> None:
    """Read a bag, whose first bytes tell its kind, and forget the types that it defines."""
    (folder / "bag").write_bytes(data)
    try:
        read_bag(folder / "bag")
    finally:
        for kept in OF_TYPES:
            kept.cache_clear()


OF_TYPES = (wire.structure, wire.deserializer, wire._definition)
TARGETS = {"config": read_config, "log": read_log_part, "map": read_picture, "bag": read_bag_file}


def main() -> None:
    """Run the target that is named."""
    logging.disable()  # sentences on damage
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
