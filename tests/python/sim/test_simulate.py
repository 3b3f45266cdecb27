# SPDX-License-Identifier: Apache-2.0
"""A scenario becomes a log: the right tables, the same bits for the same seed, nothing coupled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.scenario import Scenario
from locfuse.io.maps import write_map
from locfuse.sim.scenario import simulate
from locfuse.types import ConfigError, GridMap, Log

SHAPES = ["circle", "eight", "square", "star", "polygon", "waypoints"]
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


WORLD: dict[str, Any] = {
    "room_m": (12.0, 9.0),
    "map": {"generate": "rooms", "seed": 3, "resolution_m": 0.1},
    "path": {"shape": "roam", "speed_mps": 0.5},
    "laser": {"beams": 36, "range_max_m": 20.0, "sigma_m": 0.0},
}


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


# Worlds ----------------------------------------------------------------------------------------


def test_a_robot_roams_a_world_that_does_not_change_with_the_seed_of_the_drive() -> None:
    first, same, other = (run(seed, **WORLD) for seed in (5, 5, 6))

    assert first.grid is not None
    assert other.grid is not None
    np.testing.assert_array_equal(first.grid.cells, other.grid.cells)
    for stem in first.tables:
        assert_table_equal(first, same, stem)
    assert np.abs(first["truth"]["x_m"] - other["truth"]["x_m"]).max() > 1.0
    # 0.3 m from every wall, less half a diagonal: straight ways cross the corners of cells.
    assert np.nanmin(first["scans"]["ranges_m"]) > 0.3 - 0.5 * np.hypot(0.1, 0.1)


def test_walls_are_added_to_a_world() -> None:
    fault = {"kind": "nlos", "walls": [[1.0, 0.0, 1.0, 1.0]], "extra_m": 0.1}
    world = {**WORLD, "laser": None}
    plain = run(**world).grid
    walled = run(**{**world, "map": {**WORLD["map"], "walls": [[2.0, 0.0, 2.0, 0.5]]}},
                 faults=[fault]).grid  # fmt: skip

    assert plain is not None
    assert walled is not None
    assert (plain.cells[1:10, [10, 20]] == 0).all()
    assert (walled.cells[1:10, 10] == 100).all()
    assert (walled.cells[1:6, 20] == 100).all()
    assert (walled.cells[6:10, 20] == 0).all()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"room_m": (2.5, 20.0), "map": {"generate": "rooms"}, "path": {"shape": "roam"}},
         "simulation.map: rooms of 2.5 m x 20 m, expected at least 3 m x 3 m; room_m is the size"),
        ({"map": {"generate": "zhang", "resolution_m": 0.5}},
         "simulation.map: resolution_m is 0.5, expected > 0 and at most 0.25"),
        ({"map": {}, "path": {"shape": "roam", "clearance_m": 6.0}}, "no room to roam"),
        ({"map": {"walls": [[8.0, 4.0, 8.0, 6.0]]}},
         r"the robot starts in a wall of the map at \(8.00, 5.00\); change simulation.path"),
        ({"map": {"walls": [[7.0, 6.0, 9.0, 6.0]]}},
         r"the robot drives, after 4.5 s, into a wall of the map at \(7.84, 5.98\)"),
    ],
)  # fmt: skip
def test_a_drive_that_the_map_does_not_allow_is_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        run(**changes)


def test_a_map_that_the_robot_cannot_be_on_is_refused(tmp_path: Path) -> None:
    for cells, text in (
        (np.zeros((20, 20), np.int8), r"starts at \(8.00, 5.00\), outside of the map"),
        (np.full((100, 100), -1, np.int8), "simulation.map has no free cell"),
        (np.full((100, 100), 100, np.int8), "simulation.map has no free cell"),
    ):
        write_map(GridMap(cells, 0.1), tmp_path / "map.yaml")
        scenario = Scenario.model_validate({"map": {"file": "map.yaml"}})
        with pytest.raises(ConfigError, match=text):
            simulate(scenario, np.random.default_rng(1), tmp_path)


def test_a_robot_may_drive_where_nothing_is_known_and_off_the_map(tmp_path: Path) -> None:
    cells = np.full((100, 85), -1, np.int8)
    cells[:, :3] = 0
    write_map(GridMap(cells, 0.1, (0.0, 2.5, 0.0)), tmp_path / "map.yaml")  # north of y = 2.5
    scenario = Scenario.model_validate({"map": {"file": "map.yaml"}, "laser": {}})
    log = simulate(scenario, np.random.default_rng(1), tmp_path)
    assert log["truth"]["y_m"].min() < 2.5
    assert np.isnan(log["scans"]["ranges_m"]).all()


def test_a_map_of_one_cell_is_a_map(tmp_path: Path) -> None:
    write_map(GridMap(np.zeros((1, 1), np.int8), 10.0), tmp_path / "map.yaml")
    scenario = Scenario.model_validate({"map": {"file": "map.yaml"}, "laser": {}})
    log = simulate(scenario, np.random.default_rng(1), tmp_path)
    assert np.isnan(log["scans"]["ranges_m"]).all()
