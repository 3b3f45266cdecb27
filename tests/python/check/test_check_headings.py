# SPDX-License-Identifier: Apache-2.0
"""Headings that turn the other way, are in degrees, or stand still are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from locfuse.check.registry import check
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import load_log
from locfuse.types import FloatArray, Log

CONFIG: dict[str, Any] = {
    "simulation": {
        "duration_s": 30,
        "path": {"shape": "eight", "speed_mps": 0.8, "radius_m": 2},
        "ranges": None,
        "poses": None,
        "positions": {},
        "headings": {"offset_deg": 50, "sigma_deg": 3},
    },
    "use": ["odometry", "positions", "headings"],
}


def driven() -> tuple[RunConfig, Log]:
    config = parse_config(CONFIG)
    return config, load_log(config, None, 3)


def said_of(change: Callable[[FloatArray], FloatArray]) -> list[str]:
    config, log = driven()
    table = {**log["headings"], "heading_rad": change(log["headings"]["heading_rad"])}
    log = replace(log, tables={**log.tables, "headings": table})
    found = check(config.model_copy(update={"simulation": None, "log": "x"}), log).findings
    return [f.what for f in found if f.rule == "headings_against_odometry"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda heading: np.pi / 2 - heading, "headings turn clockwise"),
        (np.degrees, "degrees?"),
        (lambda heading: -np.degrees(heading), "degrees?"),
        (lambda heading: 0.0 * heading, "headings follow 0% of the turns"),
        (lambda heading: 0.1 * heading, "of the turns"),
    ],
)
def test_wrong_headings_are_found(change: Callable[[FloatArray], FloatArray], said: str) -> None:
    (what,) = said_of(change)
    assert said in what


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda course: course + np.pi / 2, "courses point 90 deg beside the way"),
        (lambda course: np.pi / 2 - course, "courses turn clockwise"),
        (lambda course: 0.0 * course, "courses follow 0% of the turns"),
        (lambda course: course, ""),
    ],
)
def test_wrong_courses_are_found(change: Callable[[FloatArray], FloatArray], said: str) -> None:
    simulation = {**CONFIG["simulation"], "headings": {"kind": "course"}}
    config = parse_config({**CONFIG, "simulation": simulation})
    log = load_log(config, None, 3)
    table = {**log["headings"], "heading_rad": change(log["headings"]["heading_rad"])}
    log = replace(log, tables={**log.tables, "headings": table})
    found = check(config.model_copy(update={"simulation": None, "log": "x"}), log).findings
    rules = ("headings_against_odometry", "headings_against_the_way")
    what = [f.what for f in found if f.rule in rules]
    assert any(said in one for one in what) if said else what == []


def test_a_compass_that_is_said_to_be_known_and_is_not_is_found() -> None:
    known = {"estimator": {"calibration": {"sigma_heading_offset_rad": 0.05}}}
    simulation = {**CONFIG["simulation"], "positions": {"sigma_xy_m": 0.1}}
    config = parse_config({**CONFIG, **known, "simulation": simulation})
    log = load_log(config, None, 3)
    found = check(config.model_copy(update={"simulation": None, "log": "x"}), log).findings
    assert any("50 deg beside the one in which" in f.what for f in found)


@pytest.mark.parametrize("offset", [0.0, 1.5, -3.0])
def test_right_ones_are_not_whatever_their_offset(offset: float) -> None:
    assert said_of(lambda heading: np.angle(np.exp(1j * (heading + offset)))) == []
    assert said_of(lambda heading: np.unwrap(heading) + 40.0 + offset) == []
