# SPDX-License-Identifier: Apache-2.0
"""A scenario becomes a log: the right tables, the same bits for the same seed, nothing coupled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from locfuse.config.scenario import Scenario
from locfuse.sim.scenario import simulate
from locfuse.types import Log

SHAPES = ["circle", "eight", "square", "star", "waypoints"]
SENSORS = ["odometry", "ranges", "poses", "positions"]
ALL_ON: dict[str, Any] = {"positions": {}, "path": {"shape": "waypoints"}}
FAULTS = [
    {"kind": "nlos", "walls": [[4.0, 4.0, 6.0, 4.0]], "extra_m": 0.5, "sigma_m": 0.2},
    {"kind": "bias", "anchor": "A2", "offset_m": 0.1},
    {"kind": "outliers", "probability": 0.1, "magnitude_m": 2.0},
    {"kind": "dropouts", "source": "odometry", "probability": 0.1},
    {"kind": "latency", "source": "poses", "delay_s": 0.1, "jitter_s": 0.1},
    {"kind": "wheel_slip", "from_s": 5.0, "to_s": 6.0, "translation_factor": 1.3},
]


def run(seed: int = 5, **changes: Any) -> Log:
    return simulate(Scenario.model_validate(changes), np.random.default_rng(seed))


def assert_table_equal(first: Log, second: Log, stem: str) -> None:
    assert set(first[stem]) == set(second[stem])
    for name, column in first[stem].items():
        np.testing.assert_array_equal(column, second[stem][name], err_msg=f"{stem}.{name}")


@pytest.mark.parametrize("shape", SHAPES)
def test_the_same_seed_gives_the_same_bits(shape: str) -> None:
    changes: dict[str, Any] = {"path": {"shape": shape}, "positions": {}, "faults": FAULTS}

    first, second = run(**changes), run(**changes)

    assert set(first.tables) == {*SENSORS, "truth", "anchors"} == set(second.tables)
    for stem in first.tables:
        assert_table_equal(first, second, stem)


def test_another_seed_or_a_second_call_gives_other_noise() -> None:
    rng = np.random.default_rng(5)

    logs = [simulate(Scenario(), rng), simulate(Scenario(), rng), run(seed=6)]

    first, second, third = (log["ranges"]["range_m"] for log in logs)
    assert np.all(first != second)
    assert np.all(first != third)


@pytest.mark.parametrize("off", SENSORS)
def test_switching_one_sensor_off_changes_no_bit_of_the_others(off: str) -> None:
    everything, less = run(**ALL_ON), run(**{**ALL_ON, off: None})

    assert off not in less
    for stem in {*SENSORS, "anchors"} - {off}:
        assert_table_equal(everything, less, stem)


def test_faults_change_no_bit_of_truth_and_of_sensors_they_do_not_name() -> None:
    clean, faulty = run(**ALL_ON), run(**ALL_ON, faults=FAULTS)

    for stem in ("positions", "truth", "anchors"):
        assert_table_equal(clean, faulty, stem)


def test_truth_is_known_at_every_stamp_of_every_sensor_once() -> None:
    log = run(**ALL_ON, odometry={"rate_hz": 7.0})

    stamps = [log[stem]["stamp_ns"] for stem in SENSORS]
    np.testing.assert_array_equal(log["truth"]["stamp_ns"], np.unique(np.concatenate(stamps)))


def test_the_default_is_the_room_of_the_paper() -> None:
    log = run()

    assert len(log["odometry"]["stamp_ns"]) == 30 * 60 + 1
    assert len(log["ranges"]["stamp_ns"]) == 5 * (5 * 60 + 1)
    assert len(log["poses"]["stamp_ns"]) == 2 * 60 + 1
    assert "positions" not in log
    assert log["anchors"]["anchor"].tolist() == ["A1", "A2", "A3", "A4", "A5"]
    assert log["anchors"]["x_m"].max() == log["anchors"]["y_m"].max() == 10.0
    assert log.tags == {"tag": (0.0, 0.0, 0.0)}


def test_columns_have_the_types_of_a_log_and_equal_lengths() -> None:
    log = run(**ALL_ON, faults=FAULTS)

    for stem, table in log.tables.items():
        assert len({len(column) for column in table.values()}) == 1, stem
        for name, column in table.items():
            kind = {"tag": "U", "anchor": "U", "stamp_ns": "i", "arrival_ns": "i"}.get(name, "f")
            assert column.dtype.kind == kind, f"{stem}.{name}"
            assert column.dtype.itemsize == 8 or kind == "U", f"{stem}.{name}"


@pytest.mark.parametrize("stem", [*SENSORS, "truth"])
def test_stamps_never_go_back(stem: str) -> None:
    assert np.all(np.diff(run(**ALL_ON, faults=FAULTS)[stem]["stamp_ns"]) >= 0)


def test_ranges_without_noise_are_the_distances_of_truth_and_anchors() -> None:
    log = run(ranges={"sigma_relative": 0.0}, tags={"t": (0.3, -0.1, 0.5)})
    at = dict(zip(log["anchors"]["anchor"], range(5), strict=True))
    truth = {int(t): row for row, t in enumerate(log["truth"]["stamp_ns"])}

    for row in range(0, len(log["ranges"]["stamp_ns"]), 7):
        here = truth[int(log["ranges"]["stamp_ns"][row])]
        anchor = at[log["ranges"]["anchor"][row]]
        heading = log["truth"]["heading_rad"][here]
        turned = complex(0.3, -0.1) * np.exp(1j * heading)
        dx = log["truth"]["x_m"][here] + turned.real - log["anchors"]["x_m"][anchor]
        dy = log["truth"]["y_m"][here] + turned.imag - log["anchors"]["y_m"][anchor]
        expected = np.sqrt(dx**2 + dy**2 + 0.25)
        assert log["ranges"]["range_m"][row] == pytest.approx(expected, abs=1e-14)


def test_a_scenario_without_anchors_or_ranges_has_no_such_tables() -> None:
    log = run(anchors={}, ranges=None)

    assert set(log.tables) == {"odometry", "poses", "truth"}


def test_a_drive_shorter_than_any_period_still_has_its_first_rows() -> None:
    log = run(duration_s=0.01, odometry={"output": "velocities"}, faults=FAULTS)

    assert len(log["odometry"]["stamp_ns"]) == 0
    assert len(log["ranges"]["stamp_ns"]) == 5
    assert log["truth"]["stamp_ns"].tolist() == [0]
