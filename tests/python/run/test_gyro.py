# SPDX-License-Identifier: Apache-2.0
"""A gyro beside the wheels, from every door."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.live import LiveRun
from locfuse.run.capsule import make_capsule, replay_capsule
from locfuse.run.odometry import with_odometry
from locfuse.run.run import load_log, run
from locfuse.sweep.runner import run_trials
from locfuse.types import Log, LogError
from support_adapter import Robot, assert_poses_are, later
from support_live import assert_same

# One of two wheels 0.4 m apart spins, and reports a fifth too much.
SLIPS = {"kind": "slip_episodes", "every_s": 20.0, "lasting_s": 3.0, "translation_factor": 1.1,
         "turn_radps": 0.4}  # fmt: skip
WORLD: dict[str, Any] = {
    "room_m": [20, 20],
    "path": {"shape": "eight", "radius_m": 4, "speed_mps": 0.8, "center_m": [10, 10]},
    "duration_s": 120.0,
    "anchors": {"A": [0, 0, 2], "B": [20, 0, 2], "C": [20, 20, 2], "D": [0, 20, 2]},
    "tags": {"tag": [0.2, 0, 1]},
    "ranges": {"rate_hz": 2, "sigma_m": 0.1, "sigma_relative": 0},
    "poses": None,
    "imu": {"mount_deg": [178, 5, 90]},
}


@cache
def driven(output: str = "increments", slips: bool = True, seed: int = 3) -> tuple[RunConfig, Log]:
    """Return a run of a robot with a gyro, its start given, and its log."""
    world = {**WORLD, "odometry": {"output": output}, "faults": [SLIPS] if slips else []}
    settings = {"seed": seed, "estimator": {"range": {"sigma_m": 0.1}}}
    log = load_log(parse_config({**settings, "simulation": world}), None, seed)
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    return parse_config({**settings, "start": [x, y, float(np.degrees(heading))]}), log


def without(config: RunConfig) -> RunConfig:
    return config.model_copy(update={"use": ["odometry", "ranges"]})


def test_a_gyro_halves_the_error_of_wheels_that_slip() -> None:
    with_it, without_it, nees = [], [], []
    for seed in range(1, 9):
        config, log = driven(seed=seed)
        result = run(config, log)
        with_it.append(result.metrics["position_rmse_m"])
        nees.append(result.metrics["nees_mean"])
        without_it.append(run(without(config), log).metrics["position_rmse_m"])
    assert np.mean(with_it) < 0.7 * np.mean(without_it)
    assert np.mean(nees) < 5.0


def test_slips_are_named() -> None:
    config, log = driven()
    outcomes = run(config, log).outcomes
    slips = np.char.startswith(outcomes.reason, "wheels slip")
    assert 0.02 < np.mean(slips[outcomes.source == "odometry"]) < 0.5
    assert set(outcomes.source[slips].tolist()) == {"odometry"}
    steady = run(*driven(slips=False)).outcomes
    assert np.mean(np.char.startswith(steady.reason, "wheels slip")) < 0.01


def test_the_log_stays_that_of_the_wheels() -> None:
    config, log = driven()
    assert np.array_equal(run(config, log).log["odometry"]["dheading_rad"],
                          log["odometry"]["dheading_rad"])  # fmt: skip
    turned = with_odometry(log, config)["odometry"]
    assert np.isfinite(turned["variance"][1:]).all()  # the first has no duration
    assert with_odometry(log, without(config)) is log


@pytest.mark.parametrize("output", ["increments", "velocities"])
def test_live(output: str) -> None:
    config, log = driven(output)
    stamp = log["odometry"]["stamp_ns"]
    odometry = {**log["odometry"], "arrival_ns": stamp}
    log = replace(log, tables={**log.tables, "odometry": odometry})
    assert_same(config, log)


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_nodes(ros: str) -> None:
    config, log = driven()
    config = config.model_copy(
        update={"ros": config.ros.model_copy(update={"estimate_at": "fused"})}
    )
    log = later(log)
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    arrival = {**log["odometry"], "arrival_ns": log["odometry"]["stamp_ns"]}
    log = replace(log, tables={**log.tables, "odometry": arrival})
    assert_poses_are(robot, run(config, log).estimate, least=0.8)


@pytest.mark.parametrize("bag", ["drive.bag", "drive.mcap"])
def test_bags_and_folders(bag: str, tmp_path: Path) -> None:
    config, log = driven()
    result = run(config, log)
    write_bag(result, tmp_path / bag, config.ros)
    again = read_bag(tmp_path / bag, config.ros)
    assert {k: v.tolist() for k, v in again["imu"].items() if k != "arrival_ns"} == {
        k: v.tolist() for k, v in log["imu"].items()
    }
    found = run(config, again).estimate
    assert found.position[-1].tolist() == pytest.approx(result.estimate.position[-1].tolist(),
                                                        abs=2e-3)  # fmt: skip
    write_log(log, tmp_path / "log")
    assert np.array_equal(run(config, read_log(tmp_path / "log")).estimate.position,
                          result.estimate.position)  # fmt: skip


def test_check_sweep_and_capsule() -> None:
    config, log = driven(slips=False)
    assert not [f for f in check(config, log).findings if f.severity != "note"]
    assert replay_capsule(make_capsule(config, log)) == []
    trials = run_trials(parse_config({"simulation": {**WORLD, "duration_s": 20.0}}), 2,
                        {"imu.turn": ["weighted", "average"]}, workers=1)  # fmt: skip
    assert len(trials) == 2


def test_a_gyro_alone_needs_its_z_axis_upwards(tmp_path: Path) -> None:
    level = {**WORLD, "imu": {"mount_deg": [0, 0, 0]}}
    log = load_log(parse_config({"seed": 2, "simulation": level}), None, 2)
    rates = {key: log["imu"][key] for key in ("stamp_ns", "wx_radps", "wy_radps", "wz_radps")}
    write_log(replace(log, tables={**log.tables, "imu": rates}), tmp_path / "log")
    config = parse_config({"estimator": {"range": {"sigma_m": 0.1}}})
    result = run(config, read_log(tmp_path / "log"))
    assert result.metrics["position_rmse_m"] < 0.1


def test_live_refuses_a_sample_that_cannot_be() -> None:
    config, log = driven()
    live = LiveRun(config, log)
    row = {key: values[0] for key, values in log["imu"].items()}
    assert live.on("imu", row) == "ignored"
    with pytest.raises(ValueError, match=r"angular_rate .* expected a finite number"):
        live.on("imu", {**row, "wx_radps": np.nan})
    with pytest.raises(ValueError, match="wy_radps"):
        live.on("imu", {"stamp_ns": 1, "wx_radps": 0.0})


def test_files_in_other_units_are_refused(tmp_path: Path) -> None:
    _, log = driven()
    for column, value, words in (("wz_radps", 200.0, "rad/s"), ("ax_mps2", 1e5, "m/s")):
        imu = {**log["imu"], column: np.full(len(log["imu"]["stamp_ns"]), value)}
        with pytest.raises(LogError, match=words):
            write_log(replace(log, tables={**log.tables, "imu": imu}), tmp_path / "log")


@pytest.mark.parametrize("output", ["increments", "velocities"])
def test_late_samples_give_the_bits_of_the_sorted_log(output: str) -> None:
    config, log = driven(output)
    rng = np.random.default_rng(1)

    def arriving(late_share: float) -> Log:
        tables = dict(log.tables)
        for source in ("odometry", "ranges", "imu"):
            stamp = log[source]["stamp_ns"]
            is_late = (rng.random(len(stamp)) < late_share) & (source == "imu")
            arrival = stamp + np.where(is_late, 500_000_000, 0)
            tables[source] = {**log[source], "arrival_ns": arrival}
        return replace(log, tables=tables)

    expected, late = run(config, arriving(0.0)).estimate, arriving(0.2)
    found = run(config, late).estimate
    assert found.position[-1].tolist() == expected.position[-1].tolist()
    assert found.heading is not None
    assert expected.heading is not None
    assert found.heading[-1] == expected.heading[-1]
    assert_same(config, late)


@pytest.mark.parametrize("ahead_s", [-6.0, 4.0, 3600.0])
def test_a_gyro_with_another_clock_is_left_out_with_a_word(
    ahead_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    config, log = driven(slips=False)
    imu = {**log["imu"], "stamp_ns": log["imu"]["stamp_ns"] + round(ahead_s * 1e9)}
    ahead = replace(
        log, tables={**log.tables, "imu": {**imu, "arrival_ns": log["imu"]["stamp_ns"]}}
    )
    result = run(config, ahead)
    assert "hardly a motion of odometry has samples of imu near it" in caplog.text
    assert result.metrics["counts"]["odometry"]["fused"] >= len(log["odometry"]["stamp_ns"]) - 1
    assert result.metrics["position_rmse_m"] < 0.3
