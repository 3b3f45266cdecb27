# SPDX-License-Identifier: Apache-2.0
"""Bags are read from their beginning on: of whichever kind, however packed, and up to damage."""

from __future__ import annotations

import bz2
import gzip
import logging
import os
import sqlite3
import tracemalloc
from collections import Counter
from contextlib import closing
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from locfuse.io.csv_table import unpacked
from locfuse.io.recording import read_recording
from locfuse.io.rosbag import container as stored
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_stream import Bag, _files, is_bag
from locfuse.io.rosbag.bags import read_bag
from locfuse.io.rosbag.container import Connection, CutError, Reading, need, short
from locfuse.types import LogError
from support_bags import KINDS, MS, T0, drive, sentences, world, write_messages, write_sqlite

STEPS = 400  # fill several chunks
WRITTEN = Counter({"odom": STEPS, "uwb": STEPS, "scan": STEPS, "tf_static": 1})


def measured(path: Path) -> tuple[Counter[str], list[str]]:
    """Return how many messages of each topic are read, and what was damaged."""
    bag = Bag(path)
    found = Counter(connection.topic for connection, _, _ in bag.messages(lambda _: True))
    assert found.total() == bag.counts.total()
    return found, bag.damage


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bags")
    return {kind: write_messages(folder / f"drive.{kind}", drive(STEPS)) for kind in KINDS}


def is_on(topic: str, connection: Connection) -> bool:
    return connection.topic == topic


def file_of(path: Path) -> Path:
    return next(path.glob("*.db3")) if path.is_dir() else path


@pytest.mark.parametrize("kind", KINDS)
def test_every_message_is_read_with_its_record_time_and_type(
    kind: str, bags: dict[str, Path]
) -> None:
    assert measured(bags[kind]) == (WRITTEN, [])
    assert measured(file_of(bags[kind])) == (WRITTEN, [])
    bag = Bag(bags[kind])
    first = next(m for m in bag.messages(lambda c: c.topic == "odom"))
    assert (first[0].type, first[1]) == ("nav_msgs/Odometry", T0 + 5_000_000)
    assert first[0].encoding == ("ros1" if kind == "bag" else "cdr")


@pytest.mark.parametrize("kind", KINDS)
def test_only_what_is_wanted_is_read_and_the_rest_is_known_of(
    kind: str, bags: dict[str, Path]
) -> None:
    bag = Bag(bags[kind])
    topics = {c.topic for c, _, _ in bag.messages(lambda c: c.topic == "uwb")}
    assert topics == {"uwb"}
    assert {c.topic for c in bag.counts} == set(WRITTEN)


@pytest.mark.parametrize("kind", KINDS)
def test_progress_ends_with_all_of_the_bag(kind: str, bags: dict[str, Path]) -> None:
    given: list[tuple[int, int]] = []
    for _ in Bag(bags[kind], lambda *done: given.append(done)).messages(lambda _: True):
        pass
    assert given == sorted(given)
    assert given[-1][0] == given[-1][1] == file_of(bags[kind]).stat().st_size


@pytest.mark.parametrize("packing", ["bz2", "lz4"])
def test_packed_chunks_of_ros_1_are_unpacked(
    packing: str, tmp_path: Path, bags: dict[str, Path]
) -> None:
    from rosbags.rosbag1 import Reader, Writer

    writer = Writer(tmp_path / "packed.bag")
    writer.set_compression(Writer.CompressionFormat[packing.upper()])
    with Reader(bags["bag"]) as reader, writer:
        known = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in reader.connections
        }
        for connection, time_ns, data in reader.messages():
            writer.write(known[connection.id], time_ns, data)
    assert measured(tmp_path / "packed.bag") == (WRITTEN, [])


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
def test_packed_folders_of_ros_2_are_unpacked(mode: str, tmp_path: Path) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode

    path = write_sqlite(tmp_path / "packed", drive(STEPS), mode=CompressionMode[mode],
                        fmt=CompressionFormat.ZSTD)  # fmt: skip
    assert measured(path) == (WRITTEN, [])


@pytest.mark.parametrize("kind", ["bag", "mcap"])
@pytest.mark.parametrize("share", [0.15, 0.5, 0.9])
def test_a_bag_that_is_cut_off_is_read_up_to_there(
    kind: str, share: float, tmp_path: Path, bags: dict[str, Path]
) -> None:
    data = bags[kind].read_bytes()
    path = tmp_path / f"cut.{kind}"
    path.write_bytes(data[: int(share * len(data))])
    found, damage = measured(path)
    (said,) = damage
    assert said.startswith(f"{path} is damaged at ")
    assert f"the {found.total()} messages before are kept" in said
    if kind == "bag":  # whose chunks are not packed, so that half a chunk is worth something
        assert found.total() > 0.9 * share * WRITTEN.total() - 50


def test_no_length_of_a_bag_is_a_traceback(tmp_path: Path, bags: dict[str, Path]) -> None:
    for kind in ("bag", "mcap"):
        data = bags[kind].read_bytes()
        for length in [*range(1, 200), *range(200, len(data), len(data) // 60)]:
            path = tmp_path / f"cut.{kind}"
            path.write_bytes(data[:length])
            try:
                found, damage = measured(path)
            except LogError:
                assert length < 32  # not enough to know what it is
            else:
                assert found == WRITTEN or len(damage) == 1


def test_no_changed_byte_of_a_bag_is_a_traceback(tmp_path: Path, bags: dict[str, Path]) -> None:
    for kind in ("bag", "mcap"):
        data = bytearray(write_messages(tmp_path / f"small.{kind}", drive(3)).read_bytes())
        for at in range(0, len(data), 31):
            before, data[at] = data[at], data[at] ^ 0xA5
            path = tmp_path / f"odd.{kind}"
            path.write_bytes(data)
            data[at] = before
            try:
                measured(path)
            except LogError:
                assert at < 32


def test_a_chunk_that_is_damaged_is_left_and_the_next_read(
    tmp_path: Path, bags: dict[str, Path]
) -> None:
    data = bytearray(write_messages(tmp_path / "long.mcap", drive(3000)).read_bytes())
    first = data.index(b"\x28\xb5\x2f\xfd")  # zstd's own mark
    second = data.index(b"\x28\xb5\x2f\xfd", first + 4)
    data[second : second + 4] = bytes(4)
    path = tmp_path / "odd.mcap"
    path.write_bytes(data)
    stamps = [time_ns for _, time_ns, _ in Bag(path).messages(lambda c: c.topic == "odom")]
    _, damage = measured(path)
    assert len(damage) == 1
    assert "a chunk cannot be unpacked" in damage[0]
    assert (stamps[0], stamps[-1]) == (T0 + 5 * MS, T0 + (5 + 100 * 2999) * MS)
    assert 0 < len(stamps) < 3000


def test_a_bag_that_was_never_closed_is_read(tmp_path: Path) -> None:
    closed = write_messages(tmp_path / "closed.bag", drive(STEPS))
    data = bytearray(closed.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data[at : at + 8] = bytes(8)
    path = tmp_path / "active.bag"
    path.write_bytes(data)
    found, damage = measured(path)
    assert found == WRITTEN
    assert damage == [f"{path} is damaged at its end (it was never closed); the {WRITTEN.total()} "
                      "messages before are kept"]  # fmt: skip


def test_a_database_that_is_damaged_is_read_up_to_there(
    tmp_path: Path, bags: dict[str, Path]
) -> None:
    data = bytearray(file_of(bags["db3"]).read_bytes())
    middle = len(data) // 2
    data[middle : middle + 40_000] = b"\xff" * 40_000
    path = tmp_path / "odd.db3"
    path.write_bytes(data)
    found, damage = measured(path)
    assert 0 < found.total() < WRITTEN.total()
    assert f"the {found.total()} messages before are kept" in damage[0]


def test_what_is_no_bag_is_said_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "empty.bag").write_bytes(b"")
    (tmp_path / "text.mcap").write_text("hello")
    (tmp_path / "old.bag").write_text("#ROSBAG V1.2\n")
    (tmp_path / "odd.db3").write_bytes(b"SQLite format 3\x00" + b"\xff" * 500)
    (tmp_path / "folder").mkdir()
    for name, said in (
        ("absent.bag", "no such bag; expected a .bag of ROS 1"),
        ("empty.bag", "is empty; expected a .bag of ROS 1"),
        ("text.mcap", "begins with b'hello'"),
        ("old.bag", "#ROSBAG V1.2, expected #ROSBAG V2.0"),
        ("odd.db3", "cannot be read"),
        ("folder", "a folder without metadata.yaml, .mcap and .db3 is no bag"),
    ):
        with pytest.raises(LogError) as error:
            list(Bag(tmp_path / name).messages(lambda _: True))
        assert str(error.value).startswith(str(tmp_path / name))
        assert said in str(error.value)


def test_a_folder_whose_metadata_is_wrong_is_said_in_a_sentence(tmp_path: Path) -> None:
    for text, said in (
        ("hello", "names no files"),
        ("rosbag2_bagfile_information: {relative_file_paths: [a.db3]}", "a.db3, which metadata"),
        ("rosbag2_bagfile_information: {}", "names no files"),
    ):
        (tmp_path / "metadata.yaml").write_text(text)
        with pytest.raises(LogError, match=said):
            list(Bag(tmp_path).messages(lambda _: True))


def test_a_folder_whose_recorder_was_stopped_is_read_in_the_order_of_its_files(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    messages = drive(24)
    folder = tmp_path / "stopped"
    folder.mkdir()
    for number in range(12):  # of which 10 and 11 come last
        write_messages(folder / f"drive_{number}.mcap", messages[number::12])
    whole = read_bag(write_messages(tmp_path / "whole.mcap", messages))
    with caplog.at_level(logging.WARNING):
        found = read_bag(folder)
    assert "has no metadata.yaml" in caplog.text
    assert is_bag(folder)
    assert found["odometry"]["stamp_ns"].tolist() == whole["odometry"]["stamp_ns"].tolist()
    names = [path.name for path, _ in _files(folder)]
    assert names == [f"drive_{number}.mcap" for number in range(12)]
    (folder / "odometry.csv").write_text("stamp_s,v_mps,omega_radps\n")
    assert not is_bag(folder)


def test_a_bag_is_distinguished_from_a_log_folder(tmp_path: Path, bags: dict[str, Path]) -> None:
    assert all(is_bag(path) for path in bags.values())
    assert not is_bag(tmp_path)
    assert not is_bag(tmp_path / "absent")


def test_types_are_named_as_people_name_them() -> None:
    assert short("nav_msgs/msg/Odometry") == short("nav_msgs/Odometry") == "nav_msgs/Odometry"


def test_a_topic_may_have_two_publishers_and_two_types(tmp_path: Path) -> None:
    given = drive(3) + [(T0, encode.text("odom", "not odometry"))]
    found, damage = measured(write_messages(tmp_path / "two.bag", given))
    assert (found["odom"], damage) == (4, [])


def test_a_packed_message_that_is_damaged_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode

    path = write_sqlite(tmp_path / "packed", drive(STEPS), mode=CompressionMode.MESSAGE,
                        fmt=CompressionFormat.ZSTD)  # fmt: skip
    with closing(sqlite3.connect(file_of(path))) as base:
        base.execute("UPDATE messages SET data = x'28b52ffd00' WHERE id = 3")
        base.commit()
    found, damage = measured(path)
    assert (found, damage) == (WRITTEN, [])
    assert len(read_bag(path, world=world())["ranges"]["stamp_ns"]) == 2 * (STEPS - 1)
    (said,) = sentences(caplog)
    assert f"1 of {STEPS} messages on uwb are left out: it cannot be unpacked" in said


@pytest.mark.parametrize("packing", ["bz2", "lz4", "zstd"])
def test_a_chunk_that_grows_when_it_is_unpacked_is_not(
    packing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "MAX_UNPACKED", 1000)
    pack = {"bz2": bz2.compress, "lz4": need("lz4.frame").compress, "zstd": stored.zstd().compress}
    for size in (999, 1000):
        assert Reading().unpack(pack[packing](bytes(size)), packing, None) == bytes(size)
        assert Reading().unpack(pack[packing](bytes(size)), packing, size) == bytes(size)
    for given in (None, 999, 1001, 5_000_000):
        with pytest.raises(CutError, match=r"more than|expected"):
            Reading().unpack(pack[packing](bytes(5_000_000)), packing, given)
    with pytest.raises(CutError, match="cannot be unpacked"):
        Reading().unpack(pack[packing](bytes(999))[:-8], packing, None)


@pytest.mark.parametrize("packing", ["bz2", "lz4", "zstd", "gz"])
def test_a_small_chunk_takes_little_memory(packing: str) -> None:
    """What may be unpacked, 1 GiB, is not asked for beforehand."""
    pack = {"bz2": bz2.compress, "lz4": need("lz4.frame").compress, "zstd": stored.zstd().compress,
            "gz": gzip.compress}[packing]  # fmt: skip
    for size in (0, 100, 3 << 20):
        packed = pack(bytes(size))
        tracemalloc.start()
        found = unpacked(packed) if packing == "gz" else Reading().unpack(packed, packing)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert found == bytes(size)
        assert peak < 50 << 20


def test_chunks_together_may_unpack_to_a_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored, "MAX_UNPACKED", 1000)
    packed = stored.zstd().compress(bytes(900))
    for size, chunks in ((5, 1), (30, 3)):  # a larger bag may grow a hundred times
        bag = Reading(size=size)
        for _ in range(chunks):
            bag.unpack(packed, "zstd")
        for _ in range(3):
            with pytest.raises(CutError, match=f"unpacks to more than {max(1000, 100 * size)}"):
                bag.unpack(packed, "zstd")
        assert bag.unpacked < 100 * size + 1000


def test_a_packed_file_that_grows_is_refused_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "MAX_UNPACKED", 1 << 20)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {relative_file_paths: [a.db3.zstd], compression_mode: FILE}"
    )
    (folder / "a.db3.zstd").write_bytes(stored.zstd().compress(bytes(9 << 20)))
    with pytest.raises(LogError, match=r"a\.db3\.zstd: unpacks to more than 1048576 bytes"):
        read_bag(folder)
    assert list(tmp_path.iterdir()) == [folder]


def test_names_and_connections_are_not_endless(monkeypatch: pytest.MonkeyPatch) -> None:
    known: dict[int, Connection] = {}
    odometry = Connection("odom", "nav_msgs/Odometry", "x" * 500, "cdr")
    monkeypatch.setattr(stored, "MAX_DESCRIBED", 4 * 1600)
    bag = Reading()
    with pytest.raises(CutError, match="a name of 1001 letters"):
        bag.connect(known, 1, odometry._replace(topic="o" * 1001))
    for _ in range(100):  # each chunk may describe it again
        bag.connect(known, 1, odometry)
    for number in (2, 3, 4):
        bag.connect(known, number, odometry)
    with pytest.raises(CutError, match="more than 6400 letters of connections"):
        bag.connect(known, 5, odometry)
    assert list(known) == [1, 2, 3, 4]


def test_damage_in_many_places_is_reported_for_some(tmp_path: Path) -> None:
    (tmp_path / "odd").touch()
    bag = Reading()
    for at in range(1000):
        bag.damaged(tmp_path / "odd", at, "odd")
    assert len(bag.damage) == 10


TOPICS = "TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
MESSAGES = "TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM c) SELECT x AS"


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ((TOPICS, f"VIEW messages AS {ENDLESS} rowid, 1 AS topic_id, x AS timestamp, "
                  "x'00' AS data FROM c"), "messages is computed"),
        ((f"VIEW topics AS {ENDLESS} id, hex(zeroblob(100000)) AS name, '' AS type, "
          "'' AS serialization_format FROM c", MESSAGES), "topics is computed"),
        ((TOPICS, MESSAGES, "VIEW message_definitions AS SELECT 1 AS topic_type"),
         "message_definitions is computed"),
        ((TOPICS, MESSAGES.replace("BLOB", "AS (zeroblob(900000000))")), "messages is computed"),
        (("VIRTUAL TABLE topics USING fts5(id)", MESSAGES), "topics is computed"),
    ],
    ids=["endless messages", "endless topics", "definitions", "a column", "a module"],
)  # fmt: skip
def test_a_database_whose_rows_are_computed_is_refused(
    tables: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "odd.db3"
    with closing(sqlite3.connect(path)) as base:
        for table in tables:
            base.execute(f"CREATE {table}")
        if TOPICS in tables:
            base.execute("INSERT INTO topics VALUES(1, '/odom', 'nav_msgs/msg/Odometry', 'cdr')")
        base.commit()
    with pytest.raises(LogError, match=f"{path}: cannot be read .{said}, as a view is; expected"):
        list(Bag(path).messages(lambda _: True))


def test_a_database_that_gives_rows_without_end_is_read_up_to_a_measure(tmp_path: Path) -> None:
    """Pages that point to one another give a page of rows again and again."""
    path = tmp_path / "odd.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA page_size = 512")
        base.execute(f"CREATE {TOPICS}")
        base.execute(f"CREATE {MESSAGES}")
        base.executemany("INSERT INTO topics VALUES(?, ?, 'std_msgs/msg/Empty', 'cdr')",
                         [(1, "/odom"), (2, "/tf")])  # fmt: skip
        base.executemany("INSERT INTO messages VALUES(?, 1, 0, ?)",
                         [(row, bytes(100)) for row in range(20_000)])  # fmt: skip
        base.commit()
    data = bytearray(path.read_bytes())
    inner = [at for at in range(512, len(data), 512) if data[at] == 5][:6]
    for at, following in pairwise(inner):
        for k in range(int.from_bytes(data[at + 3 : at + 5], "big")):
            cell = at + int.from_bytes(data[at + 12 + 2 * k : at + 14 + 2 * k], "big")
            data[cell : cell + 4] = (following // 512 + 1).to_bytes(4, "big")
    path.write_bytes(data)
    for wanted, said in (("odom", "its rows have more bytes than the file"),
                         ("tf", "its pages lead in a circle")):  # fmt: skip
        bag = Bag(path)
        list(bag.messages(partial(is_on, wanted)))
        assert said in bag.damage[0]


def test_a_pipe_and_a_file_that_is_named_twice_are_no_bag(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "odd.db3")
    with pytest.raises(LogError, match=r"odd\.db3: is a device or a pipe; expected a \.bag of ROS"):
        read_recording(tmp_path / "odd.db3")
    (tmp_path / "a.db3").touch()
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {relative_file_paths: [a.db3, b/a.db3]}"
    )
    with pytest.raises(LogError, match="names a file twice"):
        read_recording(tmp_path)
