# SPDX-License-Identifier: Apache-2.0
"""Robots that are set up by one drive: how well they drive another, and what is said of gaps."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.commission.commission import commission
from locfuse.commission.frame import laid_onto, pose_at
from locfuse.commission.result import Commissioned, write_commissioned
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.relations import relation_errors, relation_metrics
from locfuse.io.log_folder import read_log, read_world, write_log
from locfuse.io.recording import read_recording
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.types import Log, RunResult
from papers.datasets import convert
from support_runs import ROOT, locfuse, recording

FLOOR: dict[str, Any] = {
    "room_m": [16, 12], "map": {"generate": "rooms", "seed": 2}, "path": {"shape": "roam"},
    "duration_s": 100, "laser": {"range_max_m": 8}, "odometry": {"rate_hz": 10}, "poses": None,
    "anchors": {"A": [1, 1, 2], "B": [15, 1, 2], "C": [15, 11, 2], "D": [1, 11, 2]},
    "ranges": {"sigma_m": 0.1, "sigma_relative": 0.0},
}  # fmt: skip
OF_THE_WORLD = ("anchors", "truth")


@cache
def drive(seed: int, duration_s: float = 100.0) -> Log:
    scenario = {**FLOOR, "duration_s": duration_s}
    return load_log(parse_config({"simulation": scenario, "seed": seed}), None, seed)


def bare(log: Log, *without: str) -> Log:
    """Return a log of a new robot: without map, and without those tables."""
    tables = {name: table for name, table in log.tables.items() if name not in without}
    if "scans" in without:
        return replace(log, tables=tables, grid=None, map=None, laser=None)
    return replace(log, tables=tables, grid=None, map=None)


def set_up(log: Log, folder: Path, **config: Any) -> Commissioned:
    """Write a recording, set up a robot by it, and write that."""
    write_log(log, folder / "drive")
    result = commission(folder / "drive", base=folder / "robot", config=config)
    write_commissioned(result, folder / "robot")
    return result


def commission_of(log: Log, folder: Path) -> Commissioned:
    write_log(log, folder)
    return commission(folder, base=folder)


def drives(folder: Path, log: Log, **changes: Any) -> RunResult:
    """Run another drive as a user does."""
    robot = folder / "robot"
    write_log(log, folder / "other")
    config = load_config(robot / "robot.yaml").model_copy(update=changes)
    return run(config, read_recording(folder / "other", config.ros, robot))


def start_of(log: Log) -> list[float]:
    truth = truth_of(log)
    assert truth is not None
    found = pose_at(truth, int(log["scans"]["stamp_ns"].min()))
    assert found is not None
    return found


def test_a_drive_without_a_map_or_anchors_sets_up_the_next(tmp_path: Path) -> None:
    log = drive(1, 200.0)
    found = set_up(bare(log, *OF_THE_WORLD), tmp_path, start=start_of(log))
    assert found.missing == ()
    assert found.map is not None
    assert found.survey is not None
    assert found.survey.frame == "the frame is that of the map"
    world = read_world(tmp_path / "robot" / "world")
    assert world.grid is not None
    places = dict(zip(world["anchors"]["anchor"].tolist(),
                      np.column_stack([world["anchors"]["x_m"], world["anchors"]["y_m"]]),
                      strict=True))  # fmt: skip
    for name, at in FLOOR["anchors"].items():
        assert np.hypot(*(places[name] - at[:2])) < 0.15
    assert found.config.start == "auto"
    assert found.config.mcl is not None
    assert 0.08 < found.config.estimator.range.sigma_m < 0.13
    other = drives(tmp_path, bare(drive(2), "anchors"))
    assert other.metrics["position_rmse_m"] < 0.1
    assert other.metrics["health"]["share"]["ok"] > 0.9


def test_every_key_says_where_it_comes_from(tmp_path: Path) -> None:
    found = set_up(
        bare(drive(1), *OF_THE_WORLD, "scans"), tmp_path, estimator={"range": {"sigma_m": 0.2}}
    )
    text = (tmp_path / "robot" / "robot.yaml").read_text()
    assert all(re.search(r":$|: .*# \w", line) for line in text.splitlines())
    assert load_config(tmp_path / "robot" / "robot.yaml") == found.config
    assert "sigma_m: 0.2  # given" in text
    assert found.tuned is not None
    assert found.tuned["estimator.range.sigma_m"].value == pytest.approx(0.1, rel=0.2)


def test_anchors_that_are_listed_are_the_frame_of_the_map(tmp_path: Path) -> None:
    log = drive(1)
    found = set_up(bare(log, "truth"), tmp_path)
    assert found.missing == ()
    assert found.map is not None
    truth = truth_of(log)
    assert truth is not None
    x, y, heading = laid_onto(found.map.estimate, truth) or (np.nan, np.nan, np.nan)
    first = found.map.estimate
    assert first.heading is not None
    assert np.hypot(x - first.position[0, 0], y - first.position[0, 1]) < 0.15
    assert abs(heading - np.rad2deg(first.heading[0])) < 1.0
    assert found.world["anchors"]["x_m"].tolist() == [1.0, 15.0, 15.0, 1.0]
    other = drives(tmp_path, bare(drive(2), "anchors"))
    assert other.metrics["position_rmse_m"] < 0.15


def test_a_listed_anchor_that_is_elsewhere_is_moved(tmp_path: Path) -> None:
    log = drive(1)
    table = {name: column.copy() for name, column in log["anchors"].items()}
    table["x_m"][2] -= 3.0
    moved = replace(log, tables={**log.tables, "anchors": table})
    found = set_up(bare(moved, "truth", "scans"), tmp_path)
    assert found.survey is not None
    assert any("anchor C stands 2." in text for text in found.survey.findings)
    assert found.world["anchors"]["x_m"][2] == pytest.approx(15.0, abs=0.4)
    assert found.world["anchors"]["x_m"][:2].tolist() == [1.0, 15.0]


def test_a_tag_of_which_nobody_knows_the_place_is_found(tmp_path: Path) -> None:
    config = parse_config({"simulation": {**FLOOR, "tags": {"tag": [0.3, -0.2, 0]}}})
    log, next_log = (load_log(config, None, seed) for seed in (3, 2))
    found = set_up(replace(bare(log, *OF_THE_WORLD), tags={}), tmp_path, start=start_of(log))
    assert found.world.tags["tag"] == pytest.approx((0.3, -0.2, 0.0), abs=0.06)
    other = drives(tmp_path, replace(bare(next_log, "anchors"), tags={}))
    assert other.metrics["position_rmse_m"] < 0.1
    assert other.metrics["health"]["share"]["ok"] > 0.9


def test_what_a_recording_lacks_is_one_sentence(tmp_path: Path) -> None:
    found = set_up(bare(drive(1), *OF_THE_WORLD, "scans", "ranges"), tmp_path)
    assert found.map is None
    assert found.survey is None
    assert found.world.grid is None
    assert found.config.start == (0.0, 0.0, 0.0)
    assert len(found.missing) == 1
    assert "no tune: " in found.missing[0]
    assert found.drive is not None


def test_a_robot_that_stands_gets_what_there_is(tmp_path: Path) -> None:
    log = bare(drive(1), *OF_THE_WORLD)
    first = {name: dict(log[name]) for name in ("odometry", "scans", "ranges")}
    for column in ("dx_m", "dy_m", "dheading_rad"):
        if column in first["odometry"]:
            first["odometry"][column] = 0.0 * log["odometry"][column]
    first["scans"]["ranges_m"] = np.tile(
        log["scans"]["ranges_m"][:1], (len(log["scans"]["stamp_ns"]), 1)
    )
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(log["ranges"]["range_m"]))
    for name in FLOOR["anchors"]:
        rows = log["ranges"]["anchor"] == name
        first["ranges"]["range_m"] = np.where(
            rows, log["ranges"]["range_m"][rows][0] + noise, first["ranges"]["range_m"]
        )
    found = set_up(replace(log, tables={**log.tables, **first}), tmp_path)
    assert found.map is not None
    assert any("the robot stood" in text for text in found.map.findings)
    assert any("drive some metres" in text for text in found.advice)
    assert (tmp_path / "robot" / "world" / "map.yaml").exists()


def test_a_bag_is_as_good_as_a_log_folder(tmp_path: Path) -> None:
    write_log(bare(drive(1), "truth", "scans"), tmp_path / "drive")
    said = locfuse("convert", "log", tmp_path / "drive", tmp_path / "drive.mcap")
    assert said.status == 0
    by_log = commission(tmp_path / "drive", base=tmp_path)
    by_bag = commission(tmp_path / "drive.mcap", base=tmp_path)
    assert by_bag.missing == by_log.missing == ()
    for one, other in zip(by_bag.lines[1:], by_log.lines[1:], strict=True):  # but for the log's
        same = one[1] if isinstance(one[1], str | dict) else pytest.approx(one[1], rel=0.02)
        assert (one[0], same) == (other[0], other[1])
    assert by_bag.world["anchors"]["x_m"].tolist() == by_log.world["anchors"]["x_m"].tolist()


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    write_log(bare(drive(1), *OF_THE_WORLD), tmp_path / "drive")
    out = tmp_path / "robot"
    said = locfuse("commission", tmp_path / "drive", "--out", out)
    assert said.status == 0, said.err
    for part in ("map: ", "anchors: 4 ", "noise and calibration: ", "health of the same drive: ",
                 "next: locfuse run"):  # fmt: skip
        assert part in said.out
    page = (out / "report.html").read_text()
    for part in ("survey", "map", "tune", "anchors", "learnt", "held-out", "configuration"):
        assert f'id="{part}"' in page
    assert (out / "drive" / "report.html").exists()
    sentence = locfuse("commission", tmp_path / "drive", "--out", out).sentence()
    assert sentence.endswith("robot.yaml: is there already; name another folder with --out")


def test_positions_are_the_frame_of_map_and_anchors(tmp_path: Path) -> None:
    gps = {**FLOOR, "positions": {"rate_hz": 2, "sigma_xy_m": 0.1}}
    log = load_log(parse_config({"simulation": gps, "seed": 1}), None, 1)
    found = set_up(bare(log, *OF_THE_WORLD), tmp_path)
    at = dict(zip(found.world["anchors"]["anchor"].tolist(),
                  zip(found.world["anchors"]["x_m"], found.world["anchors"]["y_m"], strict=True),
                  strict=True))  # fmt: skip
    for name, place in FLOOR["anchors"].items():
        assert np.hypot(at[name][0] - place[0], at[name][1] - place[1]) < 0.3
    assert found.map is not None
    truth = truth_of(log)
    assert truth is not None
    laid = laid_onto(found.map.estimate, truth)
    assert laid is not None
    assert np.hypot(*(found.map.estimate.position[0] - laid[:2])) < 0.2


def test_positions_without_scans_are_the_frame_of_anchors(tmp_path: Path) -> None:
    gps = {**FLOOR, "positions": {"rate_hz": 2, "sigma_xy_m": 0.1}}
    log = load_log(parse_config({"simulation": gps, "seed": 1}), None, 1)
    found = set_up(bare(log, *OF_THE_WORLD, "scans"), tmp_path)
    for name, x, y in zip(*(found.world["anchors"][key].tolist() for key in
                            ("anchor", "x_m", "y_m")), strict=True):  # fmt: skip
        assert np.hypot(x - FLOOR["anchors"][name][0], y - FLOOR["anchors"][name][1]) < 0.5


def test_a_map_that_is_there_is_the_frame_of_anchors(tmp_path: Path) -> None:
    log = drive(1)
    without = {name: table for name, table in log.tables.items() if name not in OF_THE_WORLD}
    found = set_up(replace(log, tables=without), tmp_path, start=start_of(log))
    assert found.map is None
    assert found.survey is not None
    assert found.survey.frame == "the frame is that of the map"
    for name, x, y in zip(*(found.world["anchors"][key].tolist() for key in
                            ("anchor", "x_m", "y_m")), strict=True):  # fmt: skip
        assert np.hypot(x - FLOOR["anchors"][name][0], y - FLOOR["anchors"][name][1]) < 0.3
    assert drives(tmp_path, bare(drive(2), "anchors")).metrics["position_rmse_m"] < 0.1


def test_tags_that_are_known_stay(tmp_path: Path) -> None:
    tags = {"t1": [0.3, -0.2, 0.9], "t2": [-0.3, 0.2, 0.9]}
    config = parse_config({"simulation": {**FLOOR, "tags": tags}})
    log = bare(load_log(config, None, 1), "truth", "scans")
    found = set_up(replace(log, tags={"t1": (0.3, -0.2, 0.9)}), tmp_path)
    assert found.world.tags["t1"] == (0.3, -0.2, 0.9)
    assert found.world.tags["t2"] == pytest.approx((-0.3, 0.2, 0.9), abs=0.1)


def test_a_list_in_another_unit_or_frame_is_named(tmp_path: Path) -> None:
    log = bare(drive(1), "scans")
    cm = {key: column if key == "anchor" else 100.0 * column
          for key, column in log["anchors"].items()}  # fmt: skip
    found = set_up(replace(log, tables={**log.tables, "anchors": cm}), tmp_path)
    assert "anchors" not in {line[0] for line in found.lines}
    assert any("units of anchors.csv" in text or "anchors.csv stay" in text
               or "no survey" in text for text in (*found.missing, *(
                   found.survey.findings if found.survey else ())))  # fmt: skip
    one = {key: column[:1] for key, column in log["anchors"].items()}
    tables = {name: table for name, table in log.tables.items() if name != "truth"}
    found = commission_of(replace(log, tables={**tables, "anchors": one}), tmp_path / "one")
    assert any(text.startswith("the places of anchors.csv are not used") for text in found.missing)
    assert any(text.startswith("no scale of ranges") for text in found.missing)


def test_landmarks_that_are_listed_stay_and_are_the_frame(tmp_path: Path) -> None:
    posts = {**FLOOR, "landmarks": {"L1": [2, 2], "L2": [14, 3], "L3": [14, 10], "L4": [3, 9]},
             "landmark_sightings": {"landmarks": "named"}, "laser": None, "ranges": None,
             "map": None, "path": {"shape": "waypoints"}}  # fmt: skip
    log = load_log(parse_config({"simulation": posts, "seed": 1}), None, 1)
    found = set_up(bare(log, *OF_THE_WORLD), tmp_path)
    assert found.world["landmarks"]["x_m"].tolist() == [2.0, 14.0, 14.0, 3.0]


def test_what_is_given_stays_even_at_its_default(tmp_path: Path) -> None:
    write_log(bare(drive(1), "truth", "scans"), tmp_path / "drive")
    known = {"estimator": {"odometry": {"distance_scale": 1.0}}, "mcl": {"min_particles": 300},
             "ros": {"range_topics": {"a.1": "/r/a", "no": "/r/b"}}}  # fmt: skip
    (tmp_path / "known.yaml").write_text(yaml.safe_dump(known))
    out = tmp_path / "robot"
    said = locfuse("commission", tmp_path / "drive", "--out", out, "--config",
                   tmp_path / "known.yaml")  # fmt: skip
    assert said.status == 0, said.err
    config = load_config(out / "robot.yaml")
    assert config.estimator.odometry.distance_scale == 1.0
    assert config.mcl is not None
    assert config.mcl.min_particles == 300
    assert config.ros.range_topics == {"a.1": "/r/a", "no": "/r/b"}


def test_a_recording_is_not_written_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_log(bare(drive(1), "scans"), tmp_path / "drive")
    monkeypatch.chdir(tmp_path)
    sentence = locfuse("commission", "drive", "--out", ".").sentence()
    assert sentence == "drive: is there already; name another folder with --out"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("nowhere",), "nowhere: no such folder"),
        (("drive", "--resolution", "0"), "the resolution is 0, expected 0.001 to 10 m"),
        (("drive", "--config", "absent.yaml"), "absent.yaml: cannot be read"),
    ],
)
def test_what_is_wrong_is_one_sentence(
    words: tuple[str, ...], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(bare(drive(1), *OF_THE_WORLD, "scans", "ranges"), tmp_path / "drive")
    assert sentence in locfuse("commission", *words).sentence()


def half(log: Log, begin: float, end: float) -> Log:
    """Return what was received between two shares of a recording's time."""
    stamps = [table["stamp_ns"] for name, table in log.tables.items()
              if "stamp_ns" in table and name != "truth" and len(table["stamp_ns"])]  # fmt: skip
    first, last = min(s.min() for s in stamps), max(s.max() for s in stamps)
    low, high = (first + share * (last - first) for share in (begin, end))
    tables = {}
    for name, table in log.tables.items():
        rows = slice(None)
        if "stamp_ns" in table:
            rows = (table["stamp_ns"] >= low) & (table["stamp_ns"] <= high)
        tables[name] = {key: column[rows] for key, column in table.items()}
    return replace(log, tables=tables)


def by_hand(name: str) -> tuple[RunConfig, Log]:
    config = load_config(ROOT / "examples/configs" / name)
    return config, load_log(config, ROOT / "examples/configs", 0)


@pytest.mark.parametrize(("begin", "name"), [
    (0.0, "mrpt_office.yaml"), (0.5, "mrpt_office.yaml"), (0.0, "ieu_gazebo.yaml"),
    (0.5, "plaza.yaml"),
])  # fmt: skip
def test_half_a_recording_sets_up_the_other(begin: float, name: str, tmp_path: Path) -> None:
    if name == "mrpt_office.yaml" and not Path("/usr/share/mrpt/datasets").is_dir():
        pytest.skip("the Debian package mrpt-common is not installed")
    if name != "mrpt_office.yaml":
        recording("ieu-gazebo-uwb-lidar" if "gazebo" in name else "plaza")
    config, log = by_hand(name)
    set_up(bare(half(log, begin, begin + 0.5)), tmp_path)
    other = half(log, 0.5 - begin, 1.0 - begin)
    ours = drives(tmp_path, other, start="truth").metrics
    theirs = run(config, other).metrics
    assert ours["position_rmse_m"] <= 1.1 * theirs["position_rmse_m"]


def test_the_mapping_scans_of_intel_lab_set_up_the_others(tmp_path: Path) -> None:
    folders = {folder.name: folder for folder in
               convert("intel_lab", recording("intel-lab"), tmp_path / "intel")}  # fmt: skip
    set_up(bare(read_log(folders["mapping"])), tmp_path)
    other = read_log(folders["test"])
    hand = parse_config({
        "start": "truth", "mcl": {"min_particles": 1000, "max_particles": 1000, "poses_hz": 2},
        "use": ["odometry", "poses"],
        "estimator": {"odometry": {
            "sigma_longitudinal_per_sqrt_m": 0.1, "sigma_lateral_per_sqrt_m": 0.05,
            "sigma_heading_per_sqrt_m": 0.05, "sigma_heading_per_sqrt_rad": 0.1}},
    })  # fmt: skip
    ours, theirs = (
        relation_metrics(relation_errors(found.estimate, other["relations"]))["all"]
        for found in (drives(tmp_path, other), run(hand, other))
    )
    assert ours["translation_mean_m"] <= 1.1 * theirs["translation_mean_m"]
