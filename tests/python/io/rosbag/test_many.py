# SPDX-License-Identifier: Apache-2.0
"""What is said of many messages at once is what is said of each of them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.ros import Ros
from locfuse.io.rosbag import bag_checks, decode_many, encode, encode_many
from locfuse.io.rosbag.bag_contents import Heard
from locfuse.io.rosbag.bags import read_bag
from locfuse.io.rosbag.container import Connection
from locfuse.io.rosbag.decode import MessageError, heading_of
from locfuse.io.rosbag.decode_many import Said
from locfuse.io.rosbag.frames import _Quaternion
from locfuse.io.rosbag.unpack import Unpacked, unpack
from locfuse.io.rosbag.wire import deserializer, long, store, structure
from locfuse.types import Log
from support_bags import MS, T0, drive, sentences, world, write_messages

ODD = (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e300, 2e5, -3.0, 1e-9)
FRAMES = ("map", "/map", "", "/", "odom", "a longer name", "ä")


def awkward(rng: random.Random, types: Any, name: str, odd: float) -> Any:
    """Return a message of which each field is out of bounds with the probability `odd`."""
    from rosbags.interfaces import Nodetype

    def value(field: str, told: Any) -> Any:
        node, what = told
        if node == Nodetype.BASE:
            return number(field, what[0])
        if node == Nodetype.NAME:
            return awkward(rng, types, what, odd)
        element, length = what
        several = length if node == Nodetype.ARRAY else 2
        if node == Nodetype.SEQUENCE and rng.random() < odd:
            several = rng.choice([0, 1, 3])
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            told = [number(field, element[1][0]) for _ in range(several)]
            return np.array(told, element[1][0])
        return [value(field, element) for _ in range(several)]

    def number(field: str, kind: str) -> Any:
        strange = rng.random() < odd
        if kind == "string":
            return rng.choice(FRAMES if strange else FRAMES[:2])
        if field == "sec":
            return rng.choice([0, -5]) if strange else 1_700_000_000
        if field == "nanosec":
            return rng.choice([0, 10**9, 4 * 10**9]) if strange else rng.randrange(10**9)
        if kind.startswith("float"):
            fixed = {"angle_min": -1.0, "angle_increment": 0.5, "range_min": 0.1,
                     "range_max": 10.0, "max_range": 4.0, "min_range": 0.1}  # fmt: skip
            told = rng.choice(ODD) if strange else fixed.get(field, rng.uniform(0.01, 5.0))
            return told if kind == "float64" else float(np.float32(np.clip(told, -1e30, 1e30)))
        return rng.randrange(-1 if field == "status" else 0, 3)

    return types.types[name](**{
        field: value(field, told) for field, told in types.fielddefs[name][1]
    })  # fmt: skip


def heard() -> Heard:
    return Heard(Path("any.bag"), Ros(), Log(tables={}))


def scans(messages: Unpacked, of: Heard) -> Said:
    said = decode_many.scans(messages, of.laser)
    of.laser = said.first
    return said


def sightings(messages: Unpacked, of: Heard) -> Said:
    said = decode_many.sightings(messages, of.sight_frame)
    of.sight_frame = said.first
    return said


def positions(messages: Unpacked, of: Heard) -> Said:
    return decode_many.positions(messages, "map", (0.0, 0.0, 0.0))


def range_of(message: Any, of: Heard) -> None:
    bag_checks.range_of("N", message, of)


MANY: dict[str, tuple[Callable[[Unpacked, Heard], Said], Callable[[Any, Heard], None]]] = {
    "nav_msgs/Odometry": (lambda m, _: decode_many.odometry(m, "pose"), bag_checks.odometry),
    "geometry_msgs/PoseStamped": (lambda m, _: decode_many.truth(m, "map"), bag_checks.truth),
    "geometry_msgs/PointStamped": (lambda m, _: decode_many.truth(m, "map"), bag_checks.truth),
    "geometry_msgs/PoseWithCovarianceStamped": (
        lambda m, _: decode_many.poses(m, "map"), bag_checks.pose),
    "sensor_msgs/NavSatFix": (positions, bag_checks.position),
    "locfuse_msgs/TagPosition": (positions, bag_checks.position),
    "locfuse_msgs/UwbRange": (lambda m, _: decode_many.ranges(m, "m", "tag"), bag_checks.ranges),
    "sensor_msgs/Range": (lambda m, _: decode_many.range_of(m, "tag", "N"), range_of),
    "locfuse_msgs/LandmarkSighting": (sightings, bag_checks.sightings),
    "locfuse_msgs/LandmarkSightings": (sightings, bag_checks.sightings),
    "sensor_msgs/LaserScan": (scans, bag_checks.scan),
}  # fmt: skip


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("name", MANY)
def test_those_that_are_refused_at_once_are_those_that_are_refused_alone(
    name: str, encoding: str
) -> None:
    rng, types, of = random.Random(7), store(encoding), heard()
    write = types.serialize_ros1 if encoding == "ros1" else types.serialize_cdr
    chances = [0.0] * 4 + [0.0, 0.01, 0.03, 0.2] * 75
    data = [bytes(write(awkward(rng, types, long(name), odd), long(name))) for odd in chances]
    connection = Connection("any", name, "", encoding)
    (messages,) = unpack(structure(connection), encoding, data)
    said_of_many, check = MANY[name]
    with np.errstate(all="ignore"):  # as the reader does
        good = said_of_many(messages, of).good
    alone = []
    for one in data:
        try:
            check(deserializer(connection)(one), of)
            alone.append(True)
        except MessageError:
            alone.append(False)
    assert good.tolist() == alone
    assert 20 < good.sum() < len(good) - 20


def test_headings_of_many_are_those_of_each_and_lead_back() -> None:
    rng = np.random.default_rng(3)
    headings = np.concatenate([rng.uniform(-math.pi, math.pi, 3000), [0.0, -math.pi, 1e-300]])
    z, w = encode_many.quaternions(headings)
    for row, heading in enumerate(headings.tolist()):
        told = encode.quaternion(heading)
        assert (z[row], w[row]) == (told["z"], told["w"])
        assert heading_of(_Quaternion(0.0, 0.0, z[row], w[row])) == heading


# Whole bags ------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_frames_of_any_length_may_follow_each_other(kind: str, tmp_path: Path) -> None:
    told = []
    for number, (time_ns, one) in enumerate(drive(60)):
        if one.topic == "odom":
            one.fields["header"]["frame_id"] = "odom"[: 1 + number % 4]
            one.fields["child_frame_id"] = "b" * (number % 9)
        told.append((time_ns, one))
    log = read_bag(write_messages(tmp_path / f"odd.{kind}", told), world=world())
    plain = read_bag(write_messages(tmp_path / f"plain.{kind}", drive(60)), world=world())
    for name in plain["odometry"]:
        assert np.array_equal(log["odometry"][name], plain["odometry"][name])


def test_messages_of_which_each_third_is_bad_are_taken_as_far_as_they_go(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    told = []
    for number, (time_ns, one) in enumerate(drive(90)):
        if one.topic == "odom" and (number // 3) % 3 == 1:
            one.fields["pose"]["pose"]["position"]["x"] = math.nan
        told.append((time_ns, one))
    path = write_messages(tmp_path / "d.mcap", told)
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
    monkeypatch.setattr("locfuse.io.rosbag.bag_reader.BLOCK_MESSAGES", 7)
    in_sevens = read_bag(path, world=world())
    for stem in ("odometry", "ranges", "scans"):
        for name, values in whole[stem].items():
            assert np.array_equal(values, in_sevens[stem][name])
