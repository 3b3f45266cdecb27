# SPDX-License-Identifier: Apache-2.0
"""Runs started from nothing: by driving, by a scan on a map, by neither."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import Dataset, RunConfig
from locfuse.eval.errors import errors_against
from locfuse.io.log_folder import read_log
from locfuse.report.plot import plot_start
from locfuse.report.plot.style import MUTED
from locfuse.report.results import write_results
from locfuse.run.run import load_log, run
from locfuse.run.start import returns_of, scans_of
from locfuse.types import FloatArray, GridMap, Log, LogError, RunResult, Start
from support_figures import colours_at
from support_runs import CONFIGS, recording, write_folder

NOISE = {"range": {"sigma_m": 0.02, "sigma_relative": 0.015}}
HALL = {
    "path": {"shape": "eight"},
    "duration_s": 20.0,
    "poses": None,
    "laser": {"range_max_m": 12.0},
    "map": {"walls": [[2.0, 0.0, 2.0, 3.0], [10.0, 7.0, 7.5, 7.0], [0.0, 6.0, 1.5, 6.0]]},
}


def config_of(simulation: dict[str, Any], **more: Any) -> RunConfig:
    return parse_config({"simulation": simulation, "start": "auto", "estimator": NOISE, **more})


def rmse_of_second_half(result: RunResult) -> float:
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    later = errors.stamp_ns >= (errors.stamp_ns[0] + errors.stamp_ns[-1]) // 2
    return float(np.sqrt(np.mean(np.sum(errors.position[later] ** 2, axis=1))))


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_finds_the_pose_without_a_laser(seed: int) -> None:
    config = config_of({"path": {"shape": "square"}, "duration_s": 60.0, "poses": None})
    result = run(config, seed=seed)
    assert result.start is not None
    assert 0.5 < result.start.seconds < 20.0
    assert result.metrics["start_s"] == result.start.seconds
    assert result.metrics["position_rmse_m"] < 0.1
    assert result.metrics["heading_rmse_deg"] < 5.0


@pytest.mark.parametrize("seed", range(5))
def test_one_scan_on_a_map_is_enough(seed: int) -> None:
    result = run(config_of(HALL), seed=seed)
    assert result.start is not None
    assert result.truth is not None
    assert result.truth.heading is not None
    row = int(np.searchsorted(result.truth.stamp_ns, result.start.stamp_ns))
    assert result.start.seconds <= 0.2
    assert np.hypot(*(result.start.pose[:2] - result.truth.position[row])) < 0.05
    assert abs(result.start.pose[2] - result.truth.heading[row]) < np.deg2rad(2.0)
    assert result.start.used_scans


def test_a_room_that_looks_the_same_from_two_sides_is_ambiguous_until_it_drives() -> None:
    result = run(config_of({**HALL, "map": {}}), seed=1)
    assert result.start is not None
    assert max(len(poses) for _, poses in result.start.steps) >= 2
    assert result.start.seconds > 0.5
    assert result.metrics["position_rmse_m"] < 0.1
    assert result.metrics["heading_rmse_deg"] < 5.0


def test_no_truth_is_needed_and_none_is_used() -> None:
    config = config_of(HALL)
    log = load_log(config, None, 3)
    blind = replace(log, tables={k: v for k, v in log.tables.items() if k != "truth"})
    ours, theirs = run(config, blind), run(config, log)
    assert ours.estimate.position.tobytes() == theirs.estimate.position.tobytes()


def test_messages_used_for_the_start_are_reported_and_not_fused_twice() -> None:
    result = run(config_of(HALL), seed=2)
    assert result.start is not None
    used = result.outcomes.verdict == "ignored"
    assert used.any()
    assert set(result.outcomes.reason[used]) == {"used for the start"}
    received = used & (result.outcomes.source == "ranges")
    assert (result.outcomes.stamp_ns[received] <= result.start.stamp_ns).all()
    later = (result.outcomes.source == "ranges") & ~received
    assert (result.outcomes.stamp_ns[later] > result.start.stamp_ns).all()
    assert (result.outcomes.verdict[later] == "fused").mean() > 0.99
    assert int(result.estimate.stamp_ns[0]) == result.start.stamp_ns


def test_a_robot_that_stands_without_a_laser_gets_the_missing_input_named() -> None:
    config = config_of({"path": {"shape": "circle", "speed_mps": 1e-6}, "duration_s": 5.0,
                        "poses": None})  # fmt: skip
    with pytest.raises(LogError, match="heading is not known yet: drive on"):
        run(config)


def test_a_log_without_ranges_gets_the_missing_input_named(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "log", {"ranges.csv": None})
    with pytest.raises(LogError, match="no range, position or pose yet, and no two landmarks"):
        run(parse_config({"start": "auto"}), read_log(folder))


# Maps and scans of other kinds -----------------------------------------------------------------


def with_scans(log: Log, ranges_m: FloatArray) -> Log:
    scans = {**log["scans"], "ranges_m": ranges_m}
    return replace(log, tables={**log.tables, "scans": scans})


def start_of(log: Log, config: RunConfig) -> Start:
    found = run(config, log).start
    assert found is not None
    return found


def test_a_laser_that_hangs_upside_down_finds_the_pose_of_an_upright_one() -> None:
    config = config_of({**HALL, "laser": {"range_max_m": 12.0, "mounting": "upside_down"}})
    result = run(config, seed=2)
    assert result.log.laser is not None
    assert result.log.laser["angle_increment_rad"] < 0.0
    assert result.start is not None
    assert result.start.seconds <= 0.2
    assert result.metrics["position_rmse_m"] < 0.1

    upright = load_log(config_of(HALL), None, 2)
    assert upright.laser is not None
    step = upright.laser["angle_increment_rad"]
    last = upright.laser["angle_min_rad"] + 359 * step
    laser = {**upright.laser, "angle_min_rad": last, "angle_increment_rad": -step}
    turned = replace(with_scans(upright, upright["scans"]["ranges_m"][:, ::-1]), laser=laser)
    expected, found = (start_of(log, config_of(HALL)).pose for log in (upright, turned))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_the_frame_of_a_map_does_not_matter() -> None:
    config = config_of(HALL)
    log = load_log(config, None, 3)
    assert log.grid is not None
    cells, side = log.grid.cells, log.grid.resolution_m
    # The same world in a frame whose x axis points north.
    x, y, _ = log.grid.origin
    turned = GridMap(cells.T[::-1].copy(), side, (x + side * cells.shape[1], y, 0.5 * np.pi))
    finer = log.grid.cropped((-1.0, -1.0), (20.0, 20.0))
    for grid in (turned, finer):
        found = start_of(replace(log, grid=grid), config)
        np.testing.assert_allclose(found.pose, start_of(log, config).pose, atol=1e-5)


def test_scans_that_say_nothing_leave_the_start_to_driving() -> None:
    config = config_of(HALL)
    log = load_log(config, None, 3)
    assert log.grid is not None
    grid = log.grid
    nothing = np.full_like(log["scans"]["ranges_m"], np.nan)
    solid = GridMap(np.full_like(grid.cells, 100), grid.resolution_m, grid.origin)
    dot = GridMap(np.array([[100]], np.int8), grid.resolution_m, grid.origin)
    for blind in (with_scans(log, nothing), replace(log, grid=solid), replace(log, grid=dot)):
        found = start_of(blind, config)
        assert found.seconds > 0.5
        row = int(np.searchsorted(log["truth"]["stamp_ns"], found.stamp_ns))
        at = [log["truth"][axis][row] for axis in ("x_m", "y_m")]
        assert np.hypot(*(found.pose[:2] - at)) < 0.5


def test_scans_keep_their_intensities_unless_one_is_not_known() -> None:
    laser = {"pose_in_body": [0.0, 0.0, 0.0], "angle_min_rad": 0.0, "angle_increment_rad": 0.1,
             "range_min_m": 0.1, "range_max_m": 9.0}  # fmt: skip
    stamps, ranges = np.array([1, 2]), np.array([[1.0, 2.0], [3.0, 4.0]])
    bright = np.array([[0.0, 5.0], [np.nan, 6.0]])
    log = Log(tables={"scans": {"stamp_ns": stamps, "ranges_m": ranges}}, laser=laser)
    assert [scan.intensities.tolist() for scan in scans_of(log)] == [[], []]
    seen = {"scans": {**log["scans"], "intensities": bright}}
    first, second = scans_of(replace(log, tables=seen))
    assert (first.stamp, first.intensities.tolist()) == (1, [0.0, 5.0])
    assert (second.stamp, second.ranges.tolist()) == (2, [3.0, 4.0])
    assert second.intensities.tolist() == []


def test_a_map_without_walls_or_beams_that_are_none_are_one_sentence() -> None:
    config = config_of(HALL)
    log = load_log(config, None, 3)
    assert log.grid is not None
    bare = GridMap(np.zeros_like(log.grid.cells), 0.05)
    with pytest.raises(ValueError, match="the map has 0 occupied cells, expected at least 1"):
        run(config, replace(log, grid=bare))
    for value in (np.inf, -1.0):
        beams = log["scans"]["ranges_m"].copy()
        beams[0, 5] = value
        with pytest.raises(ValueError, match=r"LaserScan\.ranges \[m\] is .*, expected a finite"):
            run(config, with_scans(log, beams))
    ranges = {**log["ranges"], "range_m": np.full_like(log["ranges"]["range_m"], np.nan)}
    with pytest.raises(ValueError, match=r"row 0: Range\.range \[m\] is nan, expected a finite"):
        run(config, replace(log, tables={**log.tables, "ranges": ranges}))


def test_the_picture_of_a_start_shows_doubt_and_decision(tmp_path: Path) -> None:
    result = run(config_of({**HALL, "map": {}}), seed=1)
    figure = plot_start(result)
    assert figure is not None
    left, right = figure.axes
    assert "poses fit" in left.get_title(loc="left")
    assert right.get_title(loc="left").startswith("ready after")
    write_results(result, tmp_path)
    assert (tmp_path / "start.png").stat().st_size > 10_000
    assert 'id="start"' in (tmp_path / "report.html").read_text()


def test_the_picture_of_a_start_shows_a_turned_map_where_it_lies() -> None:
    result = run(config_of(HALL), seed=1)
    cells = np.zeros((4, 40), np.int8)
    cells[2, 36:38] = 100  # 18 to 19 m to the north of the origin, 1 to 1.5 m to its west
    grid = GridMap(cells, 0.5, (5.0, 4.0, 0.5 * np.pi))
    figure = plot_start(replace(result, log=replace(result.log, grid=grid)))
    assert figure is not None
    wall, *free = colours_at(figure, np.array([[3.75, 22.5], [3.25, 22.5], [3.75, 21.5]]))
    assert wall == MUTED
    assert free == 2 * ["#ffffff"]
    assert figure.axes[0].get_ylim()[1] > 23.0


def test_a_run_with_a_given_start_has_no_picture_of_it(tmp_path: Path) -> None:
    result = run(config_of(HALL).model_copy(update={"start": "truth"}))
    assert plot_start(result) is None
    write_results(result, tmp_path)
    assert not (tmp_path / "start.png").exists()
    assert 'id="start"' not in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("file", "dataset", "folder", "seconds"),
    [
        ("ieu_gazebo.yaml", "run3", "ieu-gazebo-uwb-lidar", 1.0),
        ("ieu_gazebo.yaml", "straight", "ieu-gazebo-uwb-lidar", 1.0),
        ("mrpt_office.yaml", None, "mrpt-uwb-lidar", 10.0),
    ],
    ids=["run3", "straight", "office"],
)
def test_recordings_end_as_accurate_as_when_started_from_truth(
    file: str, dataset: str | None, folder: str, seconds: float
) -> None:
    source = recording(folder)
    config = load_config(CONFIGS / file)
    assert isinstance(config.log, Dataset)
    update = {"path": str(source)} | ({} if dataset is None else {"run": dataset})
    config = config.model_copy(update={"log": config.log.model_copy(update=update)})
    log = load_log(config, CONFIGS, 0)

    auto = run(config.model_copy(update={"start": "auto"}), log)

    assert auto.start is not None
    assert auto.start.seconds <= seconds
    assert rmse_of_second_half(auto) <= 1.05 * rmse_of_second_half(run(config, log))


def test_scans_that_differ_have_their_own_geometry() -> None:
    ranges = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, np.nan]])
    table = {"stamp_ns": np.array([10, 20]), "beams": np.array([3.0, 2.0]),
             "angle_min_rad": np.array([-1.0, 0.5]), "angle_increment_rad": np.array([0.1, -0.2]),
             "ranges_m": ranges, "intensities": ranges}  # fmt: skip
    laser = {"pose_in_body": [0.0, 0.0, 0.0], "angle_min_rad": 0.0, "angle_increment_rad": 1.0,
             "range_min_m": 0.1, "range_max_m": 10.0, "time_increment_s": 0.001}  # fmt: skip
    first, second = scans_of(Log({"scans": table}, laser=laser))
    assert first.ranges.tolist() == [1.0, 2.0, 3.0]
    assert (second.ranges.tolist(), second.intensities.tolist()) == ([4.0, 5.0], [4.0, 5.0])
    assert (second.geometry.angle_min, second.geometry.angle_increment) == (0.5, -0.2)
    assert second.geometry.time_increment == 0.001
    ends = returns_of(Log({"scans": table}, laser=laser), 20)
    angles = np.array([0.5, 0.3])
    expected = np.array([[4.0], [5.0]]) * np.column_stack([np.cos(angles), np.sin(angles)])
    np.testing.assert_allclose(ends, expected)
