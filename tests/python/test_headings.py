# SPDX-License-Identifier: Apache-2.0
"""Robots outdoors: wheels, a gyro, fixes, and headings that nobody set up."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.eval.errors import errors_against
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.io.rosbag.decode import HeadingRow, MessageError, course, heading
from locfuse.run.run import load_log, run
from locfuse.types import FloatArray, RunResult

SEEDS = range(40, 52)
FIELD: dict[str, Any] = {
    "room_m": [80, 80],
    "path": {"shape": "eight", "speed_mps": 1.5, "radius_m": 15, "center_m": [40, 40]},
    "duration_s": 120,
    "odometry": {"rate_hz": 20, "output": "velocities", "sigma_heading_per_sqrt_m": 0.03,
                 "sigma_heading_per_sqrt_rad": 0.05},
    "ranges": None,
    "poses": None,
    "positions": {"rate_hz": 1, "sigma_xy_m": 1.0, "antenna_forward_m": 0.3},
    "imu": {"rate_hz": 50, "bias_radps": 0.01},
}  # fmt: skip
ANTENNA = {"estimator": {"position": {"antenna_forward_m": 0.3}}}
OTHERS = ["odometry", "ranges", "positions", "imu"]
COMPASS: dict[str, Any] = {"rate_hz": 10, "sigma_deg": 2, "offset_deg": -120}
COURSE: dict[str, Any] = {"rate_hz": 5, "sigma_deg": 4, "kind": "course"}


def runs(headings: dict[str, Any] | None, **changes: Any) -> Iterator[RunResult]:
    for seed in SEEDS:
        simulation = {**FIELD, "headings": headings}
        yield run(
            parse_config(
                {"simulation": simulation, "seed": seed, "start": "auto", **ANTENNA, **changes}
            )
        )


def errors_of(result: RunResult) -> FloatArray:
    """Return how far x, y and heading are off at each stamp of the estimate."""
    assert result.truth is not None
    found = errors_against(result.estimate, result.truth)
    assert found.heading is not None
    assert len(found.heading) == len(result.estimate)
    off: FloatArray = np.column_stack([found.position, found.heading])
    return off


def beyond_level(result: RunResult, state: str = "") -> float:
    """Return the share of the time beyond the protection level, of that in a state of health."""
    health = result.health
    assert health is not None
    stamp = result.estimate.stamp_ns
    row = np.maximum(np.searchsorted(health.stamp_ns, stamp, side="right") - 1, 0)
    beyond = (np.abs(errors_of(result)) > health.protection[row]).any(axis=1)
    return float((beyond & np.char.startswith(health.state[row], state)).mean())


@pytest.mark.parametrize("headings", [COMPASS, COURSE], ids=["compass", "course"])
def test_wheels_gyro_orientation_and_gps_start_by_themselves(headings: dict[str, Any]) -> None:
    """No more than 5 % of fixes are rejected, and no heading is biased, whatever the compass is."""
    bias, nees, beyond, ready_m, gated, fixes = [], [], [], [], 0, 0
    for result in runs(headings):
        counts = result.metrics["counts"]["positions"]
        gated += counts.get("gated", 0)
        fixes += sum(counts.values())
        ready_m.append(1.5 * result.metrics["start_s"])
        nees.append(result.metrics["nees_mean"])
        beyond.append(beyond_level(result))
        errors = errors_of(result)[:, 2]
        bias.append(float(np.mean(errors[len(errors) // 4 :])))
    assert gated / fixes <= 0.05
    assert sum(way <= 20.0 for way in ready_m) >= 11  # of 12; one was 31 m where two fixes were off
    assert abs(np.mean(bias)) < 3.0 * np.std(bias) / np.sqrt(len(bias)) + 0.002
    assert 0.7 < np.mean(nees) < 5.0  # of 3: cautious, as errors of fixes may stay
    assert np.mean(beyond) <= 0.015


CALIBRATED = {"least_sigma_rad": 0.01}, {"sigma_heading_offset_rad_per_sqrt_s": 0.002}


def test_a_compass_makes_the_heading_better() -> None:
    heading, calibration = CALIBRATED
    known = {"estimator": {**ANTENNA["estimator"], "heading": heading, "calibration": calibration}}
    said, plain, known_to_be_good = (
        np.sqrt(np.mean([np.mean(errors_of(result)[1200:, 2] ** 2) for result in made]))
        for made in (runs(COMPASS), runs(None), runs(COMPASS, **known))
    )
    assert said < 0.85 * plain
    assert known_to_be_good < 0.5 * plain


def test_its_noise_by_half_and_double_does_not_mislead() -> None:
    for sigma in (0.5, 2.0):
        said = {"estimator": {**ANTENNA["estimator"], "heading": {"least_sigma_rad": 0.1 * sigma}}}
        assert np.mean([beyond_level(result) for result in runs(COMPASS, **said)]) <= 0.015


ERRORS: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "hard iron": lambda t, heading: np.radians(20) * np.sin(heading),
    "soft iron": lambda t, heading: np.radians(10) * np.sin(2 * heading),
    "jump": lambda t, heading: np.radians(8) * (t > 60),
    "large jump": lambda t, heading: np.radians(90) * (t > 60),
    "15 deg for 30 s": lambda t, heading: np.radians(15) * ((t > 40) & (t < 70)),
    "drift": lambda t, heading: np.radians(20) * t / 60,
    "frozen": lambda t, heading: np.where(t > 60, -heading, 0.0),
}
INDOORS: dict[str, Any] = {
    **FIELD,
    "room_m": [10, 8],
    "path": {"shape": "eight", "speed_mps": 0.5, "radius_m": 1.5, "center_m": [5, 4]},
    "ranges": {"rate_hz": 10},
    "positions": None,
}


@pytest.mark.parametrize("name", ERRORS)
@pytest.mark.parametrize("place", [FIELD, INDOORS], ids=["field", "indoors"])
def test_a_compass_that_is_wrong_makes_nobody_sure_and_wrong(
    name: str, place: dict[str, Any]
) -> None:
    beyond, off, plain = [], [], []
    for seed in range(300, 306):
        given = {"seed": seed, "start": "auto", **(ANTENNA if place is FIELD else {})}
        config = parse_config({"simulation": {**place, "headings": COMPASS}, **given})
        log = load_log(config, None, seed)
        t, reads = log["headings"]["stamp_ns"] / 1e9, log["headings"]["heading_rad"]
        wrong = reads + ERRORS[name](t, reads - np.radians(COMPASS["offset_deg"]))
        table = {**log["headings"], "heading_rad": wrong}
        result = run(config, replace(log, tables={**log.tables, "headings": table}))
        beyond.append(beyond_level(result, "ok"))
        off.append(result.metrics["position_rmse_m"])
        plain.append(run(config.model_copy(update={"use": OTHERS}), log).metrics["position_rmse_m"])
    assert np.mean(beyond) <= 0.01
    assert np.mean(off) <= 1.5 * np.mean(plain) + 0.1


TOPICS: dict[str, dict[str, Any]] = {
    "own topics": {},
    "map turned from east": {"gps_origin": [48.0, 11.0, 90.0]},
    "topic of the gyro": {"topics": {"imu": "imu/data", "headings": "imu/data"}},
}


@pytest.mark.parametrize("ros", TOPICS.values(), ids=TOPICS)
@pytest.mark.parametrize("headings", [COMPASS, COURSE], ids=["compass", "course"])
@pytest.mark.parametrize("sigma", [True, False], ids=["", "without sigma"])
def test_a_bag_and_a_log_give_the_same(
    headings: dict[str, Any], ros: dict[str, Any], sigma: bool, tmp_path: Path
) -> None:
    simulation = {**FIELD, "duration_s": 20, "headings": headings}
    config = parse_config({"simulation": simulation, "seed": 4, "ros": ros})
    log = load_log(config, None, 4)
    if not sigma:
        table = {name: column for name, column in log["headings"].items() if name != "sigma_rad"}
        log = replace(log, tables={**log.tables, "headings": table})
    write_log(log, tmp_path / "log")
    write_bag(log, tmp_path / "drive.bag", config.ros)
    again, bag = read_log(tmp_path / "log"), read_bag(tmp_path / "drive.bag", config.ros)
    for column, values in log["headings"].items():
        np.testing.assert_array_equal(again["headings"][column], values)
        np.testing.assert_allclose(bag["headings"][column], values, rtol=1e-12, atol=1e-12)
    assert list(bag["headings"]) == list(log["headings"])


STAMP = Message(stamp=Message(sec=3, nanosec=0), frame_id="imu")


def orientation(z: float, w: float, first: float = 0.0, yaw: float = 0.01) -> Message:
    covariance = np.diag([first, 0.0, yaw]).ravel()
    return Message(header=STAMP, orientation=Message(x=0.0, y=0.0, z=z, w=w),
                   orientation_covariance=covariance)  # fmt: skip


def velocity(east: float, north: float, variance: float = 0.0) -> Message:
    flat = np.zeros(36)
    flat[[0, 7]] = variance
    linear = Message(x=east, y=north, z=0.0)
    return Message(header=STAMP, twist=Message(twist=Message(linear=linear), covariance=flat))


def test_what_drivers_say_is_understood() -> None:
    row: HeadingRow | None = heading(orientation(np.sin(0.4), np.cos(0.4)), None)
    assert row is not None
    assert row.heading_rad == pytest.approx(0.8)
    assert row.sigma_rad == pytest.approx(0.1)
    assert heading(orientation(0.0, 1.0, yaw=0.0), None).sigma_rad is None
    turned = heading(orientation(0.0, 1.0), (50.0, 8.0, 90.0))
    assert turned.heading_rad == pytest.approx(-np.pi / 2)
    with pytest.raises(MessageError, match="not measured"):
        heading(orientation(0.0, 1.0, first=-1.0), None)
    with pytest.raises(MessageError, match="no rotation"):
        heading(orientation(0.0, 0.0), None)
    row = course(velocity(0.0, 2.0, 0.04), None)
    assert row is not None
    assert [row.heading_rad, row.sigma_rad] == pytest.approx([np.pi / 2, 0.1])
    assert row.is_course
    assert course(velocity(0.1, 0.2), None) is None
    with pytest.raises(MessageError, match="twist"):
        course(velocity(np.nan, 0.2), None)


def test_one_topic_may_be_that_of_gyro_and_orientation(tmp_path: Path) -> None:
    config = parse_config({"ros": {"topics": {"imu": "imu/data", "headings": "imu/data"}}})
    assert config.ros.topics.of("imu") == config.ros.topics.of("headings")
