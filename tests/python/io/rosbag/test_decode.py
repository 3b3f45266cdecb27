# SPDX-License-Identifier: Apache-2.0
"""What a message of either ROS says, and what is wrong with one that says nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag import decode, encode
from locfuse.io.rosbag.decode import MessageError, RangeRow, ScanRow, SightingRow
from locfuse.types import GridMap
from support_ros import TIMES, message

STAMP = 1_700_000_000_123_456_789
ROS = pytest.mark.parametrize("ros", list(TIMES))


def odometry(ros: str = "ros2", **changes: Any) -> Any:
    given = encode.odometry("odom", STAMP, (1.0, 2.0, 0.5), (0.3, -0.2), "/odom", "/base", 0.25)
    return message(given, ros, **changes)


def scan(ros: str = "ros2", **changes: Any) -> Any:
    row = ScanRow(STAMP, "laser", -1.0, 0.5, 0.1, 10.0, np.array([1.234, np.nan, 9.5]),
                  np.array([5.0, np.nan, 7.0]))  # fmt: skip
    return message(encode.laser_scan("scan", row), ros, **changes)


def pose(ros: str = "ros2", **changes: Any) -> Any:
    covariance = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]])
    given = encode.pose_with_covariance("p", STAMP, (1.0, 2.0, -3.0), covariance, "map")
    return message(given, ros, **changes)


def uwb(ros: str = "ros2", **changes: Any) -> Any:
    rows = [
        RangeRow(STAMP, "front", "A", 1.25, 0.1, "uwb"),
        RangeRow(STAMP, "", "B", 3.0, None, ""),
    ]
    return message(encode.uwb_ranges("uwb", rows), ros, **changes)


def uwb_data(ros: str = "ros2", **changes: Any) -> Any:
    fields = {"destination_id": [7, 0x6E04], "distance": [1250.0, 3000.0],
              "stamp": [{"ns": STAMP}, {"ns": STAMP + 1}]}  # fmt: skip
    return message(fields, ros, **changes)


def sighted(ros: str = "ros2", **changes: Any) -> Any:
    rows = [SightingRow(STAMP, "tree", 4.0, 0.5, 0.1, 0.02, "eye"),
            SightingRow(STAMP, "", 5.0, -0.5, None, None, "eye")]  # fmt: skip
    return message(encode.landmark_sightings("s", rows), ros, **changes)


def grid(**changes: Any) -> Any:
    cells = np.array([[0, 100, -1], [100, 0, 0]], np.int8)
    given = encode.occupancy_grid("map", GridMap(cells, 0.05, (1.0, -2.0, 0.25)), "map")
    return message(given, **changes)


def satellite(**changes: Any) -> Any:
    fields = {"header": encode.header(STAMP, "gps"), "status": {"status": 0}, "latitude": 48.0,
              "longitude": 11.0, "altitude": 500.0, "position_covariance_type": 1,
              "position_covariance": [4.0, 0, 0, 0, 6.0, 0, 0, 0, 9.0]}  # fmt: skip
    return message(fields, **changes)


def named(**changes: Any) -> Any:
    given = encode.named_points("a", ["A", "B"], np.array([[0.0, 1, 2], [3, 4, 5]]),
                               np.array([0.5, 0.25]), "map")  # fmt: skip
    return message(given, **changes)


# What they say ---------------------------------------------------------------------------------


@ROS
def test_odometry_is_pose_and_twist(ros: str) -> None:
    row = decode.odometry(odometry(ros))
    assert row == (STAMP, 1.0, 2.0, 0.5, 0.3, -0.2, "odom", "base", 0.25, 0.0)
    assert decode.odometry(odometry(ros, twist__twist__linear__y=0.4)).left == 0.4


def test_of_odometry_only_the_half_that_is_used_is_checked() -> None:
    driven = odometry(pose__pose__orientation={"x": 0, "y": 0, "z": 0, "w": 0})
    assert decode.odometry(driven, "twist").v == 0.3
    turned = odometry(twist__twist__angular__z=math.nan)
    assert decode.odometry(turned, "pose").heading == 0.5
    for message_, use in ((driven, "pose"), (turned, "twist")):
        with pytest.raises(MessageError):
            decode.odometry(message_, use)


@ROS
def test_a_scan_comes_back_at_the_decimals_the_laser_counted(ros: str) -> None:
    row = decode.scan(scan(ros))
    assert row[:6] == (STAMP, "laser", -1.0, 0.5, 0.1, 10.0)
    assert row.ranges[[0, 2]].tolist() == [1.234, 9.5]
    assert np.isnan(row.ranges[1])
    assert row.intensities is not None
    assert row.intensities[[0, 2]].tolist() == [5.0, 7.0]
    assert np.isnan(row.intensities[1])


def test_what_a_laser_cannot_have_measured_is_no_return() -> None:
    nothing = [0.05, 0.1, 9.99, 10.0, 10.5, np.inf, -np.inf, np.nan, 0.0, -1.0]
    given = np.array([0.101, 9.97, *nothing], np.float32)
    row = decode.scan(scan(ranges=given, intensities=np.zeros(0)))
    assert row.ranges[:2].tolist() == [0.101, 9.97]
    assert np.isnan(row.ranges[2:]).all()
    assert row.intensities is None
    assert row.saturated is None


def test_a_reading_that_many_beams_share_far_from_all_others_is_no_return() -> None:
    near = np.linspace(1.0, 4.0, 40)
    wall = np.full(20, 4.1)

    def read(ranges: Any) -> ScanRow:
        given = np.array(ranges, np.float32)
        return decode.scan(scan(ranges=given, intensities=np.zeros(0), range_max=100.0))

    ended = read([*near, *[65.535] * 8])
    assert ended.saturated == 65.535
    assert np.isnan(ended.ranges[40:]).all()
    assert not np.isnan(ended.ranges[:40]).any()
    for ranges in ([*near, *wall], [*near, *[65.535] * 7], wall, [*near, 50.0, *[65.535] * 9]):
        row = read(ranges)
        assert row.saturated is None
        assert not np.isnan(row.ranges).any()


def test_a_scan_is_stamped_as_its_middle_beam() -> None:
    each = 0.001
    row = decode.scan(
        scan(ranges=np.full(101, 2.0, np.float32), intensities=np.zeros(0), time_increment=each)
    )
    assert (row.stamp_ns, row.time_increment) == (STAMP + 50_000_000, each)
    again = decode.scan(message(encode.laser_scan("scan", row)))
    assert (again.stamp_ns, again.time_increment) == (row.stamp_ns, each)
    for odd in (1.0, -0.1, math.nan):  # a turn of a hundred seconds
        row = decode.scan(
            scan(ranges=np.full(101, 2.0, np.float32), intensities=np.zeros(0), time_increment=odd)
        )
        assert (row.stamp_ns, row.time_increment) == (STAMP, 0.0)


def test_single_floats_become_short_decimals_only_where_they_mean_the_same() -> None:
    rng = np.random.default_rng(3)
    single = np.concatenate([np.round(rng.uniform(0, 60, 500), 3), rng.uniform(0, 60, 500)])
    given = single.astype(np.float32)
    wide = decode.decimals(given)
    assert np.array_equal(wide.astype(np.float32), given)  # nothing is lost
    assert np.array_equal(wide[:500], single[:500])  # and millimetres are those
    assert np.array_equal(decode.decimals(wide.astype(np.float32)), wide)
    assert decode.decimal(np.float32(0.05)) == 0.05


@ROS
def test_ranges_name_tag_and_anchor(ros: str) -> None:
    rows = decode.ranges(uwb(ros), tag="robot")
    assert rows == [(STAMP, "front", "A", 1.25, 0.1, "uwb"), (STAMP, "robot", "B", 3.0, None, "")]
    assert decode.ranges(uwb(ros).ranges[0]) == rows[:1]


def test_a_range_without_stamp_or_frame_of_its_own_has_that_of_all() -> None:
    given = uwb()
    given.ranges[1].header = message(encode.header(0, ""))
    given.header.frame_id = "/uwb"
    assert decode.ranges(given)[1] == (STAMP, "tag", "B", 3.0, None, "uwb")


@ROS
def test_the_paper_s_ranges_are_arrays_in_metres_or_millimetres(ros: str) -> None:
    rows = decode.ranges(uwb_data(ros), "mm", "robot")
    assert [row[:4] for row in rows] == [(STAMP, "robot", "7", 1.25),
                                         (STAMP + 1, "robot", "28164", 3.0)]  # fmt: skip
    assert decode.ranges(uwb_data(ros))[0].range_m == 1250.0
    assert [row.anchor for row in decode.ranges(uwb_data(distance=[0, 2.0]))] == ["28164"]


def test_a_topic_of_one_anchor_holds_plain_ranges() -> None:
    fields = {"header": encode.header(STAMP, "uwb"), "min_range": 0.1, "max_range": 50.0,
              "range": np.float32(2.3)}  # fmt: skip
    assert decode.range_of(message(fields), "t", "A") == (STAMP, "t", "A", 2.3, None, "uwb")
    for beyond in (0.05, 51.0, np.inf, -np.inf):
        assert decode.range_of(message(fields, range=beyond), "t", "A") is None
    with pytest.raises(MessageError, match="the range to A is nan"):
        decode.range_of(message(fields, range=np.nan), "t", "A")


@ROS
def test_a_pose_keeps_its_covariance_in_the_plane(ros: str) -> None:
    row = decode.pose(pose(ros))
    assert row[:5] == (STAMP, "map", 1.0, 2.0, -3.0)
    assert row.covariance.tolist() == [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]]


def test_a_heading_is_where_the_x_axis_points_whatever_roll_and_pitch() -> None:
    # Turned by 0.7 rad about z, then pitched by 0.4 rad: the axis still points to 0.7 rad.
    yaw = np.array([0, 0, np.sin(0.35), np.cos(0.35)])
    x, y, z, w = 0.0, np.sin(0.2), 0.0, np.cos(0.2)
    turned = {"x": -yaw[2] * y + yaw[3] * x, "y": yaw[3] * y + yaw[2] * x,
              "z": yaw[2] * w + yaw[3] * z, "w": yaw[3] * w - yaw[2] * z}  # fmt: skip
    assert decode.pose(pose(pose__pose__orientation=turned)).heading == pytest.approx(
        0.7, abs=1e-12
    )


def test_a_fix_is_metres_from_the_origin() -> None:
    row = decode.fix(satellite(latitude=48.001), (48.0, 11.0, 0.0))
    assert row is not None
    # A degree of the meridian at 48 deg is 111.2 km, and 500 m up 500 / 6.4e6 longer.
    assert row.x == pytest.approx(0.0, abs=1e-6)
    assert row.y == pytest.approx(111.198, abs=0.01)
    assert row.sigma_m == pytest.approx(math.sqrt(5.0))
    turned = decode.fix(satellite(latitude=48.001), (48.0, 11.0, 90.0))
    assert turned is not None
    assert (turned.x, turned.y) == pytest.approx((row.y, 0.0), abs=1e-6)


def test_a_fix_may_say_that_it_is_none_or_how_good_it_is_not() -> None:
    origin = (48.0, 11.0, 0.0)
    assert decode.fix(satellite(status__status=-1), origin) is None
    unknown = decode.fix(satellite(position_covariance_type=0), origin)
    assert unknown is not None
    assert unknown.sigma_m == -1.0
    level = decode.fix(satellite(altitude=math.nan), origin)
    assert level is not None
    assert (level.x, level.y) == pytest.approx((0.0, 0.0), abs=1e-6)
    with pytest.raises(MessageError, match=r"set ros\.gps_origin"):
        decode.fix(satellite())


def test_a_position_may_be_that_of_a_tag() -> None:
    row = decode.FixRow(STAMP, 1.5, -2.5, 0.3, "front", "map")
    assert decode.fix(message(encode.tag_position("t", row))) == row


@ROS
def test_sightings_are_range_and_bearing(ros: str) -> None:
    assert decode.sightings(sighted(ros)) == [
        (STAMP, "tree", 4.0, 0.5, 0.1, 0.02, "eye", None, None),
        (STAMP, "", 5.0, -0.5, None, None, "eye", None, None),
    ]
    assert decode.sightings(sighted(ros).sightings[0])[0].landmark == "tree"


@ROS
def test_sightings_of_a_body_that_flies_have_elevations(ros: str) -> None:
    rows = [SightingRow(STAMP, "lamp", 4.0, 0.5, 0.1, 0.02, "eye", -0.3, 0.04),
            SightingRow(STAMP, "sign", 4.0, 0.5, None, None, "eye", 0.0, None)]  # fmt: skip
    assert decode.sightings(message(encode.landmark_sightings("s", rows), ros)) == rows


def test_sightings_of_messages_from_before_there_were_elevations_are_read() -> None:
    old = sighted()
    for one in old.sightings:
        del one.has_elevation
        del one.elevation
    assert decode.sightings(old) == decode.sightings(sighted())


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"elevation": 1.6}, "elevation of lamp is 1.6 rad"),
        ({"elevation": math.nan}, "elevation of lamp is nan"),
        ({"sigma_elevation": 0.0}, "sigma_elevation 0"),
    ],
)
def test_elevations_that_cannot_be_are_refused(changes: dict[str, float], named: str) -> None:
    row = SightingRow(STAMP, "lamp", 4.0, 0.5, 0.1, 0.02, "eye", -0.3, 0.04)
    given = message(encode.landmark_sightings("s", [row]))
    for name, value in changes.items():
        setattr(given.sightings[0], name, value)
    with pytest.raises(MessageError, match=named):
        decode.sightings(given)


@ROS
def test_altitudes_are_ranges_down_points_and_poses(ros: str) -> None:
    point = message(encode.altitude("h", STAMP, 2.5, None, "map"), ros)
    assert decode.altitude(point) == (STAMP, 2.5, None, "map")
    pose_with_z = message(encode.altitude("h", STAMP, 2.5, 0.3, "map"), ros)
    assert decode.altitude(pose_with_z) == (STAMP, 2.5, 0.3, "map")
    assert decode.altitude(pose(ros)) == (STAMP, 0.0, None, "map")
    down = {"header": encode.header(STAMP, "sonar"), "range": 1.25, "min_range": 0.2,
            "max_range": 4.0}  # fmt: skip
    assert decode.altitude(message(down, ros)) == (STAMP, 1.25, None, "")
    assert decode.altitude(message({**down, "range": math.inf}, ros)) is None
    assert decode.altitude(message({**down, "range": 5.0}, ros)) is None


def test_altitudes_that_cannot_be_are_refused() -> None:
    for given, named in (
        (encode.altitude("h", STAMP, math.nan, None, "map"), "z is nan"),
        (encode.altitude("h", 0, 1.0, None, "map"), "the stamp is 0"),
        (encode.altitude("h", STAMP, 1.0, math.nan, "map"), "variance of z is NaN"),
    ):
        with pytest.raises(MessageError, match=named):
            decode.altitude(message(given))
    with pytest.raises(MessageError, match="PointStamped"):
        decode.altitude(sighted())


def test_a_map_comes_back_to_the_last_bit() -> None:
    found = decode.grid(grid(info__resolution=np.float32(0.05)))
    assert found.cells.tolist() == [[0, 100, -1], [100, 0, 0]]
    assert (found.resolution_m, found.origin) == (0.05, (1.0, -2.0, 0.25))


def test_cells_between_free_and_occupied_are_unknown() -> None:
    found = decode.grid(grid(data=np.array([0, 19, 20, 65, 66, 100], np.int8)))
    assert found.cells.ravel().tolist() == [0, 0, -1, -1, 100, 100]


def test_points_have_names_and_perhaps_radii() -> None:
    names, at, radii = decode.points(named())
    assert (names, at.tolist()) == (["A", "B"], [[0, 1, 2], [3, 4, 5]])
    assert radii is not None
    assert radii.tolist() == [0.5, 0.25]
    assert decode.points(named(radii=[]))[2] is None


def test_transforms_are_rows_whichever_message_brings_them() -> None:
    one = encode.transform(STAMP, "/base", "/laser", (1.0, 2.0, 0.0), 0.5)
    row = ("base", "laser", 1.0, 2.0, 0.5, (0.0, 0.0, 0.0, 1.0))
    assert decode.transforms(message(encode.transforms([one]))) == [row]
    assert decode.transforms(message(one)) == [row]


# What is wrong with them -----------------------------------------------------------------------

ZERO = {"ns": 0}
NO_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
HUGE = {"sec": 1, "nanosec": 10**9}
BAD: dict[str, tuple[Callable[[], object], str]] = {
    "odometry without stamp": (lambda: decode.odometry(odometry(header__stamp=ZERO)),
                               "the stamp is 0; the driver must stamp"),
    "odometry at NaN": (lambda: decode.odometry(odometry(pose__pose__position__x=math.nan)),
                        "pose.position.x is nan"),
    "odometry that is turned nowhere": (
        lambda: decode.odometry(odometry(pose__pose__orientation=NO_TURN)),
        "the orientation (0, 0, 0, 0) is no rotation"),
    "a pose for odometry": (lambda: decode.odometry(pose()), "is no nav_msgs/Odometry"),
    "nanoseconds beyond a second": (lambda: decode.odometry(odometry(header__stamp=HUGE)),
                                    "has 1000000000 nanoseconds"),
    "a scan without beams": (lambda: decode.scan(scan(ranges=[], intensities=[])), "has no beam"),
    "a scan that does not turn": (lambda: decode.scan(scan(angle_increment=0.0)),
                                  "angle_increment is 0"),
    "a scan without reach": (lambda: decode.scan(scan(range_max=0.0)),
                             "range_min and range_max are 0.1 and 0"),
    "more intensities than ranges": (lambda: decode.scan(scan(intensities=[1.0] * 5)),
                                     "3 ranges and 5 intensities"),
    "odometry for a scan": (lambda: decode.scan(odometry()), "is no sensor_msgs/LaserScan"),
    "a scan for ranges": (lambda: decode.ranges(scan()), "holds no ranges to anchors"),
    "a pose for ranges": (lambda: decode.ranges(pose()), "expected locfuse_msgs/UwbRanges"),
    "arrays that differ": (lambda: decode.ranges(uwb_data(distance=[1.0])),
                           "have 2, 1 and 2 elements"),
    "a negative distance": (lambda: decode.ranges(uwb_data(distance=[1.0, -2.0])),
                            "the distance to 28164 is -2 m"),
    "a distance of NaN": (lambda: decode.ranges(uwb_data(distance=[math.nan, 2.0])),
                          "the distance to 7 is nan m"),
    "paper's ranges without stamp": (lambda: decode.ranges(uwb_data(stamp=[])),
                                     "have 2, 2 and 0 elements"),
    "a pose without place": (lambda: decode.pose(pose(pose__pose__position__y=math.inf)),
                             "pose.position.y is inf"),
    "a covariance that is cut": (lambda: decode.pose(pose(pose__covariance=[0.0] * 9)),
                                 "has 9 elements, expected 36"),
    "a covariance of NaN": (lambda: decode.pose(pose(pose__covariance=[math.nan] * 36)),
                            "the covariance holds NaN"),
    "a latitude of radians or worse": (lambda: decode.fix(satellite(latitude=4800.0), (0, 0, 0)),
                                       "latitude and longitude are 4800 and 11"),
    "a latitude of NaN": (lambda: decode.fix(satellite(latitude=math.nan), (0, 0, 0)),
                          "nan and 11"),
    "a map without metadata": (lambda: decode.grid(grid(info__resolution=0.0)),
                               "the resolution of the map is 0 m"),
    "a map of no size": (lambda: decode.grid(grid(info__resolution=1e-9)),
                         "the resolution of the map is 1e-09 m, expected 1e-06 to 1e"),
    "a map that is nowhere": (lambda: decode.grid(grid(info__origin__position__y=-2e9)),
                              "the origin of the map is at (1, -2e+09) m, expected numbers within"),
    "a map that is at NaN": (lambda: decode.grid(grid(info__origin__position__y=math.nan)),
                             "the origin of the map is at (1, nan) m"),
    "a map without origin": (lambda: decode.grid(grid(info__origin__orientation=NO_TURN)),
                             "the map's origin is not set"),
    "a map that is cut": (lambda: decode.grid(grid(data=[0, 0])), "is 3 x 2 cells and holds 2"),
    "a map without a cell": (lambda: decode.grid(grid(info__width=0, data=[])), "0 x 2 cells"),
    "a cell of 101": (lambda: decode.grid(grid(data=[0, 0, 0, 0, 0, 101])),
                      "a cell of the map is 101"),
    "points without places": (lambda: decode.points(named(points=[])), "2 names, 0 points"),
    "points of one name": (lambda: decode.points(named(names=["A", "A"])),
                            "'A' is empty or there"),
    "a radius of 0": (lambda: decode.points(named(radii=[0.5, 0.0])), "a radius is not positive"),
    "half a sigma": (lambda: decode.sightings(message(sighted().sightings[0].__dict__ | {
        "sigma_bearing": 0.0})), "expected both > 0, or both 0"),
    "scans for sightings": (lambda: decode.sightings(scan()), "holds no sightings of landmarks"),
    "a transform to itself": (lambda: decode.transforms(message(encode.transform(
        STAMP, "a", "/a", (0.0, 0.0, 0.0)))), "from 'a' to 'a'"),
    "a transform that is none": (lambda: decode.transforms(message(encode.transform(
        STAMP, "a", "b", (math.nan, 0.0, 0.0)))), "the transform from b to a is none"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_one_sentence(case: str) -> None:
    call, said = BAD[case]
    with pytest.raises(MessageError) as error:
        call()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_single_ranges_that_are_wrong_name_their_anchor() -> None:
    for change, said in (({"range": -1.0}, "the range to B is -1 m"),
                         ({"sigma": math.nan}, "the sigma of the range to B is nan"),
                         ({"anchor": ""}, "a range has no anchor"),
                         ({"header": message(encode.header(0, ""))}, "stamp is 0")):  # fmt: skip
        given = uwb(header=message(encode.header(0, "")))
        vars(given.ranges[1]).update(change)
        with pytest.raises(MessageError, match=said):
            decode.ranges(given)
