# SPDX-License-Identifier: Apache-2.0
"""Every kind of estimator is reached from every door, on the same path: the same poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import FUSES, SOURCES, RunConfig, SwitchedOff
from locfuse.eval.errors import errors_against, interpolate
from locfuse.io.log_folder import read_log, read_log_file, write_log
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.live import LiveRun
from locfuse.report.player.world import world_of
from locfuse.report.results import write_results
from locfuse.run.capsule import make_capsule, replay_capsule
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.studio.document import checked
from locfuse.studio.estimators import choices, variant
from locfuse.sweep.runner import run_trials
from locfuse.types import ConfigError, Log, LogError, RunResult
from support_adapter import Robot, assert_poses_are, later
from support_live import assert_same, live_of
from support_live import world_of as world_tables_of
from support_runs import ROOT

WHEELS = {"sigma_longitudinal_per_sqrt_m": 0.05, "sigma_heading_per_sqrt_m": 0.03}
POSTS = {"A": [4, 4], "B": [10, 2], "C": [16, 4], "D": [18, 10], "E": [16, 16], "F": [10, 18],
         "G": [4, 16], "H": [2, 10]}  # fmt: skip
TAGS = {"front": [0.5, 0, 1], "left": [-0.4, 0.3, 1], "right": [-0.4, -0.3, 1]}
WORLDS: Mapping[str, dict[str, Any]] = {
    "pose": {"simulation": {"duration_s": 20.0}},
    "landmark_slam": {
        "simulation": {
            "room_m": [20, 20],
            "path": {"shape": "circle", "speed_mps": 1.5, "radius_m": 6, "center_m": [10, 10]},
            "duration_s": 60.0,
            "odometry": WHEELS,
            "ranges": None,
            "poses": None,
            "landmarks": POSTS,
            "landmark_sightings": {"landmarks": "unnamed", "range_max_m": 6},
        },
        "start_sigma": {"xy_m": 0.01, "heading_deg": 0.5},
        "estimator": {
            "odometry": WHEELS,
            "landmark": {"sigma_range_m": 0.05, "sigma_bearing_rad": 0.0175},
            "landmark_slam": {"use_map": False},
        },
    },
    "air": {
        "simulation": {
            "path": {"shape": "circle", "speed_mps": 0.8, "radius_m": 3},
            "duration_s": 30.0,
            "anchors": {"A": [0, 0, 0.2], "B": [10, 0, 3.5], "C": [10, 10, 0.3], "D": [0, 10, 3.8],
                        "E": [5, 0, 2], "F": [5, 10, 1]},
            "tags": {"tag": [0, 0, 0]},
            "ranges": {"rate_hz": 10, "sigma_m": 0.1, "sigma_relative": 0},
            "poses": None,
            "flight": {"height_m": 1.5, "swing_m": 0.5, "period_s": 20},
            "altitudes": {"rate_hz": 5, "sigma_m": 0.1, "altimeter_up_m": 0.2},
            "landmarks": {"lamp": [1, 9], "sign": [9, 1]},
            "landmark_height_m": 4.0,
            "landmark_sightings": {"sigma_range_m": 0.3, "sigma_bearing_deg": 2.8,
                                   "sigma_elevation_deg": 1.1},
        },
        "estimator": {
            "range": {"sigma_m": 0.1},
            "air": {"motion": "odometry", "start_height_m": 1.5,
                    "altitude": {"altimeter_up_m": 0.2}},
        },
    },
    "tag_triangle": {
        "simulation": {
            "path": {"shape": "eight", "speed_mps": 0.31, "radius_m": 1.4},
            "duration_s": 60.0,
            "odometry": {"rate_hz": 7.5},
            "tags": TAGS,
            "ranges": {"rate_hz": 1},
            "poses": None,
            "positions": {"rate_hz": 1, "sigma_xy_m": 0.12, "tags": list(TAGS)},
        },
    },
}  # fmt: skip
WORLDS = {
    **WORLDS,
    "inertial": {
        "simulation": {
            **{key: value for key, value in WORLDS["air"]["simulation"].items()
               if not key.startswith("landmark")},
            "odometry": None,
            "tags": {"front": [0.3, 0, 0.1], "back": [-0.3, 0, 0.1]},
            "imu": {"sigma_rate_radps_per_sqrt_hz": 0.0005, "sigma_force_mps2": 0.1},
        },
        "estimator": {
            "kind": "air",
            "range": {"sigma_m": 0.1},
            "air": {"motion": "inertial", "start_height_m": 1.5,
                    "altitude": {"altimeter_up_m": 0.2}},
        },
    },
}  # fmt: skip
KINDS = list(WORLDS)


def world_of_kind(kind: str) -> dict[str, Any]:
    """Return the document of a run of that kind, or of one that is inertial."""
    return {**WORLDS[kind], "estimator": {"kind": kind, **WORLDS[kind].get("estimator", {})}}


@cache
def driven(kind: str) -> tuple[RunConfig, Log]:
    """Return a run of that kind with its log; its start is given, as live."""
    world = {**world_of_kind(kind), "seed": 5}
    config = parse_config(world)
    log = load_log(config, None, config.seed)
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    start = {"start": [x, y, float(np.degrees(heading))], "simulation": None}
    return parse_config({**world, **start}), log


@cache
def result_of(kind: str) -> RunResult:
    return run(*driven(kind))


def test_every_kind_has_a_world() -> None:
    assert set(WORLDS) == {*FUSES, "inertial"}
    assert all(set(sources) <= set(SOURCES) for sources in FUSES.values())


@pytest.mark.parametrize("kind", KINDS)
def test_run(kind: str) -> None:
    result = result_of(kind)
    assert result.metrics["position_rmse_m"] < 0.3
    assert result.metrics["nees_in_band"] > 0.8
    assert result.health is not None
    assert np.mean(result.health.state == "ok") > 0.8
    fused = set(result.outcomes.source[result.outcomes.verdict == "fused"].tolist())
    sources = [*FUSES[driven(kind)[0].estimator.kind], *["imu"] * (kind == "inertial")]
    assert fused == {source for source in sources if source in result.log}


@pytest.mark.parametrize("kind", KINDS)
def test_live(kind: str) -> None:
    assert_same(*driven(kind))


@pytest.mark.parametrize("late_ones", ["all of a moment", "any row"])
@pytest.mark.parametrize("kind", KINDS)
def test_late_messages_give_the_bits_of_the_sorted_log(kind: str, late_ones: str) -> None:
    """Of several at one stamp, too, of which some are late."""
    config, log = driven(kind)
    tables, rng = dict(log.tables), np.random.default_rng(1)
    for source in ("ranges", "positions", "poses", "landmark_sightings", "altitudes", "imu"):
        if source in tables:
            stamp = tables[source]["stamp_ns"]
            is_late = stamp // 200_000_000 % 5 == 0
            if late_ones == "any row":
                is_late = rng.random(len(stamp)) < 0.2
            is_late &= (stamp > 1_000_000_000) | ("odometry" in tables)  # or it starts later
            arrival = stamp + np.where(is_late, 500_000_000, 0)
            tables[source] = {**tables[source], "arrival_ns": arrival}
    late = replace(log, tables=tables)
    expected = run(config, log).estimate
    found = run(config, late).estimate
    assert found.covariance is not None
    assert expected.covariance is not None
    assert found.position[-1].tolist() == expected.position[-1].tolist()
    assert np.array_equal(found.covariance[-1], expected.covariance[-1])
    assert_same(config, late, least=0.5)


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("kind", KINDS)
def test_nodes(kind: str, ros: str) -> None:
    config, log = driven(kind)
    config = config.model_copy(
        update={"ros": config.ros.model_copy(update={"estimate_at": "fused"})}
    )
    log = later(log)
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    assert_poses_are(robot, run(config, log).estimate, least=0.8)


@pytest.mark.parametrize("bag", ["drive.bag", "drive.mcap"])
@pytest.mark.parametrize("kind", KINDS)
def test_bags(kind: str, bag: str, tmp_path: Path) -> None:
    config, result = driven(kind)[0], result_of(kind)
    write_bag(result, tmp_path / bag, config.ros)
    again = run(config, read_bag(tmp_path / bag, config.ros)).estimate
    assert again.position[-1].tolist() == pytest.approx(
        result.estimate.position[-1].tolist(), abs=1e-6
    )


@pytest.mark.parametrize("kind", KINDS)
def test_check_sweep_and_capsule(kind: str) -> None:
    config, log = driven(kind)
    assert not [f for f in check(config, log).findings if f.severity == "error"]
    assert replay_capsule(make_capsule(config, log)) == []
    varied = {"estimator.position.gate": [0.99, 0.999]}
    trials = run_trials(parse_config(world_of_kind(kind)), 2, varied, workers=1)
    assert len(trials) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_studio(kind: str) -> None:
    """Its choice runs, and choosing another afterwards leaves nothing of it."""
    data = {key: value for key, value in WORLDS[kind].items() if key != "estimator"}
    config = checked(data)
    offered = {choice.key: choice for choice in choices(data, config)}
    if kind == "inertial":  # the motion of the choice "air"
        assert "air" in offered
        return
    if kind == "pose":
        assert "tag_triangle" not in offered
        assert "landmark_slam" not in offered
        return
    data = {**data, "start": list(driven(kind)[0].start)}
    config = checked(data)
    chosen = checked(variant(offered[kind], data, config))
    assert chosen.estimator.kind == kind
    assert run(chosen).metrics["position_rmse_m"] < 1.0
    back = checked(variant(offered["odometry"], variant(offered[kind], data, config), chosen))
    assert back.estimator == config.estimator


def test_a_map_is_written_drawn_and_known_in_the_next_drive(tmp_path: Path) -> None:
    config, log = driven("landmark_slam")
    result = result_of("landmark_slam")
    assert result.landmarks is not None
    assert len(result.landmarks) == len(POSTS)
    assert result.metrics["mapping"]["landmarks"] == len(POSTS)
    assert len(world_of(result, 10_000)["mapped"]) == len(POSTS)
    write_results(result, tmp_path / "out")
    mapped = read_log_file(tmp_path / "out" / "landmarks.csv", "landmarks")
    known = replace(log, tables={**log.tables, "landmarks": mapped})
    again = parse_config({**config.model_dump(mode="json", exclude_defaults=True),
                          "estimator": {**WORLDS["landmark_slam"]["estimator"],
                                        "kind": "landmark_slam", "landmark_slam": {}}})  # fmt: skip
    second = run(again, known)
    assert second.landmarks is not None
    assert second.landmarks.name.tolist() == mapped["landmark"].tolist()
    before = result.landmarks.covariance.trace(axis1=1, axis2=2)
    after = second.landmarks.covariance.trace(axis1=1, axis2=2)
    assert np.all(after < len(POSTS) * before)
    assert second.metrics["nees_mean"] < 3.5


def test_named_landmarks_are_scored_against_those_of_the_log() -> None:
    world = dict(WORLDS["landmark_slam"])
    sightings = {**world["simulation"]["landmark_sightings"], "landmarks": "named"}
    world["simulation"] = {**world["simulation"], "landmark_sightings": sightings}
    world["estimator"] = {**world["estimator"], "kind": "landmark_slam"}
    result = run(parse_config(world))
    assert result.landmarks is not None
    assert sorted(result.landmarks.name.tolist()) == sorted(POSTS)
    assert result.metrics["mapping"]["rmse_m"] < 0.5


def test_a_live_run_returns_its_map() -> None:
    config, log = driven("landmark_slam")
    live, _ = live_of(config, log)
    landmarks = live.landmarks()
    expected = result_of("landmark_slam").landmarks
    assert landmarks is not None
    assert expected is not None
    assert landmarks.position.tolist() == expected.position.tolist()
    assert live_of(*driven("pose"))[0].landmarks() is None


def test_heights_are_written_drawn_scored_and_published(tmp_path: Path) -> None:
    config, log = driven("air")
    result = result_of("air")
    assert result.estimate.height is not None
    assert result.estimate.height_variance is not None
    reference = truth_of(log)
    assert reference is not None
    truth = interpolate(reference, result.estimate.stamp_ns)[0].height
    assert truth is not None
    off = (result.estimate.height - truth)[-100:]
    sigma = np.sqrt(result.estimate.height_variance[-100:])
    assert np.all(np.abs(off) < 4.0 * sigma)
    assert np.all(sigma < 0.2)
    write_results(result, tmp_path / "out")
    assert (tmp_path / "out" / "height.png").is_file()
    header, *rows = (tmp_path / "out" / "estimate.csv").read_text().splitlines()
    assert header.split(",")[-3:] == ["z_m", "cov_z_z", "state"]
    assert float(rows[-1].split(",")[-3]) == result.estimate.height[-1]
    tum = (tmp_path / "out" / "estimate.tum").read_text().splitlines()[-1].split()
    assert float(tum[3]) == result.estimate.height[-1]
    live, _ = live_of(config, log)
    pose = live.fused()
    assert pose is not None
    assert pose.height == pytest.approx(result.estimate.height[-1], abs=0.05)
    fused = {"ros": config.ros.model_copy(update={"estimate_at": "fused"})}
    robot = Robot(config.model_copy(update=fused), later(log))
    robot.learn()
    robot.drive()
    last = robot.said("locfuse/pose")[-1]["pose"]
    assert last["pose"]["position"]["z"] == pytest.approx(pose.height, abs=1e-9)
    assert last["covariance"][14] == pytest.approx(pose.height_variance, rel=1e-6)
    assert live_of(*driven("pose"))[0].pose().height is None  # type: ignore[union-attr]


def test_a_flight_starts_at_the_height_of_the_reference() -> None:
    config, log = driven("air")
    truth = {**log["truth"], "z_m": log["truth"]["z_m"] - 1.1}
    flying = replace(log, tables={**log.tables, "truth": truth})
    free = config.model_copy(update={"start": "truth", "use": ["odometry"]})
    result = run(free, flying)
    assert result.estimate.height is not None
    assert result.metrics["height_rmse_m"] > 0.0
    assert result.estimate.height[0] == pytest.approx(0.4, abs=1e-9)


def test_attitudes_are_written_scored_and_published(tmp_path: Path) -> None:
    config, log = driven("inertial")
    heading = log["truth"]["heading_rad"]
    level = {"qw": np.cos(heading / 2), "qx": 0.0 * heading, "qy": 0.0 * heading,
             "qz": np.sin(heading / 2)}  # fmt: skip
    log = replace(log, tables={**log.tables, "truth": {**log["truth"], **level}})
    write_log(log, tmp_path / "log")
    log = read_log(tmp_path / "log")
    result = run(config, log)
    turned = result.estimate.orientation
    assert turned is not None
    assert result.estimate.orientation_covariance is not None
    assert result.metrics["roll_rmse_deg"] < 1.0
    assert result.metrics["pitch_rmse_deg"] < 1.0
    last = np.diagonal(result.estimate.orientation_covariance[-1])
    assert np.all(np.sqrt(last[:2]) < np.radians(2.0))
    assert np.abs(turned[-1, 1:3]).max() < 4.0 * np.sqrt(last[:2].max())
    write_results(result, tmp_path / "out")
    header, *rows = (tmp_path / "out" / "estimate.csv").read_text().splitlines()
    values = dict(zip(header.split(","), rows[-1].split(","), strict=True))
    assert [float(values[name]) for name in ("qw", "qx", "qy", "qz")] == turned[-1].tolist()
    assert float(values["cov_tilt_x_x"]) == last[0]
    tum = (tmp_path / "out" / "estimate.tum").read_text().splitlines()[-1].split()
    assert [float(tum[i]) for i in (7, 4, 5, 6)] == turned[-1].tolist()
    fused = {"ros": config.ros.model_copy(update={"estimate_at": "fused"})}
    robot = Robot(config.model_copy(update=fused), later(log))
    robot.learn()
    robot.drive()
    pose = robot.said("locfuse/pose")[-1]["pose"]
    live, _ = live_of(config, log)
    fused_pose = live.fused()
    assert fused_pose is not None
    assert fused_pose.orientation is not None
    assert fused_pose.orientation_covariance is not None
    said = [pose["pose"]["orientation"][axis] for axis in "wxyz"]
    assert said == pytest.approx(fused_pose.orientation.tolist(), abs=1e-9)
    assert pose["covariance"][21] == pytest.approx(fused_pose.orientation_covariance[0, 0])
    write_bag(result, tmp_path / "out.bag", config.ros)
    assert live_of(*driven("air"))[0].pose().orientation is None  # type: ignore[union-attr]


def test_altitudes_and_elevations_improve_the_height() -> None:
    config, log = driven("air")
    with_ranges = run(config.model_copy(update={"use": ["odometry", "ranges"]}), log).metrics
    with_all = result_of("air").metrics
    assert with_all["height_rmse_m"] < 0.8 * with_ranges["height_rmse_m"]
    assert set(with_all["nis_mean"]) == {"ranges", "landmark_sightings", "altitudes"}
    assert 0.5 < with_all["nis_mean"]["altitudes"] < 1.5


@pytest.mark.parametrize("kind", ["pose", "tag_triangle", "landmark_slam"])
def test_altitudes_without_a_height_are_named(kind: str) -> None:
    config, log = driven(kind)
    stamp = log["truth"]["stamp_ns"][::10]
    altitudes = {"stamp_ns": stamp, "height_m": np.full(len(stamp), 1.0)}
    with_altitudes = replace(log, tables={**log.tables, "altitudes": altitudes})
    result = run(config, with_altitudes)
    rows = result.outcomes.source == "altitudes"
    assert set(result.outcomes.verdict[rows].tolist()) <= {"not_modelled", "stale"}
    why = set(result.outcomes.reason[rows & (result.outcomes.verdict == "not_modelled")].tolist())
    assert why == {f"{config.estimator.filter} does not fuse altitudes"}
    assert np.array_equal(result.estimate.position[-1], result_of(kind).estimate.position[-1])
    assert_same(config, with_altitudes)
    asked = config.model_dump(mode="json", exclude_defaults=True) | {
        "use": ["odometry", "altitudes"]
    }
    with pytest.raises(ConfigError, match=r"use names \['altitudes'\]"):
        parse_config(asked)


def test_elevations_in_the_plane_are_refused() -> None:
    _, log = driven("air")
    start = [5.0, 5.0, 0.0]
    with pytest.raises(LogError, match=r"elevation_rad.*kind: air"):
        run(parse_config({"start": start}), log)
    live = LiveRun(parse_config({"start": start}), replace(log, tables=world_tables_of(log)))
    row = {key: values[0] for key, values in log["landmark_sightings"].items()}
    with pytest.raises(ValueError, match=r"elevation_rad.*kind: air"):
        live.on("landmark_sightings", row)


def test_what_a_kind_does_not_fuse_is_ignored_with_a_reason() -> None:
    config, log = driven("tag_triangle")
    rows = {key: values[::30] for key, values in log["truth"].items()}
    sigmas = np.full(len(rows["stamp_ns"]), 0.1)
    poses = {**rows, "sigma_xy_m": sigmas, "sigma_heading_rad": sigmas}
    with_poses = run(config, replace(log, tables={**log.tables, "poses": poses}))
    is_pose = with_poses.outcomes.source == "poses"
    assert set(with_poses.outcomes.verdict[is_pose].tolist()) == {"ignored"}
    assert set(with_poses.outcomes.reason[is_pose].tolist()) == {"tag_triangle does not fuse poses"}
    last = result_of("tag_triangle").estimate
    assert with_poses.estimate.position[-1].tolist() == last.position[-1].tolist()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"estimator": {"kind": "tag_triangl"}}, "did you mean 'tag_triangle'"),
        ({"estimator": {"kind": "tag_triangle", "calibration": {"sigma_scale": 0.1}}},
         "calibration is set, but it belongs to kind 'pose'"),
        ({"estimator": {"tag_triangle": {"sigma_side_m": 0.1}}}, "belongs to kind 'tag_triangle'"),
        ({"estimator": {"kind": "air"}, "start": "auto"}, "finds no height"),
        ({"estimator": {"kind": "air", "adaptive": {"messages": 20}}}, "belongs to kind 'pose'"),
        ({"estimator": {"kind": "landmark_slam"}, "use": ["poses"]}, "does not fuse"),
        ({"estimator": {"kind": "air", "air": {"motion": "inertial"}}, "use": ["ranges"]},
         "use leaves 'imu' out"),
        ({"imu": {"mount_deg": [0, 0]}}, "mount_deg"),
        ({"imu": {"sigma_bias_mps2": 0}}, "sigma_bias_mps2"),
        ({"imu": {"mount_deg": [0, 0, 1e300]}}, "mount_deg"),
        ({"switched_off": [{"source": "imu", "from_s": 1}]}, "only with estimator.kind 'air'"),
        ({"estimator": {"kind": "landmark_slam"}, "mcl": {}}, "expected one of them"),
        ({"estimator": {"kind": "landmark_slam", "landmark_slam": {"gate_new": 0.9}}},
         "expected landmark.gate <= gate_new"),
    ],
)  # fmt: skip
def test_a_configuration_that_no_kind_fits_is_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        parse_config(changes)


@pytest.mark.parametrize(
    ("tags", "says"),
    [
        ({"a": (0.5, 0.0, 1.0)}, "needs 3 tags"),
        ({"a": (0.5, 0.0, 1.0), "b": (0.0, 0.0, 1.0), "c": (-0.5, 0.0, 1.0)}, "line"),
    ],
)
def test_tags_that_make_no_triangle_are_refused(
    tags: dict[str, tuple[float, float, float]], says: str
) -> None:
    config, log = driven("tag_triangle")
    tables = {name: table for name, table in log.tables.items() if name == "odometry"}
    with pytest.raises(LogError, match=says):
        run(config, replace(log, tables=tables, tags=tags))


def test_check_names_what_a_kind_ignores_and_what_it_lacks() -> None:
    world = {"simulation": {"duration_s": 5.0, "tags": TAGS}, "estimator": {"kind": "tag_triangle"}}
    said = [f for f in check(parse_config(world)).findings if f.rule == "messages_without_use"]
    assert [f.severity for f in said] == ["warning"]
    assert "poses, which are ignored: tag_triangle does not fuse poses" in said[0].what
    (stopped,) = [f for f in check(parse_config({**world, "simulation": {"duration_s": 5.0}}))
                  .findings if f.severity == "error"]  # fmt: skip
    assert "needs 3 tags" in stopped.what
    flying = {"simulation": {"duration_s": 5.0}, "estimator": {"kind": "air"}}
    (ignored,) = [
        f for f in check(parse_config(flying)).findings if f.rule == "messages_without_use"
    ]
    assert "takes no odometry" in ignored.what


def test_a_run_warns_of_what_it_ignores(caplog: pytest.LogCaptureFixture) -> None:
    flying = {"simulation": {"duration_s": 2.0}, "estimator": {"kind": "air"}}
    result = run(parse_config(flying))
    assert "the log has odometry, which are ignored: air.motion is constant_velocity" in caplog.text
    of_odometry = result.outcomes.source == "odometry"
    assert set(result.outcomes.reason[of_odometry].tolist()) == {
        "air.motion is constant_velocity, which takes no odometry"
    }


def test_an_inertial_run_needs_forces() -> None:
    config, log = driven("inertial")
    tables = {name: table for name, table in log.tables.items() if name != "imu"}
    with pytest.raises(LogError, match="motion is inertial, but the log has no imu; add"):
        run(config, replace(log, tables=tables))
    gyro = {key: column for key, column in log["imu"].items() if not key.startswith("a")}
    with pytest.raises(LogError, match="has no ax_mps2 in imu"):
        run(config, replace(log, tables={**tables, "imu": gyro}))


def test_forces_in_g_are_named(caplog: pytest.LogCaptureFixture) -> None:
    config, log = driven("inertial")
    in_g = {key: column / 9.81 if key.startswith("a") else column
            for key, column in log["imu"].items()}  # fmt: skip
    result = run(config, replace(log, tables={**log.tables, "imu": in_g}))
    rows = len(log["imu"]["stamp_ns"])
    assert f"{rows} of {rows} samples of imu are not used" in caplog.text
    assert "expected m/s^2, gravity included" in caplog.text
    assert result.metrics["counts"]["imu"] == {"implausible": rows}


def test_an_inertial_sensor_is_switched_off_and_on() -> None:
    config, log = driven("inertial")
    off = config.model_copy(
        update={"switched_off": [SwitchedOff(source="imu", from_s=5.0, until_s=15.0)]}
    )
    result = run(off, log)
    assert result.metrics["counts"]["imu"]["ignored"] == 1000
    reference = truth_of(log)
    assert reference is not None
    errors = errors_against(result.estimate, reference)
    assert np.linalg.norm(errors.position[-1]) < 0.3


def test_a_mount_of_an_inertial_sensor_is_taken_into_account() -> None:
    """A sensor upside down and turned by a quarter gives what a straight one does."""
    config, log = driven("inertial")
    askew = dict(log["imu"])
    for kind in ("w{}_radps", "a{}_mps2"):  # body to sensor, by roll 180 then yaw 90
        x, y, z = (log["imu"][kind.format(axis)] for axis in "xyz")
        for axis, column in zip("xyz", (y, x, -z), strict=True):
            askew[kind.format(axis)] = column
    turned = replace(log, tables={**log.tables, "imu": askew})
    mounted = config.model_copy(
        update={"imu": config.imu.model_copy(update={"mount_deg": (180.0, 0.0, 90.0)})}
    )
    expected, found = result_of("inertial").estimate, run(mounted, turned).estimate
    assert found.position[-1] == pytest.approx(expected.position[-1], abs=1e-9)
    assert not np.allclose(run(config, turned).estimate.position[-1], expected.position[-1])


def test_an_unknown_heading_is_found_by_moving() -> None:
    """Of one tag; until then health says that there are several."""
    world = dict(world_of_kind("inertial"))
    simulation = {**world["simulation"], "tags": {"tag": [0, 0, 0]}, "duration_s": 60,
                  "path": {"shape": "eight", "speed_mps": 1.8, "radius_m": 1.2}}  # fmt: skip
    sigma = {"xy_m": 0.3, "heading_deg": 180}
    beyond = []
    for seed in range(4):
        config = parse_config({**world, "simulation": simulation, "start_sigma": sigma})
        log = load_log(config, None, seed)
        x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
        start = [x, y, float(np.degrees(heading)) + 40.0 + 90.0 * seed]
        result = run(config.model_copy(update={"start": tuple(start)}), log)
        assert result.health is not None
        assert result.health.state[0] == "ambiguous"
        reference = truth_of(log)
        assert reference is not None
        errors = errors_against(result.estimate, reference)
        assert errors.heading is not None
        assert errors.sigma is not None
        assert "ok" in result.health.state
        ok_from = result.health.stamp_ns[np.argmax(result.health.state == "ok")]
        assert ok_from < 20_000_000_000
        sure = errors.stamp_ns >= ok_from
        beyond.append(np.mean(np.abs(errors.heading[sure]) > 3.0 * errors.sigma[sure, 2]))
        assert abs(errors.heading[-1]) < np.radians(15.0)
    assert np.mean(beyond) <= 0.01


def test_ten_seconds_without_ranges_are_bridged() -> None:
    """Sensors of a consumer, whose noise is said twice as large: inside three sigma, 1.5 m."""
    config = load_config(ROOT / "examples" / "configs" / "inertial_flight.yaml")
    for seed in range(8):
        log = load_log(config, None, seed)
        result = run(config, log)
        reference = truth_of(log)
        assert reference is not None
        errors = errors_against(result.estimate, reference)
        assert errors.sigma is not None
        assert errors.height is not None
        assert result.estimate.height_variance is not None
        at = int(np.searchsorted(errors.stamp_ns, 49_900_000_000))
        off = np.array([*errors.position[at], errors.height[at]])
        up = np.sqrt(result.estimate.height_variance[errors.row[at]])
        sigma = np.array([*errors.sigma[at, :2], up])
        assert np.linalg.norm(off) < 1.5
        assert np.all(np.abs(off) < 3.0 * sigma)
