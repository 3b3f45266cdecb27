# SPDX-License-Identifier: Apache-2.0
"""Poses of another localizer that are judged by the estimate, and not fused."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.live import LiveRun, LiveWatched
from locfuse.report.results import write_results
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, Columns, ConfigError, Log, Watched
from support_adapter import Robot, later, pose_of, stamps
from support_live import arrivals, live_of, world_of
from support_runs import locfuse

BY_RANGES: Mapping[str, Any] = {
    "simulation": {
        "duration_s": 40.0,
        "odometry": {"output": "velocities"},
        "poses": {"rate_hz": 2.0, "sigma_xy_m": 0.05, "sigma_heading_deg": 1.0},
    },
    "watch_poses": True,
    "seed": 3,
}
BY_SCANS: Mapping[str, Any] = {
    "simulation": {
        **BY_RANGES["simulation"],
        "map": {"generate": "rooms", "seed": 2},
        "path": {"shape": "roam", "speed_mps": 0.5},
        "laser": {"range_max_m": 8.0},
        "anchors": {},
        "ranges": None,
    },
    "mcl": {"max_particles": 1000},
    "watch_poses": True,
    "seed": 3,
}
FAULT_S = (15.0, 25.0)


@cache
def driven(by: str) -> tuple[RunConfig, Log]:
    """Return a run with a given start, and its log."""
    made = parse_config(dict(BY_SCANS if by == "scans" else BY_RANGES))
    log = load_log(made, None, made.seed)
    x, y, heading = (float(log["truth"][key][0]) for key in ("x_m", "y_m", "heading_rad"))
    start = (x, y, float(np.degrees(heading)))
    return made.model_copy(update={"start": start, "simulation": None}), log


def with_fault(log: Log, change: Callable[[Columns, Any], Columns]) -> Log:
    """Change the poses of some seconds."""
    table = log["poses"]
    seconds = (table["stamp_ns"] - log["truth"]["stamp_ns"][0]) / NANOSECONDS
    rows = (seconds >= FAULT_S[0]) & (seconds < FAULT_S[1])
    changed = change({name: values.copy() for name, values in table.items()}, rows)
    return replace(log, tables={**log.tables, "poses": changed})


def moved(table: Columns, rows: Any) -> Columns:
    table["x_m"][rows] += 4.0
    return table


def silent(table: Columns, rows: Any) -> Columns:
    return {name: values[~rows] for name, values in table.items()}


def without_poses(log: Log) -> Log:
    return replace(log, tables={name: t for name, t in log.tables.items() if name != "poses"})


def during(watched: Watched, log: Log, margin_s: float) -> Any:
    seconds = (watched.stamp_ns - log["truth"]["stamp_ns"][0]) / NANOSECONDS
    return (seconds > FAULT_S[0] + margin_s) & (seconds < FAULT_S[1])


@pytest.mark.parametrize("by", ["ranges", "scans"])
def test_a_fault_is_noticed_within_two_seconds_and_does_no_harm(by: str) -> None:
    """Fused with the stated 5 cm, the same poses make the estimate wrong."""
    config, log = driven(by)
    wrong = with_fault(log, moved)
    result = run(config, wrong)
    watched = result.watched
    assert watched is not None
    assert result.health is not None
    assert len(watched) == len(result.health)
    fault = during(watched, log, 2.0)
    assert fault.any()
    assert set(watched.state[fault]) == {"lost"}
    assert set(watched.reason[fault]) == {"poses are too far from the estimate"}
    off = np.hypot(watched.error[fault, 0], watched.error[fault, 1])
    assert np.all(np.abs(off - 4.0) < 0.7)
    assert np.all(watched.within[fault] < 0.01)
    before = watched.stamp_ns < log["truth"]["stamp_ns"][0] + round(FAULT_S[0] * NANOSECONDS)
    known = watched.state != "initializing"
    assert set(watched.state[before & known]) == {"ok"}
    assert watched.state[-1] == "ok"
    alone = run(config, without_poses(log)).estimate
    assert result.estimate.position.tolist() == alone.position.tolist()
    assert alone.covariance is not None
    assert result.estimate.covariance is not None
    assert np.array_equal(result.estimate.covariance, alone.covariance)
    assert result.metrics["watched"]["alarms"] == 1
    assert result.metrics["watched"]["share"]["lost"] == pytest.approx(0.25, abs=0.05)
    poses = result.outcomes.source == "poses"
    assert set(result.outcomes.verdict[poses]) <= {"ignored"}
    assert "judged by the estimate, not fused" in result.outcomes.reason[poses]


def test_poses_that_stop_are_said_to_be_silent_and_not_wrong() -> None:
    config, log = driven("scans")
    watched = run(config, with_fault(log, silent)).watched
    assert watched is not None
    fault = during(watched, log, 5.0)
    assert set(watched.state[fault]) == {"dead_reckoning"}
    assert set(watched.reason[fault]) == {"no pose for 2 s or longer, while the robot moved"}
    assert watched.state[-1] == "ok"


def test_a_heading_that_is_wrong_is_noticed_too() -> None:
    config, log = driven("ranges")

    def turned(table: Columns, rows: Any) -> Columns:
        table["heading_rad"][rows] += 1.0
        return table

    watched = run(config, with_fault(log, turned)).watched
    assert watched is not None
    assert set(watched.state[during(watched, log, 2.0)]) == {"lost"}


@pytest.mark.parametrize("by", ["ranges", "scans"])
def test_live_says_what_the_run_says(by: str) -> None:
    config, log = driven(by)
    late = with_fault(log, moved)
    delay = {**late["poses"], "arrival_ns": late["poses"]["stamp_ns"] + 300_000_000}
    for given in (late, replace(late, tables={**late.tables, "poses": delay})):
        watched = run(config, given).watched
        assert watched is not None
        live = LiveRun(config, replace(given, tables=world_of(given)))
        said: dict[int, list[LiveWatched]] = {}  # at each stamp, message by message
        for source, row in arrivals(given):
            live.on(source, row)
            pose, now = live.fused(), live.watched()
            if pose is not None and now is not None:
                said.setdefault(pose.stamp_ns, []).append(now)
        rows = [row for row, stamp in enumerate(watched.stamp_ns.tolist()) if stamp in said]
        assert len(rows) > 0.4 * len(watched)
        assert sum(any(is_row(one, watched, row) for one in said[int(watched.stamp_ns[row])])
                   for row in rows) == len(rows)  # fmt: skip
        poses = sum(n for (source, _), n in live.counts.items() if source == "poses")
        assert poses == len(given["poses"]["stamp_ns"])


def is_row(now: LiveWatched, watched: Watched, row: int) -> bool:
    """Return whether a live run said, bit for bit, what a row of a run says."""
    return ((now.state, now.reason, now.within, now.wrong)
            == (watched.state[row], watched.reason[row], watched.within[row], watched.wrong[row])
            and np.array_equal(now.error, watched.error[row], equal_nan=True)
            and np.array_equal(now.protection, watched.protection[row]))  # fmt: skip


def test_live_says_why_there_is_nothing_to_say() -> None:
    config, log = driven("ranges")
    live, _ = live_of(config, replace(log, tables={"anchors": log["anchors"]}))
    watched = live.watched()
    assert watched is not None
    assert (watched.state, watched.within) == ("initializing", 0.0)
    assert watched.reason == "there is no estimate to judge poses by yet"
    assert np.isnan(watched.error).all()
    plain, _ = live_of(config.model_copy(update={"watch_poses": False}), log)
    assert plain.watched() is None


def test_with_odometry_alone_jumps_are_noticed() -> None:
    config, log = driven("ranges")
    config = config.model_copy(update={"use": ["odometry", "poses"]})
    watched = run(config, with_fault(log, moved)).watched
    assert watched is not None
    first = during(watched, log, 0.6) & (watched.stamp_ns < watched.stamp_ns[0] + 18 * NANOSECONDS)
    assert set(watched.state[first]) == {"lost"}
    assert (
        watched.reason[-1]
        == "the estimate cannot judge poses: it is lost, too vague, or by odometry alone"
    )


@pytest.mark.parametrize("ros", ["ros1", "ros2"])
@pytest.mark.parametrize("by", ["ranges", "scans"])
def test_nodes_publish_the_state_and_the_safe_choice(by: str, ros: str) -> None:
    config, log = driven(by)
    topics = config.ros.topics.model_copy(update={"fallback": "safe_pose"})
    given = config.ros.model_copy(update={"topics": topics, "odometry_from": "twist"})
    config = config.model_copy(update={"ros": given})
    log = later(with_fault(log, moved))
    robot = Robot(config, log, ros)
    assert (
        "safe_pose",
        "geometry_msgs/PoseWithCovarianceStamped",
        False,
    ) in robot.adapter.announced
    assert "tf" not in {topic for topic, _, _ in robot.adapter.announced}
    robot.learn()
    robot.drive()
    assert not robot.problems
    assert not robot.said("tf")  # the other localizer says where odom is
    said = [next(s for s in one["status"] if s["name"] == "locfuse: watched poses")
            for one in robot.said("diagnostics")[5:]]  # fmt: skip
    levels = {{v["key"]: v["value"] for v in one["values"]}["state"]: one["level"]
              for one in said}  # fmt: skip
    assert set(levels) >= {"ok", "lost"}
    assert levels["ok"] == 0
    assert levels["lost"] == 2
    truth = log["truth"]
    for one in robot.said("safe_pose"):
        stamp = stamps([one])[0]
        x, y, _ = pose_of(one)
        true = [np.interp(stamp, truth["stamp_ns"], truth[key]) for key in ("x_m", "y_m")]
        assert np.hypot(x - true[0], y - true[1]) < 0.8
    at = np.array(stamps(robot.said("safe_pose")))
    assert np.all(np.diff(at) > 0)
    assert np.diff(at).max() < 2 * NANOSECONDS  # during the fault, too


@pytest.mark.parametrize("by", ["ranges", "scans"])
@pytest.mark.parametrize("off_s", [-60.0, 0.4, 3.0, 1000.0])
def test_the_clock_of_poses_counts_for_nothing(by: str, off_s: float) -> None:
    """A latched pose of a minute ago, or the clock of another machine."""
    config, log = driven(by)
    poses = log["poses"]
    stamp = poses["stamp_ns"] + round(off_s * NANOSECONDS)
    wrong = {**poses, "stamp_ns": stamp, "arrival_ns": poses["stamp_ns"]}
    given = replace(log, tables={**log.tables, "poses": wrong})
    alone = run(config, without_poses(log)).estimate
    found = run(config, given).estimate
    assert found.stamp_ns.tolist() == alone.stamp_ns.tolist()
    assert found.position.tolist() == alone.position.tolist()
    live, by_live = live_of(config, given)
    _, expected = live_of(config, without_poses(log))
    assert list(by_live) == list(expected)
    assert all(by_live[at].pose.tolist() == expected[at].pose.tolist() for at in expected)
    assert live.jumps == 0


def test_right_poses_are_not_lost_while_nothing_else_comes() -> None:
    """For a minute odometry alone goes on, and turns too far, as it does not say."""
    made = {**BY_RANGES, "simulation": {**BY_RANGES["simulation"], "duration_s": 100.0}}
    config = parse_config({**made, "start": "truth"})
    log = load_log(config, None, 5)
    since = (log["ranges"]["stamp_ns"] - log["truth"]["stamp_ns"][0]) / NANOSECONDS
    out = (since > 20.0) & (since < 80.0)
    ranges = {name: values[~out] for name, values in log["ranges"].items()}
    odometry = dict(log["odometry"])
    odometry["omega_radps"] = odometry["omega_radps"] + 0.01
    log = replace(log, tables={**log.tables, "ranges": ranges, "odometry": odometry})
    watched = run(config.model_copy(update={"simulation": None}), log).watched
    assert watched is not None
    assert np.mean(watched.state == "lost") < 0.01
    assert np.mean(watched.state == "degraded") > 0.4
    assert watched.state[-1] == "ok"


def test_the_safe_choice_is_one_that_was_judged() -> None:
    config, log = driven("ranges")
    topics = config.ros.topics.model_copy(update={"fallback": "safe_pose"})
    given = config.ros.model_copy(update={"topics": topics, "odometry_from": "twist"})
    config = config.model_copy(update={"ros": given})

    def far(table: Columns, rows: Any) -> Columns:
        table["x_m"][rows] += 1e7
        return table

    robot = Robot(config, later(with_fault(log, far)))
    robot.learn()
    robot.drive()
    assert all(abs(pose_of(one)[0]) < 20.0 for one in robot.said("safe_pose"))
    robot = Robot(config, later(with_fault(log, moved)))
    robot.learn()
    robot.drive(end_s=FAULT_S[0] - 1.0)
    robot.adapter.enable("poses", False)
    before = len(robot.said("safe_pose"))
    robot.drive(begin_s=FAULT_S[0] - 1.0, end_s=FAULT_S[1])
    assert len(robot.said("safe_pose")) <= before + 1
    robot.tick(robot.adapter._now_ns + 10 * NANOSECONDS)  # type: ignore[operator]
    said = {s["name"]: s for s in robot.said("diagnostics")[-1]["status"]}
    assert said["locfuse: watched poses"]["level"] == 1
    assert "nothing has been received for" in said["locfuse: watched poses"]["message"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({**BY_RANGES, "start": "truth"}))
    return tmp_path


def test_a_user_sees_it(folder: Path) -> None:
    out = folder / "out"
    args = ("run", folder / "robot.yaml", "--out", out, "--fail-if-lost")
    said = locfuse(*args)
    assert said.status == 0, said.err
    assert "watched poses: ok" in said.out
    with (out / "watched.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {"stamp_s", "state", "within", "error_x_m", "reason"} <= set(rows[0])
    assert rows[-1]["state"] == "ok"
    assert (out / "watched.png").stat().st_size > 10_000
    assert "watched poses were ok" in (out / "report.html").read_text()
    assert json.loads((out / "metrics.json").read_text())["watched"]["alarms"] == 0
    config = {**BY_RANGES, "start": "truth", "watch_poses": False}
    (folder / "robot.yaml").write_text(yaml.safe_dump(config))
    assert locfuse(*args).status == 0
    assert not (out / "watched.csv").exists()
    assert not (out / "watched.png").exists()


def test_lost_poses_fail_a_run_that_is_to_fail(tmp_path: Path) -> None:
    config, log = driven("ranges")
    result = run(config, with_fault(log, moved))
    write_results(result, tmp_path / "out")
    text = (tmp_path / "out" / "report.html").read_text()
    assert "watched poses lost: poses are too far from the estimate" in text
    assert "watched poses no longer lost" in text


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"use": ["odometry", "ranges"]}, "add 'poses' to use"),
        ({"use": ["poses"]}, "use names poses alone"),
        ({"use": ["odometry", "poses"], "start": "auto"}, "watch_poses leaves poses out"),
        ({"smooth": True}, "watch_poses does not go with smooth"),
        ({"estimator": {"kind": "landmark_slam"}}, "relative to its start"),
        ({"mcl": {"poses_hz": 2.0}}, "does not go with mcl.poses_hz"),
    ],
)
def test_what_cannot_be_watched_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        parse_config({"watch_poses": True, **changes})
