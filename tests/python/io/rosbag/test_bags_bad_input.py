# SPDX-License-Identifier: Apache-2.0
"""What robots record that means nothing: left out, given in one sentence, the rest is kept."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Reader, Writer

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bags import read_bag, write_bag
from locfuse.io.rosbag.decode import RangeRow, SightingRow
from locfuse.io.rosbag.encode import Publication
from locfuse.run.run import run
from locfuse.types import GridMap, Log, LogError
from support_bags import MS, T0, drive, full_log, sentences, world, write_messages

HOUR = 3600 * 1_000_000_000
Recorded = tuple[int, Publication]
Edit = Callable[[Publication], Publication]


def changed(publication: Publication, **changes: Any) -> Publication:
    """Return a publication with a field replaced that is named by its path: ``header__stamp``."""
    fields = deep(publication.fields)
    for path, value in changes.items():
        *parents, name = path.split("__")
        holder = fields
        for parent in parents:
            holder = holder[parent]
        holder[name] = value
    return replace(publication, fields=fields)


def deep(fields: Any) -> Any:
    if isinstance(fields, dict):
        return {key: deep(value) for key, value in fields.items()}
    return [deep(one) for one in fields] if isinstance(fields, list) else fields


def _settings(**changes: Any) -> str:
    """Return what a bag says of its log, changed."""
    given = {"format": 1, "shift_ns": 0, "columns": {}, "log": {}}
    return yaml.safe_dump(given | changes)


def edited(topic: str, every: int = 4, **changes: Any) -> list[Recorded]:
    """Return `drive` with each fourth message on a topic changed."""
    given, number = [], 0
    for time_ns, publication in drive():
        if publication.topic == topic:
            if number % every == 0:
                publication = changed(publication, **changes)
            number += 1
        given.append((time_ns, publication))
    return given


@pytest.mark.parametrize(
    ("topic", "stem", "changes", "said"),
    [
        ("odom", "odometry", {"header__stamp": {"ns": 0}}, "the stamp is 0; the driver must stamp"),
        ("odom", "odometry", {"pose__pose__position__x": math.nan}, "pose.position.x is nan"),
        ("odom", "odometry", {"pose__pose__orientation": {"w": 0.0}}, "is no rotation"),
        ("scan", "scans", {"ranges": np.zeros(0)}, "the scan has no beam"),
        ("scan", "scans", {"angle_increment": math.nan}, "angle_increment is nan"),
        (
            "uwb",
            "ranges",
            {"ranges": [{"anchor": "A", "range": math.nan}]},
            "the range to A is nan m",
        ),
    ],
)
def test_a_message_that_means_nothing_is_left_out_and_the_others_kept(
    topic: str, stem: str, changes: dict[str, Any], said: str, tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    every = 4
    given = edited(topic, every, **changes)
    if "ranges" in changes and topic == "scan":  # the first counts
        given = given[1:]
        given = [*drive(1), *given]
    path = write_messages(tmp_path / "d.mcap", given)
    log = read_bag(path, world=world())
    whole = read_bag(write_messages(tmp_path / "whole.mcap", drive()), world=world())
    lost = len(set(whole[stem]["stamp_ns"].tolist()) - set(log[stem]["stamp_ns"].tolist()))
    assert lost in (4, 5)
    (sentence,) = [s for s in sentences(caplog) if "left out: " in s and "messages on" in s]
    assert sentence.startswith(f"{path}: 5 of ")
    assert said in sentence
    for other in {"odometry", "scans", "ranges"} - {stem}:
        assert set(whole[other]["stamp_ns"].tolist()) == set(log[other]["stamp_ns"].tolist())


def only(publications: list[Publication]) -> list[Recorded]:
    return [(T0 + k, publication) for k, publication in enumerate(publications)]


def pose(frame: str = "map", covariance: Any = None) -> Publication:
    given = np.eye(3) if covariance is None else covariance
    return encode.pose_with_covariance("amcl_pose", T0, (1.0, 2.0, 0.0), given, frame)


BAD = {
    "poses in another frame": (
        [pose("odom")], "poses are in frame 'odom', expected 'map'; see ros.frames"),
    "a covariance of no sense": (
        [pose(covariance=np.diag([1.0, 1.0, 0.0]))], "the variances of x, y and heading are 1, 1"),
    "arrays that differ in length": (
        [Publication("uwb", "locfuse_msgs/UwbData", {
            "destination_id": [1, 2], "distance": [1.0], "stamp": [{"ns": T0}]})],
        "destination_id, distance and stamp have 2, 1 and 1 elements"),
    "millimetres for metres": (
        [encode.uwb_ranges("uwb", [RangeRow(T0, "t", "A", 2e5, None, "")])],
        "a range of 200000 m; are distances in mm?"),
    "a map without metadata": (
        [changed(encode.occupancy_grid("map", GridMap(np.zeros((2, 2), np.int8), 0.1), "map"),
                 info={})], "the map is 0 x 0 cells and holds 4"),
    "a map without resolution": (
        [changed(encode.occupancy_grid("map", GridMap(np.zeros((2, 2), np.int8), 0.1), "map"),
                 info__resolution=0.0)], "the resolution of the map is 0 m"),
    "a map in another frame": (
        [encode.occupancy_grid("map", GridMap(np.zeros((2, 2), np.int8), 0.1), "odom")],
        "maps are in frame 'odom'"),
    "names without points": (
        [Publication("anchors", "locfuse_msgs/NamedPoints", {"names": ["A"]})],
        "there are 1 names, 0 points"),
    "another type on a topic": (
        [encode.text("odom", "hello")], "the message is no nav_msgs/Odometry"),
    "a scan on the topic of ranges": (
        [replace(drive()[3][1], topic="uwb")], "holds no ranges to anchors"),
    "text that is no log's": ([encode.text("locfuse/log", "a: [")], "locfuse/log holds something"),
    "text of the future": ([encode.text("locfuse/log", "format: 9")], "has format 9, expected 1"),
    "columns of no table": (
        [encode.text("locfuse/log", _settings(columns={"positions": []}))],
        "positions with the columns [], which no such table has"),
    "columns of another table": (
        [encode.text("locfuse/log", _settings(columns={"ranges": ["stamp_ns", "dx_m"]}))],
        "ranges with the columns ['stamp_ns', 'dx_m'], which no such table has"),
    "a shift of centuries": (
        [encode.text("locfuse/log", _settings(shift_ns=2**70))],
        "1180591620717411303424 ns late, which is no time"),
    "wheels faster than light": (
        [encode.odometry("odom", T0, (0, 0, 0), (1e9, 0.0), "odom", "base_link")],
        "1e+09 m/s and 0 rad/s, which no robot drives"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_what_is_wrong_is_reported_with_its_topic(
    case: str, kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    publications, said = BAD[case]
    good = encode.tag_position("fix", _fix())
    path = write_messages(tmp_path / f"d.{kind}", only([*publications, good]))
    log = read_bag(path, Ros(odometry_from="twist"))
    assert list(log.tables) == ["positions"]
    (sentence,) = sentences(caplog)
    topic = publications[0].topic
    assert sentence.startswith(f"{path}: 1 of 1 messages on {topic} are left out: ")
    assert said in sentence


def _fix() -> Any:
    from locfuse.io.rosbag.decode import FixRow

    return FixRow(T0, 1.0, 2.0, 0.1, "", "map")


def body_called(name: str, mount: tuple[float, float, float] | None) -> list[Recorded]:
    given = [(t, changed(p, child_frame_id=name) if p.topic == "odom" else p) for t, p in drive()]
    if mount is not None:
        transform = encode.transform(T0, "base_link", name, mount)
        given.insert(0, (T0, encode.transforms([transform], static=True)))
    return given


@pytest.mark.parametrize(("mount", "said"), [
    (None, "which no static transform places on 'base_link': they are taken for the same"),
    ((0.0, 0.0, 0.0), None),
    ((0.2, 0.0, 0.5), "20 of 20 messages on odom are left out: odometry is of 'wheels', which "
                      "sits at x 0.2 m, y 0 m, 28.6 deg on 'base_link'; set ros.frames.base"),
])  # fmt: skip
def test_odometry_of_another_name_is_the_body_s_unless_it_sits_elsewhere(
    mount: tuple[float, float, float] | None,
    said: str | None,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    path = write_messages(tmp_path / "d.mcap", body_called("wheels", mount))
    log = read_bag(path, world=world())
    assert ("odometry" in log) == (mount is None or mount == (0.0, 0.0, 0.0))
    given = sentences(caplog)
    assert len(given) == (0 if said is None else 1)
    assert said is None or said in given[0]


def test_odometry_of_two_bodies_on_one_topic_is_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    at_rest = (0.0, 0.0, 0.0)
    given = sorted([*body_called("wheels", at_rest), *drive()], key=lambda one: one[0])
    read_bag(write_messages(tmp_path / "d.mcap", given), world=world())
    assert any("odom has 2 child frames, base_link and wheels, whose" in s for s in
               sentences(caplog))  # fmt: skip


def test_two_nodes_on_a_topic_of_ros_1_are_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A bag of ROS 1 says which node given what."""
    path = write_messages(tmp_path / "d.bag", drive())
    two = tmp_path / "two.bag"
    with Reader(path) as reader, Writer(two) as writer:
        known = {}
        for number, (connection, time_ns, raw) in enumerate(reader.messages()):
            node = f"/driver_{number % 2}" if connection.topic == "/odom" else "/robot"
            if (connection.topic, node) not in known:
                known[connection.topic, node] = writer.add_connection(
                    connection.topic, connection.msgtype, msgdef=connection.msgdef.data,
                    md5sum=connection.digest, callerid=node)  # fmt: skip
            writer.write(known[connection.topic, node], time_ns, raw)
    read_bag(two, world=world())
    (said,) = sentences(caplog)
    assert "odom has 2 publishers, /driver_0 and /driver_1, whose messages are taken" in said


def test_a_topic_that_was_asked_for_and_is_not_there_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_messages(tmp_path / "d.mcap", drive())
    ros = Ros.model_validate({"topics": {"poses": "pose", "scans": "front/scan"},
                              "range_topics": {"north": "N"}})  # fmt: skip
    read_bag(path, ros, world())
    scans, poses, north = sentences(caplog)
    assert scans == (
        f"{path}: nothing on front/scan, where ros.topics.scans is expected; scan of that type "
        "(sensor_msgs/LaserScan) may be meant: set ros.topics.scans"
    )
    there = ("the bag has odom (nav_msgs/Odometry), scan (sensor_msgs/LaserScan), tf_static "
             "(tf2_msgs/TFMessage), uwb (locfuse_msgs/UwbRanges)")  # fmt: skip
    assert poses == f"{path}: nothing on pose, where ros.topics.poses is expected; {there}"
    assert north == (f"{path}: nothing on north, where ros.range_topics expects an anchor; {there}")


def test_a_topic_of_the_right_type_under_another_name_is_advised(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = [(t, replace(p, topic="wheels/odom") if p.topic == "odom" else p) for t, p in drive()]
    path = write_messages(tmp_path / "d.mcap", given)
    assert "odometry" not in read_bag(path, world=world())
    assert sentences(caplog) == [
        f"{path}: nothing on odom; wheels/odom of that type (nav_msgs/Odometry) may be meant: set "
        "ros.topics.odometry"
    ]


def test_a_bag_of_which_nothing_can_be_used_says_why(tmp_path: Path) -> None:
    path = write_messages(tmp_path / "d.mcap", [(T0, encode.text("chatter", "hello"))])
    with pytest.raises(LogError, match=r"ros.topics names; the bag has chatter \(std_msgs/String"):
        read_bag(path)
    path = write_messages(tmp_path / "e.mcap", only([pose("odom")]))
    with pytest.raises(
        LogError, match="no message can be used; 1 on amcl_pose are left out: poses"
    ):
        read_bag(path)
    path = write_messages(tmp_path / "f.mcap", [])
    with pytest.raises(LogError, match="the bag is empty"):
        read_bag(path)
    given = [(T0, replace(drive()[1][1], topic="wheels"))]
    with pytest.raises(LogError, match=r"wheels of that type .* set ros.topics.odometry"):
        read_bag(write_messages(tmp_path / "g.mcap", given))


def test_a_mount_that_is_not_published_is_named_with_what_to_do(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_messages(tmp_path / "d.mcap", drive()[1:])
    log = read_bag(path, world=world())
    assert "scans" not in log
    assert log.tags == {}
    tag, scan = sentences(caplog)
    assert tag == (f"{path}: where the tag 'tag' sits is not known: no static transform leads from "
                   "radio to base_link; publish it on tf_static, or say in ros.world where the "
                   "sensor is")  # fmt: skip
    assert scan.startswith(f"{path}: 20 of 20 messages on scan are left out: no static transform "
                           "leads from laser to base_link")  # fmt: skip


def test_landmarks_whose_sensor_is_nowhere_are_seen_from_the_body(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = [SightingRow(T0, "oak", 3.0, 0.1, None, None, "eye")]
    other = [SightingRow(T0 + 1, "oak", 3.0, 0.1, 0.1, 0.1, "ear")]
    given = only([encode.landmark_sightings("sightings", rows),
                 encode.landmark_sightings("sightings", other)])  # fmt: skip
    log = read_bag(write_messages(tmp_path / "d.mcap", given))
    assert log.landmark_sensor is None
    assert len(log["landmark_sightings"]["stamp_ns"]) == 1
    said = " ".join(sentences(caplog))
    assert "landmarks are taken as seen from the body's origin" in said
    assert "a sighting is in frame 'ear', the first in 'eye'" in said


def test_stamps_of_the_future_arrive_when_stamped_and_those_of_another_day_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = drive(32)
    for row, ahead in ((1, 3_000 * MS), (4, 2 * HOUR)):
        time_ns, publication = given[row]
        stamp = {"ns": time_ns - 5 * MS + ahead}
        given[row] = (time_ns, changed(publication, header__stamp=stamp))
    path = write_messages(tmp_path / "d.mcap", given)
    log = read_bag(path, world=world())
    odometry = log["odometry"]
    assert len(odometry["stamp_ns"]) == 30  # one is gone, and one has the stamp of another
    assert np.all(odometry["arrival_ns"] >= odometry["stamp_ns"])
    near, far, twice, jumps = sentences(caplog)
    assert "1 of the odometry are stamped up to 3 s after they were recorded" in near
    assert "1 of the odometry are stamped more than an hour after" in far
    assert "1 messages of odometry have the stamp of another and are left out" in twice
    assert "odometry jumps 2 times" in jumps  # to the message of the future and back


def test_a_recorder_with_another_clock_gives_no_arrival(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = drive(late_ns=9 * HOUR)
    path = write_messages(tmp_path / "d.mcap", given)
    log = read_bag(path, world=world())
    assert all("arrival_ns" not in log[stem] for stem in ("odometry", "ranges", "scans"))
    assert sentences(caplog) == [
        f"{path}: was recorded 32400 s after the stamps of its messages, by another clock; so "
        "messages arrive at their stamps"
    ]


def test_odometry_that_is_set_anew_is_no_motion(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = []
    for time_ns, publication in drive():
        if publication.topic == "odom" and time_ns > T0 + 1_000 * MS:
            x = publication.fields["pose"]["pose"]["position"]["x"]
            publication = changed(publication, pose__pose__position__x=x + 500.0)
        given.append((time_ns, publication))
    path = write_messages(tmp_path / "d.mcap", given)
    log = read_bag(path, world=world())
    driven = np.hypot(log["odometry"]["dx_m"], log["odometry"]["dy_m"])[1:]
    assert driven == pytest.approx(0.1, abs=1e-3)  # also there, by the velocities
    (said,) = sentences(caplog)
    assert f"odometry jumps 1 times, first by 500 m and 2.86 deg at {T0 / 1e9 + 1.0:.3f}" in said


def test_scans_of_another_laser_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = drive()
    scans = [row for row, (_, publication) in enumerate(given) if publication.topic == "scan"]
    time_ns, publication = given[scans[3]]
    given[scans[3]] = (time_ns, changed(publication, header__frame_id="rear"))
    log = read_bag(write_messages(tmp_path / "d.mcap", given), world=world())
    assert len(log["scans"]["stamp_ns"]) == len(scans) - 1
    (said,) = sentences(caplog)
    assert "scans of rear are left out: no static transform leads from rear to base_link" in said
    assert log.laser is not None
    assert "laser" not in log["scans"]


def test_sigmas_that_only_some_ranges_bring_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = [RangeRow(T0, "t", "A", 1.0, 0.1, ""), RangeRow(T0, "t", "B", 1.0, None, "")]
    path = write_messages(tmp_path / "d.mcap", only([encode.uwb_ranges("uwb", rows)]))
    assert "sigma_m" not in read_bag(path)["ranges"]
    assert any("1 of 2 ranges bring no sigma" in said for said in sentences(caplog))


def test_two_publishers_on_a_topic_are_no_error(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from rosbags.rosbag1 import Writer

    from locfuse.io.rosbag.wire import defined, serializer

    path = tmp_path / "two.bag"
    row = encode.uwb_ranges("uwb", [RangeRow(T0, "t", "A", 1.0, None, "")])
    with Writer(path) as writer:
        text, digest = defined("ros1", row.type)
        for number, node in enumerate(("/left", "/right")):
            connection = writer.add_connection("/uwb", "locfuse_msgs/msg/UwbRanges", msgdef=text,
                                               md5sum=digest, callerid=node)  # fmt: skip
            writer.write(connection, T0 + number, serializer("ros1", row.type)(row.fields))
    assert len(read_bag(path, world=Log(tables={}, tags={"t": (0, 0, 0)}))["ranges"]["tag"]) == 2
    assert sentences(caplog) == []


def test_types_that_nobody_knows_are_passed_over_unless_they_are_asked_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from rosbags.rosbag1 import Writer

    good = encode.tag_position("fix", _fix())
    from locfuse.io.rosbag.wire import defined, serializer

    path = tmp_path / "odd.bag"
    with Writer(path) as writer:
        odd = writer.add_connection("/odd", "odd_msgs/msg/Odd", msgdef="this is no definition",
                                    md5sum="0" * 32)  # fmt: skip
        text, digest = defined("ros1", good.type)
        fix = writer.add_connection("/fix", "locfuse_msgs/msg/TagPosition", msgdef=text,
                                    md5sum=digest)  # fmt: skip
        for k in range(3):
            writer.write(odd, T0 + k, b"\x00" * 5)
        writer.write(fix, T0, serializer("ros1", good.type)(good.fields))
    assert len(read_bag(path)["positions"]["x_m"]) == 1
    assert sentences(caplog) == []
    read_bag(path, Ros.model_validate({"topics": {"odometry": "odd"}}))
    (said,) = sentences(caplog)
    assert "messages on odd are left out: the definition of odd_msgs/Odd cannot be used" in said


def test_a_type_of_the_same_name_with_another_field_is_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Another package's message, or an older one: it given an error of Python for some fields."""
    whole, path = tmp_path / "whole.bag", tmp_path / "odd.bag"
    write_bag(full_log(), whole)
    with Reader(whole) as reader:
        given = [(c, t, bytes(data)) for c, t, data in reader.messages()]
    complete = set(read_bag(whole).tables)
    texts = {c.topic: c.msgdef.data for c, _, _ in given}
    outcomes = set()
    for topic, text in texts.items():
        for field in re.finditer(r"^\S+ (\w+)$", text, re.MULTILINE):
            other = f"{text[: field.start(1)]}odd_one{text[field.end(1) :]}"
            with Writer(path) as writer:
                known = {
                    c: writer.add_connection(c.topic, c.msgtype, md5sum="0" * 32,
                                             msgdef=other if c.topic == topic else c.msgdef.data)
                    for c in dict.fromkeys(c for c, _, _ in given)
                }  # fmt: skip
                for connection, time_ns, data in given:
                    writer.write(known[connection], time_ns, data)
            caplog.clear()
            is_whole = set(read_bag(path).tables) == complete
            assert is_whole or topic.strip("/") in " ".join(sentences(caplog)), (topic, field[1])
            outcomes.add(is_whole)
            path.unlink()
    assert outcomes == {True, False}  # fields that are not used, and those that are


def test_bytes_that_are_not_what_their_type_says_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from rosbags.rosbag1 import Writer

    from locfuse.io.rosbag.wire import defined, serializer

    path = tmp_path / "odd.bag"
    good = encode.tag_position("fix", _fix())
    with Writer(path) as writer:
        text, digest = defined("ros1", good.type)
        fix = writer.add_connection("/fix", "locfuse_msgs/msg/TagPosition", msgdef=text,
                                    md5sum=digest)  # fmt: skip
        data = bytes(serializer("ros1", good.type)(good.fields))
        for k, cut in enumerate((len(data), 3, 20, len(data) - 1)):
            writer.write(fix, T0 + k, data[:cut])
    assert len(read_bag(path)["positions"]["x_m"]) == 1
    (said,) = sentences(caplog)
    assert "3 of 4 messages on fix are left out: it cannot be unpacked (" in said


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_what_could_be_read_of_a_cut_bag_is_kept_and_reported(
    kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    whole = write_messages(tmp_path / f"whole.{kind}", drive(6000 if kind == "mcap" else 400))
    data = whole.read_bytes()
    path = tmp_path / f"cut.{kind}"
    path.write_bytes(data[: len(data) * 2 // 3])
    rows = len(read_bag(path, world=world())["odometry"]["stamp_ns"])
    all_rows = len(read_bag(whole, world=world())["odometry"]["stamp_ns"])
    assert 0.3 * all_rows < rows < 0.8 * all_rows
    (said,) = sentences(caplog)
    assert "is damaged at byte" in said
    assert "messages before are kept" in said


def test_a_bag_cut_before_its_first_message_says_so(tmp_path: Path) -> None:
    data = write_messages(tmp_path / "whole.mcap", drive()).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:100])
    with pytest.raises(LogError, match=r"cut.mcap is damaged at byte .* the 0 messages before"):
        read_bag(tmp_path / "cut.mcap")


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", ["drive.bag", "log.bag", "drive.db3"])
def test_no_damage_is_more_than_a_sentence(name: str, seed: int, tmp_path: Path) -> None:
    """Whatever is read can be written as a log folder, or it is refused in a sentence."""
    path = tmp_path / name
    if name == "log.bag":
        write_bag(full_log(), path)
    else:
        write_messages(path, drive(4))
        path = next(path.glob("*.db3")) if path.is_dir() else path
    rng = np.random.default_rng(seed)
    data = bytearray(path.read_bytes())
    for at in rng.integers(len(data) - 8, size=5).tolist():
        data[at : at + 4] = rng.integers(0, 256, 4, np.uint8).tobytes()
    (tmp_path / "odd").write_bytes(data)
    said = ""
    try:
        write_log(read_bag(tmp_path / "odd"), tmp_path / "folder")
    except LogError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 1000


def test_without_rosbags_the_error_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_messages(tmp_path / "d.mcap", drive())
    from locfuse.io.rosbag import wire

    for cached in (wire.store, wire.broken, wire.serializer, wire.deserializer, wire._definition,
                   wire._filler):  # fmt: skip
        cached.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags", None)
    for name in [name for name in sys.modules if name.startswith("rosbags.")]:
        monkeypatch.setitem(sys.modules, name, None)
    said = r"bags need the package rosbags: pip install 'locfuse\[bags\]'"
    with pytest.raises(LogError, match=said):
        read_bag(path)
    with pytest.raises(LogError, match=said):
        write_bag(full_log(), tmp_path / "e.mcap")
    assert [p.name for p in tmp_path.iterdir()] == ["d.mcap"]


def test_the_package_loads_no_rosbags_until_a_bag_is_used() -> None:
    code = "import locfuse.cli, sys; print(any(n.startswith('rosbags') for n in sys.modules))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout == "False\n"


def test_what_a_bag_lacks_is_named_by_where_a_bag_has_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_messages(tmp_path / "d.mcap", drive())
    with pytest.raises(LogError, match=r"no anchors; add anchors\.csv to the folder that ros\.wor"):
        run(parse_config({"log": str(path), "start": [0, 0, 0]}))
    given = [(t, p) for t, p in drive() if p.topic != "uwb"]
    path = write_messages(tmp_path / "wheels.mcap", given)
    run(parse_config({"log": str(path), "start": [0, 0, 0], "use": ["odometry", "ranges"]}))
    assert "use names ranges, but the log has none; is ros.topics.ranges its topic?" in (
        caplog.messages)  # fmt: skip
