# SPDX-License-Identifier: Apache-2.0
"""Messages of drivers that are not ours: presets and fields, in bags of both ROS and live."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.base import changed_keys
from locfuse.config.load import parse_config
from locfuse.config.ros import Ros, presets
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.decode import MessageError
from locfuse.io.rosbag.fields import OtherMessages
from locfuse.ros.adapter import Adapter
from locfuse.types import Log, LogError
from support_drivers import made, types_of, write
from support_runs import locfuse

T0 = 1_700_000_000_000_000_000
STEP = 100_000_000
ANCHORS = {"1": (0.0, 0.0), "2": (8.0, 0.0), "3": (8.0, 6.0), "4": (0.0, 6.0)}


def place(k: int) -> tuple[float, float]:
    return 2.0 + 0.1 * k, 3.0


def distances(k: int) -> dict[str, float]:
    """Return the distances to the anchors, in whole millimetres."""
    x, y = place(k)
    return {name: round(math.hypot(x - ax, y - ay), 3) for name, (ax, ay) in ANCHORS.items()}


def stamped(k: int) -> dict[str, Any]:
    stamp = T0 + k * STEP
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": ""}


def node_frame(k: int) -> dict[str, Any]:
    """Return a frame in which another tag is, too, as in a swarm."""
    nodes = [{"role": 1, "id": int(a), "dis": d} for a, d in distances(k).items()]
    return {"role": 2, "id": 5, "nodes": [*nodes, {"role": 2, "id": 1, "dis": 99.0}]}


# Messages of the k-th instant: the tag that they name, and their values.
def linktrack(k: int) -> tuple[str, list[Any]]:
    return "5", [node_frame(k)]


def linktrack_ros2(k: int) -> tuple[str, list[Any]]:
    return "5", [{"header": stamped(k), **node_frame(k)}]


def tagframe(k: int) -> tuple[str, list[Any]]:
    return "5", [{"role": 2, "id": 5, "dis_arr": [0.0, *distances(k).values(), 0.0, 0.0, 0.0]}]


def dwm1001(k: int) -> tuple[str, list[Any]]:
    return "tag", [{"measurements": [{"id": a, "dist": d} for a, d in distances(k).items()]},
                   {"measurements": []}]  # fmt: skip


def pozyx(k: int) -> tuple[str, list[Any]]:
    good = [{"header": stamped(k), "id": a, "status": True, "distance": 1e3 * d}
            for a, d in distances(k).items()]  # fmt: skip
    return "tag", [*good, {"header": stamped(k), "id": "1", "status": False}]


def marvelmind(k: int) -> tuple[str, list[Any]]:
    return "7", [{"address_hedge": 7, "address_beacon": int(a), "distance_m": d}
                 for a, d in distances(k).items()]  # fmt: skip


def gtec(k: int) -> tuple[str, list[Any]]:
    return "7", [{"anchorId": int(a), "tagId": 7, "range": round(1e3 * d)}
                 for a, d in distances(k).items()]  # fmt: skip


def timedomain(k: int) -> tuple[str, list[Any]]:
    return "7", [{"header": stamped(k), "requester_id": 7, "responder_id": int(a), "distance": d,
                  "distance_err": 0.125} for a, d in distances(k).items()]  # fmt: skip


def makerfabs(k: int) -> tuple[str, list[Any]]:
    links = [{"A": a, "R": f"{d:.3f}"} for a, d in distances(k).items()]
    return "tag", [{"data": json.dumps({"links": links})}]


def mauwb(k: int) -> tuple[str, list[Any]]:
    numbers = [0, *(100.0 * d for d in distances(k).values()), 0, 0, 0]
    return "1", [{"data": json.dumps({"id": 1, "range": numbers})}]


RANGES: dict[str, tuple[str, Any]] = {
    "linktrack": ("nlink_parser/LinktrackNodeframe2", linktrack),
    "linktrack, ROS 2": ("nlink_parser_ros2_interfaces/LinktrackNodeframe3", linktrack_ros2),
    "linktrack_tagframe": ("nlink_parser/LinktrackTagframe0", tagframe),
    "dwm1001": ("dwm1001_ros_interfaces/UWBMeas", dwm1001),
    "pozyx": ("pozyx_drivers/AnchorInfo", pozyx),
    "marvelmind": ("marvelmind_nav/beacon_distance", marvelmind),
    "gtec": ("gtec_msgs/Ranging", gtec),
    "timedomain": ("uwb_driver/UwbRange", timedomain),
    "makerfabs": ("std_msgs/String", makerfabs),
    "mauwb": ("std_msgs/String", mauwb),
}


def drive(kind: str, ros: str, steps: int = 40) -> Iterator[tuple[int, str, str, Any]]:
    """Yield time, topic, type and values of a robot with that radio."""
    name, messages = RANGES[kind]
    for k in range(steps):
        at = T0 + k * STEP
        pose = {"position": {"x": 0.1 * k}, "orientation": {"w": 1.0}}
        odometry = {"header": stamped(k) | {"frame_id": "odom"}, "child_frame_id": "base_link",
                    "pose": {"pose": pose}}  # fmt: skip
        yield at, "odom", "nav_msgs/Odometry", odometry
        for given in messages(k)[1]:
            yield at, "radio", name, given


def world_folder(folder: Path) -> Path:
    """Write anchors and tags of the names that radios call them."""
    folder.mkdir()
    tags = ", ".join(f"'{tag}': [0, 0, 0]" for tag in ("tag", "1", "5", "7"))
    (folder / "log.yaml").write_text(f"tags: {{{tags}}}\n")
    rows = "".join(f"{name},{x},{y},0\n" for name, (x, y) in ANCHORS.items())
    (folder / "anchors.csv").write_text(f"anchor,x_m,y_m,z_m\n{rows}")
    return folder


def expected_rows(kind: str, steps: int) -> list[tuple[int, str, str, float]]:
    messages = RANGES[kind][1]
    return [(T0 + k * STEP, messages(k)[0], name, distance)
            for k in range(steps) for name, distance in distances(k).items()]  # fmt: skip


def ros_of(kind: str) -> dict[str, Any]:
    """Return the settings: types that say whose they are need no preset."""
    ros: dict[str, Any] = {"topics": {"ranges": "radio"}}
    if RANGES[kind][0] == "std_msgs/String":
        ros["fields"] = {"ranges": kind}
    return ros


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("kind", RANGES)
def test_ranges_of_a_driver_are_read_from_a_bag_without_its_package(
    kind: str, ros: str, tmp_path: Path
) -> None:
    bag = write(tmp_path / ("drive.bag" if ros == "ros1" else "drive"), drive(kind, ros), ros)
    table = read_bag(bag, Ros.model_validate(ros_of(kind)))["ranges"]
    found = list(zip(*(table[name].tolist() for name in ("stamp_ns", "tag", "anchor", "range_m")),
                     strict=True))  # fmt: skip
    expected = expected_rows(kind, 40)
    assert [row[:3] for row in found] == [row[:3] for row in expected]
    np.testing.assert_allclose([row[3] for row in found], [row[3] for row in expected], atol=1e-6)
    sigma = table.get("sigma_m")
    assert (sigma is not None and (sigma == 0.125).all()) == (kind == "timedomain")


@pytest.mark.parametrize("kind", RANGES)
def test_they_locate_a_robot_live_as_from_the_bag(kind: str, tmp_path: Path) -> None:
    world = world_folder(tmp_path / "world")
    settings = {"start": [2.0, 3.0, 0.0], "use": ["odometry", "ranges"],
                "ros": {**ros_of(kind), "world": str(world)}}  # fmt: skip
    adapter = Adapter(parse_config(settings))
    store = types_of("ros2")
    for at, topic, short, given in drive(kind, "ros2"):
        source = "odometry" if topic == "odom" else "ranges"
        adapter.on(source, topic, made(store, short.replace("/", "/msg/"), given), at)
    assert adapter.problems() == []
    live = adapter._live
    assert live is not None
    fused, held = live.counts["ranges", "fused"], live.counts["ranges", "ignored"]
    assert fused + held == 4 * 40
    assert held == 4 * 3  # until the earliest message of a given start is known
    pose = live.pose()
    assert pose is not None
    assert pose.pose[:2] == pytest.approx(place(39), abs=0.05)


def test_every_preset_is_read_and_has_its_page() -> None:
    tested = {name.partition(",")[0] for name in RANGES} | {"apriltag", "aruco", "fiducials"}
    assert tested == set(presets()) - {"gtec_ros2"}  # which has other names of the same
    page = (Path(__file__).parents[4] / "docs" / "ros.md").read_text("utf-8")
    assert all(f"| `{name}` |" in page for name in presets())


# Landmarks ---------------------------------------------------------------------------------------


def seen(pose: dict[str, Any], kind: str) -> tuple[str, dict[str, Any]]:
    """Return a message of a camera that sees the landmark 3 there."""
    whole = {"pose": {"pose": pose}}
    messages: dict[str, tuple[str, dict[str, Any]]] = {
        "apriltag": (
            "apriltag_ros/AprilTagDetectionArray",
            {"detections": [{"id": [3], "pose": whole}]},
        ),
        "aruco": ("aruco_msgs/MarkerArray", {"markers": [{"id": 3, "pose": {"pose": pose}}]}),
        "fiducials": (
            "fiducial_msgs/FiducialTransformArray",
            {"transforms": [{"fiducial_id": 3, "transform": {"translation": pose["position"]}}]},
        ),
    }
    return messages[kind]  # fmt: skip


@pytest.mark.parametrize("kind", ["apriltag", "aruco", "fiducials"])
def test_a_marker_in_an_optical_frame_is_a_sighting_from_its_x_axis(
    kind: str, tmp_path: Path
) -> None:
    """Optical axes: x to the right, y down, z ahead. The mount of the frame is from tf."""
    camera = {"position": {"x": 0.5, "y": -0.2, "z": 2.0}, "orientation": {"w": 1.0}}
    name, given = seen(camera, kind)
    header = stamped(0) | {"frame_id": "camera_optical"}
    bag = write(tmp_path / "seen", [(T0, "tags", name, {"header": header, **given})], "ros2")
    log = read_bag(bag, Ros.model_validate({"topics": {"landmark_sightings": "tags"}}))
    table = log["landmark_sightings"]
    assert table["landmark"].tolist() == ["3"]
    assert table["range_m"][0] == pytest.approx(math.hypot(0.5, 2.0))
    ahead = math.atan2(-0.5, 2.0)  # to the left of the optical axis, which is left of x
    assert table["bearing_rad"][0] == pytest.approx(0.5 * math.pi + ahead)


# Fields of one's own -----------------------------------------------------------------------------


def shaped(fields: dict[str, Any], message: Any, source: str = "ranges") -> Any:
    """Return the shape of a message, of which every measurement is good."""
    found, errors = shaped_with_errors(fields, message, source)
    assert errors == []
    return found


def shaped_with_errors(
    fields: dict[str, Any] | str, message: Any, source: str = "ranges"
) -> tuple[Any, list[str]]:
    errors: list[str] = []
    others = OtherMessages(Ros.model_validate({"fields": {source: fields}}))
    found = others.shaped(source, message, "my_msgs/Mine", T0,
                          lambda error: errors.append(str(error)))  # fmt: skip
    return found, errors


def test_fields_have_units_signs_names_constants_and_stamps() -> None:
    fields = {"each": "a.b", "anchor": "id", "names": {"17": "north"}, "range_cm": "-d.0",
              "sigma_mm": 50, "tag": "/who", "stamp_us": "t", "quality": "rx", "minus": "fp",
              "reject_above": 6}  # fmt: skip
    elements = [{"id": 17, "d": [-250], "rx": -80.0, "fp": -82.0},
                {"id": 18, "d": [-250], "rx": -80.0, "fp": -90.0}]  # fmt: skip
    message = {"a": {"b": elements}, "who": "w1", "t": 1_000_000.5}
    (one,) = shaped(fields, message).ranges
    assert (one.anchor, one.tag, one.range, one.sigma) == ("north", "w1", 2.5, 0.05)
    assert (one.header.stamp.sec, one.header.stamp.nanosec) == (1, 500)


def test_poses_positions_and_gyros_have_fields_too() -> None:
    from locfuse.io.rosbag import decode

    pose = shaped(
        {"x_mm": "x", "y_mm": "y", "heading_deg": "yaw", "sigma_xy": 0.5, "sigma_heading_deg": 2},
        {"x": 1500, "y": -500, "yaw": 90},
        "poses",
    )
    row = decode.pose(pose)
    assert (row.x, row.y, row.heading) == pytest.approx((1.5, -0.5, 0.5 * math.pi))
    assert np.sqrt(np.diag(row.covariance)) == pytest.approx([0.5, 0.5, math.radians(2)])
    fix = decode.fix(
        shaped({"x": "p.0", "y": "p.1", "tag": "id"}, {"p": [3.0, 4.0], "id": 9}, "positions")
    )
    assert fix is not None
    assert (fix.x, fix.y, fix.tag, fix.sigma_m) == (3.0, 4.0, "9", -1.0)
    rates = {f"rate_{axis}_deg": f"g.{k}" for k, axis in enumerate("xyz")}
    imu = decode.imu(shaped(rates, {"g": [0.0, 0.0, 180.0]}, "imu"))
    assert imu.rate == pytest.approx((0.0, 0.0, math.pi))
    assert imu.force is None


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ({"nodes": [{"id": 1}]}, "the message has no field 'dis'"),
        ({}, "the message has no field 'nodes'"),
        ({"nodes": 5}, "nodes is no list"),
        ({"nodes": [{"id": 1, "dis": "near"}]}, "dis holds 'near', expected a number"),
        ({"nodes": [{"id": 1, "dis": True}]}, "dis holds 'True', expected a number"),
        ({"nodes": [{"id": 1, "dis": 10**400}]}, "expected a number"),
        ({"nodes": [{"id": None, "dis": 1}]}, "id holds nothing, expected the name of the anchor"),
        ({"nodes": np.array(5)}, "ranges"),
        ({"header": {"stamp": "now"}, "nodes": None}, "nodes is no list"),
    ],
)
def test_a_message_without_the_fields_is_one_sentence(message: Any, said: str) -> None:
    with pytest.raises(MessageError, match=said):
        shaped({"each": "nodes", "anchor": "id", "range_m": "dis"}, message)


def test_text_that_is_no_json_is_one_sentence(tmp_path: Path) -> None:
    messages = [(T0, "radio", "std_msgs/String", {"data": "AT+RANGE"})]
    bag = write(tmp_path / "text", messages, "ros2")
    with pytest.raises(LogError, match="data holds no JSON"):
        read_bag(bag, Ros.model_validate(ros_of("makerfabs")))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"ranges": {"each": "nodes", "anchor": "id"}}, "a preset, or anchor and range"),
        ({"ranges": {"anchor": "a", "range": "r", "range_mm": "d"}}, "range is given twice"),
        ({"ranges": {"anchor": 5, "range": "r"}}, "anchor is 5; expected the path of a field"),
        ({"ranges": {"anchor": "a", "range": True}}, "expected the path of a field, or a number"),
        ({"ranges": {"anchor": "a", "range": "r", "columns": [1]}}, "columns are no keys"),
        ({"ranges": {"preset": "gtec", "quality": "q"}}, "both quality and reject_above"),
        ({"ranges": {"preset": "gtec", "minus": "q"}}, "no quality to subtract it from"),
        ({"ranges": {"preset": "gtec", "names": {1: "x", "1": "y"}}}, "one name twice"),
        ({"imu": {"rate_x": "x", "rate_y": "y", "rate_z": "z", "force_z": "f"}}, "or none"),
        (
            {"landmark_sightings": {"range": "r", "bearing": "b", "forward": "f"}},
            "range and bearing or forward and left",
        ),
        ({"ranges": "linktrak"}, "no preset 'linktrak'; did you mean 'linktrack'"),
        ({"ranges": {"preset": "linktrack", "qualty": "x"}}, "did you mean 'quality'"),
        ({"ranges": {"anchor": "a", "range_deg": "x"}}, "no unit of it; expected m, cm, mm"),
        ({"landmark_sightings": {"range": "r"}}, "range and bearing or forward and left"),
    ],
)
def test_wrong_fields_are_one_sentence(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse_config({"ros": {"fields": fields}})


HARD = {"each": "links", "anchor": "A", "range_m": "R", "json_of": "data"}


def text(value: Any) -> dict[str, str]:
    return {"data": value if isinstance(value, str) else json.dumps(value)}


def test_one_bad_measurement_of_a_message_is_lost_alone() -> None:
    links = [{"A": "1", "R": "3.0"}, {"A": "2", "R": "--"}, {"A": "3"}, {"A": "4", "R": "5.0"}]
    found, errors = shaped_with_errors(HARD, text({"links": links}))
    assert [one.anchor for one in found.ranges] == ["1", "4"]
    assert [error[:30] for error in errors] == ["R holds '--', expected a number"[:30],
                                                "the message has no field 'R'"]  # fmt: skip
    found, errors = shaped_with_errors("mauwb", text({"id": 1, "range": [0, 53, None, "423"]}))
    assert [(one.anchor, one.range) for one in found.ranges] == [("1", 0.53), ("3", 4.23)]
    assert len(errors) == 1


@pytest.mark.parametrize("hostile", ["[" * 100_000, '{"links": 1e999}', "null", '"links"', ""])
def test_hostile_text_is_a_message_that_is_refused(hostile: str) -> None:
    with pytest.raises(MessageError):
        shaped_with_errors(HARD, text(hostile))


@pytest.mark.parametrize("stamp", [float("inf"), float("nan"), -1.0, 0, 1e300])
def test_a_stamp_that_is_none_is_refused(stamp: float) -> None:
    fields = {"anchor": "a", "range": "r", "stamp_s": "t"}
    with pytest.raises(MessageError, match="which is no time"):
        shaped_with_errors(fields, {"a": "A", "r": 1.0, "t": stamp})


def test_the_stamp_of_a_message_is_found_where_it_is() -> None:
    from types import SimpleNamespace as Message

    stamp = Message(sec=5, nanosec=1)
    without_header = Message(stamp=stamp, a="A", r=1.0)
    beside = Message(header=Message(stamp=stamp, frame_id="/uwb"),
                     data=json.dumps({"links": [{"A": "1", "R": 1}]}))  # fmt: skip
    named = {"anchor": "a", "range": "r", "stamp": "when"}
    for fields, message in (({"anchor": "a", "range": "r"}, without_header), (HARD, beside),
                            (named, Message(when=stamp, a="A", r=1.0))):  # fmt: skip
        (one,) = shaped(fields, message).ranges
        assert (one.header.stamp.sec, one.header.stamp.nanosec) == (5, 1)
    bad = Message(header=Message(stamp=Message(sec=1, nanosec=3 * 10**9), frame_id=""), a="A", r=1)
    with pytest.raises(MessageError, match="3000000000 nanoseconds"):
        shaped({"anchor": "a", "range": "r"}, bad)


def test_a_preset_and_what_differs_from_it_survive_a_dump() -> None:
    given: dict[str, Any] = {"preset": "pozyx", "range_m": "dist", "each": None, "only": {}}
    ros = Ros.model_validate({"fields": {"ranges": given}})
    assert ros.fields["ranges"].columns == {"anchor": "id", "range_m": "dist"}
    assert ros.fields["ranges"].only == {}
    for dump in (ros.model_dump(), ros.model_dump(exclude_unset=True), changed_keys(ros)):
        assert Ros.model_validate(dump) == ros
    by_name = Ros.model_validate({"fields": {"ranges": "linktrack"}})
    assert by_name.fields["ranges"].only == {"role": 1}
    assert Ros.model_validate(changed_keys(by_name)) == by_name


def test_nothing_that_passes_is_said(tmp_path: Path) -> None:
    fields = {"preset": "linktrack", "only": {"role": 7}}
    others = OtherMessages(Ros.model_validate({"fields": {"ranges": fields}}))
    for k in range(10):
        others.shaped("ranges", node_frame(k), "", T0, lambda error: pytest.fail(str(error)))
    (said,) = others.problems()
    assert said.startswith("no measurement of ranges passes 'only'")


def test_a_message_that_comes_too_early_is_read_when_its_time_has_come(tmp_path: Path) -> None:
    world = world_folder(tmp_path / "world")
    adapter = Adapter(
        parse_config(
            {
                "start": [2.0, 3.0, 0.0],
                "use": ["odometry", "ranges"],
                "ros": {**ros_of("linktrack, ROS 2"), "world": str(world)},
            }
        )
    )
    store = types_of("ros2")
    for at, topic, short, given in drive("linktrack, ROS 2", "ros2", 10):
        source = "odometry" if topic == "odom" else "ranges"
        message = made(store, short.replace("/", "/msg/"), given)
        adapter.on(source, topic, message, at - 800_000_000)
    adapter.tick(T0 + 10 * STEP)
    assert adapter.refused == {}
    assert adapter._live is not None
    assert sum(n for (source, _), n in adapter._live.counts.items() if source == "ranges") == 40


# Commands ----------------------------------------------------------------------------------------


def test_the_bag_of_a_robot_with_a_radio_needs_two_commands_and_its_anchors(tmp_path: Path) -> None:
    bag = write(tmp_path / "drive.bag", drive("linktrack", "ros1", 80), "ros1")
    config, world = tmp_path / "robot.yaml", tmp_path / "robot_world"
    said = locfuse("config", "init", "--log", bag, "--out", config)
    assert "fill in" in said.out
    ros = yaml.safe_load(config.read_text("utf-8"))["ros"]
    assert ros == {"world": "robot_world", "topics": {"ranges": "radio"}}
    assert (world / "anchors.csv").read_text() == "anchor,x_m,y_m,z_m\n1,,,\n2,,,\n3,,,\n4,,,\n"
    tags = yaml.safe_load((world / "log.yaml").read_text())["tags"]
    assert tags == {"5": ["forward", "left", "up"]}
    said = locfuse("run", config, "--out", tmp_path / "out")
    assert "anchors.csv, line 2: column 2 is empty, expected a number" in said.err
    said = locfuse("config", "init", "--log", bag, "--out", tmp_path / "robot.yml")
    assert "robot_world: is there already" in said.err
    rows = "".join(f"{name},{x},{y},0\n" for name, (x, y) in ANCHORS.items())
    (world / "anchors.csv").write_text(f"anchor,x_m,y_m,z_m\n{rows}")
    said = locfuse("run", config, "--out", tmp_path / "out")
    assert "log.yaml: tags.5 is 'forward', expected a finite number" in said.err
    (world / "log.yaml").write_text("tags: {'5': [0, 0, 0]}\n")
    locfuse("run", config, "--out", tmp_path / "out")
    last = (tmp_path / "out" / "estimate.csv").read_text().splitlines()[-1].split(",")
    assert [float(v) for v in last[1:3]] == pytest.approx(place(79), abs=0.1)


def test_the_log_says_what_is_left_out(tmp_path: Path) -> None:
    messages = [*drive("linktrack", "ros1", 3),
                (T0, "radio", "nlink_parser/LinktrackNodeframe2",
                 {"nodes": [{"role": 1, "id": 1, "dis": -8388.0}]})]  # fmt: skip
    log: Log = read_bag(
        write(tmp_path / "drive.bag", messages, "ros1"), Ros.model_validate(ros_of("linktrack"))
    )
    assert len(log["ranges"]["stamp_ns"]) == 12
