# SPDX-License-Identifier: Apache-2.0
"""Drives by laser and wheels without a map: simulated floors, and recordings where they are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import locfuse.core as lf
from locfuse.config.load import parse_config
from locfuse.eval.consistency import band
from locfuse.eval.dead_reckoning import dead_reckon
from locfuse.eval.errors import interpolate
from locfuse.eval.relations import relation_errors, relation_metrics
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.run.odometry import as_recorded, with_odometry
from locfuse.run.run import run
from locfuse.run.start import scans_of
from locfuse.sim.beams import cast
from locfuse.sim.maps import GENERATORS
from locfuse.types import (
    FREE,
    NANOSECONDS,
    FloatArray,
    GridMap,
    Log,
    LogError,
    Trajectory,
    wrap_angle,
)
from papers.datasets import convert
from support_live import assert_same
from support_runs import recording

SCAN_TO_SCAN = lf.ScanOdometryConfig(window_scans=1, key_distance_m=0.0, key_turn_rad=0.0)
LOCAL_MAP = lf.ScanOdometryConfig()
BEAMS = 360
AROUND = lf.LaserGeometry(lf.Pose2(), -math.pi, 2.0 * math.pi / BEAMS, 0.1, 20.0)


# Simulated floors ---------------------------------------------------------------------------------


def seen_from(grid: GridMap, pose: lf.Pose2, rng: np.random.Generator) -> lf.LaserScan:
    """Return a scan with 1 cm of noise."""
    angle: FloatArray = (
        pose.heading - math.pi + 2.0 * math.pi / BEAMS * np.arange(BEAMS, dtype=np.float64)
    )
    ranges = cast(grid, np.tile([pose.x, pose.y], (BEAMS, 1)), angle, 20.0)
    ranges[ranges > 19.9] = np.nan
    return lf.LaserScan(0, AROUND, ranges + rng.normal(0.0, 0.01, BEAMS))


def free_place(grid: GridMap, rng: np.random.Generator) -> FloatArray:
    """Return a point with half a metre of free space around it."""
    reach = math.ceil(0.5 / grid.resolution_m)
    while True:
        row = rng.integers(reach, grid.cells.shape[0] - reach)
        column = rng.integers(reach, grid.cells.shape[1] - reach)
        around = grid.cells[row - reach : row + reach + 1, column - reach : column + reach + 1]
        if (around == FREE).all():
            return grid.to_world(np.array([column + 0.5, row + 0.5]))


@pytest.mark.parametrize("floor", ["rooms", "hallways", "zhang"])
def test_covariance_is_calibrated_on_simulated_floors(floor: str) -> None:
    sigma = np.array([0.03, 0.03, 0.03])
    squared = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        grid = GENERATORS[floor](rng, (24.0, 14.0), 0.05)
        x, y = free_place(grid, rng)
        first = lf.Pose2(x, y, rng.uniform(-math.pi, math.pi))
        motion = lf.Pose2(*rng.uniform(-0.25, 0.25, 3))
        local_map = lf.LocalMap([(seen_from(grid, first, rng), lf.Pose2())])
        off = rng.normal(0.0, sigma)
        guess = lf.Pose2(motion.x + off[0], motion.y + off[1], motion.heading + off[2])
        match = local_map.match(seen_from(grid, first * motion, rng), guess, np.diag(sigma**2))
        assert match.converged
        assert match.covariance is not None
        error = lf.local(match.pose, motion)
        squared.append(float(error @ np.linalg.solve(match.covariance, error)))
    low, high = band(dof=3, count=len(squared), probability=0.99)
    print(f"{floor}: NEES {np.mean(squared):.2f} in {low:.2f} to {high:.2f}")
    assert low < np.mean(squared) < high


# Logs ---------------------------------------------------------------------------------------------


def scan_odometry(
    log: Log, config: lf.ScanOdometryConfig | None = None, noise: lf.OdometryConfig | None = None
) -> Trajectory:
    """Return the drive by the scans of a log, every pose from what was known by then.

    For a whole log: where a scan lies between two rows of the wheels both count.
    """
    scans = {scan.stamp: scan for scan in scans_of(log)}
    wheels = dead_reckon(log["odometry"])
    stamps = np.array(sorted(scans), np.int64)
    inside = (stamps >= wheels.stamp_ns[0]) & (stamps <= wheels.stamp_ns[-1])
    stamps = np.union1d(wheels.stamp_ns, stamps[inside])
    at, _ = interpolate(wheels, stamps, longest_gap_s=1e9)
    assert at.heading is not None
    rows = np.column_stack([at.position, at.heading]).tolist()

    model = lf.OdometryMotion(noise or lf.OdometryConfig())
    odometry = lf.ScanOdometry(config or lf.ScanOdometryConfig())
    moved, covariance = lf.Pose2(), np.zeros((3, 3))  # since the last scan
    fitted = lf.Pose2()  # there
    last, reported_ns = lf.Pose2(*rows[0]), int(stamps[0])
    poses = []
    for stamp, row in zip(stamps.tolist(), rows, strict=True):
        wheel = lf.Pose2(*row)
        step = model.propagate(moved, last.inverse() * wheel, (stamp - reported_ns) / NANOSECONDS)
        covariance = step.jacobian @ covariance @ step.jacobian.T + step.noise
        moved, last, reported_ns = step.moved, wheel, stamp
        if stamp in scans:
            fitted = odometry.on(scans[stamp], moved, covariance).pose
            moved, covariance = lf.Pose2(), np.zeros((3, 3))
        pose = fitted * moved
        poses.append((pose.x, pose.y, pose.heading))
    path = np.array(poses)
    return Trajectory(stamps, path[:, :2], path[:, 2])


def small_log() -> Log:
    """Return a drive of 2 s along x in a room; the wheels turn 0.02 rad each step of 5 cm."""
    rng = np.random.default_rng(3)
    cells = np.zeros((162, 202), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[100:120, 40:60] = 100
    grid = GridMap(cells, 0.05)
    stamp_ns = np.arange(21) * 100_000_000
    scans = [seen_from(grid, lf.Pose2(4.0 + 0.05 * k, 4.0, 0.0), rng).ranges for k in range(21)]
    return Log(
        tables={
            "odometry": {
                "stamp_ns": stamp_ns,
                "dx_m": np.full(21, 0.05),
                "dy_m": np.zeros(21),
                "dheading_rad": np.full(21, 0.02),
            },
            "scans": {"stamp_ns": stamp_ns + 50_000_000, "ranges_m": np.array(scans)},
        },
        laser={
            "pose_in_body": [0.0, 0.0, 0.0],
            "angle_min_rad": -math.pi,
            "angle_increment_rad": 2.0 * math.pi / BEAMS,
            "range_min_m": 0.1,
            "range_max_m": 20.0,
        },
    )


def test_a_drive_by_scans_is_straight_though_the_wheels_turn() -> None:
    log = small_log()
    path = scan_odometry(log)
    assert path.heading is not None
    assert len(path) == 21 + 20  # the last scan comes after the odometry
    np.testing.assert_allclose(path.position[-1], [0.99, 0.0], atol=0.02)
    assert abs(path.heading[-1]) < 0.02
    held = {
        "stamp_ns": log["odometry"]["stamp_ns"],
        "v_mps": np.full(21, 0.5),
        "omega_radps": np.full(21, 0.2),
    }
    again = scan_odometry(Log(tables={**log.tables, "odometry": held}, laser=log.laser))
    np.testing.assert_allclose(again.position, path.position, atol=0.02)


# Recordings ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def intel(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Return the drive with all of its scans."""
    out = tmp_path_factory.mktemp("intel")
    test, mapping = (read_log(run) for run in convert("intel_lab", recording("intel-lab"), out))
    columns = {
        name: np.concatenate([test["scans"][name], mapping["scans"][name]])
        for name in ("stamp_ns", "ranges_m")
    }
    return Log(tables={**test.tables, "scans": columns}, laser=test.laser)


@pytest.mark.parametrize("config", [SCAN_TO_SCAN, LOCAL_MAP], ids=["scan_to_scan", "local_map"])
def test_the_intel_lab_is_driven_better_than_by_wheels(
    intel: Log, config: lf.ScanOdometryConfig
) -> None:
    by_wheels = dead_reckon(intel["odometry"])
    found = {}
    for name, path in (("wheels", by_wheels), ("scans", scan_odometry(intel, config))):
        found[name] = relation_metrics(relation_errors(path, intel["relations"]))
        for span in ("short", "loop"):
            part = found[name][span]
            print(f"{name}, {span}: {part['translation_mean_m']:.4f} m, "
                  f"{part['rotation_mean_deg']:.2f} deg")  # fmt: skip
    assert found["scans"]["short"]["count"] == 1733
    assert found["scans"]["short"]["translation_mean_m"] < 0.032
    assert found["scans"]["short"]["rotation_mean_deg"] < 1.2
    assert found["scans"]["loop"]["translation_mean_m"] < 1.5
    assert found["wheels"]["short"]["translation_mean_m"] > 0.035  # what the bounds must break
    assert found["wheels"]["short"]["rotation_mean_deg"] > 1.7


def relative_errors(path: Trajectory, truth: Trajectory, seconds: float) -> tuple[float, float]:
    """Return the mean errors of relative poses over some seconds, metres and degrees."""
    at, inside = interpolate(path, truth.stamp_ns, 2.5)
    assert at.heading is not None
    assert truth.heading is not None
    begin = np.flatnonzero(inside)
    end = np.searchsorted(at.stamp_ns, at.stamp_ns + round(seconds * 1e9))
    begin, rows, end = begin[end < len(at)], np.flatnonzero(end < len(at)), end[end < len(at)]
    last = np.flatnonzero(inside)[end]

    def relative(
        position: FloatArray, heading: FloatArray, a: NDArray[np.intp], b: NDArray[np.intp]
    ) -> FloatArray:
        dx, dy = (position[b] - position[a]).T
        c, s = np.cos(heading[a]), np.sin(heading[a])
        return np.array([c * dx + s * dy, c * dy - s * dx, heading[b] - heading[a]])

    error = relative(at.position, at.heading, rows, end) - relative(
        truth.position, truth.heading, begin, last
    )
    return (
        float(np.mean(np.hypot(error[0], error[1]))),
        float(np.rad2deg(np.mean(np.abs(wrap_angle(error[2]))))),
    )


@pytest.mark.parametrize(
    ("dataset", "folder", "bounds"),  # of the mean errors over 2 s and 10 s: metres, degrees
    [
        ("mrpt_office", "mrpt-uwb-lidar", {2.0: (0.035, 0.5), 10.0: (0.075, 1.1)}),
        ("turtlebot4_mac", "turtlebot4-mac", {2.0: (0.025, 0.7), 10.0: (0.06, 1.2)}),
        ("wean_hall", "wean-hall", {2.0: (0.055, 0.8), 10.0: (0.19, 1.4)}),
    ],
)
def test_other_lasers_are_followed_with_better_headings_than_by_wheels(
    dataset: str, folder: str, bounds: dict[float, tuple[float, float]], tmp_path: Path
) -> None:
    log = read_log(convert(dataset, recording(folder), tmp_path)[-1])
    truth = truth_of(log)
    assert truth is not None
    paths = {
        "wheels": dead_reckon(log["odometry"]),
        "scan to scan": scan_odometry(log, SCAN_TO_SCAN),
        "local map": scan_odometry(log),
    }
    for seconds, (metres, degrees) in bounds.items():
        found = {name: relative_errors(path, truth, seconds) for name, path in paths.items()}
        for name, (off, turned) in found.items():
            print(f"{dataset}, {seconds:g} s, {name}: {off:.3f} m, {turned:.2f} deg")
        assert found["local map"][0] < metres
        assert found["local map"][1] < min(degrees, found["wheels"][1])


# As the odometry of a run ------------------------------------------------------------------------


def test_a_run_takes_its_odometry_from_scans_with_and_without_wheels() -> None:
    log = small_log()
    config = parse_config({"scan_odometry": {}, "start": [0, 0, 0]})
    for tables in (log.tables, {"scans": log["scans"]}):
        result = run(config, Log(tables=dict(tables), laser=log.laser))
        assert result.estimate.heading is not None
        np.testing.assert_allclose(result.estimate.position[-1], [1.0, 0.0], atol=0.02)
        assert abs(result.estimate.heading[-1]) < 0.02
        assert result.metrics["counts"]["odometry"] == {"fused": 20}


def test_it_is_the_same_live_and_a_late_scan_counts_where_it_belongs() -> None:
    config = parse_config({"scan_odometry": {}, "start": [0, 0, 0]})
    log = small_log()
    assert_same(config, log, least=0.8)
    in_time = {**log["scans"], "arrival_ns": log["scans"]["stamp_ns"]}
    expected = run(config, Log(tables={**log.tables, "scans": in_time}, laser=log.laser))
    late = {**in_time, "arrival_ns": in_time["stamp_ns"].copy()}
    late["arrival_ns"][5] += 250_000_000
    late_log = Log(tables={**log.tables, "scans": late}, laser=log.laser)
    result = run(config, late_log)
    assert result.estimate.position[-1].tolist() == expected.estimate.position[-1].tolist()
    assert result.metrics["counts"]["odometry"] == {"fused": 20}  # one row each
    assert_same(config, late_log, least=0.7)
    for name in ("stamp_ns", "dx_m", "dy_m", "dheading_rad"):  # as it was at the end
        assert result.log["odometry"][name].tolist() == expected.log["odometry"][name].tolist()


def test_a_latency_of_wheels_is_not_that_of_scans() -> None:
    """Late wheels with their latency are wheels in time; the motion of scans is not moved."""
    log = small_log()
    odometry = {**log["odometry"], "stamp_ns": log["odometry"]["stamp_ns"] + 30_000_000}
    arrival = np.concatenate([log["odometry"]["stamp_ns"][:1], log["odometry"]["stamp_ns"][:-1]])
    late = Log(tables={**log.tables, "odometry": {**odometry, "arrival_ns": arrival}},
               laser=log.laser)  # fmt: skip
    given = {"scan_odometry": {}, "start": [0, 0, 0],
            "estimator": {"odometry": {"latency_s": 0.03}}}  # fmt: skip
    expected = run(parse_config({"scan_odometry": {}, "start": [0, 0, 0]}), log).estimate
    found = run(parse_config(given), late).estimate
    assert found.stamp_ns.tolist() == expected.stamp_ns.tolist()
    assert np.array_equal(found.position, expected.position)
    assert_same(parse_config(given), late, least=0.8)


def test_scan_odometry_without_scans_is_one_sentence() -> None:
    config = parse_config({"scan_odometry": {}, "start": [0, 0, 0]})
    with pytest.raises(LogError, match="needs scans and a laser"):
        run(config, Log(tables={"odometry": small_log()["odometry"]}))


@pytest.mark.parametrize(
    # Bounds of the mean errors over 10 s: metres with wheels and without, degrees. A long hallway
    # shows no scan how far it has come along.
    ("dataset", "folder", "metres", "alone", "degrees"),
    [
        ("mrpt_office", "mrpt-uwb-lidar", 0.09, 0.09, 1.2),
        ("turtlebot4_mac", "turtlebot4-mac", 0.06, 0.06, 1.2),
        ("wean_hall", "wean-hall", 0.24, 0.8, 1.6),
    ],
)
def test_the_odometry_of_a_run_follows_recordings_without_wheels(
    dataset: str, folder: str, metres: float, alone: float, degrees: float, tmp_path: Path
) -> None:
    log = read_log(convert(dataset, recording(folder), tmp_path)[-1])
    truth = truth_of(log)
    assert truth is not None
    config = parse_config({"scan_odometry": {}, "start": [0, 0, 0]})
    blind = replace(log, tables={name: table for name, table in log.tables.items()
                                 if name != "odometry"})  # fmt: skip
    found = {
        name: relative_errors(
            dead_reckon(as_recorded(with_odometry(each, config), 2.0)["odometry"]), truth, 10.0
        )
        for name, each in (("with wheels", log), ("without", blind))
    }
    found["wheels"] = relative_errors(dead_reckon(log["odometry"]), truth, 10.0)
    for name, (off, turned) in found.items():
        print(f"{dataset}, 10 s, {name}: {off:.3f} m, {turned:.2f} deg")
    for name, most in (("with wheels", metres), ("without", alone)):
        assert found[name][0] < most
        assert found[name][1] < min(degrees, found["wheels"][1])
