# SPDX-License-Identifier: Apache-2.0
"""Our definitions are what ROS would make of them, and fields become bytes and messages again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bags import read_bag
from locfuse.io.rosbag.container import Connection
from locfuse.io.rosbag.decode import RangeRow
from locfuse.io.rosbag.wire import defined, definitions, deserializer, long, serializer
from locfuse.types import LogError
from support_bags import drive, world, write_messages

ENCODINGS = pytest.mark.parametrize("encoding", ["ros1", "cdr"])


def test_every_message_of_ours_is_defined() -> None:
    assert set(definitions()) == {
        f"locfuse_msgs/msg/{name}"
        for name in ("UwbRange", "UwbRanges", "UwbData", "LandmarkSighting", "LandmarkSightings",
                     "NamedPoints", "TagPosition")
    }  # fmt: skip


@ENCODINGS
def test_fields_make_bytes_and_bytes_messages(encoding: str) -> None:
    row = RangeRow(1_700_000_000_000_000_001, "t", "A", 1.1, 0.1, "radio")
    given = encode.uwb_ranges("uwb", [row, row])
    data = bytes(serializer(encoding, given.type)(given.fields))
    text, _ = defined(encoding, given.type)
    for definition in (text, ""):  # by the bag's own, or by ours
        message: Any = deserializer(Connection("uwb", given.type, definition, encoding))(data)
        assert [one.anchor for one in message.ranges] == ["A", "A"]
        assert message.ranges[0].range == 1.1
        assert message.ranges[0].header.stamp.nanosec == 1


@ENCODINGS
def test_fields_that_are_left_out_are_zero(encoding: str) -> None:
    data = bytes(serializer(encoding, "nav_msgs/Odometry")({"child_frame_id": "base"}))
    message: Any = deserializer(Connection("odom", "nav_msgs/Odometry", "", encoding))(data)
    assert message.child_frame_id == "base"
    assert message.pose.pose.orientation.w == 0.0
    assert np.array_equal(message.twist.covariance, np.zeros(36))


def test_a_sum_of_ros_1_is_that_of_its_own_tools() -> None:
    # Of a message that ROS 1 has, whose sum is public: what is hashed is what it hashes.
    assert defined("ros1", "nav_msgs/Odometry")[1] == "cd5e73d190d741a2f92e81eda573aca7"
    text, digest = defined("ros1", "locfuse_msgs/UwbData")
    assert "time[] stamp" in text
    assert len(digest) == 32


def test_what_cannot_be_understood_is_said() -> None:
    with pytest.raises(
        LogError, match="nothing defines odd_msgs/Odd: the bag brings no definition"
    ):
        deserializer(Connection("odd", "odd_msgs/Odd", "", "cdr"))
    with pytest.raises(LogError, match="the definition of odd_msgs/Odd cannot be used"):
        deserializer(Connection("odd", "odd_msgs/Odd", "not a definition", "cdr"))
    with pytest.raises(LogError, match="is encoded as 'json', expected ros1 or cdr"):
        deserializer(Connection("odd", "std_msgs/String", "string data", "json"))


def test_a_type_has_a_long_name() -> None:
    assert long("nav_msgs/Odometry") == long("nav_msgs/msg/Odometry") == "nav_msgs/msg/Odometry"


SEPARATOR = "=" * 80


@pytest.mark.parametrize(
    ("definition", "said"),
    [
        ("string[999999999] x\n", "an array of 999999999 elements, expected at most 1000"),
        (f"a/B[1001] x\n{SEPARATOR}\nMSG: a/B\nint8 x\n", "an array of 1001 elements"),
        (f"a/B[] x\n{SEPARATOR}\nMSG: a/B\n", "an array of a/B, which has no fields"),
        (f"a/B[] x\n{SEPARATOR}\nMSG: a/B\nint8[0] x\n", "an array of a/B, which has no fields"),
        ("a/A x\n", "recursion"),
    ],
    ids=["texts", "messages", "empty", "of nothing", "itself"],
)
@ENCODINGS
def test_a_definition_that_grows_when_read_is_refused(
    encoding: str, definition: str, said: str
) -> None:
    with pytest.raises(LogError, match=rf"the definition of a/A cannot be used \(.*{said}"):
        deserializer(Connection("a", "a/A", definition, encoding))


def test_definitions_without_end_are_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_messages(tmp_path / "drive.bag", drive(4))
    monkeypatch.setattr("locfuse.io.rosbag.bag_reader.MAX_DEFINITIONS", 100)
    with pytest.raises(LogError, match="types are defined by more than 100 letters"):
        read_bag(path, world=world())
