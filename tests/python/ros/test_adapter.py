# SPDX-License-Identifier: Apache-2.0
"""The adapter between topics, fed with messages as rospy and rclpy make them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import write_log
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import SightingRow, heading_of, stamp_ns
from locfuse.io.rosbag.encode import Fields, Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros import future_stamps as early
from locfuse.ros.adapter import Adapter
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, ConfigError, Log
from support_adapter import LATER, Robot, assert_poses_are, later, pose_of, stamps
from support_ros import message

ROOM: dict[str, Any] = {
    "simulation": {"path": {"shape": "eight", "radius_m": 2.0}, "duration_s": 20.0, "poses": None},
    "estimator": {  # that of the simulation
        "odometry": {
            "sigma_longitudinal_per_sqrt_m": 0.03, "sigma_lateral_per_sqrt_m": 0.01,
            "sigma_heading_per_sqrt_rad": 0.03,
        },
        "range": {"sigma_m": 0.1},
    },
    "start": "auto",
    "seed": 3,
}  # fmt: skip


def room(**changes: Any) -> tuple[RunConfig, Log]:
    config = parse_config({**ROOM, **changes})
    log = load_log(config, None, config.seed)
    return config, later(log)


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("odometry_from", ["pose", "twist"])
@pytest.mark.parametrize("start", ["auto", "published"])
@pytest.mark.parametrize("first_range_s", [0.0, 1.0])
def test_poses_are_those_of_the_run(
    ros: str, odometry_from: str, start: str, first_range_s: float
) -> None:
    """The first range places the tag: the run goes on from where it was."""
    published = {"odometry_from": odometry_from, "estimate_at": "fused"}
    config, log = room(ros=published)
    if start == "published":
        truth = log["truth"]
        heading_deg = float(np.degrees(truth["heading_rad"][0]))
        at = (float(truth["x_m"][0]), float(truth["y_m"][0]), heading_deg)
        config = config.model_copy(update={"start": at})
    if odometry_from == "twist":
        odometry = log["odometry"]
        seconds = np.diff(odometry["stamp_ns"], prepend=odometry["stamp_ns"][0] - 1) / NANOSECONDS
        velocity = {"stamp_ns": odometry["stamp_ns"], "v_mps": odometry["dx_m"] / seconds,
                    "omega_radps": odometry["dheading_rad"] / seconds}  # fmt: skip
        velocity["v_mps"][0] = velocity["omega_radps"][0] = 0.0
        log = replace(log, tables={**log.tables, "odometry": velocity})
    ranges = log["ranges"]
    late = ranges["stamp_ns"] >= LATER + round(first_range_s * NANOSECONDS)
    tables = {**log.tables, "ranges": {key: values[late] for key, values in ranges.items()}}
    log = replace(log, tables=tables)
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    assert_poses_are(robot, run(config, log).estimate, least=0.9)


def test_it_is_ok_soon_and_knows_where_it_is() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.drive()
    assert robot.health()["message"] == "ok"
    truth = log["truth"]
    last = robot.said("locfuse/pose")[-1]
    row = int(np.searchsorted(truth["stamp_ns"], stamps([last])[0]))
    x, y, _ = pose_of(last)
    assert np.hypot(x - truth["x_m"][row], y - truth["y_m"][row]) < 0.2
    covariance = np.asarray(last["pose"]["covariance"]).reshape(6, 6)
    assert 0.0 < covariance[0, 0] < 0.05
    names = {one["name"] for one in robot.said("diagnostics")[-1]["status"]}
    assert {"locfuse: localization", "locfuse: anchor A1", "locfuse: messages"} <= names
    path = robot.said("locfuse/path")[-1]
    assert len(path["poses"]) > 50


def test_map_to_odom_leads_to_the_pose_and_never_goes_back_in_time() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.drive()
    published = [one["transforms"][0] for one in robot.said("tf")]
    times = stamps(published)
    assert all(after > before for before, after in pairwise(times))
    assert published[-1]["header"]["frame_id"] == "map"
    assert published[-1]["child_frame_id"] == "odom"
    ahead = round(config.ros.transform_ahead_s * NANOSECONDS)
    row = published[-20]
    poses = {s: one for one in robot.said("locfuse/pose") for s in stamps([one])}
    stamp = next(s for s in sorted(poses) if s >= row["header"]["stamp"]["ns"] - ahead)
    odometry = _poses_of_odometry(robot)
    x, y, heading = pose_of(poses[stamp])
    t = row["transform"]["translation"]
    turn = heading_of(message(row["transform"]["rotation"]))
    at = odometry[stamp]
    assert t["x"] + np.cos(turn) * at[0] - np.sin(turn) * at[1] == pytest.approx(x, abs=0.02)
    assert t["y"] + np.sin(turn) * at[0] + np.cos(turn) * at[1] == pytest.approx(y, abs=0.02)
    assert np.cos(turn + at[2] - heading) == pytest.approx(1.0, abs=1e-3)


def _poses_of_odometry(robot: Robot) -> dict[int, list[float]]:
    found = {}
    for arrival in in_order_of_arrival(robot.log, robot.config.ros):
        if arrival.publication.topic == "odom":
            fields = arrival.publication.fields
            found[fields["header"]["stamp"]["ns"]] = pose_of(fields)
    return found


def test_a_folder_of_the_world_counts_more_than_topics(tmp_path: Path) -> None:
    config, log = room()
    write_log(log, tmp_path / "world")
    config = config.model_copy(update={"ros": config.ros.model_copy(update={"world": "world"})})
    robot = Robot(config, log, base=tmp_path)
    wrong = {**log["anchors"], "x_m": log["anchors"]["x_m"] + 3.0}
    for published in world_of(replace(log, tables={**log.tables, "anchors": wrong}), config.ros):
        robot.receive(published, LATER)
    robot.drive()
    assert robot.health()["message"] == "ok"


def test_a_folder_of_the_world_needs_no_messages_and_must_be_there(tmp_path: Path) -> None:
    config, log = room()
    write_log(log, tmp_path / "world")
    for name in ("odometry", "ranges", "truth"):
        (tmp_path / "world" / f"{name}.csv").unlink()
    ros = config.ros.model_copy(update={"world": "world"})
    robot = Robot(config.model_copy(update={"ros": ros}), log, base=tmp_path)
    robot.drive()
    assert robot.health()["message"] == "ok"
    with pytest.raises(ValueError, match="no such folder"):
        Robot(config.model_copy(update={"ros": ros}), log, base=tmp_path / "elsewhere")


def test_what_it_needs_and_does_not_get_is_named_once() -> None:
    config, log = room()
    robot = Robot(config, log)
    for second in range(20):
        robot.tick(LATER + second * NANOSECONDS)
    assert len(robot.problems) == len(set(robot.problems))
    text = " ".join(robot.problems)
    assert "nothing comes on odom (nav_msgs/Odometry)" in text
    assert "nothing comes on uwb" in text
    assert "ros.topics.ranges" in text
    assert robot.health()["message"] == "nothing has been received yet"


def test_a_clock_that_falls_behind_for_a_moment_loses_nothing() -> None:
    """Simulated time comes late to a busy node: what was stamped by it was refused."""
    config, log = room()
    robot, same = Robot(config, log), Robot(config, log)
    for one in (robot, same):
        one.learn()
        one.drive(end_s=10.0)
    robot.drive(begin_s=10.0, end_s=10.8, later_s=-0.9)
    same.drive(begin_s=10.0, end_s=10.8)
    for one in (robot, same):
        one.drive(begin_s=10.8)
        one.tick(LATER + 22 * NANOSECONDS)
    assert robot.problems == []
    assert robot.counts() == same.counts()
    assert pose_of(robot.said("locfuse/pose")[-1]) == pose_of(same.said("locfuse/pose")[-1])


def test_a_clock_that_stays_behind_is_reported_and_loses_nothing() -> None:
    config, log = room()
    robot, same = Robot(config, log), Robot(config, log)
    for one, later_s in ((robot, -0.8), (same, 0.0)):
        one.learn()
        one.drive(later_s=later_s)
        one.tick(LATER + 25 * NANOSECONDS)
    assert len(robot.problems) == 1
    assert "more than 0.5 s ahead of the clock, and wait for it; are both" in robot.problems[0]
    assert robot.counts() == same.counts()
    assert pose_of(robot.said("locfuse/pose")[-1]) == pose_of(same.said("locfuse/pose")[-1])


def test_what_waits_for_a_clock_that_stands_is_bounded() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    first = next(in_order_of_arrival(log, config.ros)).publication
    for _ in range(early.MOST + 7):
        robot.receive(first, LATER - NANOSECONDS)
    assert robot.adapter.refused["odometry"] == 7
    assert "too many messages wait for the clock" in robot.problems[0]


def test_a_clock_that_begins_late_is_no_silence() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.tick(0)
    robot.tick(LATER)
    assert robot.problems == []
    robot.tick(LATER + 6 * NANOSECONDS)
    assert any("nothing comes on odom" in problem for problem in robot.problems)


def test_ranges_without_anchors_or_mounts_are_reported() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.drive(end_s=2.0)
    assert len([p for p in robot.problems if "no anchors are known" in p]) == 1
    for published in world_of(log, config.ros):
        if published.topic == "anchors":
            robot.receive(published, LATER)
    robot.drive(begin_s=2.0, end_s=4.0)
    assert any("tag sits" in p and "tf_static" in p for p in robot.problems)
    assert robot.said("locfuse/pose") == []


def test_a_world_that_comes_late_is_taken() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.drive(end_s=5.0)
    robot.learn()
    robot.drive(begin_s=5.0)
    assert robot.health()["message"] == "ok"


@pytest.mark.parametrize(("mount", "fused"), [(None, True), ((0.0, 0.0, 0.0), True),
                                               ((0.2, 0.0, 0.0), False)])  # fmt: skip
def test_odometry_of_another_name_is_the_body_s_unless_it_sits_elsewhere(
    mount: tuple[float, float, float] | None, fused: bool
) -> None:
    config, log = room(ros={"frames": {"base": "base_footprint"}})
    robot = Robot(parse_config({**ROOM, "ros": {"frames": {"base": "base_link"}}}), log)
    robot.learn()
    robot.config = config  # of the driver of the wheels, who calls the body base_footprint
    if mount is not None:
        robot.receive(encode.transforms([encode.transform(0, "base_link", "base_footprint", mount)],
                                     static=True), LATER)  # fmt: skip
    robot.drive(end_s=10.0)
    counts = {one["key"]: int(one["value"]) for one in robot.counts()}
    assert (counts.get("odometry fused", 0) > 100) == fused
    assert (counts.get("odometry refused", 0) > 100) != fused
    if mount is None:
        (problem,) = robot.problems
        assert "no static transform places on 'base_link'" in problem
    elif fused:
        assert robot.problems == []
    else:
        assert "sits at x 0.2 m, y 0 m, 0 deg on 'base_link'; set ros.frames.base" in (
            robot.problems[0])  # fmt: skip


@pytest.mark.parametrize(
    ("topic", "changes", "says"),
    [
        ("odom", {"pose__pose__position__x": float("nan")}, "position.x is nan"),
        ("odom", {"header__stamp": {"ns": 0}}, "the stamp is 0"),
        ("odom", {"header__stamp": {"ns": 5 * LATER}}, "ahead of the clock"),
        ("uwb", {"ranges": [7]}, "no ranges to anchors"),
    ],
)
def test_a_bad_message_is_one_sentence_and_loses_nothing(
    topic: str, changes: dict[str, Any], says: str
) -> None:
    config, log = room()
    robot, same = Robot(config, log), Robot(config, log)
    robot.learn()
    same.learn()
    robot.drive(end_s=10.0)
    same.drive(end_s=10.0)
    now = LATER + 10 * NANOSECONDS
    arrivals = in_order_of_arrival(log, config.ros)
    bad = next(publication for arrival_ns, publication in arrivals
               if publication.topic == topic and arrival_ns > now)  # fmt: skip
    for _ in range(50):
        robot.receive(bad, now, **changes)
    robot.drive(begin_s=10.0)
    same.drive(begin_s=10.0)
    assert len(robot.problems) == 1
    assert says in robot.problems[0]
    assert (
        robot.said("locfuse/pose")[-1]["pose"]["pose"]
        == (same.said("locfuse/pose")[-1]["pose"]["pose"])
    )
    counts = {one["key"]: one["value"] for one in robot.counts()}
    assert sum(int(v) for k, v in counts.items() if k.endswith("refused")) == 50


def test_silence_is_lost_and_ends_with_the_first_messages() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.drive(end_s=10.0)
    robot.tick(LATER + 14 * NANOSECONDS)
    assert "nothing has been received for" in robot.health()["message"]
    assert robot.health()["level"] == 2
    robot.drive(begin_s=10.0, later_s=5.0)
    assert robot.health()["message"] == "ok"


def test_a_simulation_that_begins_again_is_followed() -> None:
    config, log = room(clock_jump="reset")
    robot = Robot(config, log)
    robot.learn()
    robot.drive()
    robot.published.clear()
    robot.drive()
    assert any("clock went back" in p for p in robot.problems)
    assert robot.health()["message"] == "ok"
    assert min(stamps(robot.said("locfuse/pose"))) < LATER + 5 * NANOSECONDS


def test_the_start_is_published_once_latched_and_again_after_another_search() -> None:
    config, log = room(ros={"topics": {"start": "initialpose"}})
    robot = Robot(config, log)
    robot.learn()
    robot.drive(end_s=10.0)
    published = [one for one in robot.published if one.topic == "initialpose"]
    assert len(published) == 1
    assert published[0].latched
    robot.receive(published[0], LATER + 10 * NANOSECONDS)  # what it said itself
    robot.adapter.relocalize()
    robot.drive(begin_s=10.0)
    assert len([one for one in robot.published if one.topic == "initialpose"]) == 2
    assert not robot.problems


def test_a_pose_that_is_set_is_taken_unless_its_covariance_or_frame_is_wrong() -> None:
    config, log = room(use=["odometry", "ranges"])
    robot = Robot(config, log)
    robot.learn()
    robot.drive(end_s=1.0)
    start = config.ros.topics.estimate
    assert start is not None
    truth = log["truth"]
    row = int(np.searchsorted(truth["stamp_ns"], LATER + NANOSECONDS))
    at = {
        "position": {"x": float(truth["x_m"][row]), "y": float(truth["y_m"][row]), "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": float(np.sin(truth["heading_rad"][row] / 2)),
                        "w": float(np.cos(truth["heading_rad"][row] / 2))},
    }  # fmt: skip
    published: Fields = {"header": {"stamp": {"ns": LATER + NANOSECONDS}, "frame_id": "map"},
            "pose": {"pose": at, "covariance": np.diag([0.1] * 5 + [0.0]).ravel()}}  # fmt: skip
    topic = Publication("initialpose", "geometry_msgs/PoseWithCovarianceStamped", published)
    robot.receive(topic, LATER + NANOSECONDS)
    assert any("variances of x, y and heading are not positive" in p for p in robot.problems)
    published["pose"]["covariance"] = np.diag([0.1, 0.1, 0.0, 0.0, 0.0, 0.1]).ravel()
    robot.published.clear()
    robot.receive(topic, LATER + NANOSECONDS)
    assert len(robot.said("locfuse/pose")) == 1
    published["header"]["frame_id"] = "odom"
    robot.receive(topic, LATER + NANOSECONDS)
    assert any("expected 'map'" in p for p in robot.problems)


def test_a_source_is_switched_off_and_on() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.adapter.enable("ranges", False)
    robot.drive(end_s=5.0)
    assert robot.said("locfuse/pose") == []
    robot.adapter.enable("ranges", True)
    robot.drive(begin_s=5.0)
    assert robot.health()["message"] == "ok"
    with pytest.raises(ConfigError, match="did you mean"):
        robot.adapter.enable("rangs", True)


def test_reset_forgets_all_but_the_world() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.drive()
    robot.adapter.reset()
    robot.published.clear()
    robot.tick(LATER)
    assert robot.health()["message"] == "nothing has been received yet"
    robot.drive()
    assert robot.health()["message"] == "ok"


def geo_pose(latitude: float, longitude: float, z: float = 0.0, w: float = 0.0) -> Any:
    return SimpleNamespace(position=SimpleNamespace(latitude=latitude, longitude=longitude),
                           orientation=SimpleNamespace(x=0.0, y=0.0, z=z, w=w))  # fmt: skip


def test_a_datum_says_where_the_map_begins_and_begins_anew() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    robot.drive()
    with pytest.raises(ConfigError, match="where the map begins is not known yet"):
        robot.adapter.from_degrees(48.0, 11.0)
    robot.adapter.set_datum(geo_pose(48.0, 11.0, np.sqrt(0.5), np.sqrt(0.5)))
    assert robot.adapter.from_degrees(48.0, 11.001) == pytest.approx((0.0, -74.6), abs=0.05)
    assert robot.adapter.to_degrees(0.0, -74.6) == pytest.approx((48.0, 11.001), abs=1e-6)
    robot.published.clear()
    robot.tick(LATER)
    assert robot.health()["message"] == "nothing has been received yet"
    robot.adapter.set_datum(geo_pose(48.0, 11.0))  # an orientation that nobody set
    assert robot.adapter.from_degrees(48.0, 11.001) == pytest.approx((74.6, 0.0), abs=0.05)
    for ask in (robot.adapter.from_degrees, robot.adapter.to_degrees):
        with pytest.raises(ConfigError, match="is not near the map's origin"):
            ask(7e6, 7e6)
    for wrong in (geo_pose(91.0, 0.0), geo_pose(np.nan, 0.0), geo_pose(48.0, 11.0, np.inf)):
        with pytest.raises(ConfigError, match="no place on the Earth"):
            robot.adapter.set_datum(wrong)
    assert robot.adapter.to_degrees(0.0, 0.0) == pytest.approx((48.0, 11.0), abs=1e-12)


def test_a_world_on_the_earth_is_placed_by_its_own_origin(tmp_path: Path) -> None:
    (tmp_path / "anchors.csv").write_text("anchor,latitude_deg,longitude_deg,z_m\nA,48.001,11,2\n")
    (tmp_path / "log.yaml").write_text("gps_origin: [48, 11, 0]\ntags: {tag: [0, 0, 0]}\n")
    adapter = Adapter(parse_config({"ros": {"world": "."}, "start": [0, 0, 0]}), base=tmp_path)
    assert adapter.from_degrees(48.001, 11.0) == pytest.approx((0.0, 111.2), abs=0.05)
    with pytest.raises(ConfigError, match=r"ros\.world begins"):
        adapter.set_datum(geo_pose(47.0, 11.0))


def test_a_stamp_of_either_ros_is_read() -> None:
    assert stamp_ns(message({"stamp": {"ns": 5}}, "ros1").stamp) == 5


FLOOR: dict[str, Any] = {
    "simulation": {
        "room_m": [16.0, 12.0],
        "path": {"shape": "roam", "speed_mps": 0.5},
        "map": {"generate": "rooms", "seed": 2},
        "laser": {"range_max_m": 8.0},
        "duration_s": 20.0,
        "anchors": {},
        "poses": None,
        "ranges": None,
    },
    "start": "auto",
    "mcl": {"max_particles": 10000},
    "seed": 1,
}


@pytest.mark.parametrize("published", ["folder", "topics"])
def test_particles_find_themselves_on_a_map_from_a_folder_or_a_topic(
    published: str, tmp_path: Path
) -> None:
    ros: dict[str, Any] = {"estimate_at": "fused"}
    if published == "folder":
        ros["world"] = "world"
    config = parse_config({**FLOOR, "ros": ros})
    log = load_log(config, None, config.seed)
    log = later(log)
    write_log(log, tmp_path / "world")
    robot = Robot(config, log, base=tmp_path)
    if published == "topics":
        robot.tick(LATER)
        assert "mcl waits for a map" in robot.health()["message"]
        robot.learn()
    robot.drive()
    robot.tick(LATER + 20 * NANOSECONDS)
    truth = log["truth"]
    last = robot.said("locfuse/pose")[-1]
    row = int(np.searchsorted(truth["stamp_ns"], stamps([last])[0]))
    x, y, _ = pose_of(last)
    assert np.hypot(x - truth["x_m"][row], y - truth["y_m"][row]) < 0.3
    assert not robot.problems


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_a_start_by_headings_waits_for_its_map_on_a_topic(ros: str) -> None:
    hall = {"path": {"shape": "eight"}, "duration_s": 10.0, "poses": None,
            "laser": {"range_max_m": 12.0}, "map": {"walls": [[2.0, 0.0, 2.0, 3.0]]}}  # fmt: skip
    config = parse_config({"simulation": hall, "start": "srls_headings", "seed": 3,
                           "estimator": {"range": {"sigma_m": 0.0, "sigma_relative": 0.015}},
                           "ros": {"estimate_at": "fused"}})  # fmt: skip
    log = later(load_log(config, None, config.seed))
    robot = Robot(config, log, ros=ros)
    robot.drive()
    assert robot.health()["message"] == "no map to compare a scan with"

    robot = Robot(config, log, ros=ros)
    robot.learn()
    robot.drive()
    first = robot.said("locfuse/pose")[0]
    start = run(config, log).start
    assert start is not None
    assert stamps([first])[0] >= start.stamp_ns
    truth = log["truth"]
    row = int(np.searchsorted(truth["stamp_ns"], stamps([first])[0]))
    x, y, _ = pose_of(first)
    assert np.hypot(x - truth["x_m"][row], y - truth["y_m"][row]) < 0.5
    assert not robot.problems


def test_one_spoilt_range_does_not_take_the_others_with_it() -> None:
    config, log = room()
    robot = Robot(config, log)
    robot.learn()
    for arrival_ns, publication in in_order_of_arrival(log, config.ros):
        if publication.topic == "uwb":  # a driver that always has one that failed
            publication.fields["ranges"][0]["range"] = float("nan")
        robot.receive(publication, arrival_ns)
    robot.tick(LATER + 20 * NANOSECONDS)
    assert robot.health()["message"] == "ok"
    assert len(robot.problems) <= 3
    assert all("the range to" in problem for problem in robot.problems)
    assert robot.adapter.refused["ranges"] > 100


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_odometry_of_scans_is_that_of_the_run(ros: str) -> None:
    """Without wheels; a topic has ranges of single precision."""
    world = {key: value for key, value in FLOOR.items() if key != "mcl"}
    made = parse_config(world)
    log = later(load_log(made, None, made.seed))
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    tables = {"scans": log["scans"], "truth": log["truth"]}
    log = replace(log, tables=tables)
    config = parse_config({"scan_odometry": {}, "start": [x, y, float(np.degrees(heading))],
                           "ros": {"estimate_at": "fused"}})  # fmt: skip
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    estimate = run(config, log).estimate
    last = {stamp: one for one in robot.said("locfuse/pose") for stamp in stamps([one])}
    same = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in last]
    assert len(same) > 0.9 * len(estimate)
    for row in same:
        found = pose_of(last[int(estimate.stamp_ns[row])])
        assert found[:2] == pytest.approx(estimate.position[row].tolist(), abs=1e-3)
    end = pose_of(robot.said("locfuse/pose")[-1])
    assert np.hypot(end[0] - log["truth"]["x_m"][-1], end[1] - log["truth"]["y_m"][-1]) < 0.3


FLIGHT = {"start": [0.0, 0.0, 0.0], "estimator": {"kind": "air", "air": {"start_height_m": 1.0}}}


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("kind", ["Range", "PointStamped", "PoseWithCovarianceStamped"])
def test_altitudes_of_every_type_are_fused(kind: str, ros: str) -> None:
    adapter = Adapter(parse_config(FLIGHT))
    (listens,) = [one for one in adapter.subscriptions if one.source == "altitudes"]
    assert (listens.topic, len(listens.types)) == ("altitude", 3)
    published: list[Publication] = []
    for k in range(1, 40):
        stamp = LATER + k * NANOSECONDS // 10
        given: Any = encode.altitude("altitude", stamp, 2.5, 0.1 if "Pose" in kind else None, "map")
        if kind == "Range":
            given = {"header": encode.header(stamp, "sonar"), "range": 2.5, "min_range": 0.1,
                     "max_range": 9.0}  # fmt: skip
        published += adapter.on("altitudes", "altitude", message(given, ros), stamp)
        published += adapter.tick(stamp)
    assert not adapter.problems()
    (*_, last) = [one.fields["pose"] for one in published if one.topic == "locfuse/pose"]
    assert last["pose"]["position"]["z"] == pytest.approx(2.5, abs=0.1)
    assert last["covariance"][14] < 0.1


def test_altitudes_in_another_frame_and_elevations_in_the_plane_are_refused() -> None:
    adapter = Adapter(parse_config(FLIGHT))
    given = encode.altitude("altitude", LATER, 2.5, None, "odom")
    adapter.on("altitudes", "altitude", message(given), LATER)
    assert any("altitudes are in frame 'odom'" in problem for problem in adapter.problems())
    plane = Adapter(parse_config({"start": [0.0, 0.0, 0.0]}))
    assert "altitudes" not in {one.source for one in plane.subscriptions}
    row = SightingRow(LATER, "lamp", 4.0, 0.5, None, None, "", 0.3, None)
    plane.on("landmark_sightings", "sightings",
             message(encode.landmark_sightings("sightings", [row])), LATER)  # fmt: skip
    assert any("elevation_rad" in problem and "kind: air" in problem
               for problem in plane.problems())  # fmt: skip
