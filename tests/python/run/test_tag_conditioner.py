# SPDX-License-Identifier: Apache-2.0
"""Fixes of tags are conditioned before they are fused, in every kind that fuses them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig, TagConditioner
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_writer import write_bag
from locfuse.run.capsule import make_capsule, read_capsule, replay_capsule
from locfuse.run.run import load_log, run
from locfuse.sweep.runner import run_trials
from locfuse.types import ConfigError, Log, RunResult
from support_adapter import Robot, assert_poses_are, later
from support_live import arrivals, assert_same, live_of

GOLDEN = Path(__file__).parents[2] / "golden"
TAGS = {"front": [0.5, 0, 1], "left": [-0.4, 0.3, 1], "right": [-0.4, -0.3, 1]}
BIAS = 0.5
JUMPS, FROZEN = (60, 93), (121, 124)  # rows of positions, which come from three tags in turn
CONDITIONER = {"cutoff_hz": 0, "bias_x_m": BIAS}
WORLD: dict[str, Any] = {
    "simulation": {
        "path": {"shape": "eight", "speed_mps": 0.31, "radius_m": 1.4},
        "duration_s": 60.0,
        "odometry": {"rate_hz": 7.5},
        "tags": TAGS,
        "ranges": None,
        "poses": None,
        "positions": {"rate_hz": 1, "sigma_xy_m": 0.12, "tags": list(TAGS)},
    },
    "seed": 5,
}
ESTIMATORS: dict[str, dict[str, Any]] = {
    "pose": {"kind": "pose"},
    "soft": {"kind": "tag_triangle"},
    "rigid": {"kind": "tag_triangle", "tag_triangle": {"shape": "rigid"}},
    "air": {"kind": "air", "air": {"motion": "odometry"}},
}
KINDS = list(ESTIMATORS)


@cache
def recorded() -> Log:
    """Return a drive whose RTLS is off by a bias, jumps twice, and is stuck for two epochs."""
    log = load_log(parse_config(WORLD), None, 5)
    positions = {name: values.copy() for name, values in log["positions"].items()}
    positions["x_m"] += BIAS
    for row in JUMPS:
        positions["y_m"][row] += 8.0
    for row in FROZEN:
        before = FROZEN[0] - 3
        assert positions["tag"][row] == positions["tag"][before]
        for name in ("x_m", "y_m"):
            positions[name][row] = positions[name][before]
    return replace(log, tables={**log.tables, "positions": positions})


def config_of(name: str, conditioner: dict[str, Any] | None = None, **keys: Any) -> RunConfig:
    truth = recorded()["truth"]
    x, y, heading = (float(truth[key][0]) for key in ("x_m", "y_m", "heading_rad"))
    start = {"start": [x, y, float(np.degrees(heading))]}
    chosen = CONDITIONER if conditioner is None else conditioner
    return parse_config({**start, "estimator": ESTIMATORS[name], "tag_conditioner": chosen, **keys})


@cache
def result_of(name: str) -> RunResult:
    return run(config_of(name), recorded())


@pytest.mark.parametrize("name", KINDS)
def test_run_removes_the_bias_and_rejects_what_no_tag_does(name: str) -> None:
    result = result_of(name)
    assert result.metrics["position_rmse_m"] < 0.12
    raw = run(config_of(name, tag_conditioner=None), recorded())
    assert raw.metrics["position_rmse_m"] > 0.4
    out = result.outcomes
    rows = np.flatnonzero(out.source == "positions")
    assert len(rows) == len(recorded()["positions"]["stamp_ns"])  # nothing is lost
    rejected = {row: str(reason) for row, reason in enumerate(out.reason[rows])
                if out.verdict[rows[row]] == "implausible"}  # fmt: skip
    assert sorted(rejected) == [*JUMPS, *FROZEN]
    for row in JUMPS:
        assert rejected[row].startswith("tag_conditioner: jumped ")
        assert "from the last fix, more than 2.2 m" in rejected[row]
    for row in FROZEN:
        assert rejected[row] == "tag_conditioner: frozen, while the tag moved more than 0.1 m"


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("start", ["given", "auto"])
def test_live_gives_the_same_bits(name: str, start: str) -> None:
    if name == "air" and start == "auto":
        with pytest.raises(ConfigError, match="finds no height"):
            config_of(name, start=start)
        return
    config = config_of(name, {"bias_x_m": BIAS}, **({} if start == "given" else {"start": start}))
    assert_same(config, recorded(), least=0.8)
    if start == "auto":  # the search takes conditioned fixes, too
        assert run(config, recorded()).metrics["position_rmse_m"] < 0.3


@pytest.mark.parametrize("name", KINDS)
def test_a_late_fix_is_conditioned_where_it_belongs(name: str) -> None:
    config, log = config_of(name, {"bias_x_m": BIAS}), recorded()
    stamp = log["positions"]["stamp_ns"]
    arrival = stamp + np.where(stamp // 10**9 % 5 == 0, 1_500_000_000, 0)
    late = replace(log, tables={**log.tables, "positions": {**log["positions"],
                                                            "arrival_ns": arrival}})  # fmt: skip
    expected, found = run(config, log), run(config, late)
    assert found.estimate.position[-1].tolist() == expected.estimate.position[-1].tolist()
    assert found.estimate.covariance is not None
    assert expected.estimate.covariance is not None
    assert np.array_equal(found.estimate.covariance[-1], expected.estimate.covariance[-1])
    for outcomes in (found.outcomes, expected.outcomes):
        assert np.sum(outcomes.verdict == "implausible") == len(JUMPS) + len(FROZEN)
    assert_same(config, late, least=0.5)
    too_late = run(config.model_copy(update={"history_s": 1.0}), late).outcomes
    is_stale = (too_late.source == "positions") & (too_late.verdict == "stale")
    assert np.sum(is_stale) > 20
    assert set(too_late.reason[is_stale].tolist()) == {"older than the history of 1 s"}


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
def test_nodes(ros: str) -> None:
    config = config_of("soft")
    config = config.model_copy(
        update={"ros": config.ros.model_copy(update={"estimate_at": "fused"})}
    )
    log = later(recorded())
    robot = Robot(config, log, ros)
    robot.learn()
    robot.drive()
    assert_poses_are(robot, run(config, log).estimate, least=0.8)


def test_bags(tmp_path: Path) -> None:
    config, result = config_of("soft"), result_of("soft")
    write_bag(result, tmp_path / "drive.mcap", config.ros)
    again = run(config, read_bag(tmp_path / "drive.mcap", config.ros))
    assert again.estimate.position[-1].tolist() == pytest.approx(
        result.estimate.position[-1].tolist(), abs=1e-6
    )
    assert np.sum(again.outcomes.verdict == "implausible") == len(JUMPS) + len(FROZEN)


def test_live_counts_what_is_rejected_and_forgets_on_reset() -> None:
    config = config_of("pose")
    live, _ = live_of(config, recorded())
    assert live.counts["positions", "implausible"] == len(JUMPS) + len(FROZEN)
    pose = live.pose()
    live.reset()
    for source, row in arrivals(recorded()):
        live.on(source, row)
    again = live.pose()
    assert pose is not None
    assert again is not None
    assert again.pose.tolist() == pose.pose.tolist()


def test_check_sweep_and_capsule() -> None:
    config = config_of("soft")
    frozen = [f for f in check(config, recorded()).findings if f.rule == "frozen_fixes"]
    assert frozen
    assert all("tag_conditioner" in f.advice for f in frozen)
    assert replay_capsule(make_capsule(config, recorded())) == []
    trials = run_trials(parse_config({**WORLD, "tag_conditioner": {}}), 2,
                        {"tag_conditioner.cutoff_hz": [0, 0.4]}, workers=1)  # fmt: skip
    raw, smoothed = trials["position_rmse_m"].tolist()
    assert raw != smoothed


def test_fixes_of_an_antenna_pass_as_they_are() -> None:
    log = recorded()
    antenna = {name: values for name, values in log["positions"].items() if name != "tag"}
    of_antenna = replace(log, tables={**log.tables, "positions": antenna})
    conditioned = run(config_of("pose"), of_antenna)
    plain = run(config_of("pose", tag_conditioner=None), of_antenna)
    assert conditioned.estimate.position.tolist() == plain.estimate.position.tolist()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"use": ["odometry"]}, "which use leaves out"),
        ({"estimator": {"kind": "landmark_slam"}}, "which landmark_slam does not fuse"),
        ({"mcl": {}}, "set mcl.switch or mcl.poses_hz"),
        ({"tag_conditioner": {"restart_after": 3}}, "restart_after"),
        ({"tag_conditioner": {"cutoff_hz": -1}}, "cutoff_hz"),
    ],
)
def test_a_conditioner_without_fixes_to_condition_is_refused(
    changes: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigError, match=says):
        parse_config({"tag_conditioner": {}, **changes})
    parse_config({"tag_conditioner": {}, "mcl": {"poses_hz": 5}})


def test_fixes_are_conditioned_for_the_filter_that_may_take_over_from_particles() -> None:
    capsule = read_capsule(GOLDEN / "mcl_switch.zip")
    positions = {name: values.copy() for name, values in capsule.log["positions"].items()}
    count = len(positions["stamp_ns"])
    positions["tag"] = np.full(count, "front")
    at = np.arange(count // 3, count // 3 + 2)
    positions["x_m"][at] += 6.0
    log = replace(capsule.log, tables={**capsule.log.tables, "positions": positions},
                  tags={"front": (0.0, 0.0, 0.0)})  # fmt: skip
    config = capsule.config.model_copy(update={"tag_conditioner": TagConditioner(cutoff_hz=0.0)})
    outcomes = run(config, log).outcomes
    of_fixes = outcomes.source == "positions"
    jumped = np.char.startswith(outcomes.reason[of_fixes], "tag_conditioner: jumped")
    assert jumped[at].all()
    assert np.mean(outcomes.verdict[of_fixes] == "fused") > 0.2
    raw = run(config.model_copy(update={"tag_conditioner": None}), log).outcomes
    assert not np.char.startswith(raw.reason, "tag_conditioner").any()
    assert_same(config, log, least=0.5)


def test_a_rigid_triangle_is_one_body() -> None:
    """The key `shape` alone makes of the 12 states what `kind: pose` fuses, to the bit."""
    log = recorded()
    rigid, body, soft = (run(config_of(name, tag_conditioner=None), log).estimate
                         for name in ("rigid", "pose", "soft"))  # fmt: skip
    assert rigid.position.tolist() == body.position.tolist()
    assert rigid.covariance is not None
    assert np.array_equal(rigid.covariance, body.covariance)  # type: ignore[arg-type]
    assert soft.position[-1].tolist() != rigid.position[-1].tolist()
