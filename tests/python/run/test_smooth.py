# SPDX-License-Identifier: Apache-2.0
"""A log that is smoothed: what comes out, and what it does not go with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import locfuse.core as lf
from locfuse.config.load import load_config, parse_config
from locfuse.eval.errors import errors_against
from locfuse.live.run import LiveRun
from locfuse.run.run import load_log, run
from locfuse.types import ConfigError, LogError, RunResult
from support_runs import ROOT, recording

ROOM: dict[str, Any] = {
    "simulation": {"path": {"shape": "circle", "radius_m": 3.0}, "duration_s": 30.0,
                   "poses": None},
    "estimator": {"range": {"sigma_m": 0.1}, "correlation_s": 0.0,
                  "odometry": {"sigma_longitudinal_per_sqrt_m": 0.03,
                               "sigma_lateral_per_sqrt_m": 0.01,
                               "sigma_heading_per_sqrt_m": 0.02,
                               "sigma_heading_per_sqrt_rad": 0.03}},
}  # fmt: skip


def both(config: dict[str, Any], seed: int) -> tuple[RunResult, RunResult]:
    """Return the run of the filter, and the smoothed one."""
    filtered = parse_config({**config, "seed": seed})
    smoothed = parse_config({**config, "seed": seed, "smooth": True})
    log = load_log(filtered, None, seed)
    return run(filtered, log), run(smoothed, log)


def test_all_messages_give_better_poses_than_those_before() -> None:
    ratios, nees = [], []
    for seed in range(20):
        filtered, smoothed = both(ROOM, seed)
        ratios.append(smoothed.metrics["position_rmse_m"] / filtered.metrics["position_rmse_m"])
        nees.append(smoothed.metrics["nees_mean"])
        assert smoothed.health is not None
        assert set(smoothed.outcomes.verdict.tolist()) <= {"fused", "gated"}
    assert np.mean(ratios) < 0.85
    assert 2.4 < np.mean(nees) < 3.6


def test_outcomes_are_of_the_messages_of_the_log() -> None:
    filtered, smoothed = both(ROOM, 3)
    assert smoothed.outcomes.stamp_ns.tolist() == filtered.outcomes.stamp_ns.tolist()
    assert smoothed.outcomes.source.tolist() == filtered.outcomes.source.tolist()


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"estimator": {"kind": "air"}}, "estimator.kind"),
        ({"switched_off": [{"source": "ranges", "from_s": 1.0}]}, "switched_off"),
        ({"tag_conditioner": {}}, "tag_conditioner"),
    ],
)
def test_what_it_does_not_go_with_is_named(more: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=f"smooth does not go with {named}"):
        parse_config({**ROOM, "smooth": True, **more})


def test_a_live_run_has_no_end() -> None:
    config = parse_config({**ROOM, "smooth": True, "start": [0.0, 0.0, 0.0]})
    with pytest.raises(ConfigError, match="smooth needs the whole log"):
        LiveRun(config, load_log(config, None, 1))


def test_a_clock_that_goes_back_is_named() -> None:
    drive = {**ROOM["simulation"], "odometry": {"output": "velocities"}}
    config = parse_config({"simulation": drive, "smooth": True, "clock_jump": "continue"})
    log = load_log(config, None, 1)
    tables = dict(log.tables)
    for name in ("odometry", "ranges"):
        stamp = tables[name]["stamp_ns"]
        back = np.where(stamp > 15 * 10**9, 14 * 10**9, 0)
        tables[name] = {**tables[name], "stamp_ns": stamp - back, "arrival_ns": stamp}
    log = replace(log, tables=tables)
    with pytest.raises(LogError, match="one clock"):
        run(config, log)


def test_plaza_as_a_batch_solver() -> None:
    """A batch of the same graph by gtsam leaves 0.189 m at the stamps of ranges."""
    recording("plaza")
    config = load_config(ROOT / "examples/configs/plaza.yaml")
    log = load_log(config, ROOT / "examples/configs", 0)
    result = run(config.model_copy(update={"smooth": True}), log)
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    at_ranges = np.isin(errors.stamp_ns, log["ranges"]["stamp_ns"])
    off = np.hypot(*errors.position[at_ranges].T)
    assert len(off) > 3000
    assert np.sqrt(np.mean(off**2)) < 0.20
    assert 2.0 < result.metrics["nees_mean"] < 4.0


def test_the_optimum_and_its_covariance_are_those_of_gtsam() -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed (extra bench)")
    rows, step = 300, 200_000_000
    rng = np.random.default_rng(2)
    places = np.array([[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]])
    config = lf.PoseEkfConfig()
    config.correlation_s, config.range.gate = 0.0, 1.0
    # The same in all directions: gtsam has its noise in other axes.
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.05
    config.odometry.sigma_lateral_per_sqrt_m = 0.05
    motion = np.column_stack([np.full(rows, 0.1), np.zeros(rows),
                              0.05 * np.sin(0.05 * np.arange(rows))])  # fmt: skip
    stamp, anchor = step * np.arange(1, rows + 1), (np.arange(rows) % 4).astype(np.int32)
    truth = [lf.Pose2(0, 0, 0)]
    for row in motion:
        truth.append(truth[-1] * lf.Pose2(*(row + 0.015 * rng.standard_normal(3))))
    at = np.array([[pose.x, pose.y] for pose in truth[1:]])
    ranges = np.hypot(*(at - places[anchor]).T) + 0.3 * rng.standard_normal(rows)
    log = lf.MessageLog()
    log.add_increments(stamp - step, stamp, motion)
    log.add_ranges(stamp, np.zeros(rows, np.int32), anchor, ranges, np.full(rows, 0.3))
    log.sort()
    start = lf.PoseEstimate(0, lf.Pose2(0, 0, 0), np.diag([0.1, 0.1, 0.05]) ** 2)
    anchors = lf.AnchorMap([lf.Anchor(i, [*place, 0.0]) for i, place in enumerate(places)])
    ours = lf.smooth(config, lf.World(anchors, [lf.Tag(0, [0, 0, 0])]), start, log, keyframe_s=1e6)

    pose, place = gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.L
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    graph, guess = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose2(pose(0), gtsam.Pose2(0, 0, 0), sigmas([0.1, 0.1, 0.05])))
    guess.insert(pose(0), gtsam.Pose2(0, 0, 0))
    for i, known in enumerate(places):
        guess.insert(place(i), known)
        graph.add(gtsam.PriorFactorPoint2(place(i), known, gtsam.noiseModel.Constrained.All(2)))
    driven, model = lf.Pose2(0, 0, 0), lf.OdometryMotion(config.odometry)
    for k, row in enumerate(motion):
        noise = np.diag(model.propagate(lf.Pose2(), lf.Pose2(*row), 0.2).noise) + 1e-10
        graph.add(gtsam.BetweenFactorPose2(pose(k), pose(k + 1), gtsam.Pose2(*row),
                                           sigmas(np.sqrt(noise))))  # fmt: skip
        graph.add(gtsam.RangeFactor2D(pose(k + 1), place(int(anchor[k])), float(ranges[k]),
                                      sigmas([0.3])))  # fmt: skip
        driven = driven * lf.Pose2(*row)
        guess.insert(pose(k + 1), gtsam.Pose2(driven.x, driven.y, driven.heading))
    tight = gtsam.LevenbergMarquardtParams()
    tight.setRelativeErrorTol(1e-14)
    tight.setAbsoluteErrorTol(1e-14)
    theirs = gtsam.LevenbergMarquardtOptimizer(graph, guess, tight).optimize()
    assert ours.cost == pytest.approx(graph.error(theirs), rel=1e-6)
    marginals = gtsam.Marginals(graph, theirs)
    for k in (rows // 2, rows):  # far from the start, whose residual gtsam has in other axes
        found, turn = theirs.atPose2(pose(k)), np.eye(3)
        assert ours.poses[k] == pytest.approx([found.x(), found.y(), found.theta()], abs=1e-5)
        turn[:2, :2] = found.rotation().matrix()
        covariance = turn @ marginals.marginalCovariance(pose(k)) @ turn.T
        assert ours.covariances[k] == pytest.approx(covariance, rel=1e-3, abs=1e-6)
