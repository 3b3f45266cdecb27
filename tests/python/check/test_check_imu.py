# SPDX-License-Identifier: Apache-2.0
"""What is wrong with an IMU is named by the check."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.io.log_folder import FORCES, RATES
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, Log

WORLD = {
    "path": {"shape": "eight", "radius_m": 2, "speed_mps": 0.8},
    "duration_s": 60,
    "anchors": {"A": [0, 0, 2], "B": [10, 0, 2], "C": [10, 10, 2], "D": [0, 10, 2]},
    "tags": {"tag": [0, 0, 1]},
    "ranges": {"rate_hz": 2, "sigma_m": 0.1, "sigma_relative": 0},
    "poses": None,
    "imu": {"mount_deg": [178, 5, 90]},
}


@cache
def driven(output: str) -> tuple[RunConfig, Log]:
    config = parse_config({"simulation": {**WORLD, "odometry": {"output": output}},
                           "estimator": {"range": {"sigma_m": 0.1}}})  # fmt: skip
    return config, load_log(config, None, 2)


def changed(log: Log, **columns: Any) -> Log:
    return replace(log, tables={**log.tables, "imu": {**log["imu"], **columns}})


def in_degrees(log: Log) -> Log:
    return changed(log, **{name: np.degrees(log["imu"][name]) for name in RATES})


def mirrored(log: Log) -> Log:
    return changed(log, **{name: -log["imu"][name] for name in RATES})


def in_g(log: Log) -> Log:
    return changed(log, **{name: log["imu"][name] / 9.81 for name in FORCES})


def without_gravity(log: Log) -> Log:
    return changed(log, **{name: 0.0 * log["imu"][name] for name in FORCES})


def wheels_in_degrees(log: Log) -> Log:
    odometry = dict(log["odometry"])
    for name in ("dheading_rad", "omega_radps"):
        if name in odometry:
            odometry[name] = np.degrees(odometry[name])
    return replace(log, tables={**log.tables, "odometry": odometry})


def axes_exchanged(log: Log) -> Log:
    imu = without_gravity(log)["imu"]  # upside down and turned: the vertical is near z
    return changed(without_gravity(log), wx_radps=imu["wz_radps"], wz_radps=imu["wx_radps"])


def biased_at_rest(log: Log) -> Log:
    odometry = {key: values.copy() for key, values in log["odometry"].items()}
    for name in set(odometry) - {"stamp_ns"}:
        odometry[name][:100] = 0.0
    log = replace(log, tables={**log.tables, "odometry": odometry})
    return changed(log, wy_radps=log["imu"]["wy_radps"] + 2.0)


def with_gaps(log: Log) -> Log:
    kept = log["imu"]["stamp_ns"] // NANOSECONDS % 10 != 0
    return changed(log, **{key: values[kept] for key, values in log["imu"].items()})


@pytest.mark.parametrize("output", ["increments", "velocities"])
@pytest.mark.parametrize(
    ("wrong", "rule", "words"),
    [
        (in_degrees, "imu_against_wheels", "times as much"),
        (wheels_in_degrees, "imu_against_wheels", "times as much"),
        (mirrored, "imu_against_wheels", "the other way"),
        (axes_exchanged, "imu_against_wheels", "x axis"),
        (biased_at_rest, "imu_against_wheels", "while the wheels stand"),
        (in_g, "imu_gravity", "that is 1 g"),
        (without_gravity, "imu_gravity", "without gravity"),
        (with_gaps, "imu_gaps", "gaps between samples"),
    ],
)
def test_what_is_wrong_with_an_imu_is_named(wrong: Any, rule: str, words: str, output: str) -> None:
    config, log = driven(output)
    found = [f.what for f in check(config, wrong(log)).findings if f.rule == rule]
    assert any(words in what for what in found), found


@pytest.mark.parametrize("output", ["increments", "velocities"])
def test_a_good_one_is_not(output: str) -> None:
    config, log = driven(output)
    assert not [f for f in check(config, log).findings if f.rule.startswith("imu")]
    level = parse_config({"simulation": {**WORLD, "imu": {}, "duration_s": 20}})
    assert not [f for f in check(level).findings if f.rule.startswith("imu")]
