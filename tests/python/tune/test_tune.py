# SPDX-License-Identifier: Apache-2.0
"""Noise and calibration of simulated robots and of recordings, and what is not observed."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.report.plot import plot_tune
from locfuse.run.run import load_log, run
from locfuse.tune.result import TuneResult
from locfuse.tune.tune import tune
from locfuse.types import NANOSECONDS, ConfigError, Log, LogError
from support_runs import CONFIGS, changed, locfuse, require_recording_of

SIGMA = "estimator.range.sigma_m"
WHEELS = "estimator.odometry"
ROBOTS = 4
DRIVE: dict[str, Any] = {
    "duration_s": 100.0, "poses": None, "path": {"shape": "waypoints", "speed_mps": 0.5},
    "ranges": {"sigma_m": 0.1, "sigma_relative": 0.0},
}  # fmt: skip


def robot(seed: int) -> tuple[RunConfig, Log, dict[str, float]]:
    """Return a robot with noise drawn over a factor of ten, and that noise."""
    rng = np.random.default_rng(seed)
    along, sigma, bearing = (middle * 10 ** rng.uniform(-0.5, 0.5) for middle in (0.03, 0.1, 1.5))
    drive = {**DRIVE, "ranges": {"sigma_m": sigma, "sigma_relative": 0.0},
             "odometry": {"sigma_longitudinal_per_sqrt_m": along},
             "landmarks": {"P": [2, 2], "Q": [8, 3], "R": [5, 8]},
             "landmark_sightings": {"sigma_bearing_deg": bearing}}  # fmt: skip
    config = parse_config({"simulation": drive, "seed": seed})
    true = {f"{WHEELS}.sigma_longitudinal_per_sqrt_m": along, SIGMA: sigma,
            "estimator.landmark.sigma_bearing_rad": float(np.radians(bearing))}  # fmt: skip
    return config, load_log(config, None, seed), true


def drive(seed: int = 3, **more: Any) -> tuple[RunConfig, Log]:
    config = parse_config({"simulation": DRIVE, "seed": seed, **more})
    return config, load_log(config, None, seed)


@cache
def tuned(seed: int = 3) -> TuneResult:
    """Return what `tune` finds in a drive with nothing wrong."""
    config, log = drive(seed)
    return tune(config, [log])


def changes_of(result: TuneResult) -> dict[str, float]:
    return {one.quantity.key: one.value for one in result.quantities if one.changes}


def test_sigmas_of_robots_are_found_within_a_quarter_and_their_intervals() -> None:
    z, ratios, spacings = [], [], []
    for seed in range(ROBOTS):
        config, log, true = robot(seed)
        result = tune(config, [log])
        spacings.append(result.spacing_s)
        for key, sigma in true.items():
            one = result[key]
            assert one.word == "found", key
            ratios.append(one.value / sigma)
            half = 0.5 * np.log(one.high / one.low)
            z.append(1.96 * np.log(one.value / sigma) / half)
        for fit in result.held_out:
            assert 0.95 < fit.after.nis < 1.06, fit
    assert np.mean(np.equal(spacings, 0.0)) >= 0.8, "white noise is independent"
    assert np.mean(np.abs(np.log(ratios)) < np.log(1.25)) >= 0.9
    # 12 values: their mean square is in 0.2 to 2.5 with 99.7 %; intervals are cautious at most.
    assert 0.2 < np.mean(np.square(z)) < 2.5


def test_errors_of_wheels_and_a_latency_are_found_and_taken_out() -> None:
    config, log = drive()
    wheels, ranges = log["odometry"], log["ranges"]
    angle = 0.06
    dx, dy = wheels["dx_m"] / 1.04, wheels["dy_m"] / 1.04
    wrong = changed(log, "odometry", dheading_rad=wheels["dheading_rad"] / 0.95,
                    dx_m=np.cos(angle) * dx + np.sin(angle) * dy,
                    dy_m=-np.sin(angle) * dx + np.cos(angle) * dy)  # fmt: skip
    wrong = changed(wrong, "ranges", stamp_ns=ranges["stamp_ns"] + 250_000_000)
    result = tune(config, [wrong])
    for key, value in ((f"{WHEELS}.distance_scale", 1.04), (f"{WHEELS}.turn_scale", 0.95),
                       ("estimator.range.latency_s", 0.25)):  # fmt: skip
        one = result[key]
        assert one.word == "found"
        assert one.low < value < one.high, key
        assert one.high - one.low < 0.1, key
    before, after = (run(one, wrong).metrics["position_rmse_m"]
                     for one in (config, result.config))  # fmt: skip
    assert after < 0.7 * before
    right = run(config, log).metrics["position_rmse_m"]
    assert after < 1.2 * right
    again = tune(result.config, [wrong])
    assert not {key for key in changes_of(again) if "scale" in key or "latency" in key}


def test_measurements_that_are_early_make_odometry_late() -> None:
    config, log = drive()
    early = changed(log, "ranges", stamp_ns=log["ranges"]["stamp_ns"] - 200_000_000)
    result = tune(config, [early])
    assert result["estimator.range.latency_s"].value == pytest.approx(-0.2, abs=0.05)
    assert result.changes["estimator"]["range"]["latency_s"] == 0.0
    assert result.config.estimator.odometry.latency_s == pytest.approx(0.2, abs=0.05)


def test_outliers_are_counted_and_leave_the_sigma_alone() -> None:
    config, log = drive()
    rng = np.random.default_rng(5)
    ranges = log["ranges"]["range_m"]
    out = rng.random(len(ranges)) < 0.1
    bad = changed(log, "ranges", range_m=ranges + out * rng.uniform(1.5, 6.0, len(ranges)))
    result = tune(config, [bad])
    assert result[SIGMA].value == pytest.approx(0.1, rel=0.1)
    assert result.outliers[0].share == pytest.approx(out.mean(), abs=0.01)
    assert result.outliers[0].too_long > 0.98
    assert any("10." in text and "too long" in text for text in result.findings)


def test_errors_that_stay_are_not_taken_for_motion() -> None:
    precise = {"sigma_m": 0.05, "sigma_relative": 0.0}
    config, log = drive(simulation={**DRIVE, "duration_s": 300.0, "ranges": precise})
    ranges = log["ranges"]
    rng = np.random.default_rng(6)
    wander = np.zeros(len(ranges["range_m"]))
    for anchor in np.unique(ranges["anchor"]):
        rows = np.flatnonzero(ranges["anchor"] == anchor)
        keep = np.exp(-np.diff(ranges["stamp_ns"][rows], prepend=0) / NANOSECONDS / 3.0)
        error = rng.normal(0.0, 0.3)
        for row, share in zip(rows.tolist(), keep.tolist(), strict=True):
            error = share * error + 0.3 * np.sqrt(1.0 - share**2) * rng.normal()
            wander[row] = error
    wandering = changed(log, "ranges", range_m=ranges["range_m"] + wander)
    result = tune(config, [wandering])
    assert result.spacing_s >= 1.0
    assert result[SIGMA].value == pytest.approx(0.3, rel=0.2)
    assert result[f"{WHEELS}.sigma_longitudinal_per_sqrt_m"].value < 0.12  # 0.14 by all ranges
    assert any("correlated over" in text for text in result.findings)
    assert run(result.config, wandering).metrics["nees_mean"] < 5.0


def test_what_a_standing_robot_does_not_show_stays_as_it_is() -> None:
    drive = {**DRIVE, "path": {"shape": "circle", "speed_mps": 0.0}}
    config = parse_config({"simulation": drive})
    result = tune(config)
    assert list(changes_of(result)) == [SIGMA]
    assert result.config.estimator.odometry == config.estimator.odometry
    assert {one.word for one in result.quantities if WHEELS in one.quantity.key} == {"not observed"}


def test_a_latency_is_not_observed_on_a_circle_nor_a_direction_by_ranges() -> None:
    config = parse_config({"simulation": {**DRIVE, "path": {"shape": "circle"}}, "seed": 4})
    keys = [one.quantity.key for one in tune(config).quantities]
    assert "estimator.range.latency_s" not in keys
    assert f"{WHEELS}.direction_rad" not in keys


def test_a_direction_is_found_by_what_sees_the_heading() -> None:
    config, log, _ = robot(1)
    wheels = log["odometry"]
    c, s = np.cos(0.1), np.sin(0.1)
    dx, dy = wheels["dx_m"], wheels["dy_m"]
    one = tune(config, [changed(log, "odometry", dx_m=c * dx + s * dy, dy_m=-s * dx + c * dy)])[
        f"{WHEELS}.direction_rad"
    ]
    assert one.word == "found"
    assert one.low < 0.1 < one.high


def test_a_latency_beyond_the_history_makes_room_for_itself() -> None:
    config, log = drive()
    late = changed(log, "ranges", stamp_ns=log["ranges"]["stamp_ns"] + 3 * NANOSECONDS)
    result = tune(config, [late])
    assert result["estimator.range.latency_s"].value == pytest.approx(3.0, abs=0.1)
    assert result.config.history_s >= 6.0
    before, after = result.driven[0]
    assert after.position_rmse_m < 0.5 * before.position_rmse_m
    assert any("m before" in text for text in result.comparisons)


def test_what_is_made_of_scans_is_tuned_and_driven() -> None:
    seen = load_config(CONFIGS / "wells.yaml")
    assert seen.cylinders is not None
    ((before, after),) = tune(seen, base=CONFIGS).driven
    assert after.position_rmse_m < 1.3 * before.position_rmse_m
    matched = {**DRIVE, "duration_s": 40.0, "map": {"generate": "rooms", "seed": 2}, "laser": {},
               "path": {"shape": "roam", "speed_mps": 0.5}}  # fmt: skip
    assert len(tune(parse_config({"simulation": matched, "scan_odometry": {}})).driven) == 1


def test_what_flies_is_driven_from_its_height() -> None:
    config = load_config(CONFIGS / "air_ranges.yaml").model_copy(update={"start": "truth"})
    log = load_log(config, CONFIGS, config.seed)
    result = tune(config, [log])
    before, after = result.driven[0]
    assert before.position_rmse_m == run(config, log).metrics["position_rmse_m"]
    assert after.position_rmse_m < before.position_rmse_m


def test_two_recordings_say_more_than_one() -> None:
    config, first = drive(3)
    _, second = drive(4)
    one, both = tuned(3), tune(config, [first, second])
    widths = [np.log(r[SIGMA].high / r[SIGMA].low) for r in (one, both)]
    assert widths[1] < 0.85 * widths[0]
    assert both.held_out[0].count == pytest.approx(2 * one.held_out[0].count, rel=0.05)


def test_sigmas_that_messages_bring_wrongly_are_named() -> None:
    config, log = drive()
    sigma = np.full(len(log["ranges"]["range_m"]), 0.3)
    result = tune(config, [changed(log, "ranges", sigma_m=sigma)])
    assert SIGMA not in [one.quantity.key for one in result.quantities]
    assert "ranges bring sigmas of their own, about 2.9 times too large" in result.findings


# What hand-made configurations of real robots predict worse than a tuned one.
@pytest.mark.parametrize("example", ["plaza.yaml", "ieu_gazebo.yaml", "mrpt_office.yaml"])
def test_recordings_are_predicted_better_than_by_hand(example: str) -> None:
    require_recording_of(example)
    config = load_config(CONFIGS / example)
    log = load_log(config, CONFIGS, 0)
    result = tune(config, [log])
    fit = result.held_out[0]
    assert abs(np.log(fit.after.nis)) < abs(np.log(fit.before.nis)) + 0.02
    before, after = (run(one, log).metrics["position_rmse_m"] for one in (config, result.config))
    assert after < 1.25 * before


def test_a_robot_of_which_nothing_is_known_ends_where_hands_have_not_brought_it() -> None:
    require_recording_of("plaza.yaml")
    by_hand = load_config(CONFIGS / "plaza.yaml")
    log = load_log(by_hand, CONFIGS, 0)
    config = parse_config({"log": "x", "anchors": {"all": {"scale": 1.0694, "offset_m": 0.03}}})
    result = tune(config, [log])
    tuned, hand = (run(one, log).metrics["position_rmse_m"] for one in (result.config, by_hand))
    assert tuned < 0.9 * hand
    assert result[SIGMA].value == pytest.approx(0.54, abs=0.03)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"mcl": {}}, "mcl without poses_hz"),
        ({"switched_off": [{"source": "ranges", "from_s": 1.0}]}, "switched_off"),
        ({"use": ["odometry"]}, "the log has 0 measurements"),
        ({"simulation": {**DRIVE, "duration_s": 2.0}}, "tune needs 50"),
    ],
)  # fmt: skip
def test_what_cannot_be_tuned_is_one_sentence(more: dict[str, Any], sentence: str) -> None:
    config = parse_config({"simulation": DRIVE, **more})
    with pytest.raises((ConfigError, LogError), match=sentence):
        tune(config)


def test_the_command_prints_and_writes_a_configuration_that_runs(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump({"simulation": DRIVE, "seed": 3}), encoding="utf-8")
    said = locfuse("tune", str(file), "--out", str(tmp_path / "out"))
    assert said.status == 0, said.err
    assert "estimator.range.sigma_m" in said.out
    tuned = load_config(tmp_path / "out" / "tuned.yaml")
    assert tuned.estimator.range.sigma_m == pytest.approx(0.1, rel=0.1)
    assert (tmp_path / "out" / "tune.png").stat().st_size > 10_000
    missing = locfuse("tune", str(file), "--log", str(tmp_path / "nowhere"))
    assert "nowhere" in missing.sentence()


def test_the_picture_names_every_quantity() -> None:
    result = tuned()
    figure = plot_tune(result)
    names = [label.get_text() for axes in figure.axes for label in axes.get_yticklabels()]
    for one in result.quantities:
        key = one.quantity.key.removeprefix("estimator.")
        assert f"{key}: {one.word}" in names
    with pytest.raises(KeyError, match=r"sigma_m'\?|expected"):
        result["estimator.range.sigma"]
