# SPDX-License-Identifier: Apache-2.0
"""A bag becomes a log and a log a bag, and nothing is lost on the way."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.config.ros import Ros
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bags import read_bag, write_bag
from locfuse.io.rosbag.decode import FixRow, SightingRow
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError
from support_bags import (
    KINDS,
    MS,
    T0,
    Recorded,
    differences,
    drive,
    full_log,
    sentences,
    world,
    write_messages,
)
from support_runs import CONFIGS, require_recording_of

PATHS = pytest.mark.parametrize("kind", ["bag", "mcap"])


# From bags -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_s_bag_becomes_a_log(
    kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = read_bag(write_messages(tmp_path / f"drive.{kind}", drive()), world=world())
    stamps = T0 + 100 * MS * np.arange(20)
    assert np.array_equal(log["odometry"]["stamp_ns"], stamps)
    # 0.1 m along an arc of 0.05 rad is a chord of 2 sin(0.025) 2 m, turned by half of it.
    chord = 4.0 * math.sin(0.025)
    assert log["odometry"]["dx_m"][1:] == pytest.approx(chord * math.cos(0.025), abs=1e-12)
    assert log["odometry"]["dy_m"][1:] == pytest.approx(chord * math.sin(0.025), abs=1e-12)
    assert log["odometry"]["dheading_rad"][1:] == pytest.approx(0.05, abs=1e-12)
    assert np.array_equal(log["odometry"]["arrival_ns"], stamps + 5 * MS)
    assert log["ranges"]["anchor"].tolist() == ["A", "B"] * 20
    assert log["ranges"]["range_m"][:2].tolist() == [5.0, 6.0]
    assert "sigma_m" not in log["ranges"]
    assert log.tags == {"tag": (0.1, 0.05, 0.8)}
    assert np.array_equal(log["scans"]["ranges_m"][:, 0], np.round(1.0 + 0.001 * np.arange(20), 3))
    geometry = {"angle_min_rad": -1.0, "angle_increment_rad": 0.5, "range_min_m": 0.1}
    assert log.laser == {"pose_in_body": [0.2, 0.0, 0.0], **geometry, "range_max_m": 10.0}
    assert log["anchors"]["anchor"].tolist() == ["A", "B"]
    assert sentences(caplog) == []


def test_odometry_may_be_taken_by_its_twist(tmp_path: Path) -> None:
    path = write_messages(tmp_path / "drive.mcap", drive())
    log = read_bag(path, Ros(odometry_from="twist"), world())
    assert log["odometry"]["v_mps"].tolist() == [1.0] * 20
    assert log["odometry"]["omega_radps"].tolist() == [0.5] * 20


def test_a_message_recorded_at_its_stamp_has_no_arrival(tmp_path: Path) -> None:
    log = read_bag(write_messages(tmp_path / "d.mcap", drive(late_ns=0)), world=world())
    assert all("arrival_ns" not in log[stem] for stem in ("odometry", "ranges", "scans"))


def test_a_message_never_arrives_before_its_stamp(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = read_bag(write_messages(tmp_path / "d.mcap", drive(late_ns=-20 * MS)), world=world())
    assert all("arrival_ns" not in log[stem] for stem in ("odometry", "ranges", "scans"))
    assert sentences(caplog) == []


def test_the_paper_s_topics_and_a_topic_per_anchor_are_ranges(tmp_path: Path) -> None:
    given = [message for message in drive() if message[1].topic != "uwb"]
    for k in range(20):
        stamp = {"ns": T0 + 100 * MS * k}
        given.append(
            (
                stamp["ns"],
                encode.Publication(
                    "uwb_data_topic",
                    "locfuse_msgs/UwbData",
                    {"destination_id": [7, 8], "distance": [1500.0, 0.0], "stamp": [stamp, stamp]},
                ),
            )
        )
        given.append((stamp["ns"], encode.Publication("north", "sensor_msgs/Range", {
            "header": {"stamp": stamp, "frame_id": "radio"}, "min_range": 0.0, "max_range": 90.0,
            "range": 2.3})))  # fmt: skip
    ros = Ros.model_validate({"topics": {"ranges": "/uwb_data_topic"}, "uwb_unit": "mm",
                              "uwb_tag": "radio", "range_topics": {"/north": "N"}})  # fmt: skip
    log = read_bag(write_messages(tmp_path / "d.bag", given), ros)
    assert set(zip(log["ranges"]["anchor"].tolist(), log["ranges"]["range_m"].tolist(),
                   strict=True)) == {("7", 1.5), ("N", 2.3)}  # fmt: skip
    assert log.tags == {"radio": (0.1, 0.05, 0.8)}  # the frame that is called as the tag


def test_fixes_are_metres_from_the_first_or_from_the_origin(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = [(T0 + k, encode.Publication("fix", "sensor_msgs/NavSatFix", {
        "header": encode.header(T0 + k, "gps"), "latitude": 48.0 + 1e-5 * k, "longitude": 11.0,
        "position_covariance": [0.25, 0, 0, 0, 0.25, 0, 0, 0, 1.0],
        "position_covariance_type": 2})) for k in range(3)]  # fmt: skip
    path = write_messages(tmp_path / "d.mcap", given)
    log = read_bag(path)
    assert log["positions"]["y_m"] == pytest.approx([0.0, 1.112, 2.224], abs=1e-3)
    assert log["positions"]["sigma_m"].tolist() == [0.5, 0.5, 0.5]
    origin, antenna = sentences(caplog)
    assert origin == (f"{path}: the map's origin is the first fix, at latitude 48.0 and longitude "
                      "11.0; ros.gps_origin says where it is")  # fmt: skip
    assert "positions are of 'gps', which no static transform places on 'base_link'" in antenna
    turned = read_bag(path, Ros(gps_origin=(48.0, 11.0, 90.0)))
    assert turned["positions"]["x_m"] == pytest.approx(log["positions"]["y_m"], abs=1e-9)
    assert not any("origin is" in s for s in sentences(caplog))


def test_a_laser_head_down_counts_its_angles_clockwise(tmp_path: Path) -> None:
    head_down = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
    given = drive()
    given[0][1].fields["transforms"][0]["transform"]["rotation"] = head_down
    log = read_bag(write_messages(tmp_path / "d.mcap", given), world=world())
    assert log.laser is not None
    assert (log.laser["angle_min_rad"], log.laser["angle_increment_rad"]) == (1.0, -0.5)


def test_mounts_may_come_on_tf_as_in_ros_1(tmp_path: Path) -> None:
    given = drive()
    mounts = given.pop(0)[1].fields["transforms"]
    drifting = encode.transform(T0, "odom", "base_link", (9.0, 9.0, 0.0))
    given[3:3] = [(T0, encode.transforms([drifting])), (T0, encode.transforms(mounts))]
    log = read_bag(write_messages(tmp_path / "d.bag", given), world=world())
    assert log.laser is not None
    assert log.laser["pose_in_body"] == [0.2, 0.0, 0.0]
    assert log.tags == {"tag": (0.1, 0.05, 0.8)}


def test_where_landmarks_are_seen_from_is_read_off_the_transforms(tmp_path: Path) -> None:
    mount = encode.transform(T0, "base_link", "eye", (0.3, 0.0, 0.5))
    seen = SightingRow(T0, "oak", 3.0, 0.1, None, None, "eye")
    given = [(T0, encode.transforms([mount], static=True)),
            (T0, encode.landmark_sightings("sightings", [seen]))]  # fmt: skip
    log = read_bag(write_messages(tmp_path / "d.mcap", given))
    assert log.landmark_sensor == {"pose_in_body": [0.3, 0.0, 0.5]}
    assert list(log["landmark_sightings"]) == ["stamp_ns", "landmark", "range_m", "bearing_rad"]


def test_what_the_world_says_counts_more_than_topics(tmp_path: Path) -> None:
    there = np.array([[9.0, 9.0, 9.0]])
    given = [*drive(), (T0, encode.named_points("anchors", ["A"], there, None, "map"))]
    path = write_messages(tmp_path / "d.mcap", given)
    assert read_bag(path)["anchors"]["x_m"].tolist() == [9.0]
    laser = {"pose_in_body": [1.0, 2.0, 3.0], "angle_min_rad": 0.0, "angle_increment_rad": 1.0,
             "range_min_m": 0.0, "range_max_m": 1.0}  # fmt: skip
    known = Log(tables=world().tables, tags={"tag": (1.0, 1.0, 1.0)}, laser=laser)
    log = read_bag(path, world=known)
    assert log["anchors"]["x_m"].tolist() == [5.0, 0.0]
    assert log.tags == {"tag": (1.0, 1.0, 1.0)}
    assert log.laser is not None
    assert (log.laser["pose_in_body"], log.laser["angle_min_rad"]) == ([1.0, 2.0, 3.0], -1.0)


def test_the_configuration_of_the_paper_reads_a_robot_with_its_topics(tmp_path: Path) -> None:
    ros = load_config(CONFIGS / "ros_ekim2020.yaml").ros
    given = [(T0 + k * MS, encode.Publication("uwb_data_topic", "locfuse_msgs/UwbData", {
        "destination_id": [1], "distance": [2.5], "stamp": [{"ns": T0 + k * MS}]}))
        for k in range(3)]  # fmt: skip
    given.append((T0, encode.pose_with_covariance("amcl_pose", T0, (1, 2, 0), np.eye(3), "map")))
    log = read_bag(write_messages(tmp_path / "d.bag", given), ros)
    assert log["ranges"]["range_m"].tolist() == [2.5] * 3
    assert len(log["poses"]["x_m"]) == 1


MEASURE = """
import resource, sys
from locfuse.io.rosbag.bags import read_bag
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
log = read_bag(sys.argv[1])
print(len(log["odometry"]["stamp_ns"]), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.parametrize("kind", KINDS)
def test_memory_does_not_grow_with_what_is_not_read(kind: str, tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, 1 << 20, np.uint8)
    image = {"height": 1024, "width": 1024, "step": 1024, "encoding": "mono8", "data": noise}
    small = {"frame_id": "imu"}

    def given(images: int, imus: int) -> Iterator[Recorded]:
        yield from drive(200)
        for k in range(images):
            yield T0 + k, encode.Publication("image", "sensor_msgs/Image", image)
        for k in range(imus):
            yield T0 + k, encode.Publication("imu", "std_msgs/Header", small)

    peaks = []
    for images, imus in ((0, 0), (120, 20_000)):
        path = write_messages(tmp_path / f"{images}.{kind}", given(images, imus))
        size = sum(p.stat().st_size for p in ([path] if path.is_file() else path.iterdir()))
        out = subprocess.run([sys.executable, "-c", MEASURE, str(path)], capture_output=True,
                             text=True, check=True).stdout.split()  # fmt: skip
        assert int(out[0]) == 200
        peaks.append((size, 1024 * int(out[1])))
    assert peaks[1][0] > peaks[0][0] + 120_000_000
    assert peaks[1][1] < peaks[0][1] + 15_000_000


# There and back --------------------------------------------------------------------------------


@PATHS
def test_every_table_and_setting_makes_the_round_trip(kind: str, tmp_path: Path) -> None:
    first = full_log()
    write_bag(first, tmp_path / f"one.{kind}")
    second = read_bag(tmp_path / f"one.{kind}")
    moved = set(differences(first, second))
    assert moved <= {f"odometry.{name}" for name in ("dx_m", "dy_m", "dheading_rad")}
    for name in ("dx_m", "dy_m", "dheading_rad"):
        assert second["odometry"][name] == pytest.approx(first["odometry"][name], abs=1e-14)

    write_log(second, tmp_path / "log")
    folder = read_log(tmp_path / "log")
    assert differences(second, folder) == []
    write_bag(folder, tmp_path / f"two.{kind}")
    assert differences(folder, read_bag(tmp_path / f"two.{kind}")) == []


def test_a_bag_read_as_the_other_kind_s_bag_is_the_same_log(tmp_path: Path) -> None:
    logs = []
    for kind in ("bag", "mcap"):
        write_bag(full_log(), tmp_path / f"one.{kind}")
        logs.append(read_bag(tmp_path / f"one.{kind}"))
    assert differences(*logs) == []


@pytest.mark.parametrize("leave", ["sigma_m", "arrival", "radius", "heading", "nothing measured"])
def test_columns_that_may_be_left_out_stay_out_and_others_in(leave: str, tmp_path: Path) -> None:
    log = full_log(arrival=leave != "arrival")
    tables: Any = {stem: dict(table) for stem, table in log.tables.items()}
    if leave == "sigma_m":
        del tables["ranges"]["sigma_m"]
    elif leave == "radius":
        del tables["landmarks"]["radius_m"]
        del tables["landmarks"]["z_m"]
    elif leave == "heading":
        del tables["truth"]["heading_rad"]
        del tables["truth"]["z_m"]
    elif leave == "nothing measured":
        tables["ranges"] = {name: values[:0] for name, values in tables["ranges"].items()}
        velocities = {"stamp_ns": np.array([0, MS]), "v_mps": np.array([0.1, -0.3]),
                      "omega_radps": np.array([1 / 3, 0.7])}  # fmt: skip
        tables["odometry"] = {**velocities, "arrival_ns": velocities["stamp_ns"].copy()}
    changed = Log(**{**vars(log), "tables": tables})
    write_bag(changed, tmp_path / "one.mcap")
    second = read_bag(tmp_path / "one.mcap")
    assert set(differences(changed, second)) <= {
        f"odometry.{name}" for name in ("dx_m", "dy_m", "dheading_rad")
    }


def test_stamps_from_before_1970_and_0_are_published_later_and_come_back(tmp_path: Path) -> None:
    stamp = np.array([-3_500_000_001, 0, 5])
    table = {"stamp_ns": stamp, "x_m": np.ones(3), "y_m": np.ones(3), "sigma_m": np.ones(3)}
    log = Log(tables={"positions": table})
    write_bag(log, tmp_path / "one.bag")
    assert differences(log, read_bag(tmp_path / "one.bag")) == []


def test_a_stamp_beyond_the_time_of_ros_is_rejected(tmp_path: Path) -> None:
    stamp = np.array([2**31 * 1_000_000_000])
    table = {"stamp_ns": stamp, "x_m": np.ones(1), "y_m": np.ones(1), "sigma_m": np.ones(1)}
    with pytest.raises(LogError, match="a stamp of 2147483648 s is beyond the time of ROS"):
        write_bag(Log(tables={"positions": table}), tmp_path / "one.bag")
    assert list(tmp_path.iterdir()) == []


def test_a_bag_ends_as_its_kind_is_called(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"ends in '.txt'; a bag is written as .bag"):
        write_bag(full_log(), tmp_path / "one.txt")


def test_a_bag_that_was_there_is_replaced_and_nothing_else_is_left(tmp_path: Path) -> None:
    path = tmp_path / "one.mcap"
    path.write_text("before")
    write_bag(full_log(), path)
    assert [p.name for p in tmp_path.iterdir()] == ["one.mcap"]
    assert path.read_bytes().startswith(b"\x89MCAP")


def test_topics_and_frames_are_those_of_the_configuration(tmp_path: Path) -> None:
    ros = Ros.model_validate({
        "topics": {"odometry": "/wheels/odom", "truth": "/gt", "anchors": "radios"},
        "frames": {"map": "world", "odom": "drift", "base": "/body"},
    })  # fmt: skip
    write_bag(full_log(), tmp_path / "one.mcap", ros)
    assert set(differences(full_log(), read_bag(tmp_path / "one.mcap", ros))) <= {
        "odometry.dx_m", "odometry.dy_m", "odometry.dheading_rad"
    }  # fmt: skip
    nothing = Ros.model_validate({"topics": dict.fromkeys(vars(Ros().topics))})
    with pytest.raises(LogError, match=r"no message on a topic that ros\.topics names"):
        read_bag(tmp_path / "one.mcap", nothing)


def test_a_position_s_tag_without_place_is_only_a_name(tmp_path: Path) -> None:
    given = [(T0, encode.tag_position("fix", FixRow(T0, 1.0, 2.0, 0.1, "hat", "map")))]
    log = read_bag(write_messages(tmp_path / "d.mcap", given))
    assert log["positions"]["tag"].tolist() == ["hat"]
    assert log.tags == {}


# Runs ------------------------------------------------------------------------------------------


@PATHS
def test_a_run_is_the_same_on_a_log_and_on_its_bag(kind: str, tmp_path: Path) -> None:
    config = parse_config({"simulation": {"duration_s": 10}})
    first = run(config, seed=3)
    write_bag(first.log, tmp_path / f"one.{kind}")
    again = run(config, read_bag(tmp_path / f"one.{kind}"), seed=3)
    assert np.array_equal(first.estimate.stamp_ns, again.estimate.stamp_ns)
    assert again.estimate.position == pytest.approx(first.estimate.position, abs=1e-12)
    assert again.estimate.heading == pytest.approx(first.estimate.heading, abs=1e-12)


@pytest.mark.parametrize(
    "example", ["ieu_gazebo.yaml", "mrpt_office.yaml", "plaza.yaml", "tuc_labyrinth.yaml"]
)
def test_a_recording_gives_the_same_estimates_from_its_bag(example: str, tmp_path: Path) -> None:
    require_recording_of(example)
    config = load_config(CONFIGS / example)
    log = load_log(config, CONFIGS, 0)
    first = run(config, log, base=CONFIGS)
    write_bag(log, tmp_path / "one.mcap")
    again = run(config, read_bag(tmp_path / "one.mcap"), base=CONFIGS)
    assert np.array_equal(first.estimate.stamp_ns, again.estimate.stamp_ns)
    assert np.abs(first.estimate.position - again.estimate.position).max() < 1e-11
    assert first.outcomes.verdict.tolist() == again.outcomes.verdict.tolist()


def test_what_a_run_made_of_a_log_is_in_its_bag(tmp_path: Path) -> None:
    result = run(parse_config({"simulation": {"duration_s": 5}}), seed=3)
    path = tmp_path / "one.mcap"
    write_bag(result, path)
    given = messages_of(path)
    poses = given["/locfuse/pose"]
    assert len(poses) == len(result.estimate)
    last = poses[-1].pose
    x, y = result.estimate.position[-1]
    assert (last.pose.position.x, last.pose.position.y) == (x, y)
    assert result.estimate.covariance is not None
    assert np.array_equal(last.covariance.reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))],
                          result.estimate.covariance[-1])  # fmt: skip
    assert result.health is not None
    assert len(given["/diagnostics"]) == len(result.health)
    assert given["/diagnostics"][-1].status[0].message == (
        str(result.health.reason[-1]) or str(result.health.state[-1])
    )
    (path_message,) = given["/locfuse/path"]
    assert len(path_message.poses) == pytest.approx(10, abs=1)
    assert path_message.header.frame_id == "map"


def test_map_to_odom_and_odom_to_base_make_the_estimate(tmp_path: Path) -> None:
    result = run(parse_config({"simulation": {"duration_s": 5}}), seed=3)
    write_bag(result, tmp_path / "one.mcap")
    steps: dict[str, dict[int, Any]] = {"odom": {}, "base_link": {}}
    for message in messages_of(tmp_path / "one.mcap")["/tf"]:
        for one in message.transforms:
            stamp = one.header.stamp.sec * 10**9 + one.header.stamp.nanosec
            steps[one.child_frame_id][stamp] = pose_of(one.transform)
    shift = min(steps["base_link"]) - int(result.log["odometry"]["stamp_ns"].min())
    both = sorted(steps["odom"].keys() & steps["base_link"].keys())
    assert len(both) > 20
    for stamp in both:
        row = int(np.searchsorted(result.estimate.stamp_ns, stamp - shift))
        body = steps["odom"][stamp] @ steps["base_link"][stamp]
        assert body[:2, 2] == pytest.approx(result.estimate.position[row], abs=1e-9)


def pose_of(transform: Any) -> Any:
    angle = 2.0 * math.atan2(transform.rotation.z, transform.rotation.w)
    c, s = math.cos(angle), math.sin(angle)
    at = transform.translation
    return np.array([[c, -s, at.x], [s, c, at.y], [0.0, 0.0, 1.0]])


# Others read what we write ---------------------------------------------------------------------


def messages_of(path: Path) -> dict[str, list[Any]]:
    """Return the messages of a bag by topic, as rosbags reads it, by the bag's own definitions."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
    return found


@PATHS
def test_rosbags_reads_every_message_that_we_write(kind: str, tmp_path: Path) -> None:
    write_bag(full_log(arrival=False), tmp_path / f"one.{kind}")
    given = messages_of(tmp_path / f"one.{kind}")
    assert set(given) == {
        "/odom", "/uwb", "/fix", "/amcl_pose", "/sightings", "/altitude", "/scan", "/ground_truth",
        "/map", "/anchors", "/landmarks", "/tf", "/tf_static", "/locfuse/log", "/locfuse/relations",
    }  # fmt: skip
    assert [len(given[t]) for t in ("/odom", "/uwb", "/scan", "/map")] == [40, 10, 10, 1]
    assert given["/map"][0].info.width == 5
    frames = {one.child_frame_id for one in given["/tf_static"][0].transforms}
    assert frames == {"front", "tag/laser", "silent", "laser", "landmark_sensor"}


def test_the_mcap_library_reads_what_we_write(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    write_bag(full_log(), tmp_path / "one.mcap")
    with (tmp_path / "one.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = list(reader.iter_messages())
        assert summary.statistics.message_count == len(messages)
    topics = {channel.topic: schema for schema, channel, _ in messages if schema is not None}
    assert topics["/uwb"].name == "locfuse_msgs/msg/UwbRanges"
    assert topics["/uwb"].encoding == "ros2msg"
    assert b"MSG: locfuse_msgs/UwbRange\n" in topics["/uwb"].data
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)
    by_topic = SimpleNamespace(**{c.topic[1:]: m for _, c, m in messages if "/" not in c.topic[1:]})
    assert by_topic.odom.data[:2] == b"\x00\x01"  # CDR, little-endian


def test_what_is_latched_is_offered_to_those_who_come_late(tmp_path: Path) -> None:
    from rosbags.interfaces import QosDurability
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    write_bag(full_log(), tmp_path / "one.mcap")
    write_bag(full_log(), tmp_path / "one.bag")
    latched = {"/map", "/anchors", "/landmarks", "/tf_static", "/locfuse/log"}
    with Reader2(tmp_path / "one.mcap") as reader:
        offers = {c.topic: c.ext._asdict()["offered_qos_profiles"] for c in reader.connections}
    assert latched == {topic for topic, (offer,) in offers.items()
                       if offer.durability == QosDurability.TRANSIENT_LOCAL}  # fmt: skip
    with Reader1(tmp_path / "one.bag") as reader1:
        assert latched == {c.topic for c in reader1.connections if c.ext._asdict()["latching"]}
