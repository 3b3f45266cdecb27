# SPDX-License-Identifier: Apache-2.0
"""Maps of drives: how right, how honest, what is named, and what they are good for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.eval.relations import relation_errors, relation_metrics
from locfuse.io.log_folder import read_log
from locfuse.io.maps import read_map, write_map
from locfuse.io.tum import read_tum
from locfuse.report.plot import plot_map
from locfuse.run.mapping import MapResult, make_map, write_map_result
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.types import FREE, OCCUPIED, UNKNOWN, ConfigError, GridMap, Log, LogError
from papers.datasets import convert
from support_runs import locfuse, recording

FLOOR: dict[str, Any] = {
    "room_m": [16, 12], "map": {"generate": "rooms", "seed": 2}, "path": {"shape": "roam"},
    "duration_s": 120, "laser": {"range_max_m": 8}, "anchors": {}, "ranges": None, "poses": None,
}  # fmt: skip


def drive(seed: int, **more: Any) -> tuple[RunConfig, Log]:
    """Return a drive through rooms, by wheels and a laser."""
    config = parse_config({"simulation": {**FLOOR, **more}, "start": "truth", "seed": seed})
    return config, load_log(config, None, seed)


def near(walls: NDArray[np.bool_], cells: int) -> NDArray[np.bool_]:
    """Return what is within some cells of a wall, by shifting it about."""
    found = np.zeros_like(walls)
    for rows in range(-cells, cells + 1):
        for columns in range(-cells, cells + 1):
            found |= np.roll(walls, (rows, columns), (0, 1))
    return found


def true_share(made: GridMap, true: GridMap, within: int = 2) -> float:
    """Return the fraction of the walls drawn that are within some cells of true ones."""
    rows, columns = np.nonzero(made.cells == OCCUPIED)
    at = (np.column_stack([columns, rows]) + 0.5) * made.resolution_m + made.origin[:2]
    cells = np.floor((at - true.origin[:2]) / true.resolution_m).astype(np.int64)
    inside = ((cells >= 0) & (cells < true.cells.shape[::-1])).all(axis=1)
    walls = near(true.cells == OCCUPIED, within)
    right = np.zeros(len(cells), np.bool_)
    right[inside] = walls[cells[inside, 1], cells[inside, 0]]
    return float(right.mean())


def errors(made: MapResult, log: Log) -> tuple[float, float]:
    """Return the RMSE of the drive's position, and the mean NEES of three."""
    truth = truth_of(log)
    assert truth is not None
    at, inside = interpolate(truth, made.estimate.stamp_ns)
    assert at.heading is not None
    assert made.estimate.heading is not None
    assert made.estimate.covariance is not None
    off = np.column_stack([made.estimate.position[inside] - at.position,
                           made.estimate.heading[inside] - at.heading])  # fmt: skip
    off[:, 2] = (off[:, 2] + np.pi) % (2 * np.pi) - np.pi
    P = made.estimate.covariance[inside] + 1e-10 * np.eye(3)
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(P), off)
    return float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())), float(nees.mean())


def test_a_floor_is_mapped_and_its_map_localizes_another_drive() -> None:
    config, log = drive(1, duration_s=400)
    assert log.grid is not None
    made = make_map(config, log)
    rmse, nees = errors(made, log)
    assert rmse < 0.05
    assert nees < 6.0
    assert true_share(made.grid, log.grid) > 0.95
    assert sum(loop.kept for loop in made.loops) >= 30
    assert made.findings == ()
    _, other = drive(2)
    of_run = parse_config({"simulation": FLOOR, "start": "truth", "seed": 2, "mcl": {},
                           "use": ["odometry"]})  # fmt: skip
    ours = run(of_run, log=replace(other, grid=made.grid)).metrics["position_rmse_m"]
    theirs = run(of_run, log=other).metrics["position_rmse_m"]
    assert ours < theirs + 0.02


def corridors(seed: int, folder: Path, *, equal: bool) -> tuple[RunConfig, Log]:
    """Return two laps and more of a ring of corridors of 36 by 16 m, with rooms on both sides.

    With `equal` doors are 4 m apart everywhere. Wheels turn by two radians too far in all. The
    laser sees half of a circle, 12 m.
    """
    rng = np.random.default_rng(seed)
    cells = np.full((600, 1000), OCCUPIED, np.int8)

    def clear(left: float, below: float, right: float, top: float) -> None:
        cells[round(below * 20) : round(top * 20), round(left * 20) : round(right * 20)] = FREE

    clear(6, 6, 44, 8)
    clear(6, 22, 44, 24)
    clear(6, 6, 8, 24)
    clear(42, 6, 44, 24)
    for below, top, door in ((1.0, 5.8, 5.7), (24.2, 29.0, 23.9)):
        x = 7.0
        while x < 39.0:
            width = 4.0 if equal else float(rng.uniform(3.0, 5.5))
            if equal or rng.random() < 0.8:
                clear(x, below, x + width - 0.2, top)
                at = x + (1.5 if equal else float(rng.uniform(0.5, width - 1.7)))
                clear(at, door, at + 0.9, door + 0.4)
            x += width
    write_map(GridMap(cells, 0.05), folder / "ring.yaml")
    way = {"shape": "points", "points_m": [[10, 7], [43, 7], [43, 23], [7, 23], [7, 7]],
           "closed": True, "speed_mps": 0.5}  # fmt: skip
    config = parse_config({"start": "truth", "seed": seed, "simulation": {
        "room_m": [50, 30], "map": {"file": str(folder / "ring.yaml")}, "path": way,
        "duration_s": 500, "laser": {"range_max_m": 12, "beams": 181, "field_of_view_deg": 180},
        "odometry": {"turn_bias_radps": 0.004}, "anchors": {}, "ranges": None, "poses": None}}
    )  # fmt: skip
    return config, load_log(config, folder, seed)


@pytest.mark.parametrize(("seed", "equal"), [(0, False), (2, False), (3, True)])
def test_no_corridor_is_folded(seed: int, equal: bool, tmp_path: Path) -> None:
    """Printed with pytest -s, as in results/components.md."""
    config, log = corridors(seed, tmp_path, equal=equal)
    made = make_map(config, log)
    rmse, nees = errors(made, log)
    kept = sum(loop.kept for loop in made.loops)
    print(f"seed {seed}{', equal doors' if equal else ''}: {made.length_m:.0f} m, {kept} loops, "
          f"RMSE {rmse:.3f} m, NEES {nees:.1f} of 3")  # fmt: skip
    assert rmse < 0.3
    assert nees < 6.0
    assert kept > 50
    assert log.grid is not None
    assert true_share(made.grid, log.grid, within=6) > 0.97


def test_covariances_cover_the_errors_of_many_drives() -> None:
    found = np.array([errors(make_map(*drive(seed)), drive(seed)[1]) for seed in range(10, 20)])
    assert found[:, 0].max() < 0.1
    assert found[:, 1].mean() < 4.0
    assert (found[:, 1] < 11.3).all()


def test_without_wheels_a_floor_is_mapped_as_well() -> None:
    config, log = drive(1, duration_s=30)
    tables = {name: table for name, table in log.tables.items() if name != "odometry"}
    made = make_map(config, replace(log, tables=tables))
    assert errors(made, log)[0] < 0.1
    chosen = config.model_copy(update={"use": ["ranges"]})  # what is not in `use` is left alone
    assert make_map(chosen, log).estimate.position.tolist() == made.estimate.position.tolist()


def test_a_corridor_without_wheels_is_said_to_be_a_guess() -> None:
    way = {"shape": "points", "points_m": [[5, 1.5], [34, 1.5]]}
    config, log = drive(
        1, room_m=[40, 3], map={}, duration_s=20, path=way, laser={"range_max_m": 3}
    )
    tables = {name: table for name, table in log.tables.items() if name != "odometry"}
    made = make_map(config, replace(log, tables=tables))
    assert any("along a corridor, and there are no wheels" in text for text in made.findings)
    assert not any("along a corridor" in text for text in make_map(config, log).findings)


def test_a_map_is_continued_and_its_changes_are_marked() -> None:
    config, log = drive(1)
    assert log.grid is not None
    old = make_map(config, log).grid
    cells = old.cells.copy()
    # An old map with a wall across a free place, and without one that is there.
    rows, columns = np.nonzero(cells == FREE)
    row, column = rows[len(rows) // 2], columns[len(rows) // 2]
    cells[row, column : column + 12] = OCCUPIED
    walls = np.argwhere(cells == OCCUPIED)
    gone = walls[np.hypot(*(walls - [60, 60]).T).argmin()]
    window = cells[gone[0] - 6 : gone[0] + 7, gone[1] - 6 : gone[1] + 7]
    window[window == OCCUPIED] = FREE
    _, other = drive(5)
    about = {"xy_m": 0.2, "heading_deg": 5.0}
    continued = parse_config({"simulation": FLOOR, "start": "truth", "start_sigma": about})
    made = make_map(continued, other, onto=replace(old, cells=cells))
    assert made.vanished is not None
    assert made.appeared is not None
    assert made.vanished.sum() >= 8
    assert made.appeared.sum() >= 4
    assert errors(made, other)[0] < 0.06
    assert made.grid.resolution_m == old.resolution_m
    assert true_share(made.grid, log.grid) > 0.95
    assert plot_map(made).axes


def test_another_building_and_no_start_are_named() -> None:
    config, log = drive(1)
    empty = np.full((200, 200), FREE, np.int8)
    empty[0] = empty[-1] = OCCUPIED
    other = GridMap(empty, 0.05, (50.0, 50.0, 0.0))
    made = make_map(config, log, onto=other)
    assert any("no scan fits the old map" in text for text in made.findings)
    searched = config.model_copy(update={"start": "auto"})
    with pytest.raises(ConfigError, match=r"continued from where .*start_sigma"):
        make_map(searched, log, onto=other)
    assert np.allclose(make_map(searched, log).estimate.position[0], 0.0)


def test_what_makes_a_map_doubtful_is_a_sentence() -> None:
    config, log = drive(1, duration_s=6)
    short = make_map(config, log)
    assert any("no place was seen again" in text for text in short.findings)
    scans = log["scans"]
    first = {key: value[:1] for key, value in scans.items()}
    made = make_map(config, replace(log, tables={**log.tables, "scans": first}))
    assert made.keys == 1
    assert any("the robot stood" in text for text in made.findings)
    assert (made.grid.cells != UNKNOWN).any()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"scans": None}, "a map is drawn of laser scans, but the log has none"),
        ({"blind": True}, "no scan has a return"),
    ],
)
def test_what_is_missing_is_one_sentence(change: dict[str, Any], sentence: str) -> None:
    config, log = drive(1, duration_s=2)
    tables = dict(log.tables)
    if "scans" in change:
        del tables["scans"]
    else:
        ranges = np.full_like(log["scans"]["ranges_m"], np.nan)
        tables["scans"] = {**log["scans"], "ranges_m": ranges}
    with pytest.raises(LogError, match=sentence):
        make_map(config, replace(log, tables=tables))


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    config = tmp_path / "robot.yaml"
    config.write_text(
        "start: truth\nsimulation: {room_m: [16, 12], map: {generate: rooms, seed: 2}, "
        "path: {shape: roam}, duration_s: 60, laser: {range_max_m: 8}, ranges: null, poses: null}\n"
    )
    out = tmp_path / "out"
    ran = locfuse("map", config, "--out", out, "--resolution", "0.1")
    assert ran.status == 0, ran.err
    assert "m driven" in ran.out
    assert (out / "map.png").stat().st_size > 10_000
    grid = read_map(out / "map.yaml")
    assert grid.resolution_m == 0.1
    assert (grid.cells == OCCUPIED).sum() > 100
    assert len(read_tum(out / "drive.tum")) > 50
    assert (out / "loops.csv").read_text().startswith("from_s,to_s,kept,explained,agreement\n")
    again = locfuse("map", config, "--out", out, "--onto", out / "map.yaml")
    assert again.status == 0, again.err
    assert "m^2 of walls are new" in again.out
    for arguments, sentence in (
        (("--resolution", "0"), "the resolution is 0, expected 0.001 to 10 m"),
        (("--onto", tmp_path / "none.yaml"), "none.yaml"),
        (("--log", tmp_path / "nothing"), "nothing"),
    ):
        ran = locfuse("map", config, "--out", out, *arguments)
        assert ran.status == 1
        assert sentence in ran.err


def test_what_is_written_is_a_map_of_a_log_folder(tmp_path: Path) -> None:
    made = make_map(*drive(1, duration_s=10))
    write_map_result(made, tmp_path)
    again = read_map(tmp_path / "map.yaml")
    assert np.array_equal(again.cells, made.grid.cells)
    assert again.origin == made.grid.origin


def test_intel_lab_is_mapped_as_well_as_by_the_best_that_is_published(tmp_path: Path) -> None:
    convert("intel_lab", recording("intel-lab"), tmp_path)
    log = read_log(tmp_path / "test")
    made = make_map(parse_config({"start": "truth", "log": str(tmp_path / "test")}), log)
    found = relation_metrics(relation_errors(made.estimate, log["relations"]))["all"]
    assert found["translation_mean_m"] <= 0.030
    assert found["rotation_mean_deg"] <= 1.05
    kept = sum(loop.kept for loop in made.loops)
    assert kept > 0.97 * len(made.loops) > 500
