# SPDX-License-Identifier: Apache-2.0
"""Glass lets beams pass, people hide what is behind them, and no other beam changes a bit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.config.scenario import Glass, People, Scenario
from locfuse.sim.maps import rooms
from locfuse.sim.obstacles import clearness, hidden_by, walk
from locfuse.sim.room import room_grid
from locfuse.sim.scenario import simulate
from locfuse.sim.space import cell_of, room_for
from locfuse.types import Columns, ConfigError, FloatArray, GridMap, Log

# Starts at (8, 5), heading north: the beams point south, east, north and west.
FOUR = {"beams": 4, "sigma_m": 0.0, "range_max_m": 20.0}
BEAMS = {"beams": 90, "range_max_m": 20.0}
WALL = [9.0, 1.0, 9.0, 9.0]  # a metre to the east, another one before the wall of the room


def rng(seed: int = 3) -> np.random.Generator:
    return np.random.default_rng(seed)


def run(*faults: dict[str, Any], seed: int = 5, **changes: Any) -> Log:
    settings = {
        "duration_s": 4.0,
        "laser": BEAMS,
        "map": {"walls": [WALL]},
        "faults": list(faults),
        **changes,
    }
    return simulate(Scenario.model_validate(settings), np.random.default_rng(seed))


def beams(log: Log) -> FloatArray:
    return np.asarray(log["scans"]["ranges_m"], dtype=np.float64)


def same(first: FloatArray, second: FloatArray) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = (first == second) | (np.isnan(first) & np.isnan(second))
    return equal


def assert_only_scans_differ(first: Log, second: Log) -> None:
    assert set(first.tables) == set(second.tables)
    for stem in set(first.tables) - {"scans"}:
        assert_equal(first[stem], second[stem])
    assert first.grid is not None
    assert second.grid is not None
    np.testing.assert_array_equal(first.grid.cells, second.grid.cells)
    assert first.laser == second.laser


def assert_equal(first: Columns, second: Columns) -> None:
    assert set(first) == set(second)
    for name, column in first.items():
        np.testing.assert_array_equal(column, second[name], err_msg=name)


FAULTS: dict[str, dict[str, Any]] = {
    "glass": {"kind": "glass", "share": 0.3, "panes": [WALL], "probability": 0.6},
    "people": {"kind": "people", "count": 4},
    "max_range": {"kind": "max_range", "probability": 0.5},
}
SHORT = {**BEAMS, "range_max_m": 3.5}


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_of_the_laser_is_off_unless_asked_for_and_changes_scans_only(kind: str) -> None:
    assert Scenario().faults == []
    clean, faulty = run(laser=SHORT), run(FAULTS[kind], laser=SHORT)

    assert_only_scans_differ(clean, faulty)
    differs = ~same(beams(clean), beams(faulty))
    assert 0.0 < differs.mean() < 0.6


@pytest.mark.parametrize("kind", FAULTS)
def test_one_seed_gives_the_same_faults_and_another_one_others(kind: str) -> None:
    first, again = run(FAULTS[kind], laser=SHORT), run(FAULTS[kind], laser=SHORT)
    for stem in first.tables:
        assert_equal(first[stem], again[stem])

    hit = [
        ~same(beams(run(laser=SHORT, seed=seed)), beams(run(FAULTS[kind], laser=SHORT, seed=seed)))
        for seed in (5, 6)
    ]
    assert (hit[0] != hit[1]).any()


def test_what_stands_before_a_fault_of_the_laser_does_not_change_its_draws() -> None:
    people = FAULTS["people"]
    first = run({"kind": "bias", "offset_m": 0.1}, people)
    other = run({"kind": "outliers", "probability": 0.1, "magnitude_m": 1.0}, people)
    np.testing.assert_array_equal(beams(first), beams(other))


# Glass -----------------------------------------------------------------------------------------


def test_a_beam_passes_a_pane_and_ends_at_the_wall_behind() -> None:
    glass = {"kind": "glass", "panes": [WALL], "probability": 1.0}
    clean, faulty = (run(*faults, laser=FOUR) for faults in ([], [glass]))
    np.testing.assert_allclose(beams(clean)[0], [4.975, 0.975, 4.975, 7.975], atol=1e-9)
    np.testing.assert_allclose(beams(faulty)[0], [4.975, 1.975, 4.975, 7.975], atol=1e-9)


def test_a_beam_that_passes_the_wall_of_a_room_does_not_return() -> None:
    glass = {"kind": "glass", "panes": [[10.0, 4.0, 10.0, 6.0]], "probability": 1.0}
    seen = beams(run(glass, laser=FOUR, map={}))[0]
    np.testing.assert_allclose(seen, [4.975, np.nan, 4.975, 7.975], atol=1e-9)


def test_beams_pass_a_pane_as_often_as_asked_and_the_others_keep_every_bit() -> None:
    glass = {"kind": "glass", "panes": [WALL], "probability": 0.3}
    sensor = {**BEAMS, "rate_hz": 20.0}
    always = {**glass, "probability": 1.0}
    clean, faulty, all_pass = (beams(run(*f, laser=sensor)) for f in ([], [glass], [always]))

    through, passed = ~same(clean, all_pass), ~same(clean, faulty)
    assert not passed[~through].any()
    np.testing.assert_array_equal(faulty[passed], all_pass[passed])
    share = passed[through].mean()
    assert share == pytest.approx(0.3, abs=4.0 * math.sqrt(0.3 * 0.7 / through.sum()))


def test_a_share_of_the_walls_is_glass_in_whole_pieces() -> None:
    # 2 m x 1 m in cells of 0.1 m: pieces of ten cells a side, 21 x 11 cells, so 3 x 2 of them hold
    # walls.
    grid = room_grid((2.0, 1.0), [], 0.1)
    clear = clearness(grid, Glass(share=0.5, probability=0.8), rng())

    assert set(np.unique(clear).tolist()) == {0.0, 0.8}
    assert not clear[grid.cells == 0].any()
    chosen = 0
    for row in (slice(0, 10), slice(10, 11)):
        for column in (slice(0, 10), slice(10, 20), slice(20, 21)):
            walls = grid.cells[row, column] == 100
            of_piece = clear[row, column][walls] > 0.0
            assert of_piece.all() or not of_piece.any()
            chosen += int(of_piece.all())
    assert chosen == 3
    everything = clearness(grid, Glass(share=1.0, probability=1.0), rng())
    np.testing.assert_array_equal(everything == 1.0, grid.cells == 100)


def test_of_two_kinds_of_glass_the_clearer_one_counts() -> None:
    dim = {"kind": "glass", "panes": [WALL], "probability": 0.2}
    clear = {"kind": "glass", "panes": [WALL], "probability": 1.0}
    np.testing.assert_array_equal(beams(run(dim, clear)), beams(run(clear)))


def test_a_pane_on_a_map_that_is_turned_is_in_its_place() -> None:
    cells = np.zeros((3, 4), np.int8)
    cells[1] = 100
    grid = GridMap(cells, 1.0, (5.0, 1.0, 0.5 * math.pi))  # row 1 spans x 3 to 4, y 1 to 5
    clear = clearness(grid, Glass(panes=[(3.5, 2.5, 3.5, 3.5)], probability=1.0), rng())
    assert clear.tolist() == [[0, 0, 0, 0], [0, 1, 1, 0], [0, 0, 0, 0]]


def test_a_pane_where_no_wall_is_is_refused() -> None:
    glass = {"kind": "glass", "panes": [WALL, [5.0, 4.0, 5.0, 6.0]], "probability": 1.0}
    with pytest.raises(ConfigError, match=r"from \(5.0, 4.0\) to \(5.0, 6.0\) touches no wall"):
        run(glass)


# People ----------------------------------------------------------------------------------------


def test_beams_end_where_they_enter_a_disc() -> None:
    start = np.array([[1.0, 1.0]])
    people = np.array([[[4.0, 1.0], [1.0, -1.0], [1.0, 9.0], [1.0, 7.0]]])
    headings = np.array([[0.0, -0.5 * math.pi, 0.5 * math.pi, math.pi, math.asin(0.15 / 3.0)]])

    hidden = hidden_by(people, 0.25, start, headings)

    # The last beam passes the disc's middle, 3 m ahead, by 15 cm: 4/5 of the radius are left.
    aslant = math.sqrt(3.0**2 - 0.15**2) - 0.2
    np.testing.assert_allclose(hidden, [[2.75, 1.75, 5.75, math.inf, aslant]], atol=1e-12)


def test_a_beam_that_starts_in_a_disc_goes_no_way() -> None:
    inside = hidden_by(np.array([[[0.1, 0.0]]]), 0.25, np.zeros((1, 2)), np.array([[0.0, 3.0]]))
    assert inside.tolist() == [[0.0, 0.0]]


def test_people_hide_walls_and_no_other_beam_changes_a_bit() -> None:
    clean, faulty = beams(run()), beams(run(FAULTS["people"]))
    differs = ~same(clean, faulty)
    nearer = faulty[differs & ~np.isnan(clean)] < clean[differs & ~np.isnan(clean)]
    assert 0.02 < differs.mean() < 0.5
    assert (nearer | np.isnan(faulty[differs & ~np.isnan(clean)])).all()


def test_somebody_who_has_one_place_stands_there() -> None:
    # 5 x 5 free cells of 0.1 m around (5.05, 9.05) fit a disc of 0.25 m in their middle alone.
    cells = np.full((100, 100), -1, np.int8)
    cells[88:93, 48:53] = 0
    spot = walk(GridMap(cells, 0.1), People(count=3), np.linspace(0.0, 30.0, 50), rng())
    assert np.abs(spot - [5.05, 9.05]).max() <= 0.05


def test_people_walk_at_their_speed_where_there_is_room_for_them() -> None:
    grid = rooms(rng(), (12.0, 9.0), 0.05)
    moved = GridMap(grid.cells, 0.05, (3.0, -2.0, 0.7))
    people, seconds = People(count=7, speed_mps=0.8), np.arange(0.0, 120.0, 0.0625)  # a cell a step

    way = walk(moved, people, seconds, rng())

    assert way.shape == (1920, 7, 2)
    row, column = cell_of(moved, way.reshape(-1, 2)).T
    assert room_for(moved, 0.25)[row, column].all()
    speed = np.hypot(*np.moveaxis(np.diff(way, axis=0), -1, 0)) / 0.0625
    assert speed.max() <= 0.8 + 1e-9
    assert np.median(speed) == pytest.approx(0.8)
    assert (np.ptp(way, axis=0).max(axis=1) > 2.0).all()  # nobody is stuck


def test_a_walk_does_not_depend_on_when_it_is_looked_at() -> None:
    grid = room_grid((5.0, 5.0), [], 0.1)
    often = walk(grid, People(count=2), np.arange(0.0, 20.01, 0.1), rng())
    rarely = walk(grid, People(count=2), np.arange(0.0, 20.01, 2.0), rng())
    np.testing.assert_allclose(often[::20], rarely, atol=1e-9)


def test_people_without_room_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"no room on the map for people of radius_m 6\.0"):
        run({"kind": "people", "count": 1, "radius_m": 6.0})


@pytest.mark.parametrize("radius", [0.25, 0.01])
def test_nobody_leaves_the_map(radius: float) -> None:
    grid = GridMap(np.zeros((20, 20), np.int8), 0.1)
    way = walk(grid, People(count=9, radius_m=radius), np.arange(0.0, 60.0, 0.1), rng())
    assert way.min() >= 0.0
    assert way.max() <= 2.0


# Full scale ------------------------------------------------------------------------------------


def test_beams_without_a_return_read_the_maximum() -> None:
    sensor = {**FOUR, "range_max_m": 4.98, "range_min_m": 1.0}
    seen = beams(run({"kind": "max_range"}, laser=sensor))[0]
    # Too near in the east and too far in the west, else walls as they are.
    np.testing.assert_allclose(seen, [4.975, 4.98, 4.975, 4.98], atol=1e-9)


def test_as_many_beams_read_the_maximum_as_asked() -> None:
    sensor = {"beams": 360, "range_max_m": 5.0}
    fault = {"kind": "max_range", "probability": 0.25}
    clean, faulty = beams(run(laser=sensor)), beams(run(fault, laser=sensor))
    none = np.isnan(clean)
    np.testing.assert_array_equal(faulty[~none], clean[~none])
    assert set(np.unique(faulty[none & ~np.isnan(faulty)]).tolist()) == {5.0}
    share = (faulty[none] == 5.0).mean()
    assert share == pytest.approx(0.25, abs=4.0 * math.sqrt(0.25 * 0.75 / none.sum()))
