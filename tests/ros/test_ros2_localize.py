# SPDX-License-Identifier: Apache-2.0
"""The node `localize` in a separate process with a simulated robot."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from std_srvs.srv import SetBool, Trigger

from locfuse.config.ros import Ros
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.publications import Arrival
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, Log, wrap_angle
from support_logs import SCANNER_TOPICS, SCANNERS, as_messages_hold_it
from support_robot import EPOCH_NS, HALL, Robot, config_of, shifted, simulated, start_localize
from support_ros2 import Peer, peer_in

NODE = "/locfuse"


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    with peer_in(tmp_path) as made:
        yield made


@pytest.fixture
def robot(peer: Peer) -> Robot:
    return Robot(peer, simulated(seed=0), rate=4.0)


def started(robot: Robot, folder: Path, **keys: Any) -> Any:
    """Start the node; wait until it has received the world."""
    process = start_localize(robot, folder, "odom", "uwb", "scan", **keys)
    wait_for_world(robot, "map", "anchors", "/tf_static")
    return process


def wait_for_world(robot: Robot, *topics: str) -> None:
    robot.publish_world()
    for topic in topics:
        received = f"{topic} from /peer"
        robot.peer.wait(received, lambda h=received: h in robot.status("locfuse: topics"))


def wait_for_word(robot: Robot, words: str) -> None:
    process = robot.peer.processes[0]
    robot.peer.wait(f"{words!r} in the log", lambda: words in process.log())


# Initialization and tracking --------------------------------------------------------------------


def test_first_pose_comes_within_three_seconds_of_ranges_and_scan(
    peer: Peer, tmp_path: Path
) -> None:
    robot = Robot(peer, simulated(seed=0))
    started(robot, tmp_path)
    robot.drive(end_s=6.0, until=lambda: robot.state() == "ok" and robot.poses)
    took = time.monotonic() - max(robot.first["uwb"], robot.first["scan"])
    assert robot.state() == "ok"
    assert took <= 3.0
    print(f"first ok pose {took:.2f} s after ranges and scan")


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_is_followed(peer: Peer, tmp_path: Path, seed: int) -> None:
    robot = Robot(peer, simulated(seed=seed), rate=5.0)
    process = started(robot, tmp_path)
    robot.drive()
    assert len(robot.poses) > 500
    assert robot.rmse_m() < 0.05
    assert process.end() == 0
    assert "WARN" not in process.log()
    print(f"seed {seed}: RMSE {robot.rmse_m():.4f} m")


def test_ranges_read_as_those_of_other_anchors_would_be_noticed(peer: Peer, tmp_path: Path) -> None:
    log = simulated(seed=0)
    names = log["ranges"]["anchor"]
    swapped = {**log["ranges"], "anchor": np.roll(names, 1)}
    robot = Robot(peer, replace(log, tables={**log.tables, "ranges": swapped}), rate=5.0)
    started(robot, tmp_path)
    robot.drive(end_s=10.0)
    assert not robot.poses or robot.rmse_m() > 0.05 or robot.state() != "ok"


def test_transforms_never_go_back_in_time_and_agree_with_the_pose(
    robot: Robot, tmp_path: Path
) -> None:
    started(robot, tmp_path)
    robot.drive(end_s=10.0)
    stamps = [decode.stamp_ns(m.transforms[0].header.stamp) for m in robot.transforms]
    assert len(stamps) > 100
    assert np.all(np.diff(stamps) > 0)
    frames = {(m.transforms[0].header.frame_id, m.transforms[0].child_frame_id)
              for m in robot.transforms}  # fmt: skip
    assert frames == {("map", "odom")}


def test_a_source_dies_and_returns(robot: Robot, tmp_path: Path) -> None:
    started(robot, tmp_path)
    robot.drive(0.0, 6.0)
    assert robot.state() == "ok"
    robot.drive(6.0, 12.0, without=["uwb"])
    assert robot.state() == "dead_reckoning"
    alone = len(robot.poses)
    robot.drive(12.0, 18.0)
    assert robot.state() == "ok"
    assert robot.rmse_m(alone + 100) < 0.1


def test_silence_means_lost(robot: Robot, tmp_path: Path) -> None:
    started(robot, tmp_path)
    robot.drive(0.0, 5.0)
    assert robot.state() == "ok"
    for tick in range(40):
        robot.set_time(EPOCH_NS + 5 * NANOSECONDS + tick * NANOSECONDS // 10)
        robot.peer.spin(0.05)
    assert robot.state() == "lost"
    assert re.search(r"for \d[\d.]* s", robot.status("locfuse: localization")["message"])


@pytest.mark.parametrize("does", ["reset", "continue"])
def test_a_simulation_that_begins_again(robot: Robot, tmp_path: Path, does: str) -> None:
    started(robot, tmp_path, clock_jump=does)
    robot.drive(0.0, 8.0)
    before = len(robot.poses)
    robot.drive(0.0, 10.0)
    wait_for_word(robot, "the clock went back by")
    assert len(robot.poses) > before + 100
    if does == "reset":
        assert robot.rmse_m(before + 20) < 0.1
    assert robot.state() == "ok"


def test_a_node_killed_in_mid_drive_is_restarted(robot: Robot, tmp_path: Path) -> None:
    process = started(robot, tmp_path)
    robot.drive(0.0, 7.0)
    process.kill()
    robot.drive(7.0, 9.0)
    poses = len(robot.poses)
    robot.diagnostics.clear()
    started(robot, tmp_path)
    robot.drive(9.0, 20.0)
    assert robot.state() == "ok"
    assert len(robot.poses) > poses + 100
    assert robot.rmse_m(poses) < 0.1


# The same as without ROS ------------------------------------------------------------------------


def by_arrival(log: Log) -> Log:
    """Return a log in which each message arrives at its stamp, as on a robot."""
    tables = {
        stem: {**table, "arrival_ns": table["stamp_ns"]}
        if stem in ("odometry", "ranges", "scans", "positions", "poses")
        else table
        for stem, table in log.tables.items()
    }
    return replace(log, tables=tables)


@pytest.mark.parametrize("world", ["log", None], ids=["folder", "topics"])
@pytest.mark.parametrize("start", ["auto", [5.0, 5.0, 0.0]])
def test_estimates_are_those_of_locfuse_run(
    peer: Peer, tmp_path: Path, start: Any, world: str | None
) -> None:
    without_scans = {**HALL, "laser": None, "map": None, "duration_s": 15.0}
    log = shifted(load_log(config_of(without_scans), None, 3), EPOCH_NS)
    keys = {"start": start, "use": ["odometry", "ranges"]}
    expect_those_of_run(peer, tmp_path, log, world, without_scans, keys, ("anchors", "/tf_static"))


def test_poses_of_particles_are_those_of_locfuse_run(peer: Peer, tmp_path: Path) -> None:
    hall = {**HALL, "duration_s": 8.0}
    log = as_messages_hold_it(shifted(load_log(config_of(hall), None, 3), EPOCH_NS))
    truth = log["truth"]
    heading_deg = float(np.rad2deg(truth["heading_rad"][0]))
    start = [float(truth["x_m"][0]) + 0.05, float(truth["y_m"][0]), heading_deg]
    keys = {"start": start, "use": ["odometry", "ranges"], "mcl": {}}
    expect_those_of_run(peer, tmp_path, log, "log", hall, keys, ("/tf_static",))


def test_poses_by_two_scanners_are_those_of_locfuse_run(peer: Peer, tmp_path: Path) -> None:
    """Each has a topic of its own; /tf_static and /map say where they are, and what they see."""
    hall = {**HALL, "laser": None, "lasers": SCANNERS, "duration_s": 8.0}
    log = as_messages_hold_it(shifted(load_log(config_of(hall), None, 3), EPOCH_NS))
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    keys = {"start": [x + 0.05, y, float(np.rad2deg(heading))], "use": ["odometry", "ranges"],
            "mcl": {}}  # fmt: skip
    latched = ("map", "anchors", "/tf_static")
    robot = expect_those_of_run(peer, tmp_path, log, None, hall, keys, latched, SCANNER_TOPICS)
    assert {f"{topic} from /peer" for topic in SCANNER_TOPICS} <= set(
        robot.status("locfuse: topics")
    )


def expect_those_of_run(
    peer: Peer,
    tmp_path: Path,
    log: Log,
    world: str | None,
    simulation: dict[str, Any],
    keys: dict[str, Any],
    latched: tuple[str, ...],
    scans: tuple[str, ...] = ("scan",),
) -> Robot:
    """Compare the node and `locfuse run` on a log; without a world it comes by topics."""
    write_log(by_arrival(log), tmp_path / "log")
    log = read_log(tmp_path / "log")
    expected = run(config_of(simulation, **keys), log).estimate
    topics = {"scans": list(scans)}
    robot = Robot(peer, log, Ros.model_validate({"topics": topics}), rate=2.0, in_order=True)
    ros = {"estimate_at": "fused", "world": world, "topics": topics}
    start_localize(robot, tmp_path, "odom", "uwb", ros=ros, **keys)
    wait_for_world(robot, *latched)
    robot.drive()
    peer.spin(0.5)
    found = robot.estimate()
    common, ours, theirs = np.intersect1d(found.stamp_ns, expected.stamp_ns, return_indices=True)
    print(f"{len(common)} stamps in common of {len(found)} and {len(expected)}")
    assert len(common) > 0.95 * len(expected)
    assert expected.heading is not None
    assert found.heading is not None
    apart = np.abs(found.position[ours] - expected.position[theirs]).max()
    turned = np.abs(wrap_angle(found.heading[ours] - expected.heading[theirs])).max()
    print(f"largest difference {apart:.2e} m, {turned:.2e} rad")
    assert apart < 1e-9
    assert turned < 1e-9
    return robot


# Services and topics ----------------------------------------------------------------------------


def test_services_switch_sources_and_forget(robot: Robot, tmp_path: Path) -> None:
    started(robot, tmp_path)
    robot.drive(0.0, 6.0)
    robot.wait_for_state("ok")
    off = robot.peer.call(f"{NODE}/enable/ranges", SetBool, data=False)
    assert (off.success, off.message) == (True, "ranges is off")
    robot.drive(6.0, 11.0)
    robot.wait_for_state("dead_reckoning")
    assert robot.status("locfuse: messages")["ranges switched off"] == "yes"
    on = robot.peer.call(f"{NODE}/enable/ranges", SetBool, data=True)
    assert on.message == "ranges is on"
    robot.drive(11.0, 13.0)
    robot.wait_for_state("ok")
    assert robot.peer.call(f"{NODE}/relocalize", Trigger).success
    robot.drive(13.0, 16.0)
    robot.wait_for_state("ok")
    assert robot.peer.call(f"{NODE}/reset", Trigger).success
    poses = len(robot.poses)
    robot.set_time(EPOCH_NS + 16 * NANOSECONDS)
    robot.peer.spin(1.5)
    robot.wait_for_state("initializing")
    robot.drive(16.0, 20.0)
    robot.wait_for_state("ok")
    assert robot.rmse_m(poses) < 0.1


def test_degrees_become_places_of_the_map_and_back(robot: Robot, tmp_path: Path) -> None:
    from geographic_msgs.msg import GeoPoint, GeoPose
    from geometry_msgs.msg import Point
    from robot_localization.srv import FromLL, SetDatum, ToLL

    here = GeoPoint(latitude=48.001, longitude=11.0)
    started(robot, tmp_path)
    early = robot.peer.call("fromLL", FromLL, ll_point=here).map_point
    assert np.isnan([early.x, early.y]).all()
    wait_for_word(robot, "where the map begins is not known yet")
    datum = GeoPose(position=GeoPoint(latitude=48.0, longitude=11.0))
    robot.peer.call("datum", SetDatum, geo_pose=datum)
    point = robot.peer.call("fromLL", FromLL, ll_point=here).map_point
    assert (point.x, point.y) == pytest.approx((0.0, 111.2), abs=0.05)
    back = robot.peer.call("toLL", ToLL, map_point=Point(x=point.x, y=point.y)).ll_point
    assert (back.latitude, back.longitude) == pytest.approx((48.001, 11.0), abs=1e-9)
    datum.position.latitude = 100.0
    robot.peer.call("datum", SetDatum, geo_pose=datum)
    wait_for_word(robot, "latitude 100, longitude 11 with that orientation is no place")


def test_an_initial_pose_from_a_person_is_taken(robot: Robot, tmp_path: Path) -> None:
    start_localize(robot, tmp_path, "odom", "initialpose", start=[2.0, 2.0, 0.0])
    robot.drive(0.0, 2.0, without=["uwb", "scan"])
    message = encode.pose_with_covariance("initialpose", EPOCH_NS + 2 * NANOSECONDS,
                                       (6.0, 7.0, 1.0), np.eye(3) * 0.01, "map")  # fmt: skip
    robot.peer.publish(message)
    robot.drive(2.0, 2.5, without=["uwb", "scan"])
    last = decode.pose(robot.poses[-1])
    assert abs(last.x - 6.0) < 1.0
    assert abs(last.y - 7.0) < 1.0


def test_a_localizer_that_comes_later_receives_the_start(robot: Robot, tmp_path: Path) -> None:
    started(robot, tmp_path, ros={"topics": {"start": "initialpose"}})
    robot.drive(0.0, 4.0)
    late = robot.peer.subscribe(
        "initialpose", "geometry_msgs/PoseWithCovarianceStamped", latched=True
    )
    volatile = robot.peer.subscribe("initialpose", "geometry_msgs/PoseWithCovarianceStamped")
    robot.peer.wait("the start, latched", lambda: late)
    robot.peer.wait("the start, for a volatile subscriber", lambda: volatile)
    assert decode.pose(late[0])[:5] == decode.pose(volatile[0])[:5]
    poses = len(robot.poses)
    robot.drive(4.0, 8.0)
    assert robot.rmse_m(poses) < 0.1  # it ignores its own message


# Bad input --------------------------------------------------------------------------------------


def damaged(topic: str, change: Any) -> Any:
    """Return a change that damages one message of a topic in five."""
    count = [0]

    def change_one(one: Arrival) -> Arrival:
        if one.publication.topic != topic:
            return one
        count[0] += 1
        if count[0] % 5:
            return one
        fields = change(dict(one.publication.fields))
        return one._replace(publication=replace(one.publication, fields=fields))

    return change_one


def with_pose(fields: Any, **at: float) -> Any:
    pose = fields["pose"]["pose"]
    return {**fields, "pose": {"pose": {**pose, "position": {**pose["position"], **at}}}}


def with_header(fields: Any, **header: Any) -> Any:
    return {**fields, "header": {**fields["header"], **header}}


def with_first_range(fields: Any, **keys: Any) -> Any:
    return {**fields, "ranges": [{**fields["ranges"][0], **keys}, *fields["ranges"][1:]]}


BAD = {
    "NaN in odometry": ("odom", lambda f: with_pose(f, x=float("nan")), "pose.position.x is nan"),
    "stamp zero": ("odom", lambda f: with_header(f, stamp={"ns": 0}), "the stamp is 0"),
    "future": (
        "odom",
        lambda f: with_header(f, stamp={"ns": f["header"]["stamp"]["ns"] + 10**12}),
        "ahead of the clock",
    ),
    "NaN range": ("uwb", lambda f: with_first_range(f, range=float("nan")), "is nan m"),
    "negative range": ("uwb", lambda f: with_first_range(f, range=-1.0), "not negative"),
    "wrong sizes": (
        "scan",
        lambda f: {**f, "intensities": np.ones(3, np.float32)},
        "ranges and 3 intensities",
    ),
    "unknown laser frame": (
        "scan",
        lambda f: with_header(f, frame_id="nowhere"),
        "no static transform leads from nowhere to base_link",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_messages_are_reported_once_and_do_no_harm(
    robot: Robot, tmp_path: Path, name: str
) -> None:
    topic, change, says = BAD[name]
    process = started(robot, tmp_path)
    robot.drive(0.0, 10.0, change=damaged(topic, change))
    wait_for_word(robot, says)
    assert robot.rmse_m(100) < 0.1
    assert process.log().count("WARN") <= 3
    source = {"odom": "odometry", "uwb": "ranges", "scan": "scans"}[topic]
    assert int(robot.status("locfuse: messages")[f"{source} refused"]) > 3
