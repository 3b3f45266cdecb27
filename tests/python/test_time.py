# SPDX-License-Identifier: Apache-2.0
"""Time as a run sees it: known delays, sources that are switched, clocks that go back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import locfuse.core as lf
from locfuse.config.load import parse_config
from locfuse.io.log_folder import read_log
from locfuse.run.run import run
from locfuse.types import RunResult
from support_runs import GOOD, room, write_folder

START = {"start": [3, 2, 0]}
SECOND = 1_000_000_000


def of(result: RunResult, source: str) -> Any:
    return result.outcomes.source == source


def moved(text: str, by_s: float) -> str:
    """Return a file whose stamps are later."""
    header, *rows = text.splitlines()
    later = [f"{float(row.split(',', 1)[0]) + by_s:.3f},{row.split(',', 1)[1]}" for row in rows]
    return "\n".join([header, *later]) + "\n"


@pytest.mark.parametrize("source", ["ranges", "odometry"])
def test_a_known_delay_makes_the_bits_of_the_log_without_it(tmp_path: Path, source: str) -> None:
    late = {f"{source}.csv": moved(GOOD[f"{source}.csv"], 0.05)}
    good = run(parse_config(START), read_log(write_folder(tmp_path / "a")))
    of = {"ranges": "range"}.get(source, source)
    config = parse_config({**START, "estimator": {of: {"latency_s": 0.05}}})
    bad = run(config, read_log(write_folder(tmp_path / "b", late)))
    unaware = run(parse_config(START), read_log(write_folder(tmp_path / "c", late)))

    def last(result: RunResult) -> tuple[bytes, bytes]:
        covariance = result.estimate.covariance
        assert covariance is not None
        return result.estimate.position[-1].tobytes(), covariance[-1].tobytes()

    assert last(bad) == last(good)
    assert last(unaware) != last(good)


def test_a_source_that_is_switched_off_is_ignored_with_its_reason_until_it_is_on_again() -> None:
    off_s = [{"source": "ranges", "from_s": 2.0, "until_s": 5.0}]
    result = run(room(switched_off=off_s), seed=1)
    off = of(result, "ranges") & (result.outcomes.verdict == "ignored")
    stamp_s = result.outcomes.stamp_ns / SECOND
    expected = of(result, "ranges") & (stamp_s >= 2.0) & (stamp_s < 5.0)
    np.testing.assert_array_equal(off, expected)
    assert np.count_nonzero(off) > 10
    assert set(result.outcomes.reason[off]) == {"source disabled"}
    again = run(room(switched_off=off_s), seed=1)
    assert again.estimate.position.tobytes() == result.estimate.position.tobytes()


def looped(rounds: int) -> lf.MessageLog:
    """Return a recording that is played again and again."""
    log = lf.MessageLog()
    stamp = np.arange(0, 5 * SECOND, SECOND // 10)
    forward = np.full(len(stamp), 0.2)
    turn = np.zeros(len(stamp))
    position = np.column_stack([3.0 + 0.2 * stamp / SECOND, np.full(len(stamp), 2.0)])
    for k in range(rounds):
        arrival = stamp + k * 10 * SECOND
        log.add_velocities(stamp, forward, turn, arrival)
        log.add_positions(stamp, position, np.full(len(stamp), 0.1), arrival)
    log.sort()
    return log


def replay(rounds: int, clock_jump: lf.ClockJump) -> Any:
    start = lf.PoseEstimate(0, lf.Pose2(3, 2, 0), np.diag([0.1, 0.1, 0.1]) ** 2)
    ekf = lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)
    return lf.replay(ekf, looped(rounds), clock_jump=clock_jump)


def test_a_looped_recording_is_refused_or_started_anew_or_goes_on() -> None:
    once = replay(1, lf.ClockJump.REFUSE)
    refused = replay(3, lf.ClockJump.REFUSE)
    anew = replay(3, lf.ClockJump.RESET)
    on = replay(3, lf.ClockJump.CONTINUE)

    stale = [v == lf.Verdict.STALE for v in refused.verdict]
    assert refused.jumps == 0
    assert sum(stale) > 100
    assert (anew.jumps, on.jumps) == (2, 2)
    known = len(anew.poses)  # since the jump was noticed
    assert known > 35
    assert anew.poses.tobytes() == once.poses[-known:].tobytes()
    assert anew.covariances.tobytes() == once.covariances[-known:].tobytes()
    assert lf.Verdict.STALE not in anew.verdict.tolist()
    assert np.all(np.diff(on.stamp_ns) > 0)
    assert on.poses[0, 0] > 3.5, "it goes on from where it was"


def test_a_history_that_overflows_is_counted() -> None:
    result = run(room(history_s=1000.0, history_messages=512), seed=1)
    assert result.metrics["dropped_messages"] > 0
    plain = run(room(), seed=1)
    assert plain.metrics["dropped_messages"] == 0
    assert plain.metrics["interventions"] == 0
    assert result.estimate.position.tobytes() == plain.estimate.position.tobytes()
