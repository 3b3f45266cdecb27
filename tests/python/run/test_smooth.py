# SPDX-License-Identifier: Apache-2.0
"""A log that is smoothed: what comes out, and what it does not go with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

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
