# SPDX-License-Identifier: Apache-2.0
"""Bags as files that are written: of ROS 1 and of ROS 2, by rosbags."""

from __future__ import annotations

import os
import shutil
from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import mkdtemp
from types import TracebackType
from typing import Any, Protocol

from locfuse.config.ros import plain
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.optional_rosbags import need
from locfuse.io.rosbag.wire import defined, long, serializer, store
from locfuse.io.whole import PART, sync
from locfuse.types import LogError


class Sink(Protocol):
    """What takes messages with the times at which they are recorded [ns]."""

    def write(self, time_ns: int, publication: Publication) -> None:
        """Write a message."""


def check_bag(path: Path) -> None:
    """Refuse a name of a bag that cannot be written, before the work and not after it.

    Raises LogError if it ends neither in ``.bag`` nor in ``.mcap``, or rosbags is missing.
    """
    if path.suffix not in (".bag", ".mcap"):
        raise LogError(f"{path}: ends in {path.suffix!r}; a bag is written as .bag (ROS 1) or "
                       ".mcap (ROS 2)")  # fmt: skip
    need("rosbags")


def bag_sink(path: Path) -> AbstractContextManager[Sink]:
    """Return what writes publications into a bag, which is there once its block has ended.

    Raises LogError as `check_bag`.
    """
    check_bag(path)
    return _Ros1Sink(path) if path.suffix == ".bag" else _McapSink(path)


class _FileSink(ABC):
    """Writes beside the file and moves it there when it is whole."""

    encoding = ""

    def __init__(self, path: Path) -> None:
        store(self.encoding)  # says what is missing before anything is made
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.folder = Path(mkdtemp(prefix=PART, dir=path.parent))
        self.known: dict[tuple[str, str], Any] = {}
        self.writer: Any = None

    def __enter__(self) -> _FileSink:
        self.writer = self._open()
        self.writer.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.writer.close()
            if kind is None:
                sync(self._made())
                os.replace(self._made(), self.path)
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)

    def write(self, time_ns: int, publication: Publication) -> None:
        topic, kind = publication.topic, publication.type
        if (topic, kind) not in self.known:
            self.known[topic, kind] = self._connect(f"/{plain(topic)}", kind, publication.latched)
        data = serializer(self.encoding, kind)(publication.fields)
        self.writer.write(self.known[topic, kind], time_ns, data)

    @abstractmethod
    def _open(self) -> Any: ...

    @abstractmethod
    def _made(self) -> Path: ...

    @abstractmethod
    def _connect(self, topic: str, kind: str, latched: bool) -> Any: ...


class _Ros1Sink(_FileSink):
    encoding = "ros1"

    def _open(self) -> Any:
        return need("rosbags.rosbag1").Writer(self._made())

    def _made(self) -> Path:
        return self.folder / "made.bag"

    def _connect(self, topic: str, kind: str, latched: bool) -> Any:
        text, digest = defined(self.encoding, kind)
        return self.writer.add_connection(topic, long(kind), msgdef=text, md5sum=digest,
                                          callerid="/locfuse", latching=int(latched))  # fmt: skip


class _McapSink(_FileSink):
    encoding = "cdr"

    def _open(self) -> Any:
        rosbag2 = need("rosbags.rosbag2")
        writer = rosbag2.Writer(self.folder / "made", version=rosbag2.Writer.VERSION_LATEST,
                                storage_plugin=rosbag2.StoragePlugin.MCAP)  # fmt: skip
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        return writer

    def _made(self) -> Path:
        return self.folder / "made" / "made.mcap"

    def _connect(self, topic: str, kind: str, latched: bool) -> Any:
        return self.writer.add_connection(
            topic, long(kind), typestore=store(self.encoding),
            offered_qos_profiles=[_quality(latched)],
        )  # fmt: skip


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
