# SPDX-License-Identifier: Apache-2.0
"""Without noise sensors say the geometry; with noise they err as much as they state."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.config.scenario import (
    OdometrySensor,
    PoseSensor,
    PositionSensor,
    RangeSensor,
    SightingSensor,
    Star,
)
from locfuse.sim import sensors
from locfuse.sim.trajectory import drive_of, drive_on, plan
from locfuse.types import Columns, FloatArray, wrap_angle
from support_statistics import assert_standard_normal

QUIET = OdometrySensor(
    sigma_longitudinal_per_sqrt_m=0.0, sigma_heading_per_sqrt_m=0.0, sigma_heading_per_sqrt_rad=0.0
)
STRAIGHT = drive_of((0.0, 0.0, 0.0), [(1e6, 1.0, 0.0)])
TURNING = drive_of((0.0, 0.0, 0.0), [(1e6, 0.0, 1.0)])
MIXED = drive_of((2.0, 2.0, 3.0), [(7.0, 0.2, 0.3), (2.0, 0.0, -1.0), (60.0, 0.4, 0.1)])


def rng(seed: int = 11) -> np.random.Generator:
    return np.random.default_rng(seed)


def motions(columns: Columns) -> FloatArray:
    return np.column_stack([columns["dx_m"], columns["dy_m"], columns["dheading_rad"]])


def test_stamps_are_rounded_multiples_of_the_period_from_zero_to_the_duration() -> None:
    np.testing.assert_array_equal(
        sensors.stamps(30.0, 0.1), [0, 33_333_333, 66_666_667, 100_000_000]
    )
    hour = sensors.stamps(30.0, 3600.0)
    assert hour.dtype == np.int64
    assert len(hour) == 108_001
    assert hour[-1] == 3_600_000_000_000
    assert len(sensors.stamps(5.0, 0.199)) == 1


@pytest.mark.parametrize("rate_hz", [1e-9, 1e-160, 5e-324])
def test_a_sensor_that_never_tells_again_tells_once(rate_hz: float) -> None:
    np.testing.assert_array_equal(sensors.stamps(rate_hz, 3.0), [0])


# Odometry ------------------------------------------------------------------------------------


def test_increments_of_a_circle_are_the_same_quarter_turn_each_second() -> None:
    quarter = 0.5 * math.pi  # radius 1 m, one quarter per second: 1 m ahead and 1 m to the left
    drive = drive_of((5.0, -3.0, 2.0), [(100.0, quarter, quarter)])

    columns = sensors.odometry(drive, sensors.stamps(1.0, 5.0), QUIET, rng())

    expected = [[0.0, 0.0, 0.0], *[[1.0, 1.0, quarter]] * 5]
    np.testing.assert_allclose(motions(columns), expected, atol=1e-14)


def test_the_first_increment_is_no_motion_whatever_the_noise() -> None:
    columns = sensors.odometry(MIXED, sensors.stamps(10.0, 5.0), OdometrySensor(), rng())

    assert columns["stamp_ns"][0] == 0
    np.testing.assert_array_equal(motions(columns)[0], 0.0)


def test_increments_without_noise_add_up_to_the_true_path() -> None:
    stamp_ns = sensors.stamps(7.0, 60.0)
    truth = MIXED.pose_at(sensors.seconds(stamp_ns))
    x, y, heading = truth[0]

    for row, (dx, dy, turn) in enumerate(motions(sensors.odometry(MIXED, stamp_ns, QUIET, rng()))):
        x += math.cos(heading) * dx - math.sin(heading) * dy
        y += math.sin(heading) * dx + math.cos(heading) * dy
        heading += turn
        np.testing.assert_allclose([x, y], truth[row, :2], atol=1e-12)
        assert abs(wrap_angle(heading - truth[row, 2])) < 1e-12


def test_increments_across_the_cut_at_pi_are_small() -> None:
    drive = drive_of((0.0, 0.0, 3.1), [(100.0, 0.0, 1.0)])

    columns = sensors.odometry(drive, sensors.stamps(10.0, 10.0), QUIET, rng())

    np.testing.assert_allclose(columns["dheading_rad"][1:], 0.1, atol=1e-13)


def test_a_standing_robot_reports_exactly_no_motion() -> None:
    standing = drive_of((1.0, 2.0, 0.3), [(100.0, 0.0, 0.0)])

    columns = sensors.odometry(standing, sensors.stamps(30.0, 10.0), OdometrySensor(), rng())

    np.testing.assert_array_equal(motions(columns), 0.0)


@pytest.mark.parametrize(("speed", "turn_rate"), [(0.22, 0.0), (0.5, 0.8), (0.0, -1.0), (0.3, -2)])
def test_velocities_without_noise_are_those_of_the_arc(speed: float, turn_rate: float) -> None:
    drive = drive_of((1.0, 2.0, -3.0), [(100.0, speed, turn_rate)])
    sensor = QUIET.model_copy(update={"output": "velocities"})

    columns = sensors.odometry(drive, sensors.stamps(2.0, 20.0), sensor, rng())

    np.testing.assert_allclose(columns["v_mps"], speed, atol=1e-13)
    np.testing.assert_allclose(columns["omega_radps"], turn_rate, atol=1e-13)


def test_velocities_tell_the_motion_after_their_stamp_until_the_last_epoch() -> None:
    drive = drive_of((0.0, 0.0, 0.0), [(1.0, 0.5, 0.0), (1.0, 0.0, 0.4), (9.0, 0.25, 0.1)])
    sensor = QUIET.model_copy(update={"output": "velocities"})

    columns = sensors.odometry(drive, sensors.stamps(1.0, 3.0), sensor, rng())

    np.testing.assert_array_equal(columns["stamp_ns"], [0, 1_000_000_000, 2_000_000_000])
    np.testing.assert_allclose(columns["v_mps"], [0.5, 0.0, 0.25], atol=1e-14)
    np.testing.assert_allclose(columns["omega_radps"], [0.0, 0.4, 0.1], atol=1e-14)


def test_velocities_and_increments_of_one_seed_tell_the_same_motion() -> None:
    stamp_ns = sensors.stamps(30.0, 60.0)
    arc = drive_of((0.0, 0.0, 0.0), [(100.0, 0.3, 0.4)])
    noisy = OdometrySensor(sigma_heading_per_sqrt_m=0.0, sigma_heading_per_sqrt_rad=0.0)

    reported = motions(sensors.odometry(arc, stamp_ns, noisy, rng()))[1:]
    held = sensors.odometry(arc, stamp_ns, noisy.model_copy(update={"output": "velocities"}), rng())

    driven = drive_on(
        np.zeros((len(reported), 3)),
        np.diff(sensors.seconds(stamp_ns)),
        held["v_mps"],
        held["omega_radps"],
    )
    np.testing.assert_allclose(driven[:, 2], reported[:, 2], atol=1e-15)
    # An increment's noise points along the old heading, an arc's half a turn (7 mrad) further left:
    # that turns an error of a few millimetres into a lateral one of some 20 micrometres.
    np.testing.assert_allclose(driven[:, :2], reported[:, :2], atol=1e-4)


def per_metre(columns: Columns, rate_hz: int, name: str, expected: float) -> FloatArray:
    """Return the sum of the errors of one column over each second of driving."""
    error = columns[name][1:] - expected / rate_hz
    return np.asarray(error.reshape(-1, rate_hz).sum(axis=1), dtype=np.float64)


@pytest.mark.parametrize("rate_hz", [5, 30])
def test_odometry_errors_per_metre_driven_are_as_stated_at_any_rate(rate_hz: int) -> None:
    sensor = OdometrySensor(rate_hz=rate_hz, sigma_lateral_per_sqrt_m=0.01)

    columns = sensors.odometry(STRAIGHT, sensors.stamps(rate_hz, 4000.0), sensor, rng())

    assert_standard_normal(per_metre(columns, rate_hz, "dx_m", 1.0) / 0.03)
    assert_standard_normal(per_metre(columns, rate_hz, "dy_m", 0.0) / 0.01)
    assert_standard_normal(per_metre(columns, rate_hz, "dheading_rad", 0.0) / 0.02)


@pytest.mark.parametrize("rate_hz", [5, 30])
def test_odometry_errors_per_radian_turned_are_as_stated_at_any_rate(rate_hz: int) -> None:
    sensor = OdometrySensor(rate_hz=rate_hz)

    columns = sensors.odometry(TURNING, sensors.stamps(rate_hz, 4000.0), sensor, rng())

    assert_standard_normal(per_metre(columns, rate_hz, "dheading_rad", 1.0) / 0.03)
    np.testing.assert_array_equal(columns["dx_m"], 0.0)


@pytest.mark.parametrize("rate_hz", [5, 30])
def test_odometry_errors_of_driving_and_turning_add_up_whatever_the_direction(rate_hz: int) -> None:
    sensor = OdometrySensor(rate_hz=rate_hz)
    backwards = drive_of((0.0, 0.0, 0.0), [(1e6, -0.5, -2.0)])

    columns = sensors.odometry(backwards, sensors.stamps(rate_hz, 4000.0), sensor, rng())

    chord = 0.5 * math.sin(1.0 / rate_hz) * rate_hz  # metres per second
    sigma = math.sqrt(0.02**2 * chord + 0.03**2 * 2.0)
    assert_standard_normal(per_metre(columns, rate_hz, "dheading_rad", -2.0) / sigma)


@pytest.mark.parametrize("rate_hz", [5, 30])
def test_velocity_errors_are_those_of_the_increments_over_the_interval(rate_hz: int) -> None:
    sensor = OdometrySensor(rate_hz=rate_hz, output="velocities")

    columns = sensors.odometry(STRAIGHT, sensors.stamps(rate_hz, 4000.0), sensor, rng())

    per_interval = 1.0 / math.sqrt(rate_hz)
    assert_standard_normal((columns["v_mps"] - 1.0) / rate_hz / (0.03 * per_interval))
    assert_standard_normal(columns["omega_radps"] / rate_hz / (0.02 * per_interval))


# Ranges --------------------------------------------------------------------------------------


def test_a_range_is_the_distance_in_space_from_the_turned_lever_arm() -> None:
    north = drive_of((1.0, 2.0, 0.5 * math.pi), [(10.0, 0.0, 0.0)])
    tags = {"front": (0.5, 0.25, 0.5)}  # half a metre north, a quarter west, half up
    anchors = {"near": (0.75, 2.5, 1.5), "far": (2.75, 5.5, 6.5)}  # 0 0 1; 2 3 6

    columns = sensors.ranges(
        north, sensors.stamps(1.0, 0.0), tags, anchors, RangeSensor(sigma_relative=0.0), rng()
    )

    np.testing.assert_allclose(columns["range_m"], [1.0, 7.0], atol=1e-15)


def test_ranges_come_by_stamp_then_tag_then_anchor_without_a_sigma() -> None:
    tags = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0)}
    anchors = {"A1": (0.0, 0.0, 0.0), "A10": (5.0, 0.0, 0.0), "A2": (0.0, 5.0, 0.0)}

    columns = sensors.ranges(MIXED, sensors.stamps(5.0, 0.2), tags, anchors, RangeSensor(), rng())

    assert set(columns) == {"stamp_ns", "tag", "anchor", "range_m"}
    np.testing.assert_array_equal(columns["stamp_ns"], np.repeat([0, 200_000_000], 6))
    assert columns["tag"].tolist() == ["a", "a", "a", "b", "b", "b"] * 2
    assert columns["anchor"].tolist() == ["A1", "A10", "A2"] * 4


@pytest.mark.parametrize("rate_hz", [5.0, 30.0])
@pytest.mark.parametrize(("sigma_m", "relative"), [(0.0, 0.015), (0.1, 0.0), (0.03, 0.02)])
def test_range_errors_are_as_stated_at_every_distance(
    rate_hz: float, sigma_m: float, relative: float
) -> None:
    tags = {"tag": (0.0, 0.0, 0.0)}
    anchors = {"near": (7.0, 5.0, 0.0), "far": (50.0, 5.0, 0.0)}
    circle = drive_of((8.0, 5.0, 0.5 * math.pi), [(1e6, 0.3, 0.1)])
    stamp_ns = sensors.stamps(rate_hz, 500.0)
    sensor = RangeSensor(rate_hz=rate_hz, sigma_m=sigma_m, sigma_relative=relative)
    exact = RangeSensor(sigma_relative=0.0)

    measured = sensors.ranges(circle, stamp_ns, tags, anchors, sensor, rng())
    distance = sensors.ranges(circle, stamp_ns, tags, anchors, exact, rng())["range_m"]

    z = (measured["range_m"] - distance) / np.sqrt(sigma_m**2 + (relative * distance) ** 2)
    assert_standard_normal(z[measured["anchor"] == "near"])
    assert_standard_normal(z[measured["anchor"] == "far"])


def test_no_range_is_negative() -> None:
    standing = drive_of((0.0, 0.0, 0.0), [(10.0, 0.0, 0.0)])
    anchors = {"here": (0.0, 0.0, 0.0)}

    columns = sensors.ranges(
        standing,
        sensors.stamps(30.0, 10.0),
        {"tag": (0.0, 0.0, 0.0)},
        anchors,
        RangeSensor(sigma_m=1.0),
        rng(),
    )

    assert columns["range_m"].min() == 0.0


# Poses and positions -------------------------------------------------------------------------


def test_poses_without_noise_are_the_truth() -> None:
    stamp_ns = sensors.stamps(2.0, 60.0)

    columns = sensors.poses(
        MIXED, stamp_ns, PoseSensor(sigma_xy_m=0.0, sigma_heading_deg=0.0), rng()
    )

    truth = sensors.truth(MIXED, stamp_ns)
    for name in ("stamp_ns", "x_m", "y_m", "heading_rad"):
        np.testing.assert_array_equal(columns[name], truth[name])


@pytest.mark.parametrize("rate_hz", [2.0, 10.0])
def test_the_default_pose_source_has_a_position_rmse_of_6_cm(rate_hz: float) -> None:
    stamp_ns = sensors.stamps(rate_hz, 1500.0)

    columns = sensors.poses(TURNING, stamp_ns, PoseSensor(), rng())

    truth = sensors.truth(TURNING, stamp_ns)
    error = np.column_stack([columns[name] - truth[name] for name in ("x_m", "y_m")])
    assert_standard_normal(error / (0.06 / math.sqrt(2.0)))
    turned = wrap_angle(columns["heading_rad"] - truth["heading_rad"])
    assert_standard_normal(turned / math.radians(2.0))
    assert np.all((columns["heading_rad"] >= -np.pi) & (columns["heading_rad"] < np.pi))


def test_positions_without_noise_are_those_of_the_antenna() -> None:
    west = drive_of((1.0, 2.0, math.pi), [(10.0, 0.5, 0.0)])
    sensor = PositionSensor(sigma_xy_m=0.0, antenna_forward_m=0.4, antenna_left_m=0.1)

    columns = sensors.positions(west, sensors.stamps(1.0, 2.0), {}, sensor, rng())

    np.testing.assert_allclose(columns["x_m"], [0.6, 0.1, -0.4], atol=1e-15)
    np.testing.assert_allclose(columns["y_m"], 1.9, atol=1e-15)


@pytest.mark.parametrize("rate_hz", [1.0, 5.0])
def test_position_errors_are_as_stated(rate_hz: float) -> None:
    stamp_ns = sensors.stamps(rate_hz, 2000.0)

    columns = sensors.positions(STRAIGHT, stamp_ns, {}, PositionSensor(sigma_xy_m=0.7), rng())

    assert_standard_normal((columns["x_m"] - sensors.seconds(stamp_ns)) / 0.7)
    assert_standard_normal(columns["y_m"] / 0.7)


def test_positions_of_tags_without_noise_are_where_the_tags_are() -> None:
    west = drive_of((1.0, 2.0, math.pi), [(10.0, 0.5, 0.0)])
    tags = {"a": (0.4, 0.1, 1.0), "unused": (9.0, 9.0, 9.0), "b": (-0.2, 0.0, 0.5)}
    sensor = PositionSensor(sigma_xy_m=0.0, antenna_forward_m=7.0, tags=["b", "a"])

    columns = sensors.positions(west, sensors.stamps(1.0, 1.0), tags, sensor, rng())

    assert columns["tag"].tolist() == ["b", "a"] * 2
    np.testing.assert_array_equal(columns["stamp_ns"], [0, 0, 1_000_000_000, 1_000_000_000])
    np.testing.assert_allclose(columns["x_m"], [1.2, 0.6, 0.7, 0.1], atol=1e-15)
    np.testing.assert_allclose(columns["y_m"], [2.0, 1.9] * 2, atol=1e-15)


POSTS = {"left": (3.0, 4.0), "far": (30.0, 0.0), "behind": (-2.0, 0.0)}


def test_sightings_without_noise_are_those_of_the_sensor_for_what_is_in_view() -> None:
    still = drive_of((0.0, 0.0, 0.0), [(1e6, 0.0, 0.0)])
    sensor = SightingSensor(rate_hz=1.0, sigma_range_m=0.0, sigma_bearing_deg=0.0,
                            pose_in_body=(3.0, 0.0, 90.0), field_of_view_deg=181.0)  # fmt: skip

    columns = sensors.sightings(still, sensors.stamps(1.0, 1.0), POSTS, sensor, rng())

    # From (3, 0), looking left: `left` is straight ahead, `far` too far, `behind` just in view.
    assert columns["landmark"].tolist() == ["left", "behind"] * 2
    np.testing.assert_allclose(columns["range_m"], [4.0, 5.0] * 2)
    np.testing.assert_allclose(columns["bearing_rad"], [0.0, math.pi / 2] * 2, atol=1e-15)
    np.testing.assert_array_equal(columns["stamp_ns"], [0, 0, 1_000_000_000, 1_000_000_000])


def test_sightings_may_be_without_names_and_err_as_stated() -> None:
    still = drive_of((0.0, 0.0, 0.0), [(1e6, 0.0, 0.0)])
    sensor = SightingSensor(sigma_range_m=0.2, sigma_bearing_deg=2.0, landmarks="unnamed")

    columns = sensors.sightings(still, sensors.stamps(5.0, 1000.0), POSTS, sensor, rng())

    assert set(columns["landmark"].tolist()) == {""}
    left = np.abs(columns["bearing_rad"] - 1.0) < 1.0
    assert_standard_normal((columns["range_m"][left] - 5.0) / 0.2)
    off = columns["bearing_rad"][left] - math.atan2(4.0, 3.0)
    assert_standard_normal(off / np.deg2rad(2.0))


def test_sigmas_scale_the_same_draws() -> None:
    drive = plan(Star(), (10.0, 10.0), 60.0, rng())
    stamp_ns = sensors.stamps(2.0, 20.0)
    truth = sensors.truth(drive, stamp_ns)

    once = sensors.poses(drive, stamp_ns, PoseSensor(sigma_xy_m=0.1), rng())
    twice = sensors.poses(drive, stamp_ns, PoseSensor(sigma_xy_m=0.2), rng())

    np.testing.assert_allclose(
        twice["x_m"] - truth["x_m"], 2.0 * (once["x_m"] - truth["x_m"]), atol=1e-14
    )
