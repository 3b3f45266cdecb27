# SPDX-License-Identifier: Apache-2.0
"""The messages of a .db3 of ROS 2."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO

from locfuse.config.ros import plain
from locfuse.io.rosbag.container import Connection, CutError, Message, Reading, Wanted, short, text
from locfuse.types import LogError, words

MAGIC = b"SQLite format 3\x00"


def messages(bag: Reading, path: Path, _: BinaryIO, wanted: Wanted) -> Iterator[Message]:
    """Yield the messages of a file that are wanted."""
    log = path.with_name(f"{path.name}-wal")  # what the recorder had not yet moved to the file
    size = path.stat().st_size + (log.stat().st_size if log.is_file() else 0)
    opened = False
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as base:
            base.text_factory = text
            steps = iter(range(10_000 + size // 100))  # 10 instructions of SQLite for a byte
            base.set_progress_handler(lambda: next(steps, None) is None, 1000)
            topics = _sqlite_topics(bag, base, size)
            bag.counts.update(dict.fromkeys(topics.values(), 0))
            chosen = [number for number, connection in topics.items() if wanted(connection)]
            last = base.execute("SELECT max(rowid) FROM messages").fetchone()[0] or 1
            opened = True
            for row, topic, time_ns, data in _rows(
                base, "SELECT rowid, topic_id, timestamp, data FROM messages NOT INDEXED WHERE "
                f"topic_id IN ({','.join('?' * len(chosen))})", size, chosen,
            ):  # fmt: skip
                bag.counts[topics[topic]] += 1
                bag.at(row * path.stat().st_size // last)
                yield topics[topic], int(time_ns), bytes(data)
    except (sqlite3.Error, CutError, TypeError, ValueError) as error:  # also of another type
        said = "its pages lead in a circle" if str(error) == "interrupted" else words(error)
        if not opened:
            raise LogError(f"{path}: cannot be read ({said})") from error
        bag.damaged(path, "on the way", said)


def _rows(
    base: sqlite3.Connection, query: str, size: int, given: Sequence[Any] = ()
) -> Iterator[Any]:
    """Yield the rows of a query: a damaged file may give a row again and again."""
    for row in base.execute(query, given):
        size -= sum(len(value) for value in row if isinstance(value, str | bytes))
        if size < 0:
            raise CutError("its rows have more bytes than the file")
        yield row


def _sqlite_topics(bag: Reading, base: sqlite3.Connection, size: int) -> dict[int, Connection]:
    kinds = dict(_rows(base, "SELECT name, rootpage AND type = 'table' FROM sqlite_master", size))
    for table in ("topics", "messages", "message_definitions"):
        computed = f"SELECT 1 FROM pragma_table_xinfo('{table}') WHERE hidden"
        if not kinds.get(table, 1) or (table in kinds and base.execute(computed).fetchone()):
            raise CutError(f"{table} is computed, as a view is; expected a table")
    texts: dict[str, tuple[str, str]] = {}
    if "message_definitions" in kinds:
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        texts = {kind: (encoding, text) for kind, encoding, text in _rows(base, query, size)}
    found: dict[int, Connection] = {}
    query = "SELECT id, name, type, serialization_format FROM topics"
    for number, name, kind, encoding in _rows(base, query, size):
        idl, text = texts.get(kind, ("", ""))
        bag.connect(found, number, Connection(plain(str(name)), short(str(kind)), str(text),
                                              str(encoding), idl == "ros2idl"))  # fmt: skip
    return found
