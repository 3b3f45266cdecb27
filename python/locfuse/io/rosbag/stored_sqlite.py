# SPDX-License-Identifier: Apache-2.0
"""The messages of a .db3 of ROS 2."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import BinaryIO

from locfuse.config.ros import plain
from locfuse.io.rosbag.container import Connection, Message, Reading, Wanted, short, text, words
from locfuse.types import LogError

MAGIC = b"SQLite format 3\x00"


def messages(bag: Reading, path: Path, _: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    """Yield the messages of a file that are wanted."""
    size = path.stat().st_size
    opened = False
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as base:
            base.text_factory = text
            topics = _sqlite_topics(base)
            bag.counts.update(dict.fromkeys(topics.values(), 0))
            chosen = [number for number, connection in topics.items() if wanted(connection)]
            last = base.execute("SELECT max(rowid) FROM messages").fetchone()[0] or 1
            opened = True
            for row, topic, time_ns, data in base.execute(
                "SELECT rowid, topic_id, timestamp, data FROM messages WHERE topic_id IN "
                f"({','.join('?' * len(chosen))})", chosen,
            ):  # fmt: skip
                bag.counts[topics[topic]] += 1
                bag.at(row * size // last)
                yield topics[topic], int(time_ns), bytes(data)
    except (sqlite3.Error, TypeError, ValueError) as error:  # also a value of another type
        if not opened:
            raise LogError(f"{path}: cannot be read ({words(error)})") from error
        bag.damaged(path, "on the way", words(error))


def _sqlite_topics(base: sqlite3.Connection) -> dict[int, Connection]:
    tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
    texts: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        texts = {
            kind: (encoding, text)
            for kind, encoding, text in base.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
        }
    rows = base.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
    return {
        number: Connection(plain(str(name)), short(str(kind)), str(texts.get(kind, ("", ""))[1]),
                           str(encoding), texts.get(kind, ("", ""))[0] == "ros2idl")
        for number, name, kind, encoding in rows
    }  # fmt: skip
