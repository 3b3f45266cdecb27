# SPDX-License-Identifier: Apache-2.0
"""YAML to configuration: what is refused, in which words, and that what is dumped loads again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from locfuse.config.base import given_keys
from locfuse.config.load import load_config, parse_config
from locfuse.types import ConfigError
from support_runs import CONFIGS, EXAMPLES

SIMULATED: dict[str, Any] = {"simulation": {"duration_s": 10.0}}


def refused(data: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_config(data, "run.yaml")
    text = str(caught.value)
    assert text.startswith("run.yaml: ")
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("data", "key", "advice"),
    [
        ({"histroy_s": 1.0}, "histroy_s", "history_s"),
        ({"estimator": {"hold": 0.9}}, "hold", "hold_s"),
        ({"estimator": {"odometry": {"sigma_xy_per_sqrt_sec": 1}}},
         "sigma_xy_per_sqrt_sec", "sigma_xy_per_sqrt_s"),
        ({"estimator": {"range": {"sigm_m": 1}}}, "sigm_m", "sigma_m"),
        ({"estimator": {"position": {"antenna_fwd_m": 1}}}, "antenna_fwd_m", "antenna_forward_m"),
        ({"start_sigma": {"heading_rad": 1}}, "heading_rad", "heading_deg"),
        ({"anchors": {"A1": {"ofset_m": 1}}}, "ofset_m", "offset_m"),
        ({"log": {"dataset": "plaza", "pth": "x", "path": "x"}}, "pth", "path"),
        ({"simulation": {"durations_s": 1}}, "durations_s", "duration_s"),
        ({"simulation": {"path": {"shape": "circle", "radius": 1}}}, "radius", "radius_m"),
        ({"simulation": {"ranges": {"rate": 1}}}, "rate", "rate_hz"),
        ({"simulation": {"faults": [{"kind": "bias", "offset": 1}]}}, "offset", "offset_m"),
    ],
)  # fmt: skip
def test_an_unknown_key_is_refused_with_the_nearest_name_at_every_depth(
    data: dict[str, Any], key: str, advice: str
) -> None:
    text = refused(data)

    assert f"unknown key {key!r}; did you mean {advice!r}?" in text
    for outer in _path_to(data, key):
        assert outer in text


def _path_to(data: Any, key: str) -> list[str]:
    """Return the names around a key."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for name, value in items:
        if name == key:
            return []
        if isinstance(value, dict | list):
            return [str(name), *_path_to(value, key)]
    return []


def test_a_key_like_no_other_is_answered_with_all_there_are() -> None:
    text = refused({"estimator": {"range": {"zzz": 1}}})
    assert "unknown key 'zzz'; expected" in text
    assert "sigma_m, sigma_relative" in text


@pytest.mark.parametrize(
    ("data", "parts"),
    [
        ({"estimator": {"range": {"sigma_m": -0.5}}}, ["estimator.range.sigma_m", "-0.5"]),
        ({"estimator": {"range": {"gate": 1.5}}}, ["estimator.range.gate", "1.5"]),
        ({"estimator": {"hold_s": 0}}, ["estimator.hold_s", "0"]),
        ({"estimator": {"hold_s": float("nan")}}, ["estimator.hold_s", "nan"]),
        ({"estimator": {"hold_s": "soon"}}, ["estimator.hold_s", "soon"]),
        ({"start_sigma": {"xy_m": float("inf")}}, ["start_sigma.xy_m", "inf"]),
        ({"start": "nowhere"}, ["start", "truth"]),
        ({"start": [1.0, 2.0]}, ["start"]),
        ({"use": []}, ["use"]),
        ({"use": ["lidar"]}, ["use.0", "lidar", "ranges"]),
        ({"history_s": -1}, ["history_s", "-1"]),
        ({"history_s": 1e12}, ["history_s"]),
        ({"seed": 2**64}, ["seed", "less than 1.84467e+19"]),
        ({"start_sigma": {"heading_deg": 1e10}}, ["start_sigma.heading_deg", "at most 1e+09"]),
        ({"anchors": {"all": {"scale": 2e6}}}, ["anchors.all.scale", "at most 1e+06"]),
        ({"anchors": {"all": {"offset_m": -1e10}}}, ["anchors.all.offset_m", "at least -1e+09"]),
        ({"estimator": None}, ["estimator"]),
        ({"simulation": {"path": {"shape": "spiral"}}}, ["simulation.path", "spiral", "circle"]),
    ],
)
def test_a_value_that_is_not_allowed_is_named_with_its_key(
    data: dict[str, Any], parts: list[str]
) -> None:
    text = refused(data)
    for part in parts:
        assert part in text


def test_two_origins_of_messages_are_refused() -> None:
    assert "both log and simulation" in refused({"log": "somewhere", **SIMULATED})


def test_every_mistake_is_reported_at_once() -> None:
    text = refused({"history_s": -1, "start_sigma": {"xy_m": 0}})
    assert "history_s" in text
    assert "start_sigma.xy_m" in text


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("estimator: [unclosed", "not valid YAML"),
        ("a: 1\n\tb: 2\n", "not valid YAML"),
        ("", "is empty"),
        ("- a\n- b\n", "holds list"),
        ("42", "holds int"),
        ("simulation: {}\nsimulation: {duration_s: 3}\n", "simulation"),
        ("anchors: {A1: {offset_m: 1}, A1: {offset_m: 2}}\nlog: x\n", "A1"),
    ],
)
def test_a_file_that_is_no_mapping_of_distinct_keys_is_refused(
    tmp_path: Path, text: str, part: str
) -> None:
    path = tmp_path / "run.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(path) in str(caught.value)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)


def test_broken_yaml_is_named_by_line(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text("name: x\nestimator:\n  hold_s: [1\n")
    with pytest.raises(ConfigError, match=r"line [34]"):
        load_config(path)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"absent\.yaml"):
        load_config(tmp_path / "absent.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"binary\.yaml"):
        load_config(binary)
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path)


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_loads_and_loads_again_from_its_effective_values(name: str) -> None:
    config = load_config(CONFIGS / name)

    text = yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)

    assert parse_config(yaml.safe_load(text)) == config


def test_there_is_an_example_for_every_run_of_the_comparison() -> None:
    assert set(EXAMPLES) >= {
        "ekim_room.yaml", "ieu_gazebo.yaml", "mrpt_office.yaml", "plaza.yaml", "tuc_labyrinth.yaml"
    }  # fmt: skip


def test_keys_that_are_given_are_those_of_the_file() -> None:
    wheels = {"distance_scale": 1.0}
    given = {"start": "auto", "scan_odometry": {}, "estimator": {"odometry": wheels}}
    config = parse_config(given).model_copy(update={"simulation": None})
    assert given_keys(config) == given
