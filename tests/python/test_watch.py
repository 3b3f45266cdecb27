# SPDX-License-Identifier: Apache-2.0
"""A run that is watched while it computes: what is shown is the beginning of what comes out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.report.player import pack
from locfuse.run.mcl import Stopwatch
from locfuse.run.run import load_log, run
from locfuse.types import Log, Outcomes, RunResult, Trajectory

DRIVE = {"duration_s": 600.0}
ROOM: dict[str, Any] = {"duration_s": 12.0, "laser": {"beams": 90}, "map": {}, "poses": None}
MCL = {"min_particles": 300, "max_particles": 600, "beams": 30}
KINDS: dict[str, dict[str, Any]] = {
    "ekf": {"simulation": DRIVE},
    "ekf from nothing": {"simulation": DRIVE, "start": "auto"},
    "mcl": {"simulation": ROOM, "mcl": MCL},
    "mcl that UWB takes over": {"simulation": ROOM, "mcl": {**MCL, "switch": {}}},
    "mcl from nothing": {"simulation": ROOM, "mcl": {**MCL, "max_particles": 3000},
                         "start": "auto", "use": ["odometry", "ranges"]},
}  # fmt: skip


def watched(data: dict[str, Any], log: Log | None = None) -> tuple[RunResult, list[RunResult]]:
    """Return a run, and what was seen of it: after each tenth word at most."""
    seen: list[RunResult] = []
    calls = 0

    def watch(so_far: Callable[[], RunResult]) -> None:
        nonlocal calls
        if "mcl" not in data or calls % 10 == 0:
            seen.append(so_far())
        calls += 1

    return run(parse_config(data), log, watch=watch), seen


def assert_same(a: Trajectory, b: Trajectory) -> None:
    for name in ("stamp_ns", "position", "heading", "covariance"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


def assert_begins(part: RunResult, whole: RunResult) -> None:
    """Check that estimates and outcomes of a part are the first ones of a run, bit for bit."""
    count = len(part.estimate)
    for name in ("stamp_ns", "position", "heading", "covariance"):
        begin = getattr(whole.estimate, name)[:count]
        assert getattr(part.estimate, name).tobytes() == begin.tobytes(), name
    for field in fields(Outcomes):
        begin = getattr(whole.outcomes, field.name)[: len(part.outcomes)]
        np.testing.assert_array_equal(getattr(part.outcomes, field.name), begin)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_seen_of_a_run_is_its_beginning_and_watching_changes_no_bit(kind: str) -> None:
    whole, seen = watched(KINDS[kind])
    alone = run(parse_config(KINDS[kind]))

    assert_same(whole.estimate, alone.estimate)
    assert_begins(whole, alone)
    assert len(seen) >= 2
    lengths = [len(part.outcomes) for part in seen]
    assert lengths == sorted(set(lengths))
    assert 0 < lengths[0] < lengths[-1] <= len(whole.outcomes)
    for part in seen:
        assert_begins(part, whole)
        end = int(part.outcomes.stamp_ns.max())
        for name in ("truth", "scans"):
            if name in part.log:
                assert part.log[name]["stamp_ns"].max() <= end
        counted = sum(sum(counts.values()) for counts in part.metrics["counts"].values())
        assert counted == part.metrics["messages"] == len(part.outcomes)
        assert pack(part, whole=False)["whole"] is False


def test_the_last_thing_seen_of_mcl_lacks_no_frame_and_its_error_is_that_of_the_run() -> None:
    data = KINDS["mcl"]
    seen: list[RunResult] = []
    whole = run(parse_config(data), watch=lambda so_far: seen.append(so_far()))

    assert len(seen) == len(whole.log["scans"]["stamp_ns"])
    assert len(seen[-1].frames) == len(whole.frames) == len(seen)
    for key in ("position_rmse_m", "nees_mean"):
        assert seen[-1].metrics[key] == pytest.approx(whole.metrics[key], rel=0.05), key


def test_what_arrives_late_is_missing_until_it_is_there() -> None:
    config = parse_config({"simulation": DRIVE})
    log = load_log(config, None, 1)
    late = log["ranges"]["stamp_ns"] + 500_000_000
    ranges = {**log["ranges"], "arrival_ns": late}
    log = replace(log, tables={**log.tables, "ranges": ranges})

    whole, seen = watched({"simulation": DRIVE}, log)

    assert seen
    for part in seen:
        count = len(part.estimate)
        assert part.estimate.position.tobytes() == whole.estimate.position[:count].tobytes()
        np.testing.assert_array_equal(
            part.outcomes.stamp_ns, whole.outcomes.stamp_ns[: len(part.outcomes)]
        )
        assert not np.any(part.outcomes.verdict == "ignored")
        received = part.outcomes.stamp_ns[part.outcomes.source == "ranges"]
        assert sorted(part.log["ranges"]["stamp_ns"].tolist()) == sorted(received.tolist())
        assert received.max() < part.outcomes.stamp_ns.max() - 400_000_000


def test_of_poses_from_mcl_the_mcl_is_seen() -> None:
    data = {**KINDS["mcl"], "mcl": {**MCL, "poses_hz": 2.0}}
    alone, _ = watched(KINDS["mcl"])

    whole, seen = watched(data)

    assert whole.health is not None
    assert all(part.health is not None for part in seen)
    assert len(seen[-1].frames) > 5
    assert seen[-1].metrics["mcl"] is not None
    assert len(alone.frames) == len(whole.frames)


def test_time_of_who_watches_is_not_that_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter([10.0, 11.0, 15.0, 17.0])
    monkeypatch.setattr(time, "perf_counter", lambda: next(ticks))

    clock = Stopwatch()
    with clock.stopped():
        pass

    assert clock.seconds == 3.0


def test_what_is_raised_by_who_watches_ends_the_run() -> None:
    def stop(so_far: Callable[[], RunResult]) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(parse_config(KINDS["ekf"]), watch=stop)
