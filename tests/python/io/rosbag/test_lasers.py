# SPDX-License-Identifier: Apache-2.0
"""Several lasers, and point clouds, in bags and at the nodes."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from locfuse.cli.app import app
from locfuse.config.load import load_config, parse_config
from locfuse.config.ros import Ros
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.io.rosbag.clouds import BEAMS, scan_of, slice_of
from locfuse.io.rosbag.decode import MessageError
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.ros.adapter import Adapter
from locfuse.run.run import load_log, run
from locfuse.types import FloatArray, Log, LogError
from support_adapter import Robot, assert_poses_are, later
from support_bags import KINDS, T0, drive, sentences, world, write_messages
from support_ros import message
from test_front_ends import FLOOR, TWO_LASERS, of_topics

EACH = Ros.model_validate({"topics": {"scans": ["/front/scan", "/rear/scan"]}})


def two_scanners(duration_s: float = 10.0) -> Log:
    """Return the drive of a robot with two scanners that each see one side."""
    simulation = {**TWO_LASERS, "duration_s": duration_s, "imu": {"rate_hz": 50}}
    config = parse_config({"simulation": simulation, "seed": 3})
    return later(of_topics(load_log(config, None, 3)))


@pytest.mark.parametrize("kind", KINDS[:2])
@pytest.mark.parametrize("ros", [Ros(), EACH], ids=["one topic", "a topic each"])
def test_lasers_make_the_round_trip(kind: str, ros: Ros, tmp_path: Path) -> None:
    log = two_scanners()
    write_bag(log, tmp_path / f"d.{kind}", ros)
    again = read_bag(tmp_path / f"d.{kind}", ros)
    assert again.lasers == log.lasers
    assert again.laser is None
    assert sorted(again["scans"]) == sorted(log["scans"])
    for name, column in log["scans"].items():
        np.testing.assert_array_equal(again["scans"][name], column, name)


def of_robot(log: Log, ros: Ros) -> list[tuple[int, Publication]]:
    """Return messages as a robot records them: nothing but what drivers and tf say."""
    begin = min(one.arrival_ns for one in in_order_of_arrival(log, ros))
    head = [(begin, publication) for publication in world_of(log, ros)]
    return head + [(one.arrival_ns, one.publication) for one in in_order_of_arrival(log, ros)]


def test_an_ordinary_robot_needs_two_commands(tmp_path: Path) -> None:
    """Two scanners, wheels, a gyro and a map: `config init`, then `run`."""
    log = two_scanners(20.0)
    given = [one for one in of_robot(log, EACH) if one[1].topic != "ground_truth"]
    write_messages(tmp_path / "drive.mcap", given)
    cli, config = CliRunner(), tmp_path / "robot.yaml"
    first = cli.invoke(
        app, ["config", "init", "--out", str(config), "--log", str(tmp_path / "drive.mcap")]
    )
    assert first.exit_code == 0, first.output
    assert yaml.safe_load(config.read_text())["ros"]["topics"]["scans"] == [
        "front/scan",
        "rear/scan",
    ]
    result = run(load_config(config), read_bag(tmp_path / "drive.mcap", load_config(config).ros))
    last = result.estimate.position[-1]
    at = np.column_stack([log["truth"]["x_m"], log["truth"]["y_m"]])[-1]
    assert math.hypot(*(last - at)) < 0.1
    assert set(result.log.lasers) == {"front", "rear"}


def test_a_laser_without_a_place_costs_its_own_scans(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log = two_scanners()
    mounts = encode.transform(T0, "base_link", "front", (0.2, 0.0, 0.0))
    given = [one for one in of_robot(log, EACH) if "static" not in one[1].topic]
    given.insert(0, (given[0][0], encode.transforms([mounts], static=True)))
    log_of_one = read_bag(write_messages(tmp_path / "d.mcap", sorted_by_time(given)), EACH)
    assert log_of_one.laser is not None
    assert "laser" not in log_of_one["scans"]
    assert len(log_of_one["scans"]["stamp_ns"]) == int(np.sum(log["scans"]["laser"] == "front"))
    assert any("scans of rear are left out: no static transform" in s for s in sentences(caplog))


def sorted_by_time(given: list[tuple[int, Publication]]) -> list[tuple[int, Publication]]:
    return sorted(given, key=lambda one: one[0])


def test_a_world_places_lasers_by_their_frames(tmp_path: Path) -> None:
    log = two_scanners()
    bare = [one for one in of_robot(log, EACH) if "static" not in one[1].topic]
    path = write_messages(tmp_path / "d.mcap", bare)
    placed = Log(tables={}, lasers=log.lasers)
    found = read_bag(path, EACH, placed)
    assert {name: laser["pose_in_body"] for name, laser in found.lasers.items()} == {
        name: laser["pose_in_body"] for name, laser in log.lasers.items()
    }
    one = read_bag(path, EACH, Log(tables={}, laser=log.lasers["front"]))
    assert one.laser is not None
    assert len(one["scans"]["stamp_ns"]) < len(log["scans"]["stamp_ns"])


def test_config_init_leaves_out_what_has_the_frame_of_another(tmp_path: Path) -> None:
    log = two_scanners()
    given = of_robot(log, EACH)
    doubled = [(t, replace(p, topic="/front/scan_filtered")) for t, p in given
               if p.topic.endswith("front/scan")]  # fmt: skip
    path = write_messages(tmp_path / "d.mcap", sorted_by_time(given + doubled))
    config = tmp_path / "c.yaml"
    CliRunner().invoke(app, ["config", "init", "--out", str(config), "--log", str(path)])
    text = config.read_text()
    assert yaml.safe_load(text)["ros"]["topics"]["scans"] == ["front/scan", "rear/scan"]
    assert "not front/scan_filtered of the same frames" in text


# Point clouds


def cloud_of(
    points: FloatArray,
    *,
    stamp_ns: int = T0,
    frame: str = "lidar",
    kind: str = "<f4",
    organised: int = 1,
    padding: int = 0,
) -> Publication:
    """Return a sensor_msgs/PointCloud2 of points (n, 3), with a field before them and one after."""
    size = np.dtype(kind).itemsize
    step = 4 + 3 * size + 2
    rows = np.array_split(points, organised)
    data = b""
    for row in rows:
        for point in row:
            data += struct.pack("<f", 7.0) + point.astype(kind).tobytes() + b"\0\0"
        data += b"\0" * padding
    number = {"f4": 7, "f8": 8}[kind[1:]]
    fields = [{"name": "intensity", "offset": 0, "datatype": 7, "count": 1}]
    fields += [{"name": axis, "offset": 4 + k * size, "datatype": number, "count": 1}
               for k, axis in enumerate("xyz")]  # fmt: skip
    fields.append({"name": "ring", "offset": 4 + 3 * size, "datatype": 4, "count": 1})
    return Publication("points", "sensor_msgs/PointCloud2", {
        "header": encode.header(stamp_ns, frame), "height": organised, "width": len(rows[0]),
        "fields": fields, "is_bigendian": kind[0] == ">", "point_step": step,
        "row_step": step * len(rows[0]) + padding,
        "data": np.frombuffer(data, np.uint8), "is_dense": False,
    })  # fmt: skip


UPRIGHT = np.eye(4)
UPRIGHT[:3, 3] = 0.5, 0.1, 0.4


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", ">f8"])
@pytest.mark.parametrize(("organised", "padding"), [(1, 0), (2, 0), (2, 5)])
def test_points_are_read_however_they_are_laid_out(
    ros: str, kind: str, organised: int, padding: int
) -> None:
    points = np.array([[2.0, 0.0, 0.0], [3.0, 0.0, 0.1], [0.0, 4.0, -0.1], [np.nan, 1.0, 0.0],
                       [-5.0, 0.001, 0.0], [1.0, 0.0, 5.0]])  # fmt: skip
    made = message(cloud_of(points, kind=kind, organised=organised, padding=padding), ros)
    row = scan_of(made, UPRIGHT, None)
    assert row.stamp_ns == T0
    assert row.frame == "lidar"
    assert row.mount == (0.5, 0.1, 0.4, 0.0)
    angle = row.angle_min + row.angle_increment * np.arange(BEAMS)
    there = np.flatnonzero(np.isfinite(row.ranges))
    seen = sorted(zip(row.ranges[there].tolist(), angle[there].tolist(), strict=True))
    expected = [(2.0, 0.0), (4.0, 0.5 * math.pi), (5.0, math.pi)]
    for (r, a), (true_r, true_a) in zip(seen, expected, strict=True):
        assert r == pytest.approx(true_r, abs=1e-5)
        assert a == pytest.approx(true_a, abs=0.5 * row.angle_increment + 1e-6)


def test_rings_on_one_wall_have_no_bias_and_what_stands_before_it_hides_it() -> None:
    """Of 20 rings with a noise of 2 cm the nearest alone would read 4 cm short."""
    rng = np.random.default_rng(1)
    angle = np.radians(np.arange(-60.0, 60.0) + 0.1)
    wall, post = rng.normal(4.0, 0.02, (20, len(angle))), rng.normal(3.0, 0.02, 5)
    points = [[r * math.cos(a), r * math.sin(a), 0.005 * k] for k, ring in enumerate(wall)
              for r, a in zip(ring, angle, strict=True)]  # fmt: skip
    points += [[r * math.cos(angle[7]), r * math.sin(angle[7]), 0.0] for r in post]
    ranges = scan_of(message(cloud_of(np.array(points)), "ros2"), UPRIGHT, None).ranges
    seen = ranges[np.isfinite(ranges)]
    assert len(seen) == len(angle)
    assert seen[7] == pytest.approx(np.mean(post), abs=1e-5)
    assert np.mean(np.delete(seen, 7)) == pytest.approx(4.0, abs=0.003)


def test_a_tilted_sensor_is_turned_into_the_plane() -> None:
    """A wall 3 m ahead, seen by a sensor that looks 30 degrees down and hangs head down."""
    tilt, up = math.radians(30.0), np.diag([1.0, -1.0, -1.0])
    turn = np.array([[math.cos(tilt), 0.0, math.sin(tilt)], [0.0, 1.0, 0.0],
                     [-math.sin(tilt), 0.0, math.cos(tilt)]]) @ up  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, (0.0, 0.0, 1.0)
    y, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 81), np.linspace(0, 2, 41)))
    wall = np.column_stack([np.full(len(y), 3.0), y, z]) - pose[:3, 3]
    floor = np.column_stack([np.full(41, 1.5), np.linspace(-1, 1, 41), np.full(41, -1.0)])
    row = scan_of(message(cloud_of(np.vstack([wall, floor]) @ turn), "ros2"), pose, None)
    angle = row.angle_min + row.angle_increment * np.arange(BEAMS)
    ahead = row.ranges * np.cos(angle)
    assert np.nanmax(np.abs(ahead - 3.0)) < 0.02
    assert np.isfinite(ahead).sum() > 50


def test_heights_are_of_the_body() -> None:
    assert slice_of(0.05, None) == pytest.approx((-0.05, 0.35))
    points = np.array([[1.0, 0.0, -0.35], [2.0, 0.0, 0.0]])
    made = message(cloud_of(points), "ros2")
    assert np.nanmin(scan_of(made, UPRIGHT, None).ranges) == pytest.approx(2.0)
    assert np.nanmin(scan_of(made, UPRIGHT, (0.0, 0.5)).ranges) == pytest.approx(1.0)
    with pytest.raises(MessageError, match=r"no point of the cloud is 5 to 6 m .* at 0.05 to 0.4"):
        scan_of(made, UPRIGHT, (5.0, 6.0))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"fields": []}, "the cloud has no x and no y and no z"),
        ({"point_step": 3}, "bytes for 1 rows|is at byte"),
        ({"width": 3000}, "bytes for 1 rows of 3000 points"),
        ({"width": 2**31, "height": 2**31}, "expected at most 5000000"),
        ({"row_step": 1}, "bytes for 1 rows"),
        ({"height": -1}, "expected at most"),
        ({"data": None}, "no sensor_msgs/PointCloud2"),
    ],
)
def test_a_bad_cloud_is_one_sentence(changes: dict[str, Any], sentence: str) -> None:
    made = message(cloud_of(np.ones((4, 3))), "ros2")
    for name, value in changes.items():
        setattr(made, name, value)
    with pytest.raises(MessageError, match=sentence):
        scan_of(made, UPRIGHT, None)


def test_a_cloud_of_integers_is_refused() -> None:
    made = message(cloud_of(np.ones((4, 3))), "ros2")
    made.fields[1].datatype = 5
    with pytest.raises(MessageError, match=r"x of the cloud has the datatype 5"):
        scan_of(made, UPRIGHT, None)


def clouds(log: Log, ros: Ros) -> list[tuple[int, Publication]]:
    """Return what a robot records that has a spinning sensor where the log has a laser.

    Its walls are points at five heights; a floor and a ceiling are there, too.
    """
    given = [(t, p) for t, p in of_robot(log, ros)
             if p.type != "sensor_msgs/LaserScan" and "static" not in p.topic]  # fmt: skip
    mount = encode.transform(T0, "base_link", "lidar", (0.2, 0.1, 0.4), 0.6)
    head = [(given[0][0], encode.transforms([mount], static=True))]
    for row, stamp in enumerate(log["scans"]["stamp_ns"].tolist()):
        laser, beams = log.scan_geometry(row)
        ranges = log["scans"]["ranges_m"][row, :beams]
        angle = laser["angle_min_rad"] + laser["angle_increment_rad"] * np.arange(beams)
        flat = np.column_stack([ranges * np.cos(angle), ranges * np.sin(angle)])
        walls = [np.column_stack([flat, np.full(beams, z)]) for z in (-0.2, -0.1, 0.0, 0.1, 0.2)]
        ring = np.linspace(0.0, 6.28, 50)
        others = [np.column_stack([np.cos(ring), np.sin(ring), np.full(50, z)])
                  for z in (-0.6, 2.0)]  # fmt: skip
        points = np.vstack([*walls, *others])
        head.append((stamp, cloud_of(points[np.isfinite(points).all(axis=1)], stamp_ns=stamp)))
    return sorted_by_time(given + head)


def spinning(duration_s: float = 10.0, seed: int = 3) -> Log:
    laser = {"range_max_m": 8.0, "beams": 720, "pose_in_body": [0.2, 0.1, 22.9183118052329]}
    simulation = {**FLOOR, "laser": laser, "duration_s": duration_s}
    config = parse_config({"simulation": simulation, "seed": seed})
    return later(of_topics(load_log(config, None, seed)))


CLOUDS = Ros.model_validate({"topics": {"scans": "points"}, "odometry_from": "twist",
                             "estimate_at": "fused"})  # fmt: skip


def run_config(log: Log, **ros: Any) -> Any:
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    config = parse_config({"mcl": {}, "start": [x, y, math.degrees(heading)]})
    return config.model_copy(update={"ros": CLOUDS.model_copy(update=ros)})


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_clouds_at_the_node_and_from_a_bag_are_the_same(ros: str, tmp_path: Path) -> None:
    log = spinning()
    config = run_config(log)
    given = clouds(log, CLOUDS)
    from_bag = read_bag(write_messages(tmp_path / "d.mcap", given), CLOUDS)
    assert from_bag.laser is not None
    assert from_bag.laser["pose_in_body"] == pytest.approx([0.2, 0.1, 0.0])
    assert len(from_bag["scans"]["stamp_ns"]) == len(log["scans"]["stamp_ns"])
    robot = Robot(config, log, ros)
    for now_ns, publication in given:
        robot.receive(publication, now_ns)
    assert_poses_are(robot, run(config, from_bag).estimate, least=0.4)


def test_transforms_may_come_after_the_first_cloud(tmp_path: Path) -> None:
    log = spinning(4.0)
    given = clouds(log, CLOUDS)
    static = [one for one in given if "static" in one[1].topic]
    others = [one for one in given if "static" not in one[1].topic]
    late = [*others[:30], *((others[30][0], one[1]) for one in static), *others[30:]]
    found = read_bag(write_messages(tmp_path / "d.mcap", late), CLOUDS)
    assert len(found["scans"]["stamp_ns"]) == len(log["scans"]["stamp_ns"])


def test_a_cloud_without_a_place_is_left_out_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    given = [*drive(), (T0 + 10, cloud_of(np.ones((4, 3)), stamp_ns=T0 + 10))]
    read_bag(write_messages(tmp_path / "d.mcap", given), CLOUDS, world())
    assert any("on points are left out: no static transform leads from lidar" in sentence
               for sentence in sentences(caplog))  # fmt: skip
    adapter = Adapter(parse_config({"mcl": {}, "start": [0, 0, 0], "ros": {
        "topics": {"scans": "points"}}}))  # fmt: skip
    adapter.on("scans", "points", message(cloud_of(np.ones((4, 3))), "ros2"), T0)
    assert any("no static transform leads from lidar" in one for one in adapter.problems())


def test_cylinders_are_seen_by_one_laser() -> None:
    log = two_scanners()
    landmarks = {"landmark": np.array(["a"]), "x_m": np.ones(1), "y_m": np.ones(1)}
    seen = replace(log, tables={**log.tables, "landmarks": landmarks})
    config = parse_config({"cylinders": {"radius_m": 0.1}, "start": [0, 0, 0],
                           "use": ["odometry", "landmark_sightings"]})  # fmt: skip
    with pytest.raises(LogError, match=r"seen by one laser, but the log has 2: front, rear"):
        run(config, seen)
