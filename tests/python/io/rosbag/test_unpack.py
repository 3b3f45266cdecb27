# SPDX-License-Identifier: Apache-2.0
"""Many messages at once are unpacked as rosbags unpacks each, and packed as it packs each."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag.container import Connection
from locfuse.io.rosbag.pack import pack
from locfuse.io.rosbag.unpack import MisfitError, Texts, Unpacked, unpack
from locfuse.io.rosbag.wire import broken, deserializer, long, store, structure

TYPES = [
    "nav_msgs/Odometry", "sensor_msgs/LaserScan", "locfuse_msgs/UwbRanges", "locfuse_msgs/UwbRange",
    "locfuse_msgs/UwbData", "sensor_msgs/Range", "geometry_msgs/PoseWithCovarianceStamped",
    "sensor_msgs/NavSatFix", "locfuse_msgs/TagPosition", "locfuse_msgs/LandmarkSightings",
    "geometry_msgs/PointStamped", "tf2_msgs/TFMessage", "locfuse_msgs/NamedPoints",
    "diagnostic_msgs/DiagnosticArray", "sensor_msgs/PointCloud2", "sensor_msgs/CameraInfo",
    "visualization_msgs/Marker", "std_msgs/Empty",
]  # fmt: skip
ENCODINGS = pytest.mark.parametrize("encoding", ["ros1", "cdr"])
EVERY_TYPE = pytest.mark.parametrize("name", TYPES)
BYTES = {"byte": "u1", "char": "u1", "octet": "u1", "bool": "?"}


def message(rng: random.Random, types: Any, name: str) -> Any:
    """Return a message of any type with texts and sequences of any length."""
    return types.types[name](**{
        field: value(rng, types, told) for field, told in types.fielddefs[name][1]
    })  # fmt: skip


def value(rng: random.Random, types: Any, told: Any) -> Any:
    from rosbags.interfaces import Nodetype

    node, what = told
    if node == Nodetype.NAME:
        return message(rng, types, what)
    if node == Nodetype.BASE:
        if what[0] == "string":
            return "".join(rng.choice("abä/ ") for _ in range(rng.randrange(7)))
        if what[0] == "bool":
            return rng.random() < 0.5
        if what[0].startswith("float"):
            return float(np.float32(rng.gauss(0.0, 1.0)))
        return rng.randrange(100)
    element, length = what
    several = length if node == Nodetype.ARRAY else rng.choice([0, 1, 2, 5])
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        dtype = np.dtype(BYTES.get(element[1][0], element[1][0]))
        return np.array([value(rng, types, element) for _ in range(several)], dtype)
    return [value(rng, types, element) for _ in range(several)]


def some(encoding: str, name: str, seed: int, big: bool = False) -> list[bytes]:
    """Return messages as bytes; `big` ones of CDR begin with their greatest byte."""
    rng, types = random.Random(seed), store(encoding)
    told = [message(rng, types, long(name)) for _ in range(12)]
    if encoding == "ros1":
        return [bytes(types.serialize_ros1(one, long(name))) for one in told]
    return [bytes(types.serialize_cdr(one, long(name), little_endian=not big)) for one in told]


def of(one: Any, path: str) -> list[Any]:
    """Return what a message has at a path, for each element of a sequence on the way."""
    first, _, rest = path.partition(".")
    inner = getattr(one, first.removesuffix("[]"))
    found = list(inner) if first.endswith("[]") else [inner]
    return [part for one in found for part in of(one, rest)] if rest else found


def check(name: str, encoding: str, data: list[bytes]) -> int:
    """Compare messages with what rosbags makes of them; return how many it cannot read."""
    connection = Connection("any", name, "", encoding)
    whole: dict[int, Any] = {}
    for row, one in enumerate(data):
        try:
            whole[row] = deserializer(connection)(one)
        except broken():
            continue
    found = unpack(structure(connection), encoding, data)
    assert sorted(row for messages in found for row in messages.rows.tolist()) == list(whole)
    for messages in found:
        for path in messages.paths():
            _same(messages, path, [of(whole[row], path) for row in messages.rows.tolist()])
    return len(data) - len(whole)


def _same(messages: Unpacked, path: str, told: list[list[Any]]) -> None:
    flat = [one for several in told for one in several]
    try:
        texts = messages.text(path)
        assert [texts.names[code] for code in texts.codes] == flat
        assert messages.owner(path).tolist() == [k for k, each in enumerate(told) for _ in each]
        return
    except MisfitError:
        pass
    try:
        counts = messages.counts(path)
    except MisfitError:
        if flat and not isinstance(flat[0], bool):
            _alike(messages.number(path), flat)
        return
    assert counts.tolist() == [len(one) for one in flat]
    if len(flat) and isinstance(flat[0], np.ndarray) and flat[0].dtype.kind in "iuf":
        _alike(messages.flat(path, np.ones(len(counts), bool)), np.concatenate(flat))


def _alike(found: Any, told: Any) -> None:
    assert np.array_equal(found, told, equal_nan=found.dtype.kind == "f")


@ENCODINGS
@EVERY_TYPE
def test_every_field_is_as_rosbags_reads_it(name: str, encoding: str) -> None:
    if long(name) in store(encoding).types:
        assert check(name, encoding, some(encoding, name, 1)) == 0


@EVERY_TYPE
def test_messages_of_either_order_of_bytes_may_stand_beside_each_other(name: str) -> None:
    both = zip(some("cdr", name, 2), some("cdr", name, 3, big=True), strict=True)
    assert check(name, "cdr", [one for pair in both for one in pair]) == 0


@ENCODINGS
@EVERY_TYPE
def test_those_that_rosbags_cannot_read_are_left_out_and_no_others(
    name: str, encoding: str
) -> None:
    if long(name) not in store(encoding).types:
        return
    rng = random.Random(4)
    data = some(encoding, name, 5) * 4
    for row in range(0, len(data), 2):
        odd = bytearray(data[row])
        if row % 3 == 0:
            odd = odd[: rng.randrange(len(odd) + 1)]
        elif row % 5 == 0:
            odd += bytes(rng.randrange(6))
        for _ in range(3 if odd else 0):
            odd[rng.randrange(len(odd))] = rng.choice([0, 1, 255, rng.randrange(256)])
        data[row] = bytes(odd)
    assert name == "std_msgs/Empty" or check(name, encoding, data) > 0


@ENCODINGS
@EVERY_TYPE
def test_what_is_unpacked_is_packed_byte_for_byte(name: str, encoding: str) -> None:
    if long(name) not in store(encoding).types:
        return
    fields = structure(Connection("any", name, "", encoding))
    for data in some(encoding, name, 6):
        (messages,) = unpack(fields, encoding, [data])
        values: dict[str, Any] = {}
        for path in messages.paths():
            for read in (messages.text, messages.number, lambda p, m=messages: _several(m, p)):
                try:
                    values[path] = read(path)
                    break
                except MisfitError:
                    continue
        if len(values) == len(list(messages.paths())):  # bools have no way back
            assert pack(fields, encoding, 1, values) == [data]


def _several(messages: Unpacked, path: str) -> Any:
    counts = messages.counts(path)
    try:
        if len(set(counts.tolist())) == 1:
            return messages.elements(path, slice(None), int(counts[0]))
    except MisfitError:
        pass
    return counts


def test_fields_without_value_are_zero_and_one_value_goes_for_all() -> None:
    fields = structure(Connection("odom", "nav_msgs/Odometry", "", "cdr"))
    data = pack(fields, "cdr", 2, {"header.frame_id": "odom", "child_frame_id":
                                   Texts(["", "body"], np.array([1, 0]))})  # fmt: skip
    make = deserializer(Connection("odom", "nav_msgs/Odometry", "", "cdr"))
    first, second = map(make, data)
    assert (first.child_frame_id, second.child_frame_id) == ("body", "")
    assert first.header.frame_id == second.header.frame_id == "odom"
    assert first.pose.covariance.tolist() == [0.0] * 36


def test_a_field_that_is_not_there_or_of_another_kind_is_a_misfit() -> None:
    fields = structure(Connection("odom", "nav_msgs/Odometry", "", "ros1"))
    (messages,) = unpack(fields, "ros1", pack(fields, "ros1", 3, {}))
    for read, path in ((messages.number, "header.frame_id"), (messages.text, "pose.pose"),
                       (messages.number, "ranges"), (messages.number, "pose.covariance"),
                       (messages.counts, "twist.twist.linear.x")):  # fmt: skip
        with pytest.raises(MisfitError):
            read(path)
