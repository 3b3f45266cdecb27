# SPDX-License-Identifier: Apache-2.0
"""Log folders, bags and published recordings by one door, from Python and the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.ros import Ros
from locfuse.io.log_folder import read_log, read_world, with_world
from locfuse.io.recording import convert_recording, read_recording
from locfuse.types import ConfigError, Log, LogError
from support_bags import differences, drive, write_messages
from support_runs import GOOD, locfuse, write_folder

START = "start: [0, 0, 0]\n"


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Return a configuration beside a bag, and a world that it names."""
    write_messages(tmp_path / "drive.mcap", drive(60))
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "anchors.csv").write_text(
        "anchor,x_m,y_m,z_m\nA,5,0,0.8\nB,0,6,0.8\nC,-4,-3,0.8\n"
    )
    path = tmp_path / "robot.yaml"
    path.write_text(START + "ros: {world: world}\n")
    return path


def test_a_bag_runs_as_a_log_does(robot: Path, tmp_path: Path) -> None:
    said = locfuse("run", robot, "--log", tmp_path / "drive.mcap", "--out", tmp_path / "bag")
    assert said.status == 0, said.err
    said = locfuse("convert", "bag", tmp_path / "drive.mcap", tmp_path / "log", "--config", robot)
    assert (said.status, said.out.strip()) == (0, str(tmp_path / "log"))
    assert (
        locfuse("run", robot, "--log", tmp_path / "log", "--out", tmp_path / "log_out").status == 0
    )
    one, other = (tmp_path / name / "estimate.csv" for name in ("bag", "log_out"))
    assert one.read_text() == other.read_text()
    metrics = json.loads((tmp_path / "bag" / "metrics.json").read_text())
    assert metrics["counts"]["ranges"]["fused"] > 100


def test_a_configuration_may_name_a_bag(robot: Path, tmp_path: Path) -> None:
    robot.write_text(START + "log: drive.mcap\nros: {world: world}\n")
    assert locfuse("run", robot, "--out", tmp_path / "out").status == 0
    assert locfuse("check", robot, "--out", tmp_path / "check").status == 0
    said = locfuse("check", robot, "--log", tmp_path / "drive.mcap", "--out", tmp_path / "check")
    assert said.status == 0


def test_a_capsule_of_a_bag_replays(robot: Path, tmp_path: Path) -> None:
    capsule = tmp_path / "capsule.zip"
    assert locfuse("capsule", robot, "--log", tmp_path / "drive.mcap", "--out", capsule).status == 0
    said = locfuse("replay", capsule)
    assert said.status == 0
    assert "the same bit for bit" in said.out


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_the_result_is_written_as_a_bag_that_runs_again(
    kind: str, robot: Path, tmp_path: Path
) -> None:
    result = tmp_path / "results" / f"out.{kind}"
    said = locfuse("run", robot, "--log", tmp_path / "drive.mcap", "--out", tmp_path / "out",
                   "--bag", result)  # fmt: skip
    assert said.status == 0
    assert f"bag: {result}" in said.out
    again = tmp_path / "again"
    (tmp_path / "plain.yaml").write_text(START)
    assert locfuse("run", tmp_path / "plain.yaml", "--log", result, "--out", again).status == 0
    assert (again / "estimate.csv").read_text() == (tmp_path / "out" / "estimate.csv").read_text()


def test_a_log_becomes_a_bag_and_a_bag_the_other_kind(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "log")
    for source, out in (("log", "one.mcap"), ("one.mcap", "two.bag"), ("two.bag", "again")):
        kind = "log" if source == "log" else "bag"
        assert locfuse("convert", kind, tmp_path / source, tmp_path / out).status == 0
    one, again = read_log(folder), read_log(tmp_path / "again")
    assert set(differences(one, again)) <= {"odometry.dx_m"}
    assert again["odometry"]["dx_m"] == pytest.approx(one["odometry"]["dx_m"], abs=1e-15)


def test_notes_of_a_bag_are_lines_on_standard_error(robot: Path, tmp_path: Path) -> None:
    robot.write_text(START + "ros: {world: world, topics: {poses: pose}}\n")
    said = locfuse("run", robot, "--log", tmp_path / "drive.mcap", "--out", tmp_path / "out")
    assert said.status == 0
    lines = [line for line in said.err.splitlines() if line.strip()]
    assert lines == [
        f"locfuse: {tmp_path}/drive.mcap: nothing on pose, where ros.topics.poses is expected; the "
        "bag has odom (nav_msgs/Odometry), scan (sensor_msgs/LaserScan), tf_static "
        "(tf2_msgs/TFMessage), uwb (locfuse_msgs/UwbRanges)"
    ]


def test_what_cannot_be_converted_is_one_sentence(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "log")
    bag = tmp_path / "one.mcap"
    assert locfuse("convert", "log", folder, bag).status == 0
    (tmp_path / "text").write_text("hello\n")
    (tmp_path / "a.bag").mkdir()
    for arguments, said in (
        (("bag", folder, tmp_path / "x"), "is no bag; did you mean 'convert log'?"),
        (("log", bag, tmp_path / "x"), "is no log folder; did you mean 'convert bag'?"),
        (("bag", tmp_path / "absent.bag", tmp_path / "x"), "no such bag"),
        (("log", tmp_path / "absent", tmp_path / "x"), "no such folder"),
        (("bgg", bag, tmp_path / "x"), "unknown data set 'bgg'; did you mean 'bag'?"),
        (("plaza", folder, tmp_path / "x.mcap"), "a data set becomes log folders"),
        (("plaza", bag, tmp_path / "x"), "is a file; expected a folder"),
        (("plaza", tmp_path / "absent", tmp_path / "x"), "no such folder"),
        (
            ("log", folder, tmp_path / "x.db3"),
            "x.db3: ends in '.db3'; what is written is a log "
            "folder, or a bag that ends in .bag (ROS 1) or .mcap (ROS 2)",
        ),
        (("bag", bag, tmp_path / "x.csv"), "ends in '.csv'; what is written is a log folder"),
        (("log", folder, folder / "log.yaml"), "ends in '.yaml'; what is written"),
        (("log", folder, tmp_path / "text"), "text: is a file; what is written is a log folder"),
        (("log", folder, tmp_path / "text" / "x"), "text is a file; expected a folder"),
        (("log", folder, tmp_path / "a.bag"), "a.bag: is a folder; a bag is a file"),
    ):
        assert said in locfuse("convert", *arguments).sentence()
        assert not any((tmp_path / name).exists() for name in ("x", "x.db3", "x.csv", "x.mcap"))
    config = tmp_path / "run.yaml"
    config.write_text("simulation: {duration_s: 1}\n")
    said_of_bag = locfuse("run", config, "--bag", tmp_path / "x.txt").sentence()
    assert "ends in '.txt'; a bag is written as .bag (ROS 1) or .mcap (ROS 2)" in said_of_bag
    assert "--bag" in locfuse("run", config, "--bag", bag / "below" / "x.bag").sentence()
    said_of_folder = locfuse("run", config, "--bag", tmp_path / "a.bag").sentence()
    assert f"--bag {tmp_path / 'a.bag'}: is a folder; expected a file" in said_of_folder


def test_a_recording_is_not_written_over(robot: Path, tmp_path: Path) -> None:
    bag = tmp_path / "drive.mcap"
    before = bag.read_bytes()
    for words in (("convert", "bag", bag, bag), ("run", robot, "--log", bag, "--bag", bag)):
        assert "drive.mcap: is the recording itself" in locfuse(*words).sentence()
    assert bag.read_bytes() == before


def test_a_world_is_a_log_without_messages(tmp_path: Path) -> None:
    (tmp_path / "anchors.csv").write_text(GOOD["anchors.csv"])
    (tmp_path / "log.yaml").write_text(GOOD["log.yaml"])
    world = read_world(tmp_path)
    assert world["anchors"]["anchor"].tolist() == ["south", "north", "east"]
    assert world.tags == {"tag": (0.0, 0.0, 1.0)}
    write_folder(tmp_path / "log")
    assert list(read_world(tmp_path / "log").tables) == ["anchors"]  # its messages are left alone
    for folder, said in ((tmp_path / "absent", "no such folder"),
                         (tmp_path / "log.yaml", "is a file; expected a folder"),
                         (tmp_path / "empty", "says nothing of the world")):  # fmt: skip
        if folder.name == "empty":
            folder.mkdir()
        with pytest.raises(LogError, match=said):
            read_world(folder)


def test_a_world_that_is_not_there_is_named(robot: Path, tmp_path: Path) -> None:
    robot.write_text(START + "ros: {world: nowhere}\n")
    said = locfuse("run", robot, "--log", tmp_path / "drive.mcap").sentence()
    assert said.endswith("nowhere: no such folder")


def test_from_python_it_is_the_same_door(tmp_path: Path) -> None:
    written = convert_recording("log", write_folder(tmp_path / "log"), tmp_path / "one.bag")
    assert written == [tmp_path / "one.bag"]
    given: list[tuple[int, int]] = []
    log = read_recording(tmp_path / "one.bag", Ros(), progress=lambda *done: given.append(done))
    stamps = read_log(tmp_path / "log")["odometry"]["stamp_ns"]
    assert np.array_equal(log["odometry"]["stamp_ns"], stamps)
    assert given[-1][0] == given[-1][1] > 0
    with pytest.raises(ConfigError, match="did you mean 'log'"):
        convert_recording("lgo", tmp_path / "log", tmp_path / "x")


def test_a_world_goes_before_what_a_log_folder_says(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "log")
    world = tmp_path / "world"
    world.mkdir()
    (world / "anchors.csv").write_text("anchor,x_m,y_m,z_m\nsouth,9,8,7\n")
    (world / "log.yaml").write_text("tags: {tag: [0.5, 0, 1]}\n")
    log = read_recording(folder, Ros(world="world"), tmp_path)
    assert log["anchors"]["x_m"].tolist() == [9.0]
    assert log.tags["tag"] == (0.5, 0.0, 1.0)
    own = read_log(folder)
    assert log.landmark_sensor == own.landmark_sensor
    assert (log["odometry"]["stamp_ns"] == own["odometry"]["stamp_ns"]).all()
    laser = {"angle_min_rad": 0.0, "angle_increment_rad": 0.1, "range_min_m": 0.1,
             "range_max_m": 9.0}  # fmt: skip
    log = replace(own, laser={"pose_in_body": [0.0, 0.0, 0.0], **laser},
                  lasers={"front": {"pose_in_body": [0.0, 0.0, 0.0], **laser}})  # fmt: skip
    mounted = with_world(log, Log({}, laser={"pose_in_body": [0.3, 0.0, 0.1], "range_max_m": 4.0}))
    assert mounted.laser == {"pose_in_body": [0.3, 0.0, 0.1], **laser}
    assert mounted.lasers["front"]["pose_in_body"] == [0.3, 0.0, 0.1]
    mounted = with_world(log, Log({}, lasers={"rear": {"pose_in_body": [1.0, 0.0, 0.0]}}))
    assert mounted.laser == log.laser
    assert mounted.lasers == log.lasers
