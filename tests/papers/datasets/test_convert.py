# SPDX-License-Identifier: Apache-2.0
"""Published recordings as log folders: counts, units and figures that their notes state."""

from __future__ import annotations

import csv
import gzip
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config
from locfuse.config.schema import Calibration, Dataset, Range
from locfuse.core import DistanceField, OccupancyGrid, Pose2
from locfuse.eval.errors import errors_against, interpolate
from locfuse.eval.relations import relation_errors, relation_metrics
from locfuse.io.log_folder import read_log
from locfuse.run.messages import truth_of
from locfuse.run.run import run
from locfuse.types import (
    NANOSECONDS,
    UNKNOWN,
    ConfigError,
    FloatArray,
    Log,
    LogError,
    RunResult,
    Trajectory,
    wrap_angle,
)
from papers.datasets import CONVERTERS, convert
from papers.datasets.intel_lab import rows_at, stamps_of
from papers.datasets.source import increments, read_source
from support_runs import CONFIGS, recording, require_recording_of, rows_of

FOLDERS = {
    "plaza": "plaza",
    "ieu_gazebo": "ieu-gazebo-uwb-lidar",
    "mrpt_office": "mrpt-uwb-lidar",
    "tuc_labyrinth": "tuc-labyrinth",
    "ghent": "ghent-iiot",
    "lias": "lias-planar",
    "wean_hall": "wean-hall",
    "intel_lab": "intel-lab",
    "turtlebot4_mac": "turtlebot4-mac",
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Log]:
    """Return the logs of all recordings by folder name; Plaza1 and the like by their data set."""
    found: dict[str, Log] = {}
    for name, folder in FOLDERS.items():
        out = tmp_path_factory.mktemp("converted") / name
        found |= {path.name: read_log(path) for path in convert(name, recording(folder), out)}
    return found


def rows_in(log: Log) -> dict[str, int]:
    return {stem: len(next(iter(table.values()))) for stem, table in log.tables.items()}


def range_errors(log: Log) -> dict[str, FloatArray]:
    """Return range minus distance from the true position, by anchor, in metres."""
    truth, table = truth_of(log), log["ranges"]
    assert truth is not None
    places = {str(name): np.array([x, y, z]) for name, x, y, z in zip(
        *(log["anchors"][key] for key in ("anchor", "x_m", "y_m", "z_m")), strict=True
    )}  # fmt: skip
    forward, left, up = next(iter(log.tags.values()))
    errors = {}
    for name, place in places.items():
        rows = table["anchor"] == name
        stamps, first = np.unique(table["stamp_ns"][rows], return_index=True)
        at, inside = interpolate(truth, stamps)
        heading = np.zeros(len(at)) if at.heading is None else at.heading
        c, s = np.cos(heading), np.sin(heading)
        tag = np.column_stack([
            at.position[:, 0] + c * forward - s * left,
            at.position[:, 1] + s * forward + c * left,
            np.full(len(at), up),
        ])  # fmt: skip
        measured = table["range_m"][rows][first][inside]
        errors[name] = measured - np.linalg.norm(tag - place, axis=1)
    return errors


def length_m(log: Log) -> float:
    return float(np.hypot(np.diff(log["truth"]["x_m"]), np.diff(log["truth"]["y_m"])).sum())


def duration_s(log: Log) -> float:
    return float(np.ptp(log["truth"]["stamp_ns"])) / 1e9


def test_plaza_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["plaza"]
    assert rows_in(log) == {"odometry": 9657 + 1, "ranges": 3529, "truth": 9658, "anchors": 4}
    assert duration_s(log) == pytest.approx(1933.0, abs=1.0)
    assert length_m(log) == pytest.approx(1859.0, abs=1.0)
    assert list(log.tags) == ["2"]
    assert log["anchors"]["anchor"].tolist() == ["0", "1", "5", "6"]
    np.testing.assert_allclose(
        np.column_stack([log["anchors"]["x_m"], log["anchors"]["y_m"]]),
        [[-46.623, 11.026], [11.036, -6.959], [-17.665, 59.009], [22.053, 23.848]],
        atol=6e-4,
    )
    errors = range_errors(log)
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    expected = {"0": 2.794, "1": 3.041, "5": 2.748, "6": 2.875}
    assert medians == pytest.approx(expected, abs=0.01)


def test_plaza_begins_and_ends_as_published(logs: dict[str, Log]) -> None:
    log, source = logs["plaza"], recording("plaza")
    driven = rows_of(source / "plaza1_odometry.csv")
    assert log["odometry"]["stamp_ns"][0] == log["truth"]["stamp_ns"][0] == 3_856_857_300_000
    assert [log["odometry"][k][0] for k in ("dx_m", "dy_m", "dheading_rad")] == [0.0, 0.0, 0.0]
    assert log["odometry"]["dheading_rad"][-1] == float(driven[-1]["dheading"])
    chord = np.hypot(log["odometry"]["dx_m"][1:], log["odometry"]["dy_m"][1:])
    length = np.array([abs(float(row["dist"])) for row in driven])
    np.testing.assert_allclose(chord, length, rtol=0.01, atol=1e-6)
    received = rows_of(source / "plaza1_ranges.csv")
    assert log["ranges"]["range_m"][[0, -1]].tolist() == [
        float(received[0]["range"]), float(received[-1]["range"])
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "odometry", "epochs", "scans", "seconds", "metres", "sigma"),
    [
        ("home", 2782, 461, 464, 92.7, 9.55, 0.0074),
        ("run3", 990, 164, 165, 33.0, 5.01, 0.0070),
        ("straight", 647, 107, 107, 21.5, 2.97, 0.0078),
        ("static", 187, 31, 31, 11.8, 0.0, 0.0071),
    ],
)
def test_ieu_gazebo_has_the_rows_and_figures_of_its_notes(
    logs: dict[str, Log], name: str, odometry: int, epochs: int, scans: int, seconds: float,
    metres: float, sigma: float,
) -> None:  # fmt: skip
    log = logs[name]
    assert rows_in(log) == {"odometry": odometry, "ranges": 4 * epochs, "scans": scans,
                            "truth": odometry, "anchors": 4}  # fmt: skip
    assert duration_s(log) == pytest.approx(seconds, abs=0.1)
    assert length_m(log) == pytest.approx(metres, abs=0.01)
    assert log["scans"]["ranges_m"].shape[1] == 360
    assert (log.map is None) == (name == "home")
    errors, table = range_errors(log), log["ranges"]
    relative = np.concatenate([
        values / table["range_m"][table["anchor"] == anchor][-len(values):]
        for anchor, values in errors.items()
    ])  # fmt: skip
    assert float(relative.std()) == pytest.approx(sigma, abs=4e-4)
    heading = log["truth"]["heading_rad"]
    assert (-np.pi <= heading).all()
    assert (heading < np.pi).all()


def test_ieu_gazebo_begins_and_ends_as_published(logs: dict[str, Log]) -> None:
    log, source = logs["run3"], recording("ieu-gazebo-uwb-lidar")
    drive, received = rows_of(source / "run3_odom.csv"), rows_of(source / "run3_ranges.csv")
    for row in (0, -1):
        assert log["odometry"]["stamp_ns"][row] == round(float(drive[row]["t"]) * 1e9)
        assert log["odometry"]["v_mps"][row] == float(drive[row]["v"])
        assert log["odometry"]["omega_radps"][row] == float(drive[row]["w"])
        assert log["truth"]["x_m"][row] == float(drive[row]["x"])
    assert log["ranges"]["anchor"][:4].tolist() == ["26955", "26952", "26959", "26954"]
    assert log["ranges"]["range_m"][:4].tolist() == [float(received[0][f"r{i}"]) for i in range(4)]
    last = [float(received[-1][f"r{i}"]) for i in range(4)]
    assert log["ranges"]["range_m"][-4:].tolist() == last


def test_mrpt_office_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["mrpt_office"]
    assert rows_in(log) == {"odometry": 200, "ranges": 594, "scans": 200, "truth": 199,
                            "anchors": 3}  # fmt: skip
    assert log["scans"]["ranges_m"].shape[1] == 361
    assert duration_s(log) == pytest.approx(211.0, abs=1.0)
    assert length_m(log) == pytest.approx(60.0, abs=1.0)
    assert log.tags == {"antenna": (0.16, 0.0, 1.12)}
    np.testing.assert_allclose(
        np.column_stack([log["anchors"][key] for key in ("x_m", "y_m", "z_m")]),
        [[-1.79, -4.55, 1.94], [4.71, -4.33, 1.04], [4.7023, 0.3185, 1.33]],
    )
    errors = range_errors(log)
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    assert medians == pytest.approx({"1": 0.075, "2": -0.042, "3": -0.018}, abs=0.002)
    assert float(np.abs(errors["1"]).max()) == pytest.approx(13.18, abs=0.01)
    assert float(np.abs(errors["2"]).max()) == pytest.approx(0.21, abs=0.01)


def test_mrpt_office_odometry_begins_at_the_first_frame(logs: dict[str, Log]) -> None:
    table = logs["mrpt_office"]["odometry"]
    assert table["stamp_ns"][:2].tolist() == [0, 110_200_000]
    assert [table[key][0] for key in ("dx_m", "dy_m", "dheading_rad")] == [0.0, 0.0, 0.0]
    last = rows_of(recording("mrpt-uwb-lidar") / "odometry.csv")[-1]
    assert table["dx_m"][-1] == float(last["dx"])
    assert table["dheading_rad"][-1] == float(last["dphi"])


def test_tuc_labyrinth_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["tuc_labyrinth"]
    assert rows_in(log) == {"odometry": 233, "ranges": 233, "truth": 233, "anchors": 4}
    assert duration_s(log) == pytest.approx(29.8, abs=0.1)
    assert length_m(log) == pytest.approx(9.2, abs=0.3)
    errors = range_errors(log)
    assert {name: len(values) for name, values in errors.items()} == {
        "105": 58, "107": 59, "108": 58, "109": 58
    }  # fmt: skip
    medians = {name: float(np.median(values)) for name, values in errors.items()}
    assert medians == pytest.approx(
        {"105": 0.149, "107": 0.069, "108": 0.107, "109": 0.082}, abs=0.001
    )
    assert "heading_rad" not in log["truth"]
    first = log["truth"]
    assert (first["x_m"][0], first["y_m"][0]) == (1.65205, 2.21918)


def test_tuc_labyrinth_wheels_turn_as_the_truth_does(logs: dict[str, Log]) -> None:
    log = logs["tuc_labyrinth"]
    wheels = rows_of(recording("tuc-labyrinth") / "wheel_odometry.csv")
    left, right = (np.array([float(row[k]) for row in wheels]) for k in ("v_first", "v_second"))
    np.testing.assert_allclose(log["odometry"]["v_mps"], (left + right) / 2.0, atol=1e-15)
    np.testing.assert_allclose(log["odometry"]["omega_radps"], (right - left) / 0.157, atol=1e-12)


def errors_at_rest(log: Log) -> FloatArray:
    """Return range minus distance of every range of a log whose robot stands, in metres."""
    table, at = log["ranges"], log["truth"]
    heading = at["heading_rad"][0] if "heading_rad" in at else 0.0
    c, s = np.cos(heading), np.sin(heading)
    places = {str(name): np.array([x, y, z]) for name, x, y, z in zip(
        *(log["anchors"][key] for key in ("anchor", "x_m", "y_m", "z_m")), strict=True
    )}  # fmt: skip
    tags = {
        name: np.array([at["x_m"][0] + c * x - s * y, at["y_m"][0] + s * x + c * y, z])
        for name, (x, y, z) in log.tags.items()
    }
    distance = [
        np.linalg.norm(places[anchor] - tags[tag])
        for anchor, tag in zip(table["anchor"].tolist(), table["tag"].tolist(), strict=True)
    ]
    return np.asarray(table["range_m"] - np.array(distance), dtype=np.float64)


def test_ghent_has_the_ranges_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    errors: dict[str, list[float]] = {"LOS": [], "NLOS": []}
    with gzip.open(recording("ghent-iiot") / "ranges.csv.gz", "rt") as file:
        published = list(csv.DictReader(file))
    sites = [name for name in logs if name.startswith("site_")]
    assert sites == [f"site_{n}" for n in (0, 2, 4, 6, 8, 10, 12)]
    for name in sites:
        table, error = logs[name]["ranges"], errors_at_rest(logs[name])
        mine = [row for row in published if f"site_{row['tag_site']}" == name]
        assert len(error) == len(mine)
        for anchor in np.unique(table["anchor"]):
            rows = table["anchor"] == anchor
            assert (table["stamp_ns"][rows] == NANOSECONDS * np.arange(rows.sum())).all()
            theirs = [row for row in mine if row["anchor"] == anchor]
            assert [float(row["range"]) for row in theirs] == table["range_m"][rows].tolist()
            for row, e in zip(theirs, error[rows].tolist(), strict=True):
                errors[row["condition"]].append(e)
    assert (len(errors["LOS"]), len(errors["NLOS"])) == (2442, 5913)
    los, nlos = np.array(errors["LOS"]), np.array(errors["NLOS"])
    assert [np.median(los), los.std(), np.abs(los).max()] == pytest.approx(
        [-0.068, 0.124, 0.44], abs=0.005
    )
    assert [np.median(nlos), nlos.std(), np.abs(nlos).max()] == pytest.approx(
        [0.086, 0.363, 5.04], abs=0.005
    )


def test_ghent_sites_are_where_and_how_high_they_were(logs: dict[str, Log]) -> None:
    log = logs["site_4"]
    assert log.tags == {"tag": (0.0, 0.0, 1.501)}
    assert np.unique(log["truth"]["x_m"]).tolist() == [9.994]
    assert np.unique(log["truth"]["y_m"]).tolist() == [6.148]
    np.testing.assert_array_equal(log["truth"]["stamp_ns"], np.unique(log["ranges"]["stamp_ns"]))
    assert len(log["anchors"]["anchor"]) == 19


@pytest.mark.parametrize(
    ("session", "poses", "ranges", "median", "std", "largest"),
    [("814", 18, 233913, 0.181, 0.105, 3.13), ("820", 6, 91962, 0.094, 0.101, 2.27)],
)
def test_lias_has_the_ranges_and_figures_of_its_notes(
    logs: dict[str, Log], session: str, poses: int, ranges: int, median: float, std: float,
    largest: float,
) -> None:  # fmt: skip
    of_session = [log for name, log in logs.items() if name.startswith(f"{session}_p")]
    errors = np.concatenate([errors_at_rest(log) for log in of_session])
    assert (len(of_session), len(errors)) == (poses, ranges)
    assert [np.median(errors), errors.std(), np.abs(errors).max()] == pytest.approx(
        [median, std, largest], abs=0.005
    )


def test_lias_poses_have_the_tags_and_anchors_of_their_session(logs: dict[str, Log]) -> None:
    log = logs["820_p1_300"]
    assert log.tags == {
        "0": (-0.113, -0.2432, 0.9733), "1": (-0.1316, 0.2363, 0.972), "2": (0.3492, 0.2542, 0.97)
    }  # fmt: skip
    assert log["anchors"]["x_m"].tolist()[:2] == [0.9998, -0.0878]
    assert log["truth"]["heading_rad"][0] == pytest.approx(np.deg2rad(299.781 - 360.0))
    first = log["ranges"]["stamp_ns"] == 0
    assert log["ranges"]["tag"][first].tolist() == [tag for tag in "012" for _ in range(8)]
    assert log["ranges"]["anchor"][first].tolist() == list("01234567") * 3


def test_lias_on_the_move_has_the_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["fast"]
    assert list(log.tags) == ["0", "1", "2"]
    table, truth = log["ranges"], log["truth"]
    assert len(table["range_m"]) == 323514
    assert len(np.unique(table["stamp_ns"])) == 13481
    assert duration_s(log) == pytest.approx(143.6, abs=0.1)
    assert length_m(log) / duration_s(log) == pytest.approx(0.41, abs=0.01)
    assert np.all(np.diff(truth["stamp_ns"]) > 0)
    errors = []
    for tag, lever in log.tags.items():
        rows = table["tag"] == tag
        received = {name: values[rows] for name, values in table.items()}
        of_tag = replace(log, tags={tag: lever}, tables={**log.tables, "ranges": received})
        errors += list(range_errors(of_tag).values())
    error = np.concatenate(errors)
    assert len(error) == 323514
    assert [np.median(error), error.std(), np.abs(error).max()] == pytest.approx(
        [0.173, 0.105, 3.52], abs=0.01
    )


# Laser scans on maps ---------------------------------------------------------------------------


def truth_in(log: Log) -> Trajectory:
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    return truth


def pose_at(track: Trajectory, row: int) -> list[float]:
    assert track.heading is not None
    return [*track.position[row].tolist(), float(track.heading[row])]


def dead_reckoned(log: Log) -> Trajectory:
    """Return where the odometry alone leads from the first pose of the truth."""
    truth, table = truth_in(log), log["odometry"]
    x, y, heading = pose_at(truth, 0)
    headings = heading + np.cumsum(table["dheading_rad"])
    before = np.concatenate([[heading], headings[:-1]])
    c, s = np.cos(before), np.sin(before)
    steps = np.column_stack([
        c * table["dx_m"] - s * table["dy_m"], s * table["dx_m"] + c * table["dy_m"]
    ])  # fmt: skip
    return Trajectory(table["stamp_ns"], [x, y] + np.cumsum(steps, axis=0), wrap_angle(headings))


def driven_m(log: Log) -> float:
    return float(np.hypot(log["odometry"]["dx_m"], log["odometry"]["dy_m"]).sum())


def drift_of(log: Log) -> tuple[float, float, float]:
    """Return how far dead reckoning is off: at the end, at most [m], heading at the end [deg]."""
    errors = errors_against(truth_in(log), dead_reckoned(log))
    assert errors.heading is not None
    distance = np.hypot(*errors.position.T)
    return distance[-1], distance.max(), abs(np.rad2deg(errors.heading[-1]))


def distances_to_walls(log: Log, longest_m: float, at: Trajectory | None = None) -> FloatArray:
    """Return how far the end points of shorter returns are from a wall at the truth, or at a track.

    Distances are looked up: from the centre of the cell of an end point to that of an occupied one.
    """
    grid, laser, scans = log.grid, log.laser, log["scans"]
    assert grid is not None
    assert laser is not None
    field = DistanceField(OccupancyGrid(grid.cells, grid.resolution_m, Pose2(*grid.origin)))
    track, inside = interpolate(truth_in(log) if at is None else at, scans["stamp_ns"])
    assert track.heading is not None
    forward, left, turned = laser["pose_in_body"]
    c, s = np.cos(track.heading), np.sin(track.heading)
    origin = track.position + np.column_stack([c * forward - s * left, s * forward + c * left])
    ranges = scans["ranges_m"][inside]
    beams = laser["angle_min_rad"] + laser["angle_increment_rad"] * np.arange(ranges.shape[1])
    row, beam = np.nonzero(ranges < longest_m)
    angle, length = track.heading[row] + turned + beams[beam], ranges[row, beam]
    ends = origin[row] + np.column_stack([length * np.cos(angle), length * np.sin(angle)])
    return field.distance(ends)


def percent_below(limit_m: float, distance: FloatArray) -> float:
    """Return how many are nearer; a distance looked up is often the limit itself, which is not."""
    return float(100.0 * np.mean(distance < limit_m - 1e-6))


@pytest.mark.parametrize(
    ("name", "odometry", "scans", "seconds", "metres", "first", "last", "at_walls", "drift"),
    [
        ("robotdata1", 1505, 713, 135, 41.2, [40.0513, 41.4316, -1.69329],
         [39.8914, 41.4304, 1.30590], 87.2, (1.40, 4.08, 24.7)),
        ("robotdata3", 1735, 1241, 132, 42.5, [40.0122, 41.5583, -1.75862],
         [39.9267, 39.8232, -0.06857], 95.7, (0.21, 5.99, 27.8)),
    ],
)  # fmt: skip
def test_wean_hall_has_the_rows_and_figures_of_its_notes(
    logs: dict[str, Log], name: str, odometry: int, scans: int, seconds: float, metres: float,
    first: list[float], last: list[float], at_walls: float, drift: tuple[float, float, float],
) -> None:  # fmt: skip
    log = logs[name]
    assert rows_in(log) == {"odometry": odometry, "scans": scans, "truth": scans}
    assert log["scans"]["ranges_m"].shape[1] == 180
    assert duration_s(log) == pytest.approx(seconds, abs=0.5)
    assert driven_m(log) == pytest.approx(metres, abs=0.1)
    assert pose_at(truth_in(log), 0) == first
    assert pose_at(truth_in(log), -1) == last
    end, most, turned = drift_of(log)
    assert (round(end, 2), round(most, 2), round(turned, 1)) == drift
    assert np.nanmax(log["scans"]["ranges_m"]) < 54.0
    distance = distances_to_walls(log, longest_m=30.0)
    assert round(percent_below(0.2, distance), 1) == at_walls


def test_wean_hall_begins_and_ends_as_published(logs: dict[str, Log]) -> None:
    with gzip.open(recording("wean-hall") / "robotdata1.log.gz", "rt") as file:
        lines = [line.split() for line in file]
    published = [line for line in lines if line[0] == "L"]
    table = logs["robotdata1"]["scans"]
    for row in (0, -1):
        assert table["stamp_ns"][row] == round(float(published[row][-1]) * 1e9)
        expected = [float(word) / 100.0 for word in published[row][7:-1]]
        expected = [np.nan if value > 81.8 else value for value in expected]
        np.testing.assert_array_equal(table["ranges_m"][row], expected)
    driven = [line for line in lines if line[0] == "O"]
    stamps = logs["robotdata1"]["odometry"]["stamp_ns"]
    assert stamps[[0, -1]].tolist() == [round(float(driven[k][4]) * 1e9) for k in (0, -1)]
    silent = sum(word in ("8183", "8191") for line in published for word in line[7:-1])
    assert np.isnan(table["ranges_m"]).sum() == silent > 0


def test_turtlebot4_mac_has_the_rows_and_figures_of_its_notes(logs: dict[str, Log]) -> None:
    log = logs["turtlebot4_mac"]
    assert rows_in(log) == {"odometry": 920, "scans": 357, "truth": 357}
    assert log["scans"]["ranges_m"].shape[1] == 720
    assert duration_s(log) == pytest.approx(46.0, abs=0.2)
    assert length_m(log) == pytest.approx(8.3, abs=0.1)
    assert pose_at(truth_in(log), 0) == [6.8672, -8.3727, 1.77556]
    assert pose_at(truth_in(log), -1) == [9.0386, -13.9806, -0.93506]
    assert log["odometry"]["stamp_ns"][[0, -1]].tolist() == [200_821_000, 46_155_636_000]
    assert log["scans"]["ranges_m"][0, 0] == 3.148
    assert round(100.0 * np.isnan(log["scans"]["ranges_m"]).mean(), 1) == 22.9
    end, most, _ = drift_of(log)
    assert (round(end, 2), round(most, 2)) == (0.19, 0.21)
    assert log.grid is not None
    assert (log.grid.cells.shape, log.grid.origin) == ((1706, 903), (-1.12, -39.4, 0.0))


def test_turtlebot4_mac_hits_the_walls_only_with_its_laser_turned(logs: dict[str, Log]) -> None:
    log = logs["turtlebot4_mac"]
    distance = distances_to_walls(log, longest_m=12.0)
    assert round(percent_below(0.1, distance), 1) == 85.6
    reckoned = distances_to_walls(log, longest_m=12.0, at=dead_reckoned(log))
    assert percent_below(0.1, reckoned) == pytest.approx(74.7, abs=0.15)
    assert log.laser is not None
    ahead = replace(log, laser={**log.laser, "pose_in_body": [0.0039, 0.0, 0.0]})
    assert percent_below(0.1, distances_to_walls(ahead, longest_m=12.0)) < 30.0


@pytest.mark.parametrize(("name", "scans"), [("test", 2551), ("mapping", 910)])
def test_intel_lab_has_the_rows_of_its_notes(logs: dict[str, Log], name: str, scans: int) -> None:
    log = logs[name]
    assert rows_in(log) == {"odometry": 13631, "scans": scans, "truth": 13631, "relations": 2984}
    assert log["scans"]["ranges_m"].shape[1] == 180
    assert np.nanmax(log["scans"]["ranges_m"]) < 26.3
    assert duration_s(log) == pytest.approx(2690.0, abs=2.0)
    assert driven_m(log) == pytest.approx(508.0, abs=0.5)
    assert pose_at(truth_in(log), 0) == [-0.0042, -0.0119, -0.001554]
    assert pose_at(truth_in(log), -1) == [-0.2319, -0.0541, -0.000522]
    start = pose_at(dead_reckoned(log), 0)
    end = Pose2(*start).inverse() * Pose2(*pose_at(dead_reckoned(log), -1))
    assert [end.x, end.y, end.heading] == pytest.approx([-50.7906, -35.9525, 2.540618], abs=1e-3)
    assert drift_of(log)[:2] == pytest.approx((62.0, 62.0), abs=0.05)


def test_intel_lab_keeps_the_scans_of_the_map_apart(logs: dict[str, Log]) -> None:
    with gzip.open(recording("intel-lab") / "scans.csv.gz", "rt") as file:
        published = list(csv.reader(file))[1:]
    stamps = logs["test"]["odometry"]["stamp_ns"]
    for name, keyframe in (("test", "0"), ("mapping", "1")):
        mine = [row for row in published if row[2] == keyframe]
        table = logs[name]["scans"]
        rows = np.searchsorted(stamps, table["stamp_ns"])
        assert rows.tolist() == [int(row[0]) for row in mine]
        np.testing.assert_array_equal(stamps[rows], table["stamp_ns"])
        assert table["ranges_m"][-1, 0] == float(mine[-1][3])


def test_intel_lab_hits_the_walls_as_its_notes_say(logs: dict[str, Log]) -> None:
    runs = [logs["test"], logs["mapping"]]
    distance = np.concatenate([distances_to_walls(log, longest_m=50.0) for log in runs])
    assert round(percent_below(0.1, distance), 1) == 95.4
    theirs = gmapping_in(logs["test"])
    distance = np.concatenate([distances_to_walls(log, 50.0, at=theirs) for log in runs])
    assert round(percent_below(0.1, distance), 1) == 85.4


def gmapping_in(log: Log) -> Trajectory:
    """Return GMapping's trajectory, which has the rows of the odometry, at the stamps of a log."""
    with gzip.open(recording("intel-lab") / "trajectory_gmapping.csv.gz", "rt") as file:
        _, _, x, y, theta = np.loadtxt(file, delimiter=",", skiprows=1).T
    stamps = log["odometry"]["stamp_ns"]
    return Trajectory(stamps, np.column_stack([x, y]), wrap_angle(theta))


def test_intel_lab_stamps_follow_the_recorded_times(logs: dict[str, Log]) -> None:
    with gzip.open(recording("intel-lab") / "odometry.csv.gz", "rt") as file:
        recorded_s = np.loadtxt(file, delimiter=",", skiprows=1)[:, 1]
    assert ((np.diff(recorded_s) < 0.0).sum(), np.diff(recorded_s).min()) == (
        629, pytest.approx(-0.9)
    )  # fmt: skip
    stamps = logs["test"]["odometry"]["stamp_ns"]
    assert np.diff(stamps).min() >= 10_000_000
    moved_s = np.abs(stamps / NANOSECONDS - recorded_s)
    assert moved_s.max() < 0.901
    assert moved_s.mean() < 0.05


@pytest.mark.parametrize(
    ("name", "part", "mean_m", "std_m", "median_m", "mean_deg"),
    [
        ("odometry", "all", 7.378, 14.345, 0.063, 39.33),
        ("odometry", "short", 0.036, 0.035, 0.026, 1.76),
        ("gmapping", "all", 0.051, 0.043, 0.041, 2.14),
        ("gmapping", "short", 0.043, 0.042, 0.031, 2.08),
        ("gmapping", "loop", 0.061, 0.042, 0.052, 2.23),
        ("odometry", "loop", 18.140, 17.683, 11.508, 94.32),
        ("truth", "all", 0.039, 0.032, 0.031, 1.03),
        ("truth", "short", 0.035, 0.032, 0.024, 1.07),
        ("truth", "loop", 0.044, 0.030, 0.038, 0.98),
    ],
)
def test_intel_lab_relations_are_better_met_where_rows_of_one_time_are_separated(
    logs: dict[str, Log], name: str, part: str, mean_m: float, std_m: float, median_m: float,
    mean_deg: float,
) -> None:  # fmt: skip
    log = logs["test"]
    tracks = {"odometry": dead_reckoned, "gmapping": gmapping_in, "truth": truth_in}
    found = relation_metrics(relation_errors(tracks[name](log), log["relations"]))
    assert [found[key]["count"] for key in ("all", "short", "loop")] == [2984, 1733, 1210]
    ours = found[part]
    assert round(ours["translation_mean_m"], 3) == mean_m
    assert round(ours["translation_std_m"], 3) == std_m
    assert round(ours["translation_median_m"], 3) == median_m
    assert round(ours["rotation_mean_deg"], 2) == pytest.approx(mean_deg, abs=0.011)


def test_rows_that_step_back_or_share_a_time_get_increasing_stamps() -> None:
    recorded = np.array([1000.00, 1000.50, 1000.20, 1000.80, 1000.80])
    stamps = stamps_of(np.rint(recorded * NANOSECONDS).astype(np.int64)) / NANOSECONDS
    np.testing.assert_allclose(stamps, [1000.0, 1000.2, 1000.5, 1000.7975, 1000.8075], atol=1e-9)


def test_a_time_with_all_its_digits_separates_rows_of_one_rounded_time() -> None:
    recorded = np.array([1000.80, 1000.90, 1000.80, 12.3456, 1000.80])
    recorded_ns = np.rint(recorded * NANOSECONDS).astype(np.int64)
    times = [1000.7951, 1000.7990, 1000.8049, 1000.9049, 12.34562, 1000.85, 12.3457, 0.0]
    asked = np.rint(np.array(times) * NANOSECONDS).astype(np.int64)
    assert rows_at(recorded_ns, asked).tolist() == [0, 2, 4, 1, 3, -1, -1, -1]


@pytest.mark.parametrize("name", ["robotdata1", "robotdata3", "test", "turtlebot4_mac"])
def test_cells_that_nobody_saw_are_unknown(logs: dict[str, Log], name: str) -> None:
    grid = logs[name].grid
    assert grid is not None
    assert (grid.cells == UNKNOWN).mean() > 0.5


# How well they are localized ------------------------------------------------------------------


def run_of(name: str, of_dataset: str | None = None) -> RunResult:
    require_recording_of(name)
    config = load_config(CONFIGS / name)
    if of_dataset is not None:
        assert config.log is not None
        assert not isinstance(config.log, str)
        log = config.log.model_copy(update={"run": of_dataset})
        config = config.model_copy(update={"log": log})
    return run(config, base=CONFIGS)


@pytest.mark.parametrize(
    ("name", "of_dataset", "limit_m"),
    [
        ("plaza.yaml", None, 0.40),
        ("plaza_online.yaml", None, 0.40),
        ("tuc_labyrinth.yaml", None, 0.08),
        ("mrpt_office.yaml", None, 0.13),
        ("ieu_gazebo.yaml", "run3", 0.010),
        ("ieu_gazebo.yaml", "straight", 0.010),
        ("ieu_gazebo.yaml", "home", 0.010),
    ],
)
def test_a_recorded_drive_is_localized_within_its_limit(
    name: str, of_dataset: str | None, limit_m: float
) -> None:
    metrics = run_of(name, of_dataset).metrics
    assert metrics["position_rmse_m"] <= limit_m
    compared, total = [int(word) for word in metrics["truth"].split() if word.isdigit()][:2]
    assert compared >= 0.95 * total


@pytest.mark.parametrize(
    ("name", "change", "limit_m"),
    [
        ("plaza.yaml", {"anchors": {}}, 0.40),
        ("plaza_online.yaml", {"estimator": {"calibration": Calibration()}}, 0.40),
        ("tuc_labyrinth.yaml", {"anchors": {}}, 0.08),
        ("mrpt_office.yaml", {"estimator": {"range": Range(sigma_m=0.05, gate=1.0)}}, 0.13),
        ("mrpt_office.yaml", {"estimator": {"calibration": Calibration()}}, 0.13),
    ],
    ids=["plaza without the stated scale", "plaza that learns nothing",
         "labyrinth without the stated offset", "office that takes all for right",
         "office whose errors are taken for independent"],
)  # fmt: skip
def test_without_what_is_stated_of_it_the_limit_is_broken(
    name: str, change: dict[str, dict[str, Any]], limit_m: float
) -> None:
    require_recording_of(name)
    config = load_config(CONFIGS / name)
    if "anchors" in change:
        config = config.model_copy(update={"anchors": {}})
    else:
        estimator = config.estimator.model_copy(update=change["estimator"])
        config = config.model_copy(update={"estimator": estimator})
    assert run(config, base=CONFIGS).metrics["position_rmse_m"] > limit_m


def test_the_first_200_frames_of_the_office_are_localized_within_their_limit() -> None:
    folder = str(recording("mrpt-uwb-lidar"))
    config = load_config(CONFIGS / "mrpt_office.yaml")
    first = config.model_copy(update={"log": Dataset(dataset="mrpt_office", path=folder)})
    assert run(first).metrics["position_rmse_m"] <= 0.13


def test_on_the_plaza_offset_and_scale_of_each_anchor_are_learnt_and_then_it_is_as_good() -> None:
    result = run_of("plaza_online.yaml")

    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    late = errors.stamp_ns > result.estimate.stamp_ns[0] + 300 * NANOSECONDS
    assert np.sqrt(np.mean(np.sum(errors.position[late] ** 2, axis=1))) <= 0.45
    learnt = result.metrics["calibration"]
    assert len(learnt) == 8
    for name, error in learnt.items():
        assert error["observed"]
        if "scale" in name:  # the line through all residuals that is stated with the recording
            assert abs(error["value"] - 0.0694) < 0.01


def test_in_the_office_beacon_1_is_rejected_where_it_is_wrong_and_hardly_any_other() -> None:
    result = run_of("mrpt_office.yaml")

    rejected = result.metrics["rejected"]
    assert 0.3 < rejected["1"]["share"] < 0.45
    assert rejected["2"]["count"] == 0
    assert rejected["3"]["share"] < 0.02

    truth, o = result.truth, result.outcomes
    assert truth is not None
    assert truth.heading is not None
    places = dict(zip(result.log["anchors"]["anchor"].tolist(), np.column_stack(
        [result.log["anchors"][key] for key in ("x_m", "y_m", "z_m")]), strict=True))  # fmt: skip
    table = result.log["ranges"]
    wrong: list[str] = []
    right: list[str] = []
    for stamp, anchor, range_m in zip(
        table["stamp_ns"], table["anchor"], table["range_m"], strict=True
    ):
        row = int(np.searchsorted(truth.stamp_ns, stamp))
        if row == len(truth) or truth.stamp_ns[row] != stamp:
            continue
        c, s = np.cos(truth.heading[row]), np.sin(truth.heading[row])
        tag = np.array([*(truth.position[row] + 0.16 * np.array([c, s])), 1.12])
        error = abs(range_m - float(np.linalg.norm(tag - places[str(anchor)])))
        is_row = (o.source == "ranges") & (o.stamp_ns == stamp) & (o.anchor == anchor)
        verdict = str(o.verdict[is_row][0])
        (wrong if error > 1.5 else right if error < 0.3 else []).append(verdict)
    assert len(wrong) > 90
    assert len(right) > 800
    assert wrong.count("gated") == len(wrong)
    assert right.count("gated") < 0.01 * len(right)


# What the converters share ---------------------------------------------------------------------


def test_cumulative_odometry_becomes_motions_in_the_body() -> None:
    quarter = np.pi / 2.0
    moved = increments(
        np.array([5, 6, 7, 8]),
        np.array([1.0, 1.0, 0.0, 0.0]),
        np.array([1.0, 3.0, 3.0, 3.0]),
        np.array([quarter, np.pi - 0.1, np.pi - 0.1, 0.1 - np.pi]),
    )
    assert moved["stamp_ns"].tolist() == [5, 6, 7, 8]
    c, s = np.cos(0.1), np.sin(0.1)
    np.testing.assert_allclose(moved["dx_m"], [0.0, 2.0, c, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved["dy_m"], [0.0, 0.0, s, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved["dheading_rad"], [0.0, quarter - 0.1, 0.0, 0.2], atol=1e-15)


def test_beams_may_be_numbered_with_leading_zeros_and_say_no_return_in_a_word(
    tmp_path: Path,
) -> None:
    path = tmp_path / "scans.csv"
    path.write_text("t,r00,r01,r02\n0.5,1.0,inf,2.0\n")
    table = read_source(path, dict(t="s"), beams="r", no_return=b"inf")
    np.testing.assert_array_equal(table["beams"], [[1.0, np.nan, 2.0]])
    with pytest.raises(LogError, match=r"line 2: .*inf"):
        read_source(path, dict(t="s"), beams="r")
    path.write_text("t,r00,r02\n0.5,1.0,2.0\n")
    with pytest.raises(LogError, match=r"line 1: expected the header t,r0,r1"):
        read_source(path, dict(t="s"), beams="r")


# What is refused ------------------------------------------------------------------------------


def test_an_unknown_recording_is_refused_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'plazza'; did you mean 'plaza'"):
        convert("plazza", tmp_path, tmp_path / "out")


@pytest.mark.parametrize("name", CONVERTERS)
def test_a_folder_that_is_not_the_recording_is_named(name: str, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    for source in (empty, tmp_path / "absent"):
        with pytest.raises(LogError) as caught:
            convert(name, source, tmp_path / "out")
        assert str(source) in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_damaged_file_is_named_by_line_and_nothing_is_written(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(recording("tuc-labyrinth"), source, copy_function=shutil.copyfile)
    source.chmod(0o755)
    lines = (source / "ranges.csv").read_text().splitlines()
    lines[4] = lines[4].replace(",", ";", 1)
    (source / "ranges.csv").write_text("\n".join(lines))
    with pytest.raises(LogError, match=r"ranges\.csv, line 5: 4 fields, expected 5"):
        convert("tuc_labyrinth", source, tmp_path / "out")
    (source / "ranges.csv").write_text("time,range\n1,2\n")
    with pytest.raises(LogError, match=r"expected the header t,anchor,range"):
        convert("tuc_labyrinth", source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_converting_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    source = recording("tuc-labyrinth")
    (folder,) = convert("tuc-labyrinth", source, tmp_path / "out")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    convert("tuc_labyrinth", source, tmp_path / "out")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
