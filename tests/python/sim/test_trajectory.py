# SPDX-License-Identifier: Apache-2.0
"""The truth is exact on arcs and straights, and every path is what its name says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.config.scenario import (
    Circle,
    Eight,
    Path,
    Points,
    Polygon,
    Roam,
    Square,
    Star,
    Waypoints,
)
from locfuse.sim.maps import rooms
from locfuse.sim.trajectory import Drive, drive_of, plan, sinc
from locfuse.types import wrap_angle

ROOM = (10.0, 10.0)
PATHS: list[Path] = [
    Circle(), Eight(), Square(), Star(), Star(points=7), Polygon(corners=3), Polygon(),
    Points(points_m=[(1.0, 1.0), (9.0, 1.0), (5.0, 7.0)], closed=True), Waypoints()
]  # fmt: skip


def planned(path: Path, duration_s: float = 600.0, seed: int = 3) -> Drive:
    return plan(path, ROOM, duration_s, np.random.default_rng(seed))


def shape_of(path: Path) -> str:
    many = getattr(path, "points", getattr(path, "corners", ""))  # of a star or a polygon
    return f"{path.shape}{many}"


def test_a_quarter_turn_ends_where_geometry_says() -> None:
    drive = drive_of((0.0, 0.0, 0.0), [(10.0, 1.0, 1.0)])

    pose = drive.pose_at([0.5 * math.pi])

    np.testing.assert_allclose(pose, [[1.0, 1.0, 0.5 * math.pi]], atol=1e-15)


def test_a_right_turn_is_the_mirror_image_of_a_left_turn() -> None:
    t = np.linspace(0.0, 3.0, 50)
    left = drive_of((0.0, 0.0, 0.0), [(10.0, 0.7, 0.9)]).pose_at(t)
    right = drive_of((0.0, 0.0, 0.0), [(10.0, 0.7, -0.9)]).pose_at(t)

    np.testing.assert_array_equal(right, left * [1.0, -1.0, -1.0])


def test_straight_motion_is_exact_to_the_last_bit() -> None:
    t = np.linspace(0.0, 60.0, 1801)

    pose = drive_of((0.0, 2.0, 0.0), [(60.0, 0.22, 0.0)]).pose_at(t)

    np.testing.assert_array_equal(pose[:, 0], t * 0.22)
    np.testing.assert_array_equal(pose[:, 1], 2.0)
    np.testing.assert_array_equal(pose[:, 2], 0.0)


@pytest.mark.parametrize("turn_rate", [0.0, 5e-324, 1e-300, 1e-16, 1e-9, -1e-9, 1e-6])
def test_slow_turns_agree_with_the_series_and_do_not_stop_the_robot(turn_rate: float) -> None:
    speed, t = 0.5, 4.0

    pose = drive_of((0.0, 0.0, 0.0), [(10.0, speed, turn_rate)]).pose_at([t])[0]

    a = turn_rate * t
    series = [speed * t * (1.0 - a * a / 6.0), speed * t * a / 2.0 * (1.0 - a * a / 12.0), a]
    np.testing.assert_allclose(pose, series, rtol=1e-12, atol=1e-300)


def test_turning_in_place_does_not_move() -> None:
    pose = drive_of((1.0, 2.0, 0.1), [(10.0, 0.0, 1.0)]).pose_at(np.linspace(0.0, 10.0, 101))

    np.testing.assert_array_equal(pose[:, :2], np.tile([1.0, 2.0], (101, 1)))


def test_poses_agree_with_numerical_integration() -> None:
    drive = drive_of(
        (1.0, -2.0, 3.0), [(1.0, 0.3, 0.4), (0.5, 0.0, -2.0), (2.0, 0.8, 0.0), (1.5, -0.2, 1.1)]
    )
    steps = 50_000
    h = 5.0 / steps
    middle = (np.arange(steps) + 0.5) * h
    row = np.searchsorted(drive.start, middle, side="right") - 1
    turned = np.concatenate([[0.0], np.cumsum(h * drive.turn_rate[row])])
    heading = 3.0 + 0.5 * (turned[1:] + turned[:-1])
    x = 1.0 + np.sum(h * drive.speed[row] * np.cos(heading))
    y = -2.0 + np.sum(h * drive.speed[row] * np.sin(heading))

    pose = drive.pose_at([5.0])[0]

    np.testing.assert_allclose(pose[:2], [x, y], atol=1e-9)
    assert abs(wrap_angle(pose[2] - 3.0 - turned[-1])) < 1e-9


def test_many_times_at_once_equal_one_by_one_in_any_order() -> None:
    drive = planned(Star())
    t = np.random.default_rng(1).permutation(np.linspace(0.0, 300.0, 200))

    together = drive.pose_at(t)

    one_by_one = np.concatenate([drive.pose_at([each]) for each in t])
    np.testing.assert_allclose(together, one_by_one, atol=1e-15)


@pytest.mark.parametrize("t", [-1e-9, math.nan])
def test_times_without_a_pose_are_refused(t: float) -> None:
    with pytest.raises(ValueError, match="expected at least"):
        planned(Circle()).pose_at([0.0, t])


def test_a_motion_that_lasts_no_time_is_refused() -> None:
    with pytest.raises(ValueError, match="row 1"):
        drive_of((0.0, 0.0, 0.0), [(0.0, 1.0, 0.0), (1.0, 1.0, 0.0)])


def test_a_drive_without_motions_is_refused() -> None:
    with pytest.raises(ValueError, match="no motion"):
        drive_of((0.0, 0.0, 0.0), [])


def test_a_drive_of_unequal_columns_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Drive\.speed has shape \(1,\), expected \(2,\)"):
        Drive(np.array([0.0, 1.0]), np.ones(1), np.ones(2), np.zeros((2, 3)))


def test_wrapping_keeps_what_is_inside_and_never_returns_plus_pi() -> None:
    below = np.nextafter(-np.pi, -10.0)
    inside = np.array([-np.pi, -1e-17, 0.0, 0.1, np.nextafter(np.pi, 0.0)])

    np.testing.assert_array_equal(wrap_angle(inside), inside)
    assert wrap_angle(np.pi) == -np.pi
    assert -np.pi <= wrap_angle(below) < np.pi
    np.testing.assert_allclose(wrap_angle([7.0, -7.0]), [7.0 - 2 * np.pi, 2 * np.pi - 7.0])


def test_sinc_is_one_at_zero_and_sine_over_angle_elsewhere() -> None:
    np.testing.assert_array_equal(sinc([0.0, 0.5, -2.0]), [1.0, np.sin(0.5) / 0.5, np.sin(2) / 2])


@pytest.mark.parametrize("path", PATHS, ids=shape_of)
def test_paths_stay_in_the_room_and_their_headings_in_one_turn(path: Path) -> None:
    pose = planned(path).pose_at(np.linspace(0.0, 600.0, 20_001))

    assert np.all((pose[:, :2] >= 0.0) & (pose[:, :2] <= ROOM))
    assert np.all((pose[:, 2] >= -np.pi) & (pose[:, 2] < np.pi))


@pytest.mark.parametrize("path", PATHS, ids=shape_of)
def test_paths_have_no_jumps_and_drive_at_their_speed(path: Path) -> None:
    t = np.linspace(0.0, 600.0, 60_001)

    pose = planned(path).pose_at(t)

    step = np.hypot(*np.diff(pose[:, :2], axis=0).T)
    assert step.max() <= path.speed_mps * 0.01 * (1.0 + 1e-9)
    turning = getattr(path, "turn_rate_radps", 1.0)
    assert np.abs(wrap_angle(np.diff(pose[:, 2]))).max() <= turning * 0.01 * (1.0 + 1e-9)


@pytest.mark.parametrize("path", PATHS[2:], ids=shape_of)
def test_cornered_paths_drive_straight_and_turn_in_place(path: Path) -> None:
    drive = planned(path)

    assert np.all((drive.speed == 0.0) != (drive.turn_rate == 0.0))
    assert np.all(drive.speed[drive.turn_rate == 0.0] == path.speed_mps)


@pytest.mark.parametrize("path", PATHS[:-1], ids=shape_of)
def test_closed_paths_come_back_to_the_start_after_every_lap(path: Path) -> None:
    drive = planned(path, 2000.0)
    laps = {"circle": 2.0 * math.pi * 3.0 / 0.22, "eight": 8.0 * math.pi / 0.22}
    if isinstance(path, Square):
        laps["square"] = 24.0 / 0.22 + 2.0 * math.pi
    if isinstance(path, Star):
        turn = math.pi * (path.points - 1) / path.points
        laps["star"] = path.points * (8.0 * math.sin(0.5 * turn) / 0.22 + turn)
    if isinstance(path, Polygon):
        side = 8.0 * math.sin(math.pi / path.corners)
        laps["polygon"] = path.corners * side / 0.22 + 2.0 * math.pi
    if isinstance(path, Points):
        laps["points"] = (8.0 + 2.0 * math.hypot(4.0, 6.0)) / 0.22 + 2.0 * math.pi

    pose = drive.pose_at(laps[path.shape] * np.arange(1, 6))

    start = drive.pose_at([0.0])
    np.testing.assert_allclose(pose[:, :2], np.tile(start[:, :2], (5, 1)), atol=1e-9)
    np.testing.assert_allclose(wrap_angle(pose[:, 2] - start[0, 2]), 0.0, atol=1e-9)


def test_the_circle_keeps_its_distance_and_runs_counter_clockwise() -> None:
    pose = planned(Circle(radius_m=2.0, speed_mps=0.5)).pose_at([0.0, 2.0 * math.pi])

    np.testing.assert_allclose(pose[0], [7.0, 5.0, 0.5 * math.pi], atol=1e-15)
    np.testing.assert_allclose(pose[1, :2], [5.0, 7.0], atol=1e-14)
    far = planned(Circle()).pose_at(np.linspace(0.0, 600.0, 999))
    np.testing.assert_allclose(np.hypot(*(far[:, :2] - 5.0).T), 3.0, atol=1e-12)


def test_a_circle_at_no_speed_is_a_robot_that_stands() -> None:
    pose = planned(Circle(speed_mps=0.0)).pose_at([0.0, 1.0, 599.0])

    np.testing.assert_array_equal(pose, np.tile([8.0, 5.0, 0.5 * math.pi], (3, 1)))


def test_the_eight_is_a_western_circle_to_the_left_and_an_eastern_one_to_the_right() -> None:
    lap = 2.0 * math.pi * 2.0 / 0.22

    pose = planned(Eight()).pose_at([0.25 * lap, 0.5 * lap, lap, 1.25 * lap, 1.5 * lap])

    expected = [[3.0, 7.0], [1.0, 5.0], [5.0, 5.0], [7.0, 7.0], [9.0, 5.0]]
    np.testing.assert_allclose(pose[:, :2], expected, atol=1e-12)


def test_the_square_reaches_its_corners_when_the_sides_and_turns_are_done() -> None:
    drive = planned(Square(speed_mps=0.5, turn_rate_radps=0.5 * math.pi))

    pose = drive.pose_at([0.0, 12.0, 12.5, 13.0, 25.0, 38.0])

    quarter = 0.5 * math.pi
    expected = [
        [2.0, 2.0, 0.0],
        [8.0, 2.0, 0.0],
        [8.0, 2.0, 0.5 * quarter],
        [8.0, 2.0, quarter],
        [8.0, 8.0, quarter],
        [2.0, 8.0, -np.pi],
    ]
    np.testing.assert_allclose(pose[:, :2], np.array(expected)[:, :2], atol=1e-13)
    np.testing.assert_allclose(wrap_angle(pose[:, 2] - np.array(expected)[:, 2]), 0.0, atol=1e-13)


@pytest.mark.parametrize("points", [5, 7, 9])
def test_the_star_turns_on_the_tips_of_a_regular_polygon(points: int) -> None:
    drive = planned(Star(points=points), 2000.0)

    tips = drive.start_pose[drive.speed == 0.0][:points, :2]

    angle = np.arctan2(tips[:, 1] - 5.0, tips[:, 0] - 5.0)
    np.testing.assert_allclose(np.hypot(*(tips - 5.0).T), 4.0, atol=1e-12)
    np.testing.assert_allclose(np.diff(np.sort(angle)), 2.0 * np.pi / points, atol=1e-12)
    np.testing.assert_allclose(drive.start_pose[0, :2], [5.0, 9.0])


@pytest.mark.parametrize("corners", [3, 4, 5, 8])
def test_the_polygon_goes_once_around_from_its_northern_corner(corners: int) -> None:
    drive = planned(Polygon(corners=corners), 2000.0)

    at = drive.start_pose[drive.speed > 0.0][:corners, :2] - 5.0

    turned = 2.0 * np.pi / corners * np.arange(corners)  # counter-clockwise from the north
    np.testing.assert_allclose(at, 4.0 * np.column_stack([-np.sin(turned), np.cos(turned)]),
                               atol=1e-12)  # fmt: skip


def test_a_drive_through_points_turns_the_short_way_and_stands_at_the_last() -> None:
    path = Points(points_m=[(1.0, 1.0), (3.0, 1.0), (3.0, 2.0)], speed_mps=0.5, turn_rate_radps=0.5)
    turned = 4.0 + math.pi  # a straight of 4 s, a quarter turn to the left of pi s

    pose = planned(path).pose_at([0.0, 4.0, 4.0 + 0.5 * math.pi, turned + 1.0, turned + 2.0, 599.0])

    quarter = 0.5 * math.pi
    expected = [
        [1.0, 1.0, 0.0],
        [3.0, 1.0, 0.0],
        [3.0, 1.0, 0.5 * quarter],
        [3.0, 1.5, quarter],
        [3.0, 2.0, quarter],
        [3.0, 2.0, quarter],
    ]
    np.testing.assert_allclose(pose, expected, atol=1e-12)


def test_closed_points_go_round_in_equal_laps() -> None:
    path = Points(points_m=[(1.0, 1.0), (4.0, 1.0), (4.0, 5.0)], closed=True, speed_mps=1.0)
    lap = 12.0 + 2.0 * math.pi
    t = np.linspace(0.0, lap, 400)

    drive = planned(path)

    np.testing.assert_allclose(drive.pose_at(t + 3.0 * lap), drive.pose_at(t), atol=1e-9)
    np.testing.assert_allclose(drive.pose_at([lap - 1e-9])[0], [1.0, 1.0, 0.0], atol=1e-8)


def test_waypoints_keep_the_margin_and_turn_the_short_way() -> None:
    drive = planned(Waypoints(margin_m=2.0), 5000.0)

    seconds = np.diff(drive.start)
    turns = drive.speed[:-1] == 0.0
    assert np.all((drive.start_pose[:, :2] >= 2.0) & (drive.start_pose[:, :2] <= 8.0))
    assert seconds[turns].max() <= math.pi
    assert {-1.0, 0.0, 1.0} == set(np.sign(drive.turn_rate).tolist())


def test_a_longer_drive_prolongs_the_same_random_waypoints() -> None:
    t = np.linspace(0.0, 50.0, 500)

    np.testing.assert_array_equal(
        planned(Waypoints(), 50.0).pose_at(t), planned(Waypoints(), 500.0).pose_at(t)
    )


def test_other_seeds_give_other_waypoints() -> None:
    first, second = planned(Waypoints(), seed=1), planned(Waypoints(), seed=2)

    assert not np.array_equal(first.start_pose[0], second.start_pose[0])


def test_points_in_one_line_make_no_turn_of_a_rounding_error() -> None:
    # Here the way goes straight on at a point but for 1e-17 rad: a turn without a duration.
    grid = rooms(np.random.default_rng(2), (12.0, 9.0), 0.05)
    rng = np.random.default_rng(1).spawn(7)[0]
    drive = plan(Roam(speed_mps=0.5), (12.0, 9.0), 60.0, rng, grid)
    assert np.diff(drive.start).min() > 1e-9
