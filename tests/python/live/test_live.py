# SPDX-License-Identifier: Apache-2.0
"""A run on messages as they arrive is the run of their log."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse import _core
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.live import LivePose, LiveRun
from locfuse.run.capsule import read_capsule
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import load_log, run
from locfuse.run.start import start_of
from locfuse.types import ConfigError, Log
from support_live import arrivals, assert_same, live_of, world_of

GOLDEN = Path(__file__).parents[2] / "golden"
ROOM: dict[str, Any] = {
    "simulation": {"path": {"shape": "eight", "radius_m": 2.0}, "duration_s": 30.0},
    "start": "auto",
    "seed": 3,
}


@pytest.mark.parametrize("start", ["auto", [5.0, 5.0, 0.0]])
def test_poses_are_those_of_the_run(start: Any) -> None:
    config = parse_config({**ROOM, "start": start})
    assert_same(config, load_log(config, None, config.seed))


def test_what_is_all_gated_is_reported_as_by_the_run() -> None:
    place = np.array([(5.0, 5.0)] * 50 + [(14.0, 22.0)] * 100)
    log = Log({"positions": {"stamp_ns": np.arange(150) * 10**8, "x_m": place[:, 0],
                             "y_m": place[:, 1], "sigma_m": np.full(150, 0.1)}})  # fmt: skip
    config = parse_config({"start": [5.0, 5.0, 0.0]})
    assert_same(config, log)
    health = run(config, log).health
    assert health is not None
    live, _ = live_of(config, log)
    assert live.health().state == health.state[-1] == "dead_reckoning"
    assert live.health().within == health.within[-1]


def test_late_messages_are_fused_where_they_belong() -> None:
    config = parse_config(ROOM | {"simulation": ROOM["simulation"] | {"faults": [
        {"kind": "latency", "source": "ranges", "delay_s": 0.05, "jitter_s": 0.1},
        {"kind": "latency", "source": "odometry", "delay_s": 0.02},
    ]}})  # fmt: skip
    assert_same(config, load_log(config, None, config.seed), least=0.5)


@pytest.mark.parametrize("name", sorted(path.stem for path in GOLDEN.glob("*.zip")))
def test_poses_are_those_of_the_golden_runs(name: str) -> None:
    capsule = read_capsule(GOLDEN / f"{name}.zip")
    assert_same(capsule.config, capsule.log, least=0.5)


def a_range(stamp_ns: int, **changes: Any) -> dict[str, Any]:
    return {"stamp_ns": stamp_ns, "tag": "tag", "anchor": "A1", "range_m": 5.0, **changes}


def room() -> tuple[RunConfig, Log]:
    config = parse_config(ROOM)
    return config, load_log(config, None, config.seed)


def test_it_searches_anew_on_request() -> None:
    config, log = room()
    live, _ = live_of(config, log)
    assert live.pose() is not None
    assert live.health().state == "ok"
    live.relocalize()
    assert live.pose() is None
    assert live.health().state == "initializing"
    assert live.health().reason


def test_reset_is_as_it_was_made() -> None:
    config, log = room()
    live, poses = live_of(config, log)
    live.reset()
    assert not live.counts
    assert live.pose() is None
    for source, row in arrivals(log):
        live.on(source, row)
    pose = live.fused()
    assert pose is not None
    assert np.array_equal(pose.pose, poses[pose.stamp_ns].pose)


def test_a_recording_that_begins_again_is_followed_where_the_clock_may_jump() -> None:
    config, log = room()
    for policy, follows in (("refuse", False), ("reset", True), ("continue", True)):
        live, poses = live_of(config.model_copy(update={"clock_jump": policy}), log)
        last = max(poses)
        for source, row in arrivals(log):
            if row["stamp_ns"] < last // 2:
                live.on(source, row)
        pose = live.fused()
        assert pose is not None
        assert (pose.stamp_ns < last) == follows, policy
        assert (live.jumps == 1) == follows, policy


def test_a_source_that_is_off_is_ignored_and_a_wrong_name_is_refused() -> None:
    config, log = room()
    live, _ = live_of(config, log)
    stamp = live.received_ns
    assert stamp is not None
    live.enable("ranges", False)
    assert live.on("ranges", a_range(stamp)) == "ignored"
    live.enable("ranges", True)
    assert live.on("ranges", a_range(stamp)) != "ignored"
    assert live.counts["ranges", "ignored"] >= 1
    with pytest.raises(ConfigError, match="did you mean 'ranges'"):
        live.enable("range", False)


def test_what_the_world_does_not_know_is_not_modelled_and_what_is_not_valid_is_refused() -> None:
    config, log = room()
    live, _ = live_of(config, log)
    stamp = live.received_ns
    assert stamp is not None
    assert live.on("ranges", a_range(stamp, anchor="A9")) == "not_modelled"
    assert live.names.anchor_names[-1] == "A9"
    with pytest.raises(ValueError, match="range"):
        live.on("ranges", a_range(stamp, range_m=-1.0))


def test_a_robot_does_not_know_the_truth_and_particles_need_a_map() -> None:
    with pytest.raises(ConfigError, match="'truth', which a robot does not know"):
        LiveRun(parse_config({}), Log({}))
    with pytest.raises(ConfigError, match="needs a map"):
        LiveRun(parse_config({"start": "auto", "mcl": {}}), Log({}))


def test_what_particles_know_is_reported_in_words() -> None:
    capsule = read_capsule(GOLDEN / "mcl_global.zip")
    live = LiveRun(capsule.config, replace(capsule.log, tables={}))
    assert live.health().state == "initializing"
    states = []
    for source, row in arrivals(capsule.log):
        live.on(source, row)
        states.append(live.health().state)
    assert states[-1] == "ok"
    assert {"initializing", "ambiguous"} & set(states)
    assert [source.name for source in live.sources()] == ["scan"]
    health = live.health()
    assert health.within > 0.9
    # Another place is left with some percent: no level holds at a risk of one.
    assert health.wrong > 0.005
    assert np.all(np.isinf(health.protection))


def particles_from_the_truth() -> tuple[RunConfig, Log, LivePose]:
    capsule = read_capsule(GOLDEN / "mcl.zip")
    start = start_of(capsule.config, truth_of(capsule.log),
                     to_messages(capsule.log, capsule.config))  # fmt: skip
    at = np.array([start.pose.x, start.pose.y, start.pose.heading])
    config = capsule.config.model_copy(update={"start": "auto"})
    return config, capsule.log, LivePose(start.stamp, at, start.covariance)


@pytest.mark.parametrize("late_ns", [50_000_000, 150_000_000, 400_000_000])
def test_scans_that_come_when_their_turn_is_over_are_used_where_they_belong(late_ns: int) -> None:
    config, log, start = particles_from_the_truth()
    table = {**log["scans"], "arrival_ns": log["scans"]["stamp_ns"] + late_ns}
    late = replace(log, tables={**log.tables, "scans": table})
    _, poses = live_of(config, late, start)
    _, on_time = live_of(config, log, start)
    shared = sorted(poses.keys() & on_time.keys())
    assert len(shared) >= len(on_time) - 3 > 10  # one shows how late they are, the last may wait
    for stamp in shared:
        assert poses[stamp].pose == pytest.approx(on_time[stamp].pose, abs=0.1)


def test_one_scan_in_five_late_by_half_a_second_ends_with_the_particles_of_those_in_time() -> None:
    config, log, start = particles_from_the_truth()
    stamp = log["scans"]["stamp_ns"]
    late_ns = np.where(np.arange(len(stamp)) % 5 == 1, 500_000_000, 0)
    scans = {**log["scans"], "arrival_ns": stamp + late_ns}
    late = replace(log, tables={**log.tables, "scans": scans})
    ends = []
    for one in (log, late):
        _, poses = live_of(config, one, start)
        at = _core.PoseEstimate(start.stamp_ns, _core.Pose2(*start.pose.tolist()),
                                start.covariance)  # fmt: skip
        of_run = run(config, one, start=at)
        estimate = of_run.estimate
        assert estimate.covariance is not None
        assert not np.any(of_run.outcomes.verdict == "stale")
        ends.append((estimate.position[-1].tolist(), estimate.covariance[-1].tolist()))
        rows = [row for row, stamp in enumerate(estimate.stamp_ns.tolist()) if stamp in poses]
        assert len(rows) >= len(estimate) // 2 > 5  # of two at once one is seen
        for row in rows:
            live = poses[int(estimate.stamp_ns[row])].pose
            assert live[:2].tolist() == estimate.position[row].tolist()
    assert ends[0] == ends[1]


def test_a_scan_that_is_too_late_for_particles_is_stale_and_says_why() -> None:
    config, log, start = particles_from_the_truth()
    stamp = log["scans"]["stamp_ns"]
    late_ns = np.where(np.arange(len(stamp)) == 3, 5 * 10**9, 0)
    scans = {**log["scans"], "arrival_ns": stamp + late_ns}
    at = _core.PoseEstimate(start.stamp_ns, _core.Pose2(*start.pose.tolist()), start.covariance)
    outcomes = run(config, replace(log, tables={**log.tables, "scans": scans}), start=at).outcomes
    stale = outcomes.verdict == "stale"
    assert outcomes.source[stale].tolist() == ["scans"]
    assert outcomes.reason[stale].tolist() == ["older than the history of 2 s"]


def test_particles_with_a_given_start_have_protection_levels() -> None:
    live, _ = live_of(*particles_from_the_truth())
    health = live.health()
    assert health.state == "ok"
    assert np.all(np.isfinite(health.protection))


def test_one_stamp_a_century_ahead_silences_nothing() -> None:
    second = 10**9
    for jump in (_core.ClockJump.REFUSE, _core.ClockJump.RESET, _core.ClockJump.CONTINUE):
        live = _core.Live(
            _core.RecoveringEkf(_core.RecoveringEkfConfig(), _core.World()), clock_jump=jump
        )
        live.start_at(_core.PoseEstimate(0, _core.Pose2(1.0, 2.0, 0.0), 0.01 * np.eye(3)))
        stamps = [k * second // 10 for k in range(1, 30)]
        stamps.insert(5, 4 * 10**18)
        verdicts = [
            live.on(_core.PositionFix(stamp, np.array([1.0, 2.0]), 0.01 * np.eye(2))).verdict
            for stamp in stamps
        ]
        assert verdicts.pop(5) == _core.Verdict.IGNORED
        assert set(verdicts) == {_core.Verdict.FUSED}
        assert live.current().stamp == stamps[-1]


@pytest.mark.parametrize(
    ("source", "changes", "words"),
    [
        ("range", {}, ["no source 'range'", "did you mean 'ranges'"]),
        ("ranges", {"anchor": None}, ["ranges", "'anchor'", "range_m"]),
        ("ranges", {"stamp_ns": None}, ["'stamp_ns'"]),
        ("ranges", {"range_m": [1.0, 2.0]}, ["another type"]),
        ("ranges", {"range_m": "far"}, ["far"]),
        ("ranges", {"range_m": -1.0}, ["range", "-1"]),
    ],
)
def test_a_row_that_cannot_be_used_is_refused_and_forgotten(
    source: str, changes: dict[str, Any], words: list[str]
) -> None:
    config, log = room()
    live = LiveRun(config, replace(log, tables=world_of(log)))
    row = {k: value for k, value in {**a_range(1000), **changes}.items() if value is not None}
    with pytest.raises(ValueError, match=words[0]) as caught:
        live.on(source, row)
    assert all(word in str(caught.value) for word in words)
    assert not live.counts
    later = LiveRun(config, replace(log, tables=world_of(log)))
    later.go_on_from(live)  # is fed what that received
    assert not later.counts
