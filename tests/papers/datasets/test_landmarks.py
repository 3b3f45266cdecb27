# SPDX-License-Identifier: Apache-2.0
"""Recordings of landmarks as log folders: the figures of their notes, from the converted logs."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.eval.errors import errors_against, interpolate
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, Trajectory, wrap_angle
from papers.datasets import convert
from papers.datasets.source import TRUCK, TRUCK_LASER, truck_odometry
from support_recordings import (
    carried,
    converted,
    damaged,
    driven_m,
    reckoned,
    robust_sigma,
    rows_in,
    sighting_errors,
    truth_in,
)
from support_runs import recording

Logs = dict[str, Log]


def out_of(factory: pytest.TempPathFactory) -> Path:
    return factory.mktemp("converted")


@pytest.fixture(scope="module")
def tubes(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return converted("utias_tubes", out_of(tmp_path_factory))["utias_tubes"]


@pytest.fixture(scope="module")
def mrclam(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return converted("mrclam6", out_of(tmp_path_factory))


@pytest.fixture(scope="module")
def carpark(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return converted("acfr_carpark", out_of(tmp_path_factory))["acfr_carpark"]


@pytest.fixture(scope="module")
def arena(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return converted("lego_arena", out_of(tmp_path_factory))["lego_arena"]


@pytest.fixture(scope="module")
def park(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    return converted("victoria_park", out_of(tmp_path_factory))


def drift_of(log: Log) -> tuple[float, float]:
    """Return how far dead reckoning from the truth is off at the end: metres, degrees."""
    begin, _ = interpolate(truth_in(log), log["odometry"]["stamp_ns"][:1])
    assert begin.heading is not None
    x, y = begin.position[0]
    errors = errors_against(reckoned(log, (x, y, begin.heading[0])), truth_in(log))
    assert errors.heading is not None
    return float(np.hypot(*errors.position[-1])), float(np.rad2deg(errors.heading[-1]))


def with_rows(log: Log, rows: NDArray[np.bool_]) -> Log:
    """Return a log that has only some of its sightings."""
    seen = {name: values[rows] for name, values in log["landmark_sightings"].items()}
    return replace(log, tables={**log.tables, "landmark_sightings": seen})


# Tubes ----------------------------------------------------------------------------------------


def test_utias_tubes_has_the_rows_and_figures_of_its_notes(tubes: Log) -> None:
    assert rows_in(tubes) == {
        "odometry": 6304, "landmark_sightings": 31298, "truth": 6132, "landmarks": 17
    }  # fmt: skip
    assert tubes["odometry"]["stamp_ns"][[0, -1]].tolist() == [0, 630_300_000_000]
    seen = tubes["landmark_sightings"]
    known = np.isin(seen["stamp_ns"], tubes["truth"]["stamp_ns"])
    assert seen["range_m"].max() == pytest.approx(5.6, abs=0.05)
    assert np.abs(seen["bearing_rad"]).max() == pytest.approx(2.09, abs=0.01)
    errors = sighting_errors(with_rows(tubes, known))
    assert len(errors.row) == known.sum() == 30609
    assert errors.range_m.mean() == pytest.approx(0.0, abs=1.5e-3)
    assert errors.range_m.std() == pytest.approx(0.033, abs=1.5e-3)
    assert errors.bearing_rad.mean() == pytest.approx(0.003, abs=1e-3)
    assert errors.bearing_rad.std() == pytest.approx(0.026, abs=1e-3)
    assert driven_m(tubes) == pytest.approx(181.0, abs=0.5)
    # The notes say 2.5 m and 16 degrees, which is with the speeds of the row behind, not before.
    off_m, off_deg = drift_of(tubes)
    assert off_m == pytest.approx(2.47, abs=0.01)
    assert off_deg == pytest.approx(-14.5, abs=0.1)


def test_utias_tubes_states_its_noise_and_where_its_laser_is(tubes: Log) -> None:
    seen = tubes["landmark_sightings"]
    assert np.unique(seen["sigma_range_m"]) == pytest.approx([0.030], abs=5e-5)
    assert np.unique(seen["sigma_bearing_rad"]) == pytest.approx([0.026], abs=1e-4)
    assert tubes.landmark_sensor == {"pose_in_body": [0.21901627, 0.0, 0.0]}
    assert seen["landmark"][:7].tolist() == ["10", "11", "12", "13", "14", "15", "16"]
    assert (seen["range_m"][0], seen["bearing_rad"][1]) == (1.3743, 0.53497)


def test_utias_tubes_are_seen_wrong_from_anywhere_but_their_laser(tubes: Log) -> None:
    body = replace(tubes, landmark_sensor=None)
    assert sighting_errors(body).range_m.std() > 0.1


def test_utias_tubes_are_driven_past_at_an_angle_to_the_heading(tubes: Log) -> None:
    truth, _ = interpolate(truth_in(tubes), tubes["odometry"]["stamp_ns"])
    assert truth.heading is not None
    ahead, fast = 10, 0.1  # rows, m/s
    moved = truth.position[ahead:] - truth.position[:-ahead]
    seconds = (truth.stamp_ns[ahead:] - truth.stamp_ns[:-ahead]) / NANOSECONDS
    turned = np.abs(wrap_angle(truth.heading[ahead:] - truth.heading[:-ahead]))
    straight = (np.hypot(*moved.T) > fast * seconds) & (turned < 0.05)
    middle = truth.heading[:-ahead] + 0.5 * wrap_angle(
        truth.heading[ahead:] - truth.heading[:-ahead]
    )
    offset = wrap_angle(np.arctan2(moved[:, 1], moved[:, 0]) - middle)[straight]
    assert np.rad2deg(np.median(offset)) == pytest.approx(-4.6, abs=0.3)


# MRCLAM ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run", "seconds", "metres", "seen", "median_m", "sigma_m", "sigma_rad", "off_m", "off_deg"),
    [
        ("robot1", 760, 48, 1534, 0.038, 0.079, 0.011, 8.3, 136),
        ("robot3", 887, 55, 4348, -0.022, 0.128, 0.006, 4.9, -94),
        ("robot5", 886, 50, 4239, 0.002, 0.134, 0.006, 2.2, 61),
    ],
)
def test_mrclam6_has_the_figures_of_its_notes(
    mrclam: Logs, run: str, seconds: float, metres: float, seen: int, median_m: float,
    sigma_m: float, sigma_rad: float, off_m: float, off_deg: float,
) -> None:  # fmt: skip
    log = mrclam[run]
    stamps = log["odometry"]["stamp_ns"]
    assert float(np.ptp(stamps)) / NANOSECONDS == pytest.approx(seconds, abs=0.6)
    assert driven_m(log) == pytest.approx(metres, abs=0.6)
    assert len(log["landmark_sightings"]["range_m"]) == seen
    errors = sighting_errors(log)
    assert np.median(errors.range_m) == pytest.approx(median_m, abs=1e-3)
    assert robust_sigma(errors.range_m) == pytest.approx(sigma_m, abs=1e-3)
    assert robust_sigma(errors.bearing_rad) == pytest.approx(sigma_rad, abs=6e-4)
    assert 0.009 < float(np.mean(np.abs(errors.range_m) > 0.5)) < 0.041
    found_m, found_deg = drift_of(log)
    assert found_m == pytest.approx(off_m, abs=0.1)
    assert found_deg == pytest.approx(off_deg, abs=1.0)


def test_mrclam6_sees_landmarks_by_subject_and_nobody_else(mrclam: Logs) -> None:
    names = {str(number) for number in range(6, 21)}
    for log in mrclam.values():
        assert set(log["landmarks"]["landmark"].tolist()) == names
        assert set(log["landmark_sightings"]["landmark"].tolist()) <= names
        truth, driven, seen = (
            log[stem]["stamp_ns"] for stem in ("truth", "odometry", "landmark_sightings")
        )
        assert driven[0] == 0
        assert -20_000_000 < truth[0] <= 0 <= seen[0]
        assert max(driven[-1], seen[-1]) <= truth[-1] < driven[-1] + 20_000_000
    first = mrclam["robot1"]["landmark_sightings"]  # barcode 90 is subject 15
    assert first["landmark"][0] == "15"
    assert (first["range_m"][0], first["bearing_rad"][0]) == (6.758, -0.005)
    assert first["stamp_ns"][0] == 2_443_000_000  # after the first odometry at ...187.156 s


# Car park -------------------------------------------------------------------------------------


def tape_in(log: Log, row: int, radius_m: float = 0.0, within_m: float = 30.0) -> FloatArray:
    """Return where reflective tape is in the frame of the laser, a point for each pole, (n, 2)."""
    laser = log.laser
    assert laser is not None
    scan, bright = log["scans"]["ranges_m"][row], log["scans"]["intensities"][row] > 0.0
    beams = np.flatnonzero(bright & (scan < within_m))
    apart = (np.diff(beams) > 2) | (np.abs(np.diff(scan[beams])) > 0.5)
    found = []
    for part in np.split(beams, np.flatnonzero(apart) + 1):
        if len(part) > 0:
            angle = laser["angle_min_rad"] + laser["angle_increment_rad"] * part.mean()
            length = scan[part].mean() + radius_m
            found.append([length * np.cos(angle), length * np.sin(angle)])
    return np.array(found).reshape(-1, 2)


def fitted(points: FloatArray, poles: FloatArray, near: FloatArray) -> FloatArray:
    """Return the pose (x, y, heading) that best puts points on poles near a place, then the rest.

    After the pose come the distances from the poles, as many as points were nearer than 0.5 m.
    """
    best = np.zeros(3)
    for heading in np.deg2rad(np.arange(0.0, 360.0, 1.0)):
        apart = np.linalg.norm(
            placed(points, np.array([*near, heading]))[:, np.newaxis] - poles, axis=2
        )
        which, hit = apart.argmin(axis=1), apart.min(axis=1) < 0.5
        if hit.sum() > len(best) - 3:
            pose = _rigid(points[hit], poles[which[hit]])
            off = np.linalg.norm(placed(points[hit], pose) - poles[which[hit]], axis=1)
            best = np.concatenate([pose, off])
    return best


def placed(points: FloatArray, pose: FloatArray) -> FloatArray:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(pose[:2] + points @ np.array([[c, s], [-s, c]]), dtype=np.float64)


def _rigid(points: FloatArray, poles: FloatArray) -> FloatArray:
    p, q = points - points.mean(axis=0), poles - poles.mean(axis=0)
    heading = np.arctan2((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum(), (p * q).sum())
    c, s = np.cos(heading), np.sin(heading)
    at = poles.mean(axis=0) - np.array([[c, -s], [s, c]]) @ points.mean(axis=0)
    return np.array([*at, heading])


def gps_of(log: Log) -> Trajectory:
    table = log["positions"]
    return Trajectory(table["stamp_ns"], np.column_stack([table["x_m"], table["y_m"]]))


def test_acfr_carpark_has_the_rows_and_figures_of_its_notes(carpark: Log) -> None:
    assert rows_in(carpark) == {"odometry": 2400, "positions": 300, "scans": 281, "landmarks": 15}
    scans = carpark["scans"]
    assert scans["ranges_m"].shape == scans["intensities"].shape == (281, 361)
    assert np.unique(scans["intensities"]).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.isnan(scans["ranges_m"]).sum() == 68527 + 15 + 57 + 861
    assert scans["ranges_m"][0, :3].tolist() == [0.84, 0.85, 0.84]
    assert "truth" not in carpark
    assert np.unique(carpark["positions"]["sigma_m"]).tolist() == [0.03]
    assert np.unique(carpark["landmarks"]["radius_m"]).tolist() == [0.03]
    # The notes are of the whole drive: 1.5 in a scan, none in 14 %.
    found = np.array([len(tape_in(carpark, row)) for row in range(281)])
    assert found.mean() == pytest.approx(1.80, abs=0.005)
    assert np.mean(found == 0) == pytest.approx(0.07, abs=0.005)


def gps_against_poles(log: Log, radius_m: float = 0.0, lag_s: float = 0.0) -> FloatArray:
    """Return pose - GPS, ahead and to the left, and how far off poles, for three poles or more."""
    poles = np.column_stack([log["landmarks"]["x_m"], log["landmarks"]["y_m"]])
    gps = gps_of(log)
    gps = replace(gps, stamp_ns=gps.stamp_ns - round(lag_s * NANOSECONDS))
    places, inside = interpolate(gps, log["scans"]["stamp_ns"])
    found = []
    for at, row in zip(places.position, np.flatnonzero(inside).tolist(), strict=True):
        (x, y, heading, *off) = fitted(tape_in(log, row, radius_m), poles, at)
        if len(off) >= 3:
            c, s, dx, dy = np.cos(heading), np.sin(heading), x - at[0], y - at[1]
            found.append([c * dx + s * dy, c * dy - s * dx, np.median(off)])
    return np.array(found)


def test_acfr_carpark_gps_is_where_its_laser_is(carpark: Log) -> None:
    # The notes are of the whole drive: 66 scans, 0.033 and 0.083 m, -2 and -1 cm, 0.017 m.
    found = gps_against_poles(carpark)
    apart = np.hypot(found[:, 0], found[:, 1])
    assert len(found) == 45
    assert np.median(apart) == pytest.approx(0.028, abs=1e-3)
    assert np.quantile(apart, 0.95) == pytest.approx(0.085, abs=2e-3)
    assert found.mean(axis=0)[:2] == pytest.approx([-0.028, -0.011], abs=1e-3)
    assert np.median(found[:, 2]) == pytest.approx(0.014, abs=1e-3)
    late = gps_against_poles(carpark, lag_s=0.1)
    assert np.median(np.hypot(late[:, 0], late[:, 1])) > 0.14
    assert np.median(gps_against_poles(carpark, radius_m=0.03)[:, 2]) > 0.016


def later_than(log: Log, seconds: float) -> Log:
    """Return a log whose odometry begins later."""
    rows = log["odometry"]["stamp_ns"] >= round(seconds * NANOSECONDS)
    driven = {name: values[rows] for name, values in log["odometry"].items()}
    return replace(log, tables={**log.tables, "odometry": driven})


def antenna_errors(log: Log, x: float, y: float, heading: float) -> FloatArray:
    """Return how far the laser is from GPS on odometry alone, from a pose of the laser."""
    forward, left, _ = TRUCK_LASER["pose_in_body"]
    c, s = np.cos(heading), np.sin(heading)
    start = (x - c * forward + s * left, y - s * forward - c * left, heading)
    track, gps = reckoned(log, start), gps_of(log)
    begin = np.searchsorted(gps.stamp_ns, track.stamp_ns[0])
    at, inside = interpolate(track, gps.stamp_ns[begin:])
    return distances(carried(at, forward, left), gps.position[begin:][inside])


def distances(points: FloatArray, others: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(*(points - others).T), dtype=np.float64)


def test_acfr_carpark_is_driven_from_where_its_notes_say(carpark: Log) -> None:
    errors = antenna_errors(later_than(carpark, 46.598), 4.688, 0.836, 4.382)
    assert errors[:10].max() < 0.04
    assert (errors[-1], errors.mean()) == pytest.approx((0.96, 0.66), abs=0.01)
    as_if_the_axle_were_there = reckoned(later_than(carpark, 46.598), (4.688, 0.836, 4.382))
    at, _ = interpolate(as_if_the_axle_were_there, gps_of(carpark).stamp_ns[20:])
    assert np.hypot(*(at.position[-1] - gps_of(carpark).position[-1])) > 5.0


# The truck ------------------------------------------------------------------------------------


def test_the_left_wheel_is_slower_than_the_axle_in_a_left_turn() -> None:
    # Circle of 10 m to the middle of the axle: the left wheel is at 10 - H.
    base, left = TRUCK.config.wheel_base_m, TRUCK.config.encoder_left_m
    steering = np.arctan2(base, [10.0, -10.0, np.inf])
    steering[1] -= np.pi
    wheel = 2.0 * np.array([10.0 - left, 10.0 + left, 10.0]) / 10.0
    moved = TRUCK.velocities(wheel, steering)
    np.testing.assert_allclose(moved[:, 0], 2.0, rtol=1e-15)
    np.testing.assert_allclose(moved[:, 1], [0.2, -0.2, 0.0], rtol=1e-15)
    back = TRUCK.velocities(-wheel, steering)
    np.testing.assert_array_equal(back, -moved)


def test_a_truck_that_steers_across_its_way_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "drive.csv"
    file.write_text("t_s,speed_encoder_mps,steering_rad\n1.0,2.0,0.1\n1.1,2.0,1.6\n")
    with pytest.raises(LogError, match=r"drive\.csv: .*steering is 1\.6"):
        truck_odometry(file)


# Arena ----------------------------------------------------------------------------------------


def test_lego_arena_has_the_rows_and_figures_of_its_notes(arena: Log) -> None:
    assert rows_in(arena) == {
        "odometry": 167 - 37, "scans": 167, "truth": 167, "landmarks": 6
    }  # fmt: skip
    assert arena["scans"]["ranges_m"].shape == (167, 660)
    assert arena["scans"]["stamp_ns"][0] == 315_000_000
    assert arena["scans"]["ranges_m"][0, :2].tolist() == [0.189, 0.186]
    assert np.isnan(arena["scans"]["ranges_m"]).sum() == 22
    assert "heading_rad" not in arena["truth"]
    assert (arena["truth"]["x_m"][-1], arena["truth"]["y_m"][-1]) == (0.656, 0.988)
    assert driven_m(arena) == pytest.approx(5.1, abs=0.05)


def arena_errors(log: Log) -> FloatArray:
    track = reckoned(log, (1.850, 1.897, np.deg2rad(213.5)))
    off = errors_against(track, truth_in(log)).position
    return distances(off, np.zeros_like(off))


def test_lego_arena_is_dead_reckoned_as_its_notes_say(arena: Log) -> None:
    errors = arena_errors(arena)
    assert (errors.mean(), errors[-1], errors.max()) == pytest.approx(
        (0.043, 0.042, 0.095), abs=5e-4
    )
    turned = {**arena["odometry"]}
    turned["dheading_rad"] = turned["dheading_rad"] * 173.0 / 155.0
    narrow = replace(arena, tables={**arena.tables, "odometry": turned})
    # The notes say 0.43 m of the whole drive.
    assert arena_errors(narrow).mean() == pytest.approx(0.17, abs=0.005)


def test_lego_arena_has_the_axle_under_its_camera(arena: Log) -> None:
    heading = np.deg2rad(213.0)
    forward = 0.03
    back = forward * np.array([np.cos(heading), np.sin(heading)])
    track = reckoned(arena, (1.850 - back[0], 1.897 - back[1], heading))
    scanner = replace(track, position=carried(track, forward, 0.0))
    errors = np.hypot(*errors_against(scanner, truth_in(arena)).position.T)
    assert errors.mean() == pytest.approx(0.062, abs=5e-4)


def arcs_in(log: Log) -> FloatArray:
    """Return what stands out in the scans at places of the truth, shape (n, 3).

    Nearest range, distance of the nearest cylinder's centre, half the angle of the beams.
    """
    laser, scans, places = log.laser, log["scans"], log["landmarks"]
    assert laser is not None
    centres = np.column_stack([places["x_m"], places["y_m"]])
    true, known = interpolate(truth_in(log), scans["stamp_ns"])
    track = reckoned(log, (1.850, 1.897, np.deg2rad(213.5)))
    rough, given = interpolate(track, scans["stamp_ns"])
    both = known & given
    assert rough.heading is not None
    poses = Trajectory(
        scans["stamp_ns"][both], true.position[given[known]], rough.heading[known[given]]
    )
    forward, left, turned = laser["pose_in_body"]
    beams = laser["angle_min_rad"] + laser["angle_increment_rad"] * np.arange(660)
    assert poses.heading is not None
    found = []
    for eye, heading, scan in zip(
        carried(poses, forward, left), poses.heading + turned, scans["ranges_m"][both], strict=True
    ):
        edges = np.flatnonzero(np.abs(np.diff(np.nan_to_num(scan))) > 0.1)
        for first, last in zip(edges[:-1] + 1, edges[1:], strict=True):
            if min(scan[first - 1] - scan[first], scan[last + 1] - scan[last]) > 0.1:
                nearest = scan[first : last + 1].min()
                angle = heading + beams[first : last + 1].mean()
                end = eye + (nearest + 0.055) * np.array([np.cos(angle), np.sin(angle)])
                cylinder = np.linalg.norm(centres - end, axis=1).argmin()
                if np.linalg.norm(centres[cylinder] - end) < 0.25:
                    half = 0.5 * (last - first + 1) * laser["angle_increment_rad"]
                    found.append([nearest, np.linalg.norm(centres[cylinder] - eye), half])
    return np.array(found)


def test_lego_arena_has_cylinders_of_their_radius_and_ranges_that_are_short(arena: Log) -> None:
    nearest, distance, half = arcs_in(arena).T
    assert len(nearest) > 450
    short = distance - 0.055 - nearest
    for low, high, expected in ((0.0, 0.6, 0.03), (0.6, 1.5, 0.07), (1.5, 2.5, 0.12)):
        rows = (distance > low) & (distance < high)
        assert np.median(distance[rows] * np.sin(half[rows])) == pytest.approx(0.050, abs=0.001)
        assert np.median(short[rows]) == pytest.approx(expected, abs=0.005)
    assert np.unique(arena["landmarks"]["radius_m"]).tolist() == [0.055]


# Park -----------------------------------------------------------------------------------------


def test_victoria_park_has_the_rows_and_figures_of_its_notes(park: Logs) -> None:
    shared = {"odometry": 31962, "positions": 2320}
    assert rows_in(park["laser"]) == {**shared, "scans": 3741}
    assert rows_in(park["trees"]) == {**shared, "landmark_sightings": 30550}
    log = park["laser"]
    assert log["scans"]["ranges_m"].shape[1] == 361
    assert np.isnan(log["scans"]["ranges_m"]).mean() == pytest.approx(0.83, abs=0.005)
    assert np.nanmax(log["scans"]["ranges_m"]) == 81.7
    gaps = np.diff(log["positions"]["stamp_ns"]) / NANOSECONDS
    assert (gaps > 2.0).sum() == 36
    assert "truth" not in log
    assert "landmarks" not in log


def test_victoria_park_is_dead_reckoned_as_its_notes_say(park: Logs) -> None:
    log = park["laser"]
    gps = gps_of(log)
    x, y = gps.position[0].tolist()
    errors = antenna_errors(log, x, y, float(np.deg2rad(38.0)))
    first = (gps.stamp_ns >= log["odometry"]["stamp_ns"][0]) & (gps.stamp_ns < 60 * NANOSECONDS)
    assert errors[-1] == pytest.approx(133.0, abs=0.5)
    assert errors.mean() == pytest.approx(97.0, abs=0.5)
    assert errors[: first.sum()].mean() == pytest.approx(1.6, abs=0.02)
    assert driven_m(log) == pytest.approx(2200.0, abs=50.0)


def test_victoria_park_trees_are_where_the_raw_scan_is_short(park: Logs) -> None:
    seen, scans, laser = park["trees"]["landmark_sightings"], park["laser"]["scans"], TRUCK_LASER
    assert park["trees"].landmark_sensor == {"pose_in_body": laser["pose_in_body"]}
    assert np.unique(seen["landmark"]).tolist() == [""]
    row = np.searchsorted(scans["stamp_ns"], seen["stamp_ns"])
    np.testing.assert_array_equal(scans["stamp_ns"][row], seen["stamp_ns"])
    assert len(row) / len(scans["stamp_ns"]) == pytest.approx(8.2, abs=0.05)
    beam = (seen["bearing_rad"] - laser["angle_min_rad"]) / laser["angle_increment_rad"]
    raw = scans["ranges_m"][row, np.rint(beam).astype(np.intp)]
    with gzip.open(recording("victoria-park") / "trees_reference_detector.csv.gz", "rt") as file:
        diameter = np.loadtxt(file, delimiter=",", skiprows=1)[:, 3]
    off = np.abs(seen["range_m"] - raw - diameter / 2.0)
    assert np.mean(off < 0.1) > 0.9
    beside = np.clip(np.rint(beam).astype(np.intp) + 180, 0, 360)
    assert np.mean(np.abs(seen["range_m"] - scans["ranges_m"][row, beside]) < 1.0) < 0.2


# What is refused ------------------------------------------------------------------------------


def test_a_robot_whose_truth_is_of_another_day_is_refused(tmp_path: Path) -> None:
    source = damaged(recording("mrclam6"), tmp_path / "source", "Robot1_Groundtruth.dat.gz", 5, "")
    (source / "Robot1_Groundtruth.dat.gz").write_bytes(gzip.compress(b"7.0 1 2 3\n8.0 1 2 3\n"))
    with pytest.raises(LogError, match=r"Robot1_Odometry.dat.gz: no stamp within the time of"):
        convert("mrclam6", source, tmp_path / "out")
    assert not (tmp_path / "out").exists()
