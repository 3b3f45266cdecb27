# SPDX-License-Identifier: Apache-2.0
"""What is wrong with an altimeter is named by the check."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import load_log
from locfuse.types import FloatArray, Log

WORLD = {
    "simulation": {
        "duration_s": 40,
        "odometry": None,
        "poses": None,
        "ranges": None,
        "positions": {},
        "flight": {"height_m": 20, "swing_m": 3, "period_s": 20},
        "altitudes": {"rate_hz": 10, "sigma_m": 0.2, "altimeter_up_m": 0.5},
    },
    "estimator": {"kind": "air", "air": {"altitude": {"altimeter_up_m": 0.5}}},
}


@cache
def flown() -> tuple[RunConfig, Log]:
    config = parse_config(WORLD)
    return config, load_log(config, None, 2)


def found(height: FloatArray, truth: bool = True, kind: str = "air") -> list[str]:
    """Return what is said of altitudes (n,)."""
    config, log = flown()
    tables: dict[str, Any] = {**log.tables, "altitudes": {**log["altitudes"], "height_m": height}}
    if not truth:
        tables["truth"] = {key: log["truth"][key] for key in log["truth"] if key != "z_m"}
    if kind != "air":
        config = parse_config({"start": "truth"})
    findings = check(config, replace(log, tables=tables)).findings
    return [f.what for f in findings if f.rule == "implausible_altitudes"]


def measured() -> FloatArray:
    return flown()[1]["altitudes"]["height_m"].astype(np.float64)


def test_a_good_altimeter_is_not_named() -> None:
    assert found(measured()) == []
    outliers = measured()
    outliers[::37] += 30.0
    assert found(outliers) == []  # the gate is for them


def test_a_flight_that_hovers_on_the_millimetre_is_no_unit() -> None:
    rng = np.random.default_rng(3)
    assert found(20.5 + 0.001 * rng.standard_normal(len(measured())), truth=False) == []


@pytest.mark.parametrize("truth", [True, False])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda height: 1000.0 * height, "millimetres"),
        (lambda height: np.full(len(height), 20.5), "altitudes are 20.5 m"),
        (lambda height: height + 5.0 * (np.arange(len(height)) > 200), "m after 20 s and stay"),
    ],
)
def test_what_is_wrong_is_named(change: Any, words: str, truth: bool) -> None:
    (what, *_) = found(change(measured()), truth)
    assert words in what


def test_an_offset_is_named_against_the_reference_alone() -> None:
    (what,) = found(measured() + 4.0)
    assert "off the reference" in what
    assert found(measured() + 4.0, truth=False) == []


def test_no_altimeter_of_another_kind_is_looked_at() -> None:
    assert found(1000.0 * measured(), kind="pose") == []


def test_altitudes_place_nothing_in_the_plane() -> None:
    config, log = flown()
    alone = config.model_copy(update={"use": ["odometry", "altitudes"]})
    driven = {"stamp_ns": log["truth"]["stamp_ns"], "v_mps": np.zeros(len(log["truth"]["x_m"])),
              "omega_radps": np.zeros(len(log["truth"]["x_m"]))}  # fmt: skip
    findings = check(alone, replace(log, tables={**log.tables, "odometry": driven})).findings
    assert any("position and heading are unobservable" in f.what for f in findings)
