# SPDX-License-Identifier: Apache-2.0
"""Anchors and landmarks found by a drive: how well, how honestly, in which frame, what is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.report.plot import plot_survey
from locfuse.run.run import load_log
from locfuse.run.survey import survey
from locfuse.run.survey_result import SurveyResult, write_survey
from locfuse.types import ConfigError, FloatArray, Log, LogError
from support_runs import ROOT, locfuse, recording

SEEDS = 30
NOISE = {"sigma_longitudinal_per_sqrt_m": 0.03, "sigma_lateral_per_sqrt_m": 0.01,
         "sigma_heading_per_sqrt_m": 0.02, "sigma_heading_per_sqrt_rad": 0.03}  # fmt: skip


def room(seed: int, **more: Any) -> tuple[RunConfig, Log, FloatArray]:
    """Return a minute's drive in a room of any size with 4 to 8 anchors, and where those are."""
    rng = np.random.default_rng(1000 + seed)
    count = int(rng.integers(4, 9))
    w, h = rng.uniform(6.0, 14.0, 2).tolist()
    rim = [(0, 0), (w, 0), (w, h), (0, h), (w / 2, 0), (w / 2, h), (0, h / 2), (w, h / 2)][:count]
    anchors = {f"A{i}": [x + float(rng.normal(0.0, 0.2)), y + float(rng.normal(0.0, 0.2)),
                         float(rng.uniform(1.5, 2.5))] for i, (x, y) in enumerate(rim)}  # fmt: skip
    drive = {"path": {"shape": "waypoints", "speed_mps": 0.5}, "room_m": [w, h], "poses": None,
             "duration_s": 60.0, "anchors": anchors, "odometry": NOISE,
             "ranges": {"sigma_m": 0.1, "sigma_relative": 0.0}}  # fmt: skip
    config = parse_config({"simulation": drive, "seed": seed, "estimator": {
        "range": {"sigma_m": 0.1}, "odometry": NOISE, "correlation_s": 0.0,
        "calibration": {"sigma_anchor_offset_m": 1e-4}}, **more})  # fmt: skip
    return config, load_log(config, None, seed), np.array(list(anchors.values()))


def onto_axis(at: FloatArray) -> FloatArray:
    """Return places (n, 2) with the first as the origin and the second on the x axis."""
    base = at[1] - at[0]
    angle = np.arctan2(base[1], base[0])
    R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned: FloatArray = (at - at[0]) @ R.T
    return turned


def bound(log: Log, anchors: FloatArray) -> FloatArray:
    """Return the Cramer-Rao bound of x and y of all anchors, first on second on the x axis.

    Fisher information of the true poses at the stamps of ranges and of the anchors together.
    """
    truth, ranges, odometry = log["truth"], log["ranges"], log["odometry"]
    stamps = np.unique(ranges["stamp_ns"])
    x, y = (np.interp(stamps, truth["stamp_ns"], truth[k]) for k in ("x_m", "y_m"))
    theta = np.interp(stamps, truth["stamp_ns"], np.unwrap(truth["heading_rad"]))
    n, m = len(stamps), len(anchors)
    H = np.zeros((3 * n + 2 * m, 3 * n + 2 * m))
    H[:3, :3] += np.diag([1e12] * 3)  # the frame
    for k in range(n - 1):
        rows = (odometry["stamp_ns"] > stamps[k]) & (odometry["stamp_ns"] <= stamps[k + 1])
        Q = 1e-10 * np.eye(3)
        heading, to = theta[k], np.array([x[k], y[k]])
        for dx, turn in zip(odometry["dx_m"][rows], odometry["dheading_rad"][rows], strict=True):
            c, s = np.cos(heading), np.sin(heading)
            F = np.eye(3)
            F[:2, 2] = (-s * dx, c * dx)
            far = abs(dx)
            along, across = (
                NOISE["sigma_longitudinal_per_sqrt_m"],
                NOISE["sigma_lateral_per_sqrt_m"],
            )
            R = np.array([[c, -s], [s, c]])
            G = np.zeros((3, 3))
            G[:2, :2] = R @ np.diag([along**2 * far, across**2 * far]) @ R.T
            G[2, 2] = (NOISE["sigma_heading_per_sqrt_m"] ** 2 * far
                       + NOISE["sigma_heading_per_sqrt_rad"] ** 2 * abs(turn))  # fmt: skip
            Q = F @ Q @ F.T + G
            heading, to = heading + turn, to + np.array([c, s]) * dx
        F = np.eye(3)
        F[:2, 2] = (-(y[k + 1] - y[k]), x[k + 1] - x[k])
        J = np.hstack([-F, np.eye(3)])
        both = slice(3 * k, 3 * k + 6)
        H[both, both] += J.T @ np.linalg.solve(Q, J)
    names = {f"A{i}": i for i in range(m)}
    row_of = {int(stamp): k for k, stamp in enumerate(stamps)}
    for stamp, name in zip(ranges["stamp_ns"].tolist(), ranges["anchor"].tolist(), strict=True):
        k, a = row_of[stamp], names[name]
        off = np.array([x[k] - anchors[a, 0], y[k] - anchors[a, 1], -anchors[a, 2]])
        u = off[:2] / np.linalg.norm(off) / 0.1
        at = [3 * k, 3 * k + 1, 3 * n + 2 * a, 3 * n + 2 * a + 1]
        J = np.array([*u, *-u])
        H[np.ix_(at, at)] += np.outer(J, J)
    P = np.linalg.inv(H)[3 * n :, 3 * n :]
    J = np.empty((2 * m, 2 * m))
    flat = anchors[:, :2].ravel()
    for k in range(2 * m):
        step = np.zeros(2 * m)
        step[k] = 1e-5
        ends = [onto_axis((flat + way * step).reshape(-1, 2)).ravel() for way in (1.0, -1.0)]
        J[:, k] = (ends[0] - ends[1]) / 2e-5
    framed: FloatArray = J @ P @ J.T
    return framed


def placed(result: SurveyResult) -> FloatArray:
    return np.array([a.position for a in result.anchors])


def exchanged(log: Log, i: int, j: int) -> Log:
    """Return a log whose list has two anchors in one another's place, heights and all."""
    table = {name: column.copy() for name, column in log["anchors"].items()}
    for name in ("x_m", "y_m", "z_m"):
        table[name][[i, j]] = table[name][[j, i]]
    return replace(log, tables={**log.tables, "anchors": table})


def test_anchors_are_near_the_bound_and_as_sure_as_right() -> None:
    ratios, nees = [], []
    for seed in range(SEEDS):
        config, log, anchors = room(seed)
        found = survey(config, log, frame=("A0", "A1"))
        assert not found.findings
        assert {a.word for a in found.anchors} <= {"good", "weak"}
        error = placed(found)[:, :2] - onto_axis(anchors[:, :2])
        ratios.append(np.sum(error**2) / np.trace(bound(log, anchors)))
        one = found.anchors[2]
        nees.append(error[2] @ np.linalg.solve(one.covariance[:2, :2], error[2]))
    assert np.sqrt(np.mean(ratios)) < 1.2
    assert 1.2 < np.mean(nees) < 3.1  # of 2, over 30 rooms: 99 %


def test_ids_that_are_swapped_are_named_in_every_room() -> None:
    for seed in range(SEEDS // 2):
        config, log, anchors = room(seed)
        i, j = np.random.default_rng(seed).choice(len(anchors), 2, replace=False).tolist()
        found = survey(config, exchanged(log, i, j))
        a, b = sorted((f"A{i}", f"A{j}"))
        assert any(
            f"anchors {a} and {b} are swapped" in text or f"anchors {b} and {a} are swapped" in text
            for text in found.findings
        ), seed
        assert seed % 3 or not survey(config, log).findings


def test_an_anchor_that_is_elsewhere_is_named_and_found() -> None:
    config, log, anchors = room(3)
    table = {name: column.copy() for name, column in log["anchors"].items()}
    table["x_m"][2] += 1.5
    found = survey(config, replace(log, tables={**log.tables, "anchors": table}))
    assert len(found.findings) == 1
    assert "anchor A2 stands 1." in found.findings[0]
    assert np.hypot(*(placed(found)[2] - anchors[2])[:2]) < 0.4


def test_an_anchor_that_moves_on_the_way_is_named() -> None:
    config, log, anchors = room(2)
    ranges = {name: column.copy() for name, column in log["ranges"].items()}
    truth = log["truth"]
    late = (ranges["stamp_ns"] > truth["stamp_ns"][0] + 40 * 10**9) & (ranges["anchor"] == "A3")
    x, y = (np.interp(ranges["stamp_ns"][late], truth["stamp_ns"], truth[k])
            for k in ("x_m", "y_m"))  # fmt: skip
    other = anchors[3] + np.array([2.0, -2.0, 0.0])
    ranges["range_m"][late] = np.sqrt((x - other[0]) ** 2 + (y - other[1]) ** 2 + other[2] ** 2)
    found = survey(config, replace(log, tables={**log.tables, "ranges": ranges}))
    (text,) = [text for text in found.findings if "A3" in text]
    assert "wrong from 40 s on" in text
    spots = re.findall(r"\((-?[0-9.]+), (-?[0-9.]+)\)", text)
    assert min(np.hypot(float(x) - other[0], float(y) - other[1]) for x, y in spots) < 0.5


def test_heights_that_nobody_knows_are_found() -> None:
    config, log, anchors = room(4)
    nowhere = {name: column for name, column in log.tables.items() if name != "anchors"}
    found = survey(config, replace(log, tables=nowhere), frame=("A0", "A1"))
    error = placed(found)[:, :2] - onto_axis(anchors[:, :2])
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.3
    for a, z in zip(found.anchors, anchors[:, 2], strict=True):
        assert a.position[2] >= 0.0
        assert abs(a.position[2] - z) < 3.5 * np.sqrt(a.covariance[2, 2])


def laid_onto(at: FloatArray, anchors: FloatArray) -> FloatArray:
    """Return the errors of places (n, 2) that are laid onto others as a whole, mirrored or not."""
    p, q = at - at.mean(axis=0), anchors - anchors.mean(axis=0)
    u, _, v = np.linalg.svd(p.T @ q)
    error: FloatArray = p @ u @ v - q
    return error


def test_a_tag_alone_finds_anchors_without_odometry() -> None:
    nees, errors = [], []
    for seed in range(15):
        config, log, anchors = room(seed)
        alone = {name: table for name, table in log.tables.items() if name != "odometry"}
        found = survey(config, replace(log, tables=alone))
        assert not found.findings  # the list shows which side is which
        off = placed(found)[:, :2] - anchors[:, :2]
        errors.append(np.sqrt(np.mean(np.sum(laid_onto(placed(found)[:, :2], anchors[:, :2]) ** 2,
                                             axis=1))))  # fmt: skip
        assert np.hypot(*off.T).max() < 0.4
        nees.append(np.mean([e @ np.linalg.solve(a.covariance[:2, :2], e)
                             for e, a in zip(off, found.anchors, strict=True)]))  # fmt: skip
    assert np.median(errors) < 0.05
    assert 1.0 < np.mean(nees) < 3.8  # of 2


def test_without_a_list_a_tag_alone_may_be_mirrored() -> None:
    config, log, anchors = room(6)
    alone = {name: log[name] for name in ("ranges", "truth")}
    found = survey(config, replace(log, tables=alone), frame=("A0", "A1"))
    assert {a.word for a in found.anchors[2:]} == {"two places"}
    assert any("may" in text or "mirrored" in text for text in found.findings)
    assert not found.advice
    assert np.hypot(*laid_onto(placed(found)[:, :2], anchors[:, :2]).T).max() < 0.4
    for a in found.anchors:
        if a.other is not None:
            assert a.other[1] == pytest.approx(-a.position[1], abs=0.2)


def test_a_trolley_without_wheels_finds_the_anchors_around_it() -> None:
    recording("lias-planar")
    config = load_config(ROOT / "examples/configs/lias_triangle.yaml")
    log = load_log(config, ROOT / "examples/configs", 0)
    # Errors stay for a second, over 100 ranges, which a survey takes as independent.
    noise = config.estimator.range.model_copy(update={"sigma_m": 0.8})
    estimator = config.estimator.model_copy(update={"range": noise})
    found = survey(config.model_copy(update={"estimator": estimator}), log)
    listed = log["anchors"]
    assert not found.findings
    for a in found.anchors:
        (row,) = np.flatnonzero(listed["anchor"] == a.name)
        off = a.position[:2] - [listed["x_m"][row], listed["y_m"][row]]
        assert np.hypot(*off) < 0.12  # 0.09 to 0.10 m


def test_places_of_tags_on_the_robot_are_found() -> None:
    squares, nees = [], []
    for seed in range(12):
        config, _, anchors = room(seed)
        dumped = config.model_dump(mode="json", exclude_unset=True)
        dumped["simulation"]["tags"] = {"tag": [0.3, -0.2, 0.5]}
        config = parse_config(dumped)
        log = load_log(config, None, seed)
        wrong = np.array([0.3, -0.2]) + np.random.default_rng(seed).normal(0.0, 0.3, 2)
        log = replace(log, tags={"tag": (float(wrong[0]), float(wrong[1]), 0.5)})
        found = survey(config, log, frame=("A0", "A1"), sigma_tag_m=0.3)
        (tag,) = found.tags
        assert tag.name == "tag"
        assert tag.sigma_m < 0.02
        squares.append(np.sum((tag.position - [0.3, -0.2]) ** 2) / tag.sigma_m**2)
        error = (placed(found)[:, :2] - onto_axis(anchors[:, :2]))[2]
        nees.append(error @ np.linalg.solve(found.anchors[2].covariance[:2, :2], error))
    assert np.mean(squares) < 3.5  # of 2 at the most, over 12 rooms: 99 %
    assert 0.9 < np.mean(nees) < 3.7
    with pytest.raises(ConfigError, match="sigma of tags is -1"):
        survey(config, log, sigma_tag_m=-1.0)


def test_points_that_were_measured_are_the_frame() -> None:
    config, log, anchors = room(5)
    turned = onto_axis(anchors[:, :2]) + np.array([100.0, -50.0])
    nan = np.full(2, np.nan)
    measured = {"anchor": np.array(["A0", "A3"]), "x_m": turned[[0, 3], 0],
                "y_m": turned[[0, 3], 1], "z_m": nan}  # fmt: skip
    found = survey(config, log, measured=measured)
    assert found.frame == "the frame is that in which A0, A3 were measured"
    off = placed(found)[:, :2] - turned
    assert np.hypot(*off[[0, 3]].T).max() < 0.05
    assert np.hypot(*off.T).max() < 0.3
    assert found.anchors[3].sigma_m < 0.03


def test_positions_are_the_frame_of_what_is_found() -> None:
    config, log, anchors = room(
        6, start=[1.0, 1.0, 0.0], start_sigma={"xy_m": 30.0, "heading_deg": 100}
    )
    truth = log["truth"]
    rng = np.random.default_rng(1)
    rows = slice(0, None, 30)
    count = len(truth["x_m"][rows])
    positions = {"stamp_ns": truth["stamp_ns"][rows], "sigma_m": np.full(count, 0.1),
                 "x_m": truth["x_m"][rows] + rng.normal(0.0, 0.1, count),
                 "y_m": truth["y_m"][rows] + rng.normal(0.0, 0.1, count)}  # fmt: skip
    found = survey(config, replace(log, tables={**log.tables, "positions": positions}))
    assert found.frame == "the frame is that of the positions"
    assert np.hypot(*(placed(found) - anchors)[:, :2].T).max() < 0.3


def straight(turns: bool = False) -> tuple[RunConfig, Log]:
    """Return a drive along a line of 10 m, past anchors on both sides of it."""
    step, rows = 0.05, 200
    stamp = (np.arange(rows) + 1) * 10**8
    along = step * (np.arange(rows) + 1)
    anchors = {"L": (3.0, 4.0), "R": (7.0, -3.0), "Q": (12.0, 5.0)}
    noise = np.random.default_rng(2).normal(0.0, 0.05, (rows, 3))
    ranges = [(stamp, np.full(rows, name), np.hypot(along - x, y) + noise[:, i])
              for i, (name, (x, y)) in enumerate(anchors.items())]  # fmt: skip
    column: list[NDArray[Any]] = [np.concatenate(part) for part in zip(*ranges, strict=True)]
    order = np.argsort(column[0], kind="stable")
    tables = {
        "odometry": {"stamp_ns": stamp, "dx_m": np.full(rows, step), "dy_m": np.zeros(rows),
                     "dheading_rad": np.zeros(rows)},
        "ranges": {"stamp_ns": column[0][order], "tag": np.full(3 * rows, "tag"),
                   "anchor": column[1][order], "range_m": column[2][order]},
    }  # fmt: skip
    config = parse_config({"log": "drive", "estimator": {"range": {"sigma_m": 0.05}}})
    return config, Log(tables, tags={"tag": (0.0, 0.0, 0.0)})


def test_on_a_straight_drive_both_sides_are_shown() -> None:
    config, log = straight()
    found = survey(config, log, height_m=0.0)
    assert [a.word for a in found.anchors] == ["two places"] * 3
    for a in found.anchors:
        assert a.other is not None
        assert a.other[1] == pytest.approx(-a.position[1], abs=0.5)
    assert found.frame.startswith("the origin is where the robot starts")
    assert found.stop is not None
    assert abs(found.stop[1]) > 1.0  # off the line
    assert "drive by (" in found.advice
    figure = plot_survey(found)
    assert len(figure.axes[0].patches) == 3


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"ranges": None}, "nothing to survey"),
        ({"odometry": None}, "no odometry"),
        ({"frame": ("L", "M")}, "no range names an anchor 'M'"),
        ({"frame": ("L", "L")}, "names one anchor twice"),
    ],
)
def test_what_is_missing_is_one_sentence(change: dict[str, Any], sentence: str) -> None:
    config, log = straight()
    frame = change.pop("frame", None)
    tables = {name: table for name, table in log.tables.items() if name not in change}
    with pytest.raises(LogError, match=sentence):
        survey(config, replace(log, tables=tables), frame=frame)


def test_parts_that_odometry_does_not_join_are_doubtful() -> None:
    config, log, _ = room(0)
    odometry = log["odometry"]
    since = (odometry["stamp_ns"] - odometry["stamp_ns"][0]) / 1e9
    kept = (since < 20.0) | (since > 30.0)
    gap = {name: column[kept] for name, column in odometry.items()}
    found = survey(config, replace(log, tables={**log.tables, "odometry": gap}))
    assert {a.word for a in found.anchors} <= {"doubtful", "not placed"}
    assert found.findings[0].startswith("odometry is missing for 10.1 s from 20 s on")


def test_odometry_in_another_unit_is_doubtful() -> None:
    config, log, _ = room(3)
    feet = {**log["odometry"], "dx_m": log["odometry"]["dx_m"] * 3.28}
    found = survey(config, replace(log, tables={**log.tables, "odometry": feet}))
    assert {a.word for a in found.anchors} <= {"doubtful", "not placed"}
    assert "is that in metres and radians?" in found.findings[0]


def test_measured_places_that_contradict_the_drive_are_refused() -> None:
    config, log, anchors = room(2)
    swapped = {"anchor": np.array(["A0", "A1", "A2", "A3"]), "x_m": anchors[[1, 0, 2, 3], 0],
               "y_m": anchors[[1, 0, 2, 3], 1], "z_m": np.full(4, np.nan)}  # fmt: skip
    with pytest.raises(LogError, match="contradict the drive"):
        survey(config, log, measured=swapped)
    far = {"anchor": np.array(["A0", "A1"]), "x_m": np.array([0.0, 30.0]), "y_m": np.zeros(2),
           "z_m": np.full(2, np.nan)}  # fmt: skip
    with pytest.raises(LogError, match="A0, A1 contradict the drive"):
        survey(config, log, measured=far)
    with pytest.raises(LogError, match="leave one of them out"):
        survey(config, log, measured=far, frame=("A0", "A1"))


def test_a_frame_that_cannot_be_had_is_said() -> None:
    config, log = straight()
    found = survey(config, log, height_m=0.0, frame=("L", "R"))
    assert found.frame.startswith(
        "L, R may be in two places and give no frame: the origin is where"
    )
    one = {"anchor": np.array(["L"]), "x_m": np.zeros(1), "y_m": np.zeros(1), "z_m": np.zeros(1)}
    config, log, _ = room(1)
    one["anchor"] = np.array(["A1"])
    found = survey(config, log, measured=one)
    assert found.frame.startswith("x and y of two anchors that are placed make a frame")


def test_a_flight_is_refused() -> None:
    _, log = straight()
    with pytest.raises(ConfigError, match=r"estimator\.kind pose"):
        survey(parse_config({"log": "drive", "estimator": {"kind": "air"}}), log)


def test_a_robot_that_stands_is_asked_to_drive() -> None:
    config, log = straight()
    odometry = {**log["odometry"], "dx_m": np.zeros(200)}
    ranges = {**log["ranges"], "range_m": np.full(600, 5.0)}
    standing = replace(log, tables={**log.tables, "odometry": odometry, "ranges": ranges})
    found = survey(config, standing, height_m=0.0)
    assert [a.word for a in found.anchors] == ["not placed"] * 3
    assert found.advice == "the robot hardly moved: drive some metres, with turns"


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    config = tmp_path / "robot.yaml"
    config.write_text("simulation: {path: {shape: waypoints, speed_mps: 0.5}, poses: null}\n")
    measured = tmp_path / "measured.csv"
    measured.write_text("anchor,x_m,y_m,z_m\nA1,100,50,\nA2,110,50,0\n")
    out = tmp_path / "out"
    ran = locfuse("survey", str(config), "--measured", str(measured), "--out", str(out))
    assert ran.status == 0, ran.err
    assert "The frame is that in which A1, A2 were measured." in ran.out
    assert (out / "survey.png").stat().st_size > 10_000
    assert (out / "anchors.csv").read_text().startswith("anchor,x_m,y_m,z_m\nA1,")
    for text, sentence in (
        ("anchor,x_m,y_m,z_m\nA1,1,b,\n", "line 2: 'b' is not a number"),
        ("anchor,x_m\nA1,1\n", "line 1: expected the header anchor,x_m,y_m,z_m"),
        ("anchor,x_m,y_m,z_m\nA1,1,2,3\nA1,1,2,3\n", "line 3: anchor A1 is listed twice"),
        ("anchor,x_m,y_m,z_m\nA7,1,2,3\n", "no range names an anchor 'A7'"),
    ):
        measured.write_text(text)
        ran = locfuse("survey", str(config), "--measured", str(measured), "--out", str(out))
        assert ran.status == 1
        assert sentence in ran.err
    assert "expected two anchors" in locfuse("survey", str(config), "--frame", "A1").err


def test_wrong_heights_are_named() -> None:
    drive = {"path": {"shape": "waypoints", "speed_mps": 0.5}, "poses": None}
    config = parse_config({"simulation": drive, "estimator": {"range": {"sigma_m": 0.1}}})
    found = survey(config, height_m=3.0)
    assert any("too short: is its height" in text for text in found.findings)


def test_what_is_written_is_a_file_of_a_log_folder(tmp_path: Path) -> None:
    from locfuse.io.log_folder import read_log_file

    config, log, _ = room(1)
    found = survey(config, log)
    (path,) = write_survey(found, tmp_path)
    again = read_log_file(path, "anchors")
    assert again["anchor"].tolist() == [a.name for a in found.anchors]
    assert np.array_equal(again["x_m"], placed(found)[:, 0])


@pytest.mark.parametrize(
    ("name", "data", "most"),
    [("plaza", "plaza", 0.3), ("mrpt_office", None, 0.5),
     ("ieu_gazebo", "ieu-gazebo-uwb-lidar", 0.05)],
)  # fmt: skip
def test_anchors_of_recordings_are_where_they_were_surveyed(
    name: str, data: str | None, most: float
) -> None:
    if data is not None:
        recording(data)
    elif not Path("/usr/share/mrpt/datasets").exists():
        pytest.skip("the recording of mrpt-common is not installed")
    config = load_config(ROOT / f"examples/configs/{name}.yaml")
    log = load_log(config, ROOT / "examples/configs", 0)
    found = survey(config, log)
    listed = log["anchors"]
    rows = {str(anchor): row for row, anchor in enumerate(listed["anchor"])}
    assert not found.findings
    for a in found.anchors:
        row = rows[a.name]
        off = a.position[:2] - np.array([listed["x_m"][row], listed["y_m"][row]])
        assert a.word in ("good", "weak")
        assert np.hypot(*off) < most
