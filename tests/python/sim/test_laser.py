# SPDX-License-Identifier: Apache-2.0
"""Beams end where a wall begins, and err as much as they state."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.scenario import Covered, LaserSensor, MaxRange, Scenario
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.maps import write_map
from locfuse.run.run import run
from locfuse.sim import laser
from locfuse.sim.room import room_grid
from locfuse.sim.scenario import simulate
from locfuse.sim.sensors import stamps
from locfuse.sim.trajectory import drive_of
from locfuse.types import ConfigError, FloatArray, GridMap, Log, LogError
from support_statistics import assert_standard_normal

EXACT = LaserSensor(beams=4, range_min_m=0.0, range_max_m=50.0, sigma_m=0.0)
ROOM = room_grid((10.0, 10.0), [], 0.05)  # faces 2.5 cm inside of the lines


def rng(seed: int = 4) -> np.random.Generator:
    return np.random.default_rng(seed)


def one_scan(
    pose: tuple[float, float, float], sensor: LaserSensor, grid: GridMap = ROOM
) -> FloatArray:
    standing = drive_of(pose, [(1.0, 0.0, 0.0)])
    seen = laser.scans(standing, stamps(1.0, 0.0), grid, sensor, rng())
    return np.asarray(seen["ranges_m"][0], dtype=np.float64)


# Geometry ------------------------------------------------------------------------------------


def test_beams_along_the_axes_end_at_the_faces_of_the_walls() -> None:
    seen = one_scan((4.0, 3.0, 0.0), EXACT)  # west, south, east, north
    np.testing.assert_allclose(seen, [3.975, 2.975, 5.975, 6.975], atol=1e-12)


def test_the_first_beam_stands_half_the_field_of_view_to_the_right() -> None:
    full = laser.geometry(EXACT)
    half = laser.geometry(EXACT.model_copy(update={"field_of_view_deg": 180.0, "beams": 181}))

    assert full["angle_min_rad"] == -math.pi
    assert full["angle_increment_rad"] == pytest.approx(math.pi / 2)
    assert half["angle_min_rad"] == -math.pi / 2
    assert half["angle_increment_rad"] == pytest.approx(math.radians(1.0))


def test_the_beams_of_a_laser_that_hangs_upside_down_run_clockwise() -> None:
    over = EXACT.model_copy(update={"mounting": "upside_down"})
    half = {"field_of_view_deg": 180.0, "beams": 3}

    seen = one_scan((4.0, 3.0, 0.0), over)  # west, north, east, south
    np.testing.assert_allclose(seen, [3.975, 6.975, 5.975, 2.975], atol=1e-12)
    ahead = one_scan((4.0, 3.0, 0.0), over.model_copy(update=half))  # north, east, south
    np.testing.assert_allclose(ahead, [6.975, 5.975, 2.975], atol=1e-12)
    assert laser.geometry(over)["angle_min_rad"] == math.pi
    assert laser.geometry(over)["angle_increment_rad"] == pytest.approx(-0.5 * math.pi)


def test_a_laser_in_front_that_looks_left_sees_from_there() -> None:
    sensor = EXACT.model_copy(update={"pose_in_body": (0.5, 0.25, 90.0)})
    # The body looks north: the laser stands 0.5 m north and 0.25 m west of it and looks west.
    seen = one_scan((4.0, 3.0, 0.5 * math.pi), sensor)  # east, north, west, south
    np.testing.assert_allclose(seen, [6.225, 6.475, 3.725, 3.475], atol=1e-12)


# What gives no return ------------------------------------------------------------------------


def test_what_is_too_near_or_too_far_gives_no_return() -> None:
    sensor = EXACT.model_copy(update={"range_min_m": 3.0, "range_max_m": 6.0})
    seen = one_scan((4.0, 3.0, 0.0), sensor)
    np.testing.assert_allclose(seen, [3.975, np.nan, 5.975, np.nan], atol=1e-12)


def test_as_many_beams_are_lost_as_stated() -> None:
    sensor = LaserSensor(range_max_m=20.0, dropout=0.2)
    standing = drive_of((5.0, 5.0, 0.0), [(1000.0, 0.0, 0.0)])

    seen = laser.scans(standing, stamps(1.0, 99.0), ROOM, sensor, rng())["ranges_m"]

    share = float(np.isnan(seen).mean())
    assert share == pytest.approx(0.2, abs=4.0 * math.sqrt(0.2 * 0.8 / seen.size))


# Noise ---------------------------------------------------------------------------------------


def test_noise_is_as_stated() -> None:
    standing = drive_of((5.0, 5.0, 0.3), [(1000.0, 0.0, 0.0)])
    sensor = LaserSensor(range_max_m=20.0, sigma_m=0.03)

    seen = laser.scans(standing, stamps(1.0, 49.0), ROOM, sensor, rng())["ranges_m"]
    exact = one_scan((5.0, 5.0, 0.3), sensor.model_copy(update={"sigma_m": 0.0}))

    assert_standard_normal((seen - exact) / 0.03)


def test_switching_dropouts_on_changes_no_bit_of_the_beams_that_are_left() -> None:
    pose = (3.0, 4.0, 1.0)
    sensor = LaserSensor(range_max_m=20.0)
    everything = one_scan(pose, sensor)
    less = one_scan(pose, sensor.model_copy(update={"dropout": 0.5}))
    left = ~np.isnan(less)
    assert 100 < left.sum() < 260
    np.testing.assert_array_equal(less[left], everything[left])


# In a scenario -------------------------------------------------------------------------------


def drive(seed: int = 5, base: Path | None = None, **changes: Any) -> Log:
    settings = {"duration_s": 4.0, "laser": {}, "map": {}, **changes}
    return simulate(Scenario.model_validate(settings), np.random.default_rng(seed), base)


def test_a_scenario_with_a_laser_has_scans_their_geometry_and_the_grid() -> None:
    log = drive(laser={"rate_hz": 2.0, "beams": 90})

    assert log["scans"]["ranges_m"].shape == (9, 90)
    assert log.laser is not None
    assert log.laser["angle_increment_rad"] == pytest.approx(math.radians(4.0))
    assert log.grid is not None
    np.testing.assert_array_equal(log.grid.cells, ROOM.cells)
    assert set(log["scans"]["stamp_ns"]) <= set(log["truth"]["stamp_ns"])


def test_the_laser_changes_no_bit_of_the_other_sensors() -> None:
    with_laser, without = drive(), drive(laser=None)

    assert "scans" not in without
    assert without.grid is not None
    for stem in ("odometry", "ranges", "poses"):
        for name, column in without[stem].items():
            np.testing.assert_array_equal(column, with_laser[stem][name])


def test_one_seed_gives_the_same_scans_and_another_one_others() -> None:
    first, same, other = (drive(seed)["scans"]["ranges_m"] for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, same)
    assert np.nanmin(np.abs(first - other)) > 0.0


def test_the_walls_that_block_ranges_block_beams() -> None:
    fault = {"kind": "nlos", "walls": [[9.0, 1.0, 9.0, 9.0]], "extra_m": 1.0}
    sensor = {"beams": 4, "sigma_m": 0.0, "range_max_m": 10.0}
    log = drive(laser=sensor, faults=[fault], map={"walls": [[7.0, 7.0, 9.0, 7.0]]})

    # Starts at (8, 5), heading north: the beams point south, east, north and west.
    expected = [4.975, 0.975, 1.975, 7.975]
    np.testing.assert_allclose(log["scans"]["ranges_m"][0], expected, atol=1e-9)


def test_the_map_may_be_a_file_beside_the_configuration(tmp_path: Path) -> None:
    write_map(room_grid((9.0, 9.0), [], 0.1), tmp_path / "hall.yaml")
    log = drive(base=tmp_path, map={"file": "hall.yaml"}, laser={"beams": 4, "sigma_m": 0.0})

    assert log.grid is not None
    assert log.grid.cells.shape == (91, 91)
    assert log["scans"]["ranges_m"][0][1] == pytest.approx(0.95)
    with pytest.raises(LogError, match=r"absent\.yaml: no such file"):
        drive(base=tmp_path, map={"file": "absent.yaml"})


def test_a_simulated_log_with_scans_survives_the_way_through_a_folder(tmp_path: Path) -> None:
    log = drive()
    write_log(log, tmp_path)
    again = read_log(tmp_path)

    np.testing.assert_array_equal(again["scans"]["ranges_m"], log["scans"]["ranges_m"])
    assert again.laser == log.laser
    assert log.grid is not None
    assert again.grid is not None
    np.testing.assert_array_equal(again.grid.cells, log.grid.cells)


def test_a_run_of_a_simulation_with_a_laser_has_scans_and_grid(tmp_path: Path) -> None:
    write_map(ROOM, tmp_path / "map.yaml")
    simulation = {"duration_s": 5.0, "laser": {}, "map": {"file": "map.yaml"}}
    result = run(parse_config({"simulation": simulation}), base=tmp_path)

    assert "scans" in result.log
    assert result.log.grid is not None
    assert result.metrics["position_rmse_m"] < 0.3


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "nothing to see": ({"laser": {}}, "a laser needs something to see; add 'map: {}'"),
    "order": ({"laser": {"range_min_m": 4.0}}, "range_min_m is 4.0 and range_max_m is 3.5"),
    "one beam": ({"laser": {"beams": 1}}, "laser.beams: expected at least 2"),
    "view": ({"laser": {"field_of_view_deg": 361.0}}, "laser.field_of_view_deg: expected at most"),
    "both": ({"map": {"file": "a.yaml", "resolution_m": 0.1}}, "nothing for resolution_m"),
    "too fine": ({"map": {"resolution_m": 1e-6}}, "which makes 1e\\+07 cells"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_laser_that_cannot_be_is_refused(case: str) -> None:
    changes, text = REFUSED[case]
    with pytest.raises(ConfigError, match=text):
        parse_config({"simulation": changes})


# Covers --------------------------------------------------------------------------------------


def under(fault: dict[str, Any], **keys: Any) -> FloatArray:
    """Return two scans, at 0 s and 1 s, from the middle of a room, with a cover."""
    sensor = EXACT.model_copy(update={"beams": 8} | keys)
    standing = drive_of((5.0, 5.0, 0.7), [(1.0, 0.0, 0.0)])
    cover = Covered.model_validate({"kind": "covered"} | fault)
    seen = laser.scans(standing, stamps(1.0, 1.0), ROOM, sensor, rng(), [(cover, rng())])
    return np.asarray(seen["ranges_m"], dtype=np.float64)


def test_the_right_half_is_covered_and_the_rest_is_as_it_was() -> None:
    bare = laser.scans(drive_of((5.0, 5.0, 0.7), [(1.0, 0.0, 0.0)]), stamps(1.0, 1.0), ROOM,
                       EXACT.model_copy(update={"beams": 8}), rng())["ranges_m"]  # fmt: skip
    seen = under({"from_deg": -180, "to_deg": 0})  # beams at -180, -135, .. 135
    assert np.isnan(seen[:, :5]).all()
    np.testing.assert_array_equal(seen[:, 5:], bare[:, 5:])


@pytest.mark.parametrize(
    ("edges", "hidden"),
    [((135, 225), [0, 1, 7]), ((-225, -135), [0, 1, 7]), ((-180, 180), list(range(8))),
     ((10, 40), []), ((45, 45.0001), [5])],
)  # fmt: skip
def test_a_cover_may_reach_over_the_back(edges: tuple[float, float], hidden: list[int]) -> None:
    seen = under({"from_deg": edges[0], "to_deg": edges[1]})
    assert np.flatnonzero(np.isnan(seen[0])).tolist() == hidden


def test_a_cover_is_on_the_same_side_of_a_laser_that_hangs_upside_down() -> None:
    seen = under({"from_deg": 30, "to_deg": 60}, mounting="upside_down")
    angle = laser.geometry(EXACT.model_copy(update={"beams": 8, "mounting": "upside_down"}))
    left = angle["angle_min_rad"] + angle["angle_increment_rad"] * np.arange(8)
    np.testing.assert_array_equal(np.isnan(seen[0]), np.isclose(left, math.pi / 4))


def test_a_cover_may_be_taken_off() -> None:
    seen = under({"from_deg": -180, "to_deg": 180, "from_s": 0.5, "to_s": 2})
    assert not np.isnan(seen[0]).any()
    assert np.isnan(seen[1]).all()


def test_what_is_covered_may_read_the_maximum() -> None:
    cover, full = Covered(from_deg=-180, to_deg=0), MaxRange()
    standing = drive_of((5.0, 5.0, 0.7), [(1.0, 0.0, 0.0)])
    seen = laser.scans(standing, stamps(1.0, 0.0), ROOM, EXACT, rng(),
                       [(full, rng()), (cover, rng())])  # fmt: skip
    assert (seen["ranges_m"][0, :3] == EXACT.range_max_m).all()


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"from_deg": 0, "to_deg": 0}, "expected from_deg < to_deg"),
        ({"from_deg": -180, "to_deg": 181}, "at most a full turn"),
        ({"from_deg": 0, "to_deg": 90, "from_s": 1}, "belong together"),
        ({"from_deg": 0, "to_deg": 90, "from_s": 2, "to_s": 1}, "from_s < to_s"),
    ],
)
def test_covers_that_make_no_sense_are_refused(wrong: dict[str, float], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Covered.model_validate({"kind": "covered"} | wrong)


def test_a_configuration_may_cover_the_laser() -> None:
    config = parse_config({"simulation": {
        "duration_s": 2, "laser": {"range_max_m": 12}, "map": {},
        "faults": [{"kind": "covered", "from_deg": -180, "to_deg": 0}],
    }})  # fmt: skip
    assert config.simulation is not None
    ranges = simulate(config.simulation, rng())["scans"]["ranges_m"]
    assert np.isnan(ranges[:, :181]).all()
    assert np.isfinite(ranges[:, 181:]).any()
