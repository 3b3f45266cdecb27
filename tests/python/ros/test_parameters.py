# SPDX-License-Identifier: Apache-2.0
"""The flat parameters of a node and the configuration that they make."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.ros.parameters import LARGEST_INTEGER, Parameter, config_of, parameters, values_of
from locfuse.types import ConfigError

ROOT = Path(__file__).parents[3]
EVERYTHING: dict[str, Any] = {
    "start": [1.0, 2.0, 90.0],
    "anchors": {"all": {"offset_m": 0.1}},
    "switched_off": [{"source": "ranges", "from_s": 3.0}],
    "mcl": {"poses_hz": 2.0, "switch": None, "likelihood": "beams"},
    "cylinders": {"radius_m": 0.1},
    "estimator": {"range": {"noise": "student_t", "latency_s": 0.05}},
    "ros": {"gps_origin": [50.0, 8.0, 0.0], "topics": {"scans": None}},
}


def by_name(config: RunConfig) -> dict[str, Parameter]:
    return {p.name: p for p in parameters(config)}


@pytest.mark.parametrize("keys", [{}, EVERYTHING])
def test_parameters_make_the_configuration_they_are_of(keys: dict[str, Any]) -> None:
    config = parse_config(keys)
    given = {p.name: p.value for p in parameters(config) if p.value is not None}
    given["ros.topics.scans"] = config.ros.topics.scans or ""  # which parameters cannot leave out
    assert config_of(given) == config


def test_every_parameter_says_what_it_means() -> None:
    assert [p.name for p in parameters(parse_config(EVERYTHING)) if not p.description] == []


def test_bounds_are_those_of_the_schema() -> None:
    found = by_name(RunConfig())
    gate = found["estimator.range.gate"]
    assert gate.low is not None
    assert 0.0 < gate.low < 1e-300
    assert gate.high == 1.0
    assert (found["history_messages"].low, found["history_messages"].high) == (512, 10**9)
    assert found["mcl.seed"].high == LARGEST_INTEGER
    assert found["estimator.position.antenna_left_m"].low is None
    assert found["when_lost"].choices == ("restart", "go_on")


def test_kinds_are_those_of_the_schema() -> None:
    found = by_name(RunConfig())
    kinds = {
        "estimator.range.gate": "float",
        "seed": "int",
        "estimator.calibration.consider": "bool",
        "name": "text",
        "use": "texts",
        "ros.gps_origin": "floats",
        "start": "any",
        "switched_off": "yaml",
    }
    assert {name: found[name].kind for name in kinds} == kinds


def test_a_node_has_neither_log_nor_simulation() -> None:
    assert not [p.name for p in parameters(RunConfig()) if p.name.startswith(("log", "simulation"))]
    with pytest.raises(ConfigError, match="log is not for a node"):
        config_of({"log": "my_drive"})


def test_parameters_count_more_than_the_file(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    keys = {"simulation": {}, "start": "auto", "estimator": {"range": {"gate": 0.9}, "hold_s": 2.0}}
    path.write_text(yaml.safe_dump(keys))
    config = config_of({"estimator.range.gate": 0.99}, path)
    assert config.estimator.range.gate == 0.99
    assert config.estimator.hold_s == 2.0
    assert config.simulation is None
    assert load_config(path).simulation is not None


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"estimator.hold": 0.9}, "estimator: unknown key 'hold'; did you mean 'hold_s"),
        ({"estimatr.range.gate": 0.9}, "unknown key 'estimatr'; did you mean 'estimator'"),
        ({"estimator.range.gate": 7}, "at most 1"),
        ({"estimator.range.gate": "x", "seed": 1}, "estimator.range.gate: "),
        ({"seed": 1, "seed.x": 2}, "seed.x is below seed, which is 1; set one"),
        ({"switched_off": "[{"}, "switched_off: is no YAML"),
        ({"estimator.range.gate": ""}, "estimator.range.gate: "),
    ],
)
def test_what_is_wrong_is_named(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError) as error:
        config_of(given)
    assert says in str(error.value)
    assert str(error.value).startswith("parameters: ")


def test_mappings_in_mappings_say_what_names_with_dots_say(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text("start: auto\nestimator: {range: {sigma_m: 0.2, gate: 0.99}}\n")
    config = config_of({"estimator": {"range": {"sigma_relative": 0.01}}, "mcl": {}}, path, "/n")
    assert config == config_of({"estimator.range.sigma_relative": 0.01, "mcl": {}}, path)
    assert config.estimator.range.sigma_m == 0.2
    assert config.estimator.range.sigma_relative == 0.01
    assert config.estimator.range.gate == 0.99
    assert config.mcl is not None
    off = {"switched_off": [{"source": "ranges", "from_s": 1.0}]}
    assert config_of(off).switched_off[0].source == "ranges"
    anchors = config_of({"anchors": {"a.1": {"offset_m": 0.5}}}).anchors
    assert anchors["a.1"].offset_m == 0.5
    with pytest.raises(ConfigError, match="/n: estimator: unknown key 'hold'"):
        config_of({"estimator": {"hold": 0.9}}, path, "/n")


DECLARED = (
    Parameter("rate_hz", "float", 5.0, 0.1, 100.0, "how often"),
    Parameter("format", "text", "ranges", None, None, "which", ("ranges", "data")),
    Parameter("seed", "int", 0, 0, None, "of the noise"),
    Parameter("clock", "bool", True, None, None, "whether it ticks"),
)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"rate": 1.0}, "/n: unknown 'rate'; did you mean 'rate_hz'?"),
        ({"rate_hz": 0}, "/n: rate_hz is 0.0, expected a number from 0.1 to 100"),
        ({"rate_hz": "5"}, "/n: rate_hz is '5', expected a number from 0.1 to 100"),
        ({"rate_hz": float("nan")}, "/n: rate_hz is nan"),
        ({"rate_hz": True}, "/n: rate_hz is True, expected a number"),
        ({"format": "text"}, "/n: format is 'text', expected ranges or data"),
        ({"seed": -1}, "/n: seed is -1, expected a whole number from 0"),
        ({"seed": 1.5}, "/n: seed is 1.5, expected a whole number"),
        ({"clock": 1}, "/n: clock is 1, expected true or false"),
    ],
)
def test_values_of_a_small_node_are_refused_with_a_sentence(given: Any, words: str) -> None:
    with pytest.raises(ConfigError) as error:
        values_of(DECLARED, given, "/n")
    assert str(error.value).startswith(words)


def test_values_of_a_small_node_have_defaults() -> None:
    published = values_of(DECLARED, {"rate_hz": 7})
    assert published == {"rate_hz": 7.0, "format": "ranges", "seed": 0, "clock": True}
    assert isinstance(published["rate_hz"], float)


def test_an_empty_text_stands_for_none() -> None:
    assert config_of({"ros.topics.scans": "", "mcl.seed": ""}).ros.topics.scans is None


def test_a_seed_that_no_parameter_holds_is_refused() -> None:
    with pytest.raises(ConfigError, match="a parameter holds up to"):
        parameters(RunConfig(seed=2**63))
