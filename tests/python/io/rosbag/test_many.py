# SPDX-License-Identifier: Apache-2.0
"""Many messages of one topic, good and bad, become one table."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from locfuse.io.rosbag.bag_files import bag_sink
from locfuse.io.rosbag.bags import read_bag
from locfuse.io.rosbag.wire import serializer
from support_bags import MS, T0, drive, sentences, world, write_messages


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_frames_of_any_length_may_follow_each_other(kind: str, tmp_path: Path) -> None:
    messages = []
    for number, (time_ns, one) in enumerate(drive(60)):
        if one.topic == "odom":
            one.fields["header"]["frame_id"] = "odom"[: 1 + number % 4]
            one.fields["child_frame_id"] = "b" * (number % 9)
        messages.append((time_ns, one))
    log = read_bag(write_messages(tmp_path / f"odd.{kind}", messages), world=world())
    plain = read_bag(write_messages(tmp_path / f"plain.{kind}", drive(60)), world=world())
    for name in plain["odometry"]:
        assert np.array_equal(log["odometry"][name], plain["odometry"][name])


def test_messages_of_which_each_third_is_bad_are_taken_as_far_as_they_go(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    messages = []
    for number, (time_ns, one) in enumerate(drive(90)):
        if one.topic == "odom" and (number // 3) % 3 == 1:
            one.fields["pose"]["pose"]["position"]["x"] = math.nan
        messages.append((time_ns, one))
    path = write_messages(tmp_path / "d.mcap", messages)
    log = read_bag(path, world=world())
    kept = [k for k in range(90) if k % 3 != 1]
    assert ((log["odometry"]["stamp_ns"] - T0) // (100 * MS)).tolist() == kept
    assert sentences(caplog) == [
        f"{path}: 30 of 90 messages on odom are left out: pose.position.x is nan, expected a "
        "finite number"
    ]


def test_blocks_leave_no_seam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_messages(tmp_path / "d.bag", drive(200))
    whole = read_bag(path, world=world())
    monkeypatch.setattr("locfuse.io.rosbag.columns.BLOCK_ROWS", 7)
    in_sevens = read_bag(path, world=world())
    for stem in ("odometry", "ranges", "scans"):
        for name, values in whole[stem].items():
            assert np.array_equal(values, in_sevens[stem][name])


@pytest.mark.parametrize("damage", ["cut", "longer", "not UTF-8"])
@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_damaged_messages_among_good_ones_are_left_out(
    kind: str, damage: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, encoding = tmp_path / f"d.{kind}", "ros1" if kind == "bag" else "cdr"
    with bag_sink(path) as sink:
        for number, (time_ns, one) in enumerate(drive(9)):
            sink.write(time_ns, one)
            if one.topic == "odom" and (number // 3) % 3 == 1:
                data = bytes(serializer(encoding, one.type)(one.fields))
                data = {"cut": data[:-9], "longer": data + bytes(9),
                        "not UTF-8": data.replace(b"link", b"l\xffnk")}[damage]  # fmt: skip
                connection = sink.known["odom", one.type]
                sink.writer.write(connection, time_ns, data)
    log = read_bag(path, world=world())
    assert ((log["odometry"]["stamp_ns"] - T0) // (100 * MS)).tolist() == list(range(9))
    (said,) = sentences(caplog)
    assert "3 of 12 messages on odom are left out: it cannot be unpacked (" in said
