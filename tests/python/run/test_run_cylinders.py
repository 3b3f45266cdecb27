# SPDX-License-Identifier: Apache-2.0
"""Cylinders in scans as sightings of a run: ready worlds, recordings, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from locfuse import _core
from locfuse.config.build import build_cylinder_detector
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import Cylinders
from locfuse.run.cylinders import with_cylinders
from locfuse.run.run import load_log, run
from locfuse.sim.scenario import simulate
from locfuse.types import ConfigError, Log, LogError
from support_live import assert_same
from support_runs import ROOT

CONFIGS = ROOT / "examples" / "configs"
FIELDS = [name for name in Cylinders.model_fields if name != "method"]
METHODS = ("arcs", "closest_beam", "cone")


def test_every_setting_is_one_of_the_detectors_with_its_default() -> None:
    default = _core.CylinderDetectorConfig()
    every = {name for name in dir(default) if not name.startswith("_")}
    assert every == {"method", *FIELDS, *Cylinders.fixed}
    assert {method.name.lower() for method in _core.CylinderMethod} == set(METHODS)
    assert Cylinders().method == default.method.name.lower()
    assert all(hasattr(default, name) for name in Cylinders.fixed)
    assert Cylinders().model_dump(exclude={"method"}) == {
        name: getattr(default, name) for name in FIELDS
    }


@pytest.mark.parametrize("name", FIELDS)
def test_a_setting_reaches_the_detector(name: str) -> None:
    value: Any = 3 if name == "least_beams" else 1.25
    config = build_cylinder_detector(Cylinders(**{name: value})).config
    others = {field: getattr(Cylinders(), field) for field in FIELDS if field != name}
    assert {field: getattr(config, field) for field in FIELDS} == {**others, name: value}


@pytest.mark.parametrize("name", FIELDS)
def test_the_schema_refuses_what_the_detector_refuses_and_nothing_else(name: str) -> None:
    values: list[Any] = [
        -math.inf,
        -1e10,
        -1.0,
        0.0,
        1e-7,
        1e-6,
        1e-3,
        0.5,
        1.0,
        1.5,
        1e6,
        1e160,
        math.inf,
        math.nan,
    ]
    if name == "least_beams":
        values = [-1, 0, 1, 7, 10**9, 2**31 - 1]
    for value in values:
        try:
            _core.CylinderDetector(_core.CylinderDetectorConfig(**{name: value}))
            core = True
        except ValueError:
            core = False
        try:
            Cylinders(**{name: value})
            schema = True
        except ValidationError:
            schema = False
        assert schema == core, value


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FIELDS)
def test_the_schema_refuses_what_a_method_has_no_use_for_as_the_detector_does(
    method: str, name: str
) -> None:
    values: dict[str, Any] = {"radius_m": 0.3, name: 3 if name == "least_beams" else 0.5}
    values["radius_m"] *= name != "radius_m"
    settings = {**values, "method": method}
    chosen = _core.CylinderMethod[method.upper()]
    unused = {"least_evidence", "least_corner_evidence", "leg_distance_m"}
    if method != "arcs" and (name == "radius_m" or (method == "cone" and name in unused)):
        with pytest.raises(ValidationError, match=name):
            Cylinders(**settings)
        with pytest.raises(ValueError, match=name):
            _core.CylinderDetector(_core.CylinderDetectorConfig(**values, method=chosen))
    else:
        config = build_cylinder_detector(Cylinders(**settings)).config
        assert (config.method, getattr(config, name)) == (chosen, values[name])


@pytest.mark.parametrize("method", ["closest_beam", "cone"])
@pytest.mark.parametrize("ready", ["wells_clean", "gadau_discs"])
def test_single_beams_locate_in_a_run_and_live_and_say_how_well(ready: str, method: str) -> None:
    config = load_config(CONFIGS / f"{ready}.yaml")
    assert config.cylinders is not None
    log = load_log(config, CONFIGS, config.seed)
    arcs = run(config, log).metrics
    sharp = with_cylinders(log, config)["landmark_sightings"]["sigma_bearing_rad"]
    other = config.cylinders.model_copy(update={"method": method})
    config = config.model_copy(update={"cylinders": other})
    figures = run(config, log).metrics
    assert 1.5 * arcs["position_rmse_m"] < figures["position_rmse_m"] < 0.02
    assert figures["heading_rmse_deg"] < 0.6
    assert 1.0 < figures["nees_mean"] < 5.0
    assert figures["nees_in_band"] > 0.85
    assert_same(config, log)
    # With the sigmas of arcs the same beams would be believed far too much.
    seen = with_cylinders(log, config)["landmark_sightings"]["sigma_bearing_rad"]
    assert np.median(seen) > 3.0 * np.median(sharp)


@pytest.mark.parametrize(
    ("ready", "position_m", "heading_deg"),
    [
        ("wells", 0.02, 0.5),
        ("wells_clean", 0.01, 0.3),
        ("gadau_discs", 0.01, 0.3),
        ("gadau_discs_8", 0.01, 0.5),
        ("gadau_standing", 0.003, 0.1),
    ],
)
def test_ready_worlds_tell_where_the_robot_is(
    ready: str, position_m: float, heading_deg: float
) -> None:
    config = load_config(CONFIGS / f"{ready}.yaml")
    figures = run(config, base=CONFIGS).metrics
    assert figures["position_rmse_m"] < position_m
    assert figures["heading_rmse_deg"] < heading_deg
    assert 1.0 < figures["nees_mean"] < 5.0
    # A radius that is wrong by half shows.
    assert config.cylinders is not None
    half = config.cylinders.model_copy(update={"radius_m": 0.5 * config.cylinders.radius_m})
    wrong = run(config.model_copy(update={"cylinders": half}), base=CONFIGS).metrics
    assert wrong["position_rmse_m"] > 5.0 * figures["position_rmse_m"]


def test_wells_learns_how_its_gyro_drifts() -> None:
    learnt = run(load_config(CONFIGS / "wells.yaml"), base=CONFIGS).metrics["calibration"]
    bias = learnt["turn bias"]
    assert abs(bias["value"] - 0.0087) < 3.0 * bias["sigma"] < 0.003


def test_the_laser_sees_discs_where_landmarks_are() -> None:
    config = load_config(CONFIGS / "gadau_discs.yaml")
    assert config.simulation is not None
    scenario = config.simulation.model_copy(update={"duration_s": 1.0})
    log = simulate(scenario, np.random.default_rng(0))
    bare = simulate(scenario.model_copy(update={"landmark_radius_m": 0.0}),
                    np.random.default_rng(0))  # fmt: skip
    assert log["landmarks"]["radius_m"].tolist() == [0.3] * 5
    assert "radius_m" not in bare["landmarks"]
    shorter = log["scans"]["ranges_m"] < bare["scans"]["ranges_m"] - 0.1
    x, y, heading = (log["truth"][name] for name in ("x_m", "y_m", "heading_rad"))
    rows = np.searchsorted(log["truth"]["stamp_ns"], log["scans"]["stamp_ns"])
    beam = -np.deg2rad(114.6) + np.deg2rad(229.2) / 150 * np.arange(151)
    poles = np.column_stack([log["landmarks"]["x_m"], log["landmarks"]["y_m"]])
    for row, at in enumerate(rows.tolist()):
        angle, reach = heading[at] + beam, log["scans"]["ranges_m"][row]
        ends = np.column_stack([x[at] + reach * np.cos(angle), y[at] + reach * np.sin(angle)])
        off = np.linalg.norm(ends[shorter[row]][:, None] - poles, axis=-1).min(axis=1)
        assert len(off) > 5
        assert np.abs(off - 0.3).max() < 0.05


def test_a_gyro_that_drifts_tells_more_turn() -> None:
    scenario = parse_config({"simulation": {"duration_s": 10}}).simulation
    assert scenario is not None
    assert scenario.odometry is not None
    drifting = scenario.odometry.model_copy(update={"turn_bias_radps": 0.1})
    turned = [
        float(simulate(scenario.model_copy(update={"odometry": sensor}), np.random.default_rng(1))
              ["odometry"]["dheading_rad"].sum())
        for sensor in (scenario.odometry, drifting)
    ]  # fmt: skip
    assert turned[1] - turned[0] == pytest.approx(1.0, abs=0.01)


def log_of(**edit: Any) -> tuple[Any, Log]:
    config = load_config(CONFIGS / "gadau_discs.yaml")
    assert config.simulation is not None
    short = config.simulation.model_copy(update={"duration_s": 2.0})
    config = config.model_copy(update={"simulation": short})
    return config, replace(load_log(config, CONFIGS, 0), **edit)


@pytest.mark.parametrize(("table", "key"), [("scans", "laser"), ("landmarks", "landmarks")])
def test_a_log_without_what_they_need_is_one_sentence(table: str, key: str) -> None:
    config, log = log_of()
    left = {name: columns for name, columns in log.tables.items() if name != table}
    with pytest.raises(LogError, match=rf"the log has no {table}; add simulation\.{key}, or leave"):
        run(config, replace(log, tables=left))


def test_sightings_of_its_own_are_not_replaced() -> None:
    config, log = log_of()
    seen = with_cylinders(log, config)
    assert set(seen["landmark_sightings"]["landmark"].tolist()) == {""}
    assert np.all(seen["landmark_sightings"]["sigma_range_m"] > 0.0)
    assert seen.landmark_sensor == {"pose_in_body": log.laser["pose_in_body"]}  # type: ignore[index]
    with pytest.raises(LogError, match=r"has landmark_sightings, which cylinders"):
        with_cylinders(seen, config)


def test_brightness_that_the_log_does_not_tell_is_one_sentence() -> None:
    config, log = log_of()
    bright = config.cylinders.model_copy(update={"least_intensity": 1.0})
    with pytest.raises(LogError, match="intensities is empty"):
        run(config.model_copy(update={"cylinders": bright}), log)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ({"cylinders": {}, "use": ["odometry"]}, "add 'landmark_sightings' to use"),
        ({"cylinders": {"radius": 1}}, "did you mean 'radius_m'"),
        ({"cylinders": {"method": "cone"}}, "method cone needs radius_m"),
        ({"cylinders": {"method": "arc"}}, "did you mean 'arcs'"),
        (
            {"cylinders": {"method": "cone", "radius_m": 1, "leg_distance_m": 1}},
            "method cone does not use leg_distance_m",
        ),
        ({"cylinders": {"radius_min_m": 2}}, "expected radius_min_m <= radius_max_m"),
        (
            {"cylinders": {}, "simulation": {"landmarks": {"A": [1, 1]}, "landmark_sightings": {}}},
            "expected one of them",
        ),
    ],
)
def test_what_cannot_be_meant_is_one_sentence(text: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_config(text)


def test_poles_of_a_recording_become_sightings() -> None:
    source = "../../../shared/data/acfr-carpark"
    config = parse_config(
        {
            "log": {"dataset": "acfr_carpark", "path": source},
            "use": ["odometry", "landmark_sightings"],
            "start": [4.0, 4.7, 251],
            "cylinders": {
                "sigma_range_m": 0.03, "sigma_bearing_rad": 0.004, "radius_m": 0.03,
                "least_beams": 1, "least_intensity": 1,
            },
        }
    )  # fmt: skip
    try:
        log = load_log(config, CONFIGS, 0)
    except LogError as error:
        pytest.skip(str(error))
    seen = with_cylinders(log, config)["landmark_sightings"]
    assert len(seen["range_m"]) > 400
    assert np.all(seen["range_m"] < 82.0)
