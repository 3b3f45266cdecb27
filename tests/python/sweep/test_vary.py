# SPDX-License-Identifier: Apache-2.0
"""What varies: lists, grids, draws, and where the values stand in a configuration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from locfuse.config.load import load_config, parse_config
from locfuse.config.scenario import Eight, Scenario
from locfuse.config.schema import RunConfig
from locfuse.sweep.runner import plan
from locfuse.sweep.vary import Axis, as_written, axes_of, with_values
from locfuse.types import ConfigError
from support_runs import CONFIGS, EXAMPLES
from support_sweep import short_room

SIGMA = "simulation.ranges.sigma_m"


def axis(key: str, values: Any, config: RunConfig | None = None) -> Axis:
    (found,) = axes_of(config or short_room(), {key: values})
    return found


def changed(config: RunConfig, key: str, value: Any) -> RunConfig:
    return with_values(config, as_written(config), [Axis(key, (value,))], [value])


@pytest.mark.parametrize(
    ("text", "values", "kind"),
    [
        ("0.1,0.2", (0.1, 0.2), "float64"),
        ("1,2", (1, 2), "int64"),
        ("1,2.5", (1, 2.5), "float64"),
        ("circle, eight", ("circle", "eight"), "string"),
        ("[10, 10],[20,20]", ([10, 10], [20, 20]), "string"),
        ("null, {rate_hz: 2}", (None, {"rate_hz": 2}), "string"),
        ("0..1:3", (0.0, 0.5, 1.0), "float64"),
        ("-1e-1..+.1:2", (-0.1, 0.1), "float64"),
    ],
)
def test_lists_and_grids(text: str, values: tuple[Any, ...], kind: str) -> None:
    found = axis(SIGMA, text)
    assert (found.values, found.kind) == (values, kind)


def test_a_grid_in_equal_ratios() -> None:
    assert axis(SIGMA, "0.01..1:3log").values == pytest.approx((0.01, 0.1, 1.0))


def test_a_sequence_is_taken_as_it_is() -> None:
    assert axis(SIGMA, [0.1, 0.2]).values == (0.1, 0.2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no value is given"),
        ("a,b:", None),
        ("[1", "cannot be read"),
        ("0.5..0.1", "expected LOW < HIGH"),
        ("1..1", "expected LOW < HIGH"),
        ("0..1:log", "needs LOW > 0"),
        ("0..1:", "expected a number of values"),
        ("0..1:1", "expected 2 to 100000"),
        ("0..1:1000000", "expected 2 to 100000"),
    ],
)
def test_what_cannot_be_read_is_refused_with_the_key(text: str, said: str | None) -> None:
    if said is None:
        assert axis(SIGMA, text).kind == "string"
        return
    with pytest.raises(ConfigError, match=said) as error:
        axis(SIGMA, text)
    assert str(error.value).startswith(SIGMA)


def test_numbers_of_numpy_are_numbers() -> None:
    found = axis(SIGMA, np.linspace(0.1, 0.2, 2))
    assert (found.values, found.kind) == ((0.1, 0.2), "float64")
    assert axis(SIGMA, np.array([1, 2])).kind == "int64"


@pytest.mark.parametrize("values", [[object()], [float("nan")], ".nan", "2020-01-01"])
def test_what_cannot_stand_in_a_configuration_is_refused(values: Any) -> None:
    with pytest.raises(
        ConfigError, match=f"{SIGMA}: the value .* is not allowed in a configuration"
    ):
        axis(SIGMA, values)


def test_no_values_are_refused() -> None:
    with pytest.raises(ConfigError, match="no value is given"):
        axis(SIGMA, [])


# Draws -----------------------------------------------------------------------------------------


def draws(found: Axis, count: int) -> np.ndarray[Any, Any]:
    return np.array([found.draw(0, trial, 0) for trial in range(count)])


def test_draws_are_even_between_both_ends() -> None:
    values = draws(axis(SIGMA, "0.1..0.3"), 2000)
    assert stats.kstest(values, "uniform", args=(0.1, 0.2)).pvalue > 0.01


def test_draws_are_even_in_the_logarithm_if_asked() -> None:
    values = draws(axis(SIGMA, "0.01..1:log"), 2000)
    assert stats.kstest(np.log10(values), "uniform", args=(-2.0, 2.0)).pvalue > 0.01


def test_whole_numbers_are_drawn_where_the_key_takes_no_others() -> None:
    config = parse_config({"simulation": {"path": {"shape": "polygon", "corners": 5}}})
    found = axis("simulation.path.corners", "3..6", config)
    values = draws(found, 4000)
    assert found.kind == "int64"
    counts = np.bincount(values.astype(int), minlength=7)[3:]
    assert counts.sum() == 4000
    assert stats.chisquare(counts).pvalue > 0.01
    assert axis("simulation.duration_s", "3..6", config).kind == "float64"


def test_a_trial_draws_the_same_however_many_there_are() -> None:
    config = short_room()
    axes = axes_of(config, {SIGMA: "0.1..0.3", "simulation.ranges.rate_hz": "1,2"})
    assert plan(config, axes, 5) == plan(config, axes, 9)[:5]


def test_keys_and_trials_draw_apart_and_the_seed_decides() -> None:
    found = axis(SIGMA, "0.1..0.3")
    values = {found.draw(seed, trial, place) for seed in range(3) for trial in range(3)
              for place in range(3)}  # fmt: skip
    assert len(values) == 27


# Plans -----------------------------------------------------------------------------------------


def test_combinations_take_turns_and_seeds_count_up() -> None:
    config = short_room().model_copy(update={"seed": 7})
    axes = axes_of(config, {SIGMA: "0.1,0.2", "simulation.path.shape": ["circle", "eight"]})
    found = plan(config, axes, 6)
    assert [trial.values for trial in found[:5]] == [
        (0.1, "circle"), (0.1, "eight"), (0.2, "circle"), (0.2, "eight"), (0.1, "circle"),
    ]  # fmt: skip
    assert [trial.seed for trial in found] == [7, 8, 9, 10, 11, 12]


def test_too_few_trials_for_the_combinations_are_refused() -> None:
    config = short_room()
    with pytest.raises(ConfigError, match="6 combinations, which is more than 5 trials"):
        plan(config, axes_of(config, {SIGMA: "1,2,3", "history_s": "1,2"}), 5)


# Keys ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("simulaton.ranges.sigma_m", "did you mean 'simulation'"),
        ("simulation.rangs.sigma_m", "simulation: unknown key 'rangs'; did you mean 'ranges'"),
        ("simulation.anchors.A9.0", "simulation.anchors: unknown key 'A9'; did you mean 'A"),
        ("simulation.anchors.A1.3", "no place '3'; expected 0 to 2"),
        ("simulation.faults.0", "simulation.faults: no place '0'; it is empty"),
        ("anchors.A1", "anchors: unknown key 'A1'; it is empty"),
        ("mcl.beams", "mcl: is not set in the configuration; set it there first"),
        ("history_s.x", "history_s: is 2.0, in which there is no 'x'"),
        ("seed", "trial k has the seed of the configuration plus k"),
    ],
)
def test_wrong_keys_are_refused_with_the_nearest(key: str, said: str) -> None:
    with pytest.raises(ConfigError) as error:
        axis(key, "1,2")
    assert said in str(error.value)


def test_the_last_part_of_a_key_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'sgma_m'; did you mean 'sigma_m'"):
        changed(short_room(), "simulation.ranges.sgma_m", 1.0)


def test_a_value_that_is_not_allowed_is_refused_with_the_key() -> None:
    with pytest.raises(ConfigError, match=r"^with simulation.ranges.sigma_m=-1: .*got -1"):
        changed(short_room(), SIGMA, -1)


def test_a_value_changes_its_key_and_nothing_else() -> None:
    config = short_room()
    assert config.simulation is not None
    assert config.simulation.ranges is not None
    expected = config.model_dump()
    expected["simulation"]["ranges"]["sigma_m"] = 0.25
    assert changed(config, SIGMA, 0.25).model_dump() == expected


def test_a_part_of_a_table_or_a_list_leaves_the_rest() -> None:
    found = changed(short_room(), "simulation.anchors.A5.2", 2.5)
    assert found.simulation is not None
    assert found.simulation.anchors["A5"] == (5.0, 0.0, 2.5)
    assert found.simulation.anchors["A1"] == (0.0, 0.0, 0.0)
    assert len(found.simulation.anchors) == 5


def test_a_fault_of_a_list_can_be_varied() -> None:
    faults = [{"kind": "outliers", "probability": 0.1, "magnitude_m": 1.0}]
    found = changed(short_room(faults=faults), "simulation.faults.0.magnitude_m", 2.0)
    assert found.simulation is not None
    assert found.simulation.faults[0].model_dump()["magnitude_m"] == 2.0


def test_another_shape_brings_its_own_keys() -> None:
    found = changed(short_room(path={"shape": "eight"}), "simulation.path.shape", "square")
    assert found.simulation is not None
    assert found.simulation.path.model_dump()["side_m"] == 6.0


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_is_written_so_that_it_reads_the_same(name: str) -> None:
    config = load_config(CONFIGS / name)
    assert parse_config(as_written(config)) == config


def test_a_configuration_made_in_python_keeps_what_it_did_not_set() -> None:
    config = RunConfig(simulation=Scenario(path=Eight(radius_m=1.0)))
    assert parse_config(as_written(config)) == config
