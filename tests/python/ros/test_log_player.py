# SPDX-License-Identifier: Apache-2.0
"""A log that is given as a robot would."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.ros import Ros
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag import decode
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros.log_player import FIRST_NS, PARAMETERS, LogPlayer
from locfuse.ros.parameters import values_of
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, ConfigError, Log
from support_ros import message

NOW = 10**12


def drive(**simulation: Any) -> tuple[RunConfig, Log]:
    keys = {"duration_s": 5.0, "laser": {}, "map": {}, "positions": {}, **simulation}
    config = parse_config({"simulation": keys})
    log = load_log(config, None, 1)
    later = {
        stem: {k: v + NOW if k.endswith("_ns") else v for k, v in table.items()}
        for stem, table in log.tables.items()
    }
    return config, Log(later, log.tags, log.laser, log.map, log.grid)


def test_messages_are_those_of_the_log_in_order_of_arrival() -> None:
    _, log = drive()
    given = list(in_order_of_arrival(log, Ros()))
    arrivals = [one.arrival_ns for one in given]
    assert arrivals == sorted(arrivals)
    of = {topic: [message(one.publication) for one in given if one.publication.topic == topic]
          for topic in ("odom", "uwb", "scan", "fix", "amcl_pose", "ground_truth")}  # fmt: skip
    assert len(of["odom"]) == len(log["odometry"]["stamp_ns"])
    assert len(of["scan"]) == len(log["scans"]["stamp_ns"])
    assert len(of["ground_truth"]) == len(log["truth"]["stamp_ns"])
    ranges = [row for one in of["uwb"] for row in decode.ranges(one)]
    assert [row.range_m for row in ranges] == log["ranges"]["range_m"].tolist()
    assert [row.stamp_ns for row in ranges] == log["ranges"]["stamp_ns"].tolist()
    fixes = [decode.fix(one) for one in of["fix"]]
    assert [row.x for row in fixes if row is not None] == log["positions"]["x_m"].tolist()
    poses = [decode.pose(one) for one in of["amcl_pose"]]
    assert [row.y for row in poses] == log["poses"]["y_m"].tolist()


def test_increments_are_published_as_the_poses_they_add_up_to() -> None:
    _, log = drive()
    rows = [decode.odometry(message(one.publication)) for one in in_order_of_arrival(log, Ros())
            if one.publication.topic == "odom"]  # fmt: skip
    step = rows[1].x, rows[1].y, rows[1].heading
    table = log["odometry"]
    assert (rows[0].x, rows[0].y, rows[0].heading) == (0.0, 0.0, 0.0)
    assert step == pytest.approx([table[k][1] for k in ("dx_m", "dy_m", "dheading_rad")])
    turned = sum(table["dheading_rad"][1:])
    assert rows[-1].heading == pytest.approx(np.remainder(turned + np.pi, 2 * np.pi) - np.pi)


def test_velocities_are_published_as_they_are() -> None:
    _, log = drive(odometry={"output": "velocities"})
    rows = [decode.odometry(message(one.publication), "twist")
            for one in in_order_of_arrival(log, Ros())
            if one.publication.topic == "odom"]  # fmt: skip
    assert [row.v for row in rows] == log["odometry"]["v_mps"].tolist()


def test_what_arrives_late_is_published_late() -> None:
    _, log = drive()
    late = {**log["ranges"], "arrival_ns": log["ranges"]["stamp_ns"] + NANOSECONDS}
    given = in_order_of_arrival(Log({**log.tables, "ranges": late}, log.tags, log.laser), Ros())
    waits = {one.arrival_ns - one.publication.fields["ranges"][0]["header"]["stamp"]["ns"]
             for one in given if one.publication.topic == "uwb"}  # fmt: skip
    assert waits == {NANOSECONDS}


def test_what_has_no_topic_is_not_published() -> None:
    _, log = drive()
    ros = Ros.model_validate({"topics": {"scans": None, "ranges": "/uwb/all"}})
    topics = {one.publication.topic for one in in_order_of_arrival(log, ros)}
    assert "scan" not in topics
    assert "/uwb/all" in topics


def test_the_world_is_published_latched() -> None:
    _, log = drive()
    given = {one.topic: one for one in world_of(log, Ros())}
    assert set(given) == {"tf_static", "anchors", "map"}
    assert all(one.latched for one in given.values())
    frames = {row.child for row in decode.transforms(message(given["tf_static"]))}
    assert frames == {*log.tags, "laser"}


def player(folder: Path, warned: list[str] | None = None, **given: Any) -> LogPlayer:
    given = {"log": str(folder)} | given
    said: list[str] = [] if warned is None else warned
    return LogPlayer(values_of(PARAMETERS, given), said.append)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    _, log = drive()
    write_log(log, tmp_path / "log")
    return tmp_path / "log"


def test_the_clock_reaches_each_message_before_it_is_published(folder: Path) -> None:
    clock = 0
    steps = list(player(folder).steps())
    for step in steps:
        if step.publication is None:
            assert clock <= step.clock_ns
            assert step.clock_ns - clock <= 5_000_000 or clock == 0
            clock = step.clock_ns
        else:
            assert step.clock_ns == max(clock, NOW)
    assert steps[-1].due_s == pytest.approx(5.0, abs=0.2)
    given = [step for step in steps if step.publication is not None]
    assert len([s for s in given if s.publication and s.publication.topic == "uwb"]) > 20
    tf = [s.publication for s in given if s.publication and s.publication.topic == "tf"]
    assert decode.transforms(message(tf[0]))[0].child == "base_link"


def test_speed_says_when_messages_are_due(folder: Path) -> None:
    [slow, fast, all_can] = [list(player(folder, speed=s).steps())[-1] for s in (0.5, 10.0, 0.0)]
    assert slow.due_s == pytest.approx(20.0 * fast.due_s)
    assert all_can.due_s == 0.0
    assert slow.clock_ns == fast.clock_ns == all_can.clock_ns


def test_a_loop_begins_anew_with_the_clock_of_the_log(folder: Path) -> None:
    once = list(player(folder).steps())
    twice = list(islice(player(folder, loop=True).steps(), 2 * len(once)))
    assert [s.clock_ns for s in twice] == 2 * [s.clock_ns for s in once]
    assert twice[-1].due_s == pytest.approx(2.0 * once[-1].due_s)


def test_a_log_that_begins_at_0_is_published_later_and_says_so(tmp_path: Path) -> None:
    log = load_log(parse_config({"simulation": {"duration_s": 1.0}}), None, 1)
    write_log(log, tmp_path / "log")
    warned: list[str] = []
    first = next(iter(player(tmp_path / "log", warned).steps()))
    assert first.clock_ns == FIRST_NS
    assert first.publication is not None
    (sentence,) = warned
    assert "which is no time to ROS; all stamps are 1000 s later" in sentence


def test_what_cannot_be_played_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nothing to play; set log to a log folder, or config"):
        player(tmp_path, log="")
