# SPDX-License-Identifier: Apache-2.0
"""A robot that turns while its laser turns: where `mcl` and `scan_odometry` put the beams."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.scenario import Scenario
from locfuse.run.odometry import with_odometry
from locfuse.run.run import load_log, run
from locfuse.sim.beams import cast
from locfuse.sim.scenario import true_drive
from locfuse.types import NANOSECONDS, FloatArray, Log, RunResult, wrap_angle

RATE_HZ, BEAMS = 5.0, 360
LASER: dict[str, Any] = {"rate_hz": RATE_HZ, "beams": BEAMS, "range_max_m": 8.0}
FLOOR: dict[str, Any] = {
    "room_m": [12, 9],
    "map": {"generate": "rooms", "seed": 2},
    "path": {"shape": "roam", "speed_mps": 0.5, "turn_rate_radps": 1.5},
    "laser": LASER,
    "duration_s": 30.0,
    "anchors": {},
    "poses": None,
    "ranges": None,
}


def swept(log: Log, scenario: Scenario, seed: int, sweep_s: float = 1.0 / RATE_HZ) -> Log:
    """Return a log whose scans take a while: each beam from where the robot is at that moment.

    The stamp stays that of the middle, as in a log folder.
    """
    assert log.laser is not None
    assert log.grid is not None
    laser, stamps = log.laser, log["scans"]["stamp_ns"]
    drive = true_drive(scenario, seed, log.grid)
    each = sweep_s / BEAMS
    after: FloatArray = each * (np.arange(BEAMS, dtype=np.float64) - 0.5 * (BEAMS - 1))
    when = stamps[:, None] / NANOSECONDS + after
    inside = (when[:, 0] >= 0.0) & (when[:, -1] <= scenario.duration_s)
    when = when[inside]
    pose = drive.pose_at(when.ravel())
    angle = laser["angle_min_rad"] + laser["angle_increment_rad"] * np.arange(BEAMS)
    heading = pose[:, 2] + np.tile(angle, len(when))
    exact = cast(log.grid, pose[:, :2], heading, 8.1).reshape(when.shape)
    noise = 0.01 * np.random.default_rng(seed).standard_normal(exact.shape)
    ranges = np.where(exact + noise < 8.0, exact + noise, np.nan)
    tables = {**log.tables, "scans": {"stamp_ns": stamps[inside], "ranges_m": ranges}}
    return replace(log, tables=tables, laser={**laser, "time_increment_s": each})


STILL: dict[str, Any] = {"map": {"walls": [[3, 2, 5, 2], [8, 6, 8, 7.5], [2, 6, 3, 7]]}}
PATHS: dict[str, dict[str, Any]] = {
    "turns on the spot": {**STILL, "path": {"shape": "circle", "center_m": [6, 4],
                                            "radius_m": 0.001, "speed_mps": 0.0015}},
    "drives a circle": {**STILL, "path": {"shape": "circle", "center_m": [6, 4],
                                          "radius_m": 0.5, "speed_mps": 0.75}},
}  # fmt: skip
SEEDS = range(8)
# An ordinary robot: velocities at 50 Hz whose turn is by a gyro.
WHEELS = {"rate_hz": 50.0, "output": "velocities", "sigma_longitudinal_per_sqrt_m": 0.01,
          "sigma_heading_per_sqrt_m": 0.01, "sigma_heading_per_sqrt_rad": 0.01}  # fmt: skip


@cache
def driven(name: str, seed: int, turns: str) -> RunResult:
    """Return a run by particles, whose laser turns or sees all at once.

    `turns` is "at once", "known" or, where the log does not say so, "unknown".
    """
    simulation = {**FLOOR, **PATHS.get(name, {}), "odometry": WHEELS}
    config = parse_config({"simulation": simulation, "seed": seed, "mcl": {}, "start": "truth"})
    log = load_log(config, None, seed)
    assert config.simulation is not None
    if turns != "at once":
        log = swept(log, config.simulation, seed)
    if turns == "unknown":
        log = without_times(log)
    return run(config, log)


def without_times(log: Log) -> Log:
    assert log.laser is not None
    laser = {key: value for key, value in log.laser.items() if key != "time_increment_s"}
    return replace(log, laser=laser)


def heading_and_nees(name: str, turns: str) -> tuple[float, float]:
    """Return the heading RMSE [deg] and the mean NEES, of 3 degrees of freedom, over the seeds."""
    metrics = [driven(name, seed, turns).metrics for seed in SEEDS]
    heading = np.sqrt(np.mean([m["heading_rmse_deg"] ** 2 for m in metrics]))
    assert {m["nees_dof"] for m in metrics} == {3}
    return float(heading), float(np.mean([m["nees_mean"] for m in metrics]))


BEGINS = pytest.mark.xfail(strict=True, reason="a turn that begins or ends within a scan is taken "
                           "for one that lasts for all of it")  # fmt: skip


@pytest.mark.parametrize("name", [*PATHS, pytest.param("roams", marks=BEGINS)])
def test_heading_of_a_robot_that_turns_while_its_laser_does(name: str) -> None:
    for turns in ("at once", "known", "unknown"):
        heading, nees = heading_and_nees(name, turns)
        print(f"{name}, beams {turns}: heading {heading:.3f} deg, NEES {nees:.2f}")
    heading, nees = heading_and_nees(name, "known")
    assert heading <= 0.4
    assert nees < 5.0
    assert heading_and_nees(name, "unknown")[0] > 0.4


def drift_deg(name: str, seed: int, times: bool) -> float:
    """Return how far the heading by scan odometry is off after 30 s."""
    simulation = {**FLOOR, **PATHS[name], "odometry": WHEELS}
    config = parse_config({"simulation": simulation, "seed": seed, "scan_odometry": {}})
    assert config.simulation is not None
    log = swept(load_log(config, None, seed), config.simulation, seed)
    made = with_odometry(log if times else without_times(log), config)["odometry"]
    drive = true_drive(config.simulation, seed, log.grid)
    ends = drive.pose_at(made["stamp_ns"][[0, -1]] / NANOSECONDS)[:, 2]
    turned = float(np.sum(made["dheading_rad"][1:]))
    return abs(math.degrees(float(wrap_angle(turned - (ends[1] - ends[0])))))


@pytest.mark.parametrize("name", PATHS)
def test_scan_odometry_knows_when_beams_are_measured(name: str) -> None:
    """It turns by 45 rad in that time; at 1.5 rad/s each scan is sheared by 17 degrees."""
    known = [drift_deg(name, seed, True) for seed in SEEDS]
    unknown = [drift_deg(name, seed, False) for seed in SEEDS[:2]]
    print(f"{name}: {np.max(known):.2f} deg, without times {np.min(unknown):.0f} deg")
    assert np.max(known) < 5.0
    assert np.min(unknown) > 20.0
