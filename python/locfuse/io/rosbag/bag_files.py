# SPDX-License-Identifier: Apache-2.0
"""Bags as files that are written: of ROS 1 and of ROS 2, by rosbags."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from locfuse.config.ros import plain
from locfuse.io.rosbag.container import need
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.wire import defined, long, serializer, store
from locfuse.io.whole import PART, sync
from locfuse.types import LogError


def check_bag(path: Path) -> None:
    """Refuse a name of a bag that cannot be written, before the work and not after it.

    Raises LogError if it ends neither in ``.bag`` nor in ``.mcap``, or rosbags is missing.
    """
    if path.suffix not in (".bag", ".mcap"):
        raise LogError(f"{path}: ends in {path.suffix!r}; a bag is written as .bag (ROS 1) or "
                       ".mcap (ROS 2)")  # fmt: skip
    need("rosbags")


class Sink:
    """Writes messages with the times at which they are recorded [ns], by a writer of rosbags."""

    def __init__(self, encoding: str, writer: Any) -> None:
        self.encoding, self.writer = encoding, writer
        self.known: dict[tuple[str, str], Any] = {}

    def write(self, time_ns: int, publication: Publication) -> None:
        """Write a message."""
        topic, kind = publication.topic, publication.type
        if (topic, kind) not in self.known:
            offered = self._offered(kind, publication.latched)
            self.known[topic, kind] = self.writer.add_connection(
                f"/{plain(topic)}", long(kind), **offered
            )
        data = serializer(self.encoding, kind)(publication.fields)
        self.writer.write(self.known[topic, kind], time_ns, data)

    def _offered(self, kind: str, latched: bool) -> dict[str, Any]:
        """Return what a connection says besides its topic and type."""
        if self.encoding == "cdr":
            return {"typestore": store("cdr"), "offered_qos_profiles": [_quality(latched)]}
        text, digest = defined("ros1", kind)
        latching = int(latched)
        return {"msgdef": text, "md5sum": digest, "callerid": "/locfuse", "latching": latching}


@contextmanager
def bag_sink(path: Path) -> Iterator[Sink]:
    """Yield what writes publications into a bag, which is there once its block has ended.

    It is written beside the file and moved there when it is whole. Raises LogError as `check_bag`.
    """
    check_bag(path)
    encoding = "ros1" if path.suffix == ".bag" else "cdr"
    store(encoding)  # says what is missing before anything is made
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(mkdtemp(prefix=PART, dir=path.parent))
    try:
        if encoding == "ros1":
            made, writer = folder / "made.bag", need("rosbags.rosbag1").Writer(folder / "made.bag")
        else:
            made, writer = folder / "made" / "made.mcap", _mcap_writer(folder / "made")
        with writer:
            yield Sink(encoding, writer)
        sync(made)
        os.replace(made, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _mcap_writer(folder: Path) -> Any:
    rosbag2 = need("rosbags.rosbag2")
    writer = rosbag2.Writer(folder, version=rosbag2.Writer.VERSION_LATEST,
                            storage_plugin=rosbag2.StoragePlugin.MCAP)  # fmt: skip
    writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    return writer


def _quality(latched: bool) -> Any:
    """Return what a publisher of ROS 2 offers: reliable, and kept for who comes late if latched."""
    said = need("rosbags.interfaces")
    ever = said.QosTime(2147483647, 4294967295)
    durability = said.QosDurability
    return said.Qos(
        said.QosHistory.KEEP_LAST, 1 if latched else 10, said.QosReliability.RELIABLE,
        durability.TRANSIENT_LOCAL if latched else durability.VOLATILE, ever, ever,
        said.QosLiveliness.AUTOMATIC, ever, False,
    )  # fmt: skip
