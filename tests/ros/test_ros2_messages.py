# SPDX-License-Identifier: Apache-2.0
"""Our messages from the generators of ROS 2, and the fields that fill them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

import support_ros2
from locfuse.io.rosbag import decode, encode
from locfuse.types import GridMap
from locfuse_ros.fill import message_class, message_of, time_of

ROOT = Path(__file__).parents[2]
STAMP = 1_700_000_000_123_456_789


def through_the_wire(publication: encode.Publication) -> Any:
    kind = message_class(publication.type)
    return deserialize_message(
        serialize_message(message_of(publication.type, publication.fields)), kind
    )


def test_definitions_are_those_that_bags_are_read_by() -> None:
    ours = {p.name: p.read_text() for p in (ROOT / "python/locfuse/io/rosbag/msg").glob("*.msg")}
    theirs = {p.name: p.read_text() for p in (ROOT / "ros2/locfuse_msgs/msg").glob("*.msg")}
    assert ours == theirs
    cmake = (ROOT / "ros2/locfuse_msgs/CMakeLists.txt").read_text()
    assert all(f'"msg/{name}"' in cmake for name in ours)


def test_every_message_is_generated() -> None:
    for path in (ROOT / "ros2/locfuse_msgs/msg").glob("*.msg"):
        made = message_class(f"locfuse_msgs/{path.stem}")()
        fields = [line.split()[1] for line in path.read_text().splitlines()
                  if line and not line.startswith("#")]  # fmt: skip
        assert list(made.get_fields_and_field_types()) == fields


def rows() -> list[decode.RangeRow]:
    return [
        decode.RangeRow(STAMP, "front", "A1", 3.25, 0.1, "uwb_front"),
        decode.RangeRow(STAMP + 1, "front", "A2", 4.5, None, ""),
    ]


SCAN = decode.ScanRow(STAMP, "laser", -1.0, 0.5, 0.1, 30.0, np.array([1.0, np.nan, 2.5]),
                      np.array([10.0, 20.0, np.nan]))  # fmt: skip
SEEN = [decode.SightingRow(STAMP, "tree", 2.0, 0.5, 0.1, 0.02, "camera"),
        decode.SightingRow(STAMP, "lamp", 2.0, 0.5, 0.1, 0.02, "camera", 0.3, 0.04)]  # fmt: skip
FIX = decode.FixRow(STAMP, 1.5, -2.5, 0.2, "front", "map")
COVARIANCE = np.diag([0.04, 0.09, 0.01])


def test_ranges_come_through() -> None:
    assert decode.ranges(through_the_wire(encode.uwb_ranges("uwb", rows()))) == rows()


def test_altitudes_come_through() -> None:
    for sigma in (0.3, None):
        sent = encode.altitude("altitude", STAMP, 2.5, sigma, "map")
        assert decode.altitude(through_the_wire(sent)) == (STAMP, 2.5, sigma, "map")


def test_a_scan_comes_through() -> None:
    row = decode.scan(through_the_wire(encode.laser_scan("scan", SCAN)))
    assert row[:6] == SCAN[:6]
    np.testing.assert_array_equal(row.ranges, SCAN.ranges)
    np.testing.assert_array_equal(row.intensities, SCAN.intensities)


def test_odometry_comes_through() -> None:
    publication = encode.odometry(
        "odom", STAMP, (1.0, 2.0, 0.7), (0.5, -0.1), "odom", "base_link", 0.2
    )
    expected = decode.OdometryRow(STAMP, 1.0, 2.0, 0.7, 0.5, -0.1, "odom", "base_link", 0.2)
    assert decode.odometry(through_the_wire(publication)) == expected


def test_a_pose_comes_through() -> None:
    publication = encode.pose_with_covariance("pose", STAMP, (1.0, 2.0, -3.0), COVARIANCE, "map")
    row = decode.pose(through_the_wire(publication))
    assert row[:5] == (STAMP, "map", 1.0, 2.0, -3.0)
    np.testing.assert_array_equal(row.covariance, COVARIANCE)


def test_sightings_and_positions_come_through() -> None:
    assert decode.sightings(through_the_wire(encode.landmark_sightings("seen", SEEN))) == SEEN
    assert decode.fix(through_the_wire(encode.tag_position("fix", FIX))) == FIX


def test_a_map_comes_through() -> None:
    grid = GridMap(np.array([[0, 100, -1], [0, 0, 100]], np.int8), 0.05, (1.0, -2.0, 0.3))
    read = decode.grid(through_the_wire(encode.occupancy_grid("map", grid, "map")))
    np.testing.assert_array_equal(read.cells, grid.cells)
    assert read.resolution_m == pytest.approx(0.05)
    assert read.origin == pytest.approx(grid.origin)


def test_points_and_transforms_come_through() -> None:
    at, radii = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.array([0.1, 0.2])
    publication = encode.named_points("anchors", ["A", "B"], at, radii, "map")
    names, points, found = decode.points(through_the_wire(publication))[:3]
    assert list(names) == ["A", "B"]
    np.testing.assert_array_equal(points, at)
    np.testing.assert_array_equal(found, radii)
    moved = encode.transform(STAMP, "base_link", "laser", (0.1, 0.2, 0.5), 0.3)
    [row] = decode.transforms(through_the_wire(encode.transforms([moved], static=True)))
    assert (row.parent, row.child, row.x, row.y, row.z) == ("base_link", "laser", 0.1, 0.2, 0.3)


def test_path_and_diagnostics_come_through() -> None:
    path = through_the_wire(encode.path("path", "map", [STAMP], [(1.0, 2.0, 0.5)]))
    assert path.poses[0].pose.position.y == 2.0
    status = encode.health_status("lost", "nothing fits", 0.1, 0.9, (1.0, 2.0, 0.5))
    [read] = through_the_wire(encode.diagnostics(STAMP, [status])).status
    assert read.level == read.ERROR
    assert {v.key: v.value for v in read.values}["within"] == "0.1"


@pytest.mark.parametrize(
    ("fails", "error", "says"),
    [
        (lambda: message_class("nobodys_msgs/Thing"), LookupError, "no Python package"),
        (lambda: message_class("nav_msgs/Thing"), LookupError, "has no message 'Thing'"),
        (lambda: message_of("nav_msgs/Path", {"psoes": []}), AttributeError, "no field 'psoes'"),
        (lambda: time_of(2**31 * 10**9), ValueError, "1901 to 2038"),
    ],
)
def test_what_cannot_be_filled_is_an_error(
    fails: Callable[[], object], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        fails()


def test_messages_go_from_process_to_process(tmp_path: Path) -> None:
    world = tmp_path / "log"
    world.mkdir()
    (world / "anchors.csv").write_text("anchor,x_m,y_m,z_m\nA,3,4,0\n")
    (world / "ranges.csv").write_text("stamp_s,tag,anchor,range_m\n5,t,A,5.0\n5.1,t,A,5.25\n")
    (world / "log.yaml").write_text("tags: {t: [0, 0, 0]}\n")
    with support_ros2.peer_in(tmp_path) as peer:
        ranges = peer.subscribe("uwb", "locfuse_msgs/UwbRanges")
        anchors = peer.subscribe("anchors", "locfuse_msgs/NamedPoints", latched=True)
        mounts = peer.subscribe("/tf_static", "tf2_msgs/TFMessage", latched=True)
        replay = peer.start("replay_log", {"log": str(world)})
        peer.wait("both ranges", lambda: len(ranges) == 2 and anchors and mounts)
        assert replay.wait() == 0
    assert [decode.ranges(m)[0].range_m for m in ranges] == [5.0, 5.25]
    assert decode.points(anchors[0])[0] == ["A"]
    assert decode.transforms(mounts[0])[0].child == "t"
