# SPDX-License-Identifier: Apache-2.0
"""The messages that a bag holds, as bytes, one by one in the order of its file.

Bags are read from their beginning on, never by their index: so memory does not grow with them, and
of one that is damaged or was never closed everything before the damage is read.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from locfuse.io.log_yaml import load_yaml
from locfuse.io.rosbag import stored_mcap, stored_ros1, stored_sqlite
from locfuse.io.rosbag.container import BLOCK, CutError, Message, Reading, Wanted, zstd
from locfuse.types import LogError

KINDS = "a .bag of ROS 1, a .mcap, or a .db3 or folder of ROS 2"
STORED = r"\.(mcap|db3)(\.zstd)?$"  # names of files in a folder of ROS 2
READERS = {one.MAGIC: one.messages for one in (stored_ros1, stored_mcap, stored_sqlite)}


class Bag(Reading):
    """A bag.

    `path` is a file, or a folder of ROS 2; `progress` is called with (bytes read, total bytes).
    """

    def __init__(self, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
        super().__init__(progress)
        self.path = path

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield connection, record time [ns] and bytes of the messages that are wanted.

        Raises LogError if there is no such bag, or it is none.
        """
        files = _files(self.path)
        self.size = sum(path.stat().st_size for path, _ in files)
        self.before = self._reported = 0
        self.counts, self.damage = Counter(), []
        self.unpacked = self.described = 0
        if self.path.is_dir() and not (self.path / "metadata.yaml").is_file():
            self.damage.append(
                f"{self.path}: has no metadata.yaml, as its recorder was stopped; its {len(files)} "
                "files are read in the order of their numbers"
            )
        for path, packing in files:
            yield from _unpacked(self, path, packing, wanted)
            self.before += path.stat().st_size
            self.share = 0.0
            self.at(0)


def is_bag(path: Path) -> bool:
    """Return whether a path is not that of a log folder: no folder, or one of a ROS 2 bag."""
    is_other = os.path.exists(path) and not os.path.isdir(path)
    return is_other or os.path.isfile(path / "metadata.yaml") or bool(_without_metadata(path))


def _without_metadata(folder: Path) -> list[Path]:
    """Return the files of a bag whose recorder was stopped before it wrote metadata, by number."""
    if not os.path.isdir(folder):
        return []
    there = sorted(folder.iterdir())
    if any(path.name.endswith((".csv", ".csv.gz")) or path.name == "log.yaml" for path in there):
        return []  # a log folder
    found = [path for path in there if re.search(STORED, path.name)]
    return sorted(found, key=lambda path: [int(n) for n in re.findall(r"\d+", path.name)])


def _files(path: Path) -> list[tuple[Path, str]]:
    """Return the files of a bag, and how they are packed: ``file``, ``message`` or not."""
    if not path.exists():
        raise LogError(f"{path}: no such bag; expected {KINDS}")
    if path.is_file():
        return [(path, "")]
    if not path.is_dir():
        raise LogError(f"{path}: is a device or a pipe; expected {KINDS}")
    if not (path / "metadata.yaml").is_file():
        if found := _without_metadata(path):
            return [(file, "file" if file.suffix == ".zstd" else "") for file in found]
        raise LogError(f"{path}: a folder without metadata.yaml, .mcap and .db3 is no bag; "
                       f"expected {KINDS}")  # fmt: skip
    metadata = load_yaml(path / "metadata.yaml")
    try:
        metadata = metadata["rosbag2_bagfile_information"]
        names = [str(name) for name in metadata["relative_file_paths"]]
        packing = str(metadata.get("compression_mode") or "").lower()
    except (KeyError, TypeError, AttributeError):
        raise LogError(f"{path / 'metadata.yaml'}: names no files, expected the "
                       "relative_file_paths of a ROS 2 bag") from None  # fmt: skip
    files = [path / Path(name).name for name in names]
    for file in files:
        if not file.is_file():
            raise LogError(f"{path}: {file.name}, which metadata.yaml names, is not there")
    if len(set(files)) < len(files):
        raise LogError(f"{path}: metadata.yaml names a file twice")
    return [(file, "" if packing == "none" else packing) for file in files]


def _unpacked(bag: Bag, path: Path, packing: str, wanted: Wanted) -> Iterator[Message]:
    if packing == "file":
        with TemporaryDirectory() as folder:
            file = Path(folder) / path.stem
            _unpack(bag, path, file)
            try:
                yield from _of_file(bag, file, wanted, packed=path)
            except LogError as error:
                raise LogError(str(error).replace(str(file), str(path))) from error
            finally:
                bag.damage = [said.replace(str(file), str(path)) for said in bag.damage]
    elif packing == "message":
        for connection, time_ns, data in _of_file(bag, path, wanted):
            with suppress(CutError):  # packed bytes are no message either
                data = bag.unpack(data, "zstd")
            yield connection, time_ns, data
    else:
        yield from _of_file(bag, path, wanted)


def _unpack(bag: Bag, packed: Path, file: Path) -> None:
    library = zstd()
    try:
        with library.open(packed, "rb") as source, file.open("wb") as target:
            while block := source.read(BLOCK):
                bag.unpacked += len(block)
                if bag.unpacked > bag.may_unpack():
                    raise LogError(
                        f"{packed}: unpacks to more than {bag.may_unpack()} bytes; if it is a bag "
                        "of yours, unpack it with zstd -d and give the file"
                    )
                target.write(block)
    except (EOFError, OSError, library.ZstdError) as error:
        raise LogError(f"{packed}: cannot be unpacked ({error})") from error


def _of_file(bag: Bag, path: Path, wanted: Wanted, packed: Path | None = None) -> Iterator[Message]:
    """Yield the messages of one file, whose kind its first bytes give."""
    with path.open("rb") as file:
        magic = file.read(16)
        reader = next((r for start, r in READERS.items() if magic.startswith(start)), None)
        if reader is None:
            what = f"begins with {magic!r}" if magic else "is empty"
            raise LogError(f"{packed or path}: {what}; expected {KINDS}")
        size = path.stat().st_size
        bag.share = 1.0 if packed is None else packed.stat().st_size / size
        file.seek(0)
        yield from reader(bag, path, file, wanted)
