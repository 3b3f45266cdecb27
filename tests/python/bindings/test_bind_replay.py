# SPDX-License-Identifier: Apache-2.0
"""Bulk logs and replay from Python: shapes, refused rows, progress, one call against many."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import locfuse.core as lf

STAMPS = np.arange(4, dtype=np.int64) * 100_000_000
ONES = np.ones(4)
IDS = np.zeros(4, dtype=np.int32)


def make_ekf() -> lf.PoseEkf:
    anchors = lf.AnchorMap([lf.Anchor(0, [0, 0, 0]), lf.Anchor(1, [8, 0, 0])])
    start = lf.PoseEstimate(0, lf.Pose2(3.0, 2.0, 0.3), 0.01 * np.eye(3))
    return lf.PoseEkf(lf.PoseEkfConfig(), lf.World(anchors, [lf.Tag(0, [0, 0, 0])]), start)


def drive(rows: int = 400, seed: int = 5) -> tuple[lf.MessageLog, list[Any]]:
    """Return a log and the same messages one by one, in order of arrival."""
    rng = np.random.default_rng(seed)
    log = lf.MessageLog()
    single: list[tuple[int, int, int, Any]] = []
    stamp = np.arange(rows, dtype=np.int64) * 50_000_000
    motion = np.column_stack([np.full(rows, 0.01), np.zeros(rows), np.full(rows, 0.02)])
    begin = np.maximum(stamp - 50_000_000, 0)
    anchor = (np.arange(rows) % 2).astype(np.int32)
    range_m = np.where(anchor == 0, 3.6, 5.4) + 0.05 * rng.standard_normal(rows)
    log.add_increments(begin, stamp, motion)
    log.add_ranges(stamp, np.zeros(rows, np.int32), anchor, range_m, np.full(rows, 0.1))
    log.sort()
    for k in range(rows):
        u = lf.Increment(int(begin[k]), int(stamp[k]), lf.Pose2(*motion[k]))
        single.append((int(begin[k]), 0, k, u))
        z = lf.Range(int(stamp[k]), 0, int(anchor[k]), float(range_m[k]), 0.1)
        single.append((int(stamp[k]), 1, k, z))
    single.sort(key=lambda entry: entry[:3])
    return log, [entry[3] for entry in single]


def test_a_replay_is_the_same_as_its_messages_one_by_one() -> None:
    log, single = drive()
    ekf = make_ekf()

    record = lf.replay(make_ekf(), log)
    outcomes = [ekf.on(message) for message in single]

    assert len(log) == len(single) == len(record.verdict)
    assert record.last.covariance.tobytes() == ekf.estimate().covariance.tobytes()
    assert record.last.pose.x == ekf.estimate().pose.x
    names = [verdict.name for verdict in lf.Verdict]
    assert [names[v] for v in record.verdict] == [o.verdict.name for o in outcomes]
    np.testing.assert_array_equal(record.nis, [o.nis for o in outcomes])
    np.testing.assert_array_equal(record.dof, [o.dof for o in outcomes])
    assert (np.diff(record.stamp_ns) > 0).all()
    assert record.poses.shape == (len(record.stamp_ns), 3)
    assert record.covariances.shape == (len(record.stamp_ns), 3, 3)


def test_a_replay_leaves_its_start_as_it_was() -> None:
    ekf = make_ekf()
    before = ekf.belief.x.tobytes(), ekf.belief.P.tobytes()
    lf.replay(ekf, drive()[0])
    assert (ekf.belief.x.tobytes(), ekf.belief.P.tobytes()) == before


def test_without_record_only_the_last_estimate_is_kept() -> None:
    log = drive()[0]
    full, last = lf.replay(make_ekf(), log), lf.replay(make_ekf(), log, record=False)
    assert len(last.stamp_ns) == len(last.verdict) == 0
    assert last.last.covariance.tobytes() == full.last.covariance.tobytes()


def test_replays_in_threads_give_the_same_bits() -> None:
    log = drive(3000)[0]
    expected = lf.replay(make_ekf(), log).covariances.tobytes()
    found: list[bytes] = []

    def work() -> None:
        found.append(lf.replay(make_ekf(), log).covariances.tobytes())

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 4


def test_progress_is_reported_and_may_raise() -> None:
    log = drive(20_000)[0]
    calls: list[int] = []
    lf.replay(make_ekf(), log, progress=lambda done, _: calls.append(done))
    assert calls == sorted(set(calls))
    assert calls
    assert calls[-1] <= len(log)

    def stop(done: int, so_far: Callable[[], lf.RunLog]) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lf.replay(make_ekf(), log, progress=stop)


def test_the_run_so_far_is_the_beginning_of_the_whole_one() -> None:
    log = drive(20_000)[0]
    shown: list[tuple[int, lf.RunLog]] = []

    whole = lf.replay(make_ekf(), log, progress=lambda done, run: shown.append((done, run())))

    assert len(shown) == 2
    for done, part in shown:
        rows = len(part.stamp_ns)
        assert len(part.verdict) == done
        assert 0 < rows < len(whole.stamp_ns)
        assert part.covariances.tobytes() == whole.covariances[:rows].tobytes()
        assert part.nis.tobytes() == whole.nis[:done].tobytes()
        assert part.verdict.tobytes() == whole.verdict[:done].tobytes()
        assert part.last.stamp >= part.stamp_ns[-1]


def test_the_run_so_far_cannot_be_asked_for_later() -> None:
    kept: list[Callable[[], lf.RunLog]] = []
    lf.replay(make_ekf(), drive(20_000)[0], progress=lambda _, so_far: kept.append(so_far))

    with pytest.raises(RuntimeError, match="after the progress callback had returned"):
        kept[0]()


def test_a_negative_history_is_refused() -> None:
    with pytest.raises(ValueError, match="history is -1 ns"):
        lf.replay(make_ekf(), drive()[0], history=-1)


def column(bad: float) -> np.ndarray:
    values = ONES.copy()
    values[2] = bad
    return values


ADD: dict[str, Callable[[lf.MessageLog, float], None]] = {
    "Velocity.forward": lambda log, v: log.add_velocities(STAMPS, column(v), ONES),
    "Velocity.turn_rate": lambda log, v: log.add_velocities(STAMPS, ONES, column(v)),
    "Increment.motion": lambda log, v: log.add_increments(
        STAMPS, STAMPS + 1, np.column_stack([ONES, column(v), ONES])
    ),
    "Range.range": lambda log, v: log.add_ranges(STAMPS, IDS, IDS, column(v)),
    "Range.sigma": lambda log, v: log.add_ranges(STAMPS, IDS, IDS, ONES, column(v)),
    "PositionFix.position": lambda log, v: log.add_positions(
        STAMPS, np.column_stack([column(v), ONES]), ONES
    ),
    "PositionFix.(covariance|sigma)": lambda log, v: log.add_positions(
        STAMPS, np.column_stack([ONES, ONES]), column(v)
    ),
    "PoseObservation.pose": lambda log, v: log.add_poses(
        STAMPS, np.column_stack([ONES, ONES, column(v)]), ONES, ONES
    ),
    "PoseObservation.(covariance|sigma)": lambda log, v: log.add_poses(
        STAMPS, np.column_stack([ONES, ONES, ONES]), ONES, column(v)
    ),
    "RangeBearing.(covariance|sigma_range)": lambda log, v: log.add_sightings(
        STAMPS, IDS, ONES, ONES, column(v), ONES
    ),
    "RangeBearing.(covariance|sigma_bearing)": lambda log, v: log.add_sightings(
        STAMPS, IDS, ONES, ONES, ONES, column(v)
    ),
    "RangeBearing.sigma_elevation": lambda log, v: log.add_sightings(
        STAMPS, IDS, ONES, ONES, elevation=ONES, sigma_elevation=column(v)
    ),
    "Altitude.height": lambda log, v: log.add_altitudes(STAMPS, column(v)),
    "Altitude.sigma": lambda log, v: log.add_altitudes(STAMPS, ONES, column(v)),
}


NOT_MEASURED = {"PositionFix.(covariance|sigma)", "PoseObservation.(covariance|sigma)"}


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        (field, bad)
        for field in ADD
        for bad in (math.nan, math.inf, -math.inf)
        if field not in NOT_MEASURED or bad != math.inf  # says that this was not measured
    ],
)
def test_a_row_that_is_not_valid_is_named_and_nothing_is_added(field: str, bad: float) -> None:
    log = lf.MessageLog()
    ADD[field](log, 0.5)
    assert len(log) == 4
    with pytest.raises(ValueError, match=rf"row 2: {field}"):
        ADD[field](log, bad)
    assert len(log) == 4


def test_an_elevation_that_is_nan_was_not_measured() -> None:
    log = lf.MessageLog()
    log.add_sightings(STAMPS, IDS, ONES, ONES, elevation=column(math.nan))
    assert len(log) == 4
    with pytest.raises(ValueError, match=r"row 2: RangeBearing.elevation \[rad\] is 1.6"):
        log.add_sightings(STAMPS, IDS, ONES, ONES, elevation=column(1.6))
    with pytest.raises(ValueError, match="elevation"):
        log.add_sightings(STAMPS, IDS, ONES, ONES, elevation=ONES[1:])
    with pytest.raises(ValueError, match="elevation is 1"):  # of a filter in the plane
        lf.replay(make_ekf(), log)


IDS_OF: dict[str, Callable[[Any], Any]] = {
    "ranges.tag": lambda ids: lf.MessageLog().add_ranges(STAMPS, ids, IDS, ONES),
    "ranges.anchor": lambda ids: lf.MessageLog().add_ranges(STAMPS, IDS, ids, ONES),
    "positions.tag": lambda ids: lf.MessageLog().add_positions(
        STAMPS, np.ones((4, 2)), ONES, tag=ids
    ),
    "sightings.landmark": lambda ids: lf.MessageLog().add_sightings(STAMPS, ids, ONES, ONES),
}


@pytest.mark.parametrize("ids_of", IDS_OF)
@pytest.mark.parametrize(
    ("dtype", "huge"),
    [(np.int64, 2**32), (np.int64, -(2**31) - 1), (np.uint32, 2**31), (np.uint64, 2**64 - 1)],
)
def test_an_id_that_would_be_another_one_is_named_by_row(
    ids_of: str, dtype: type[np.integer[Any]], huge: int
) -> None:
    ids = np.array([0, 1, 0, 1], dtype)
    IDS_OF[ids_of](ids)
    ids[2] = huge  # of 32 bits it was 0, or -1, which is no landmark and the antenna
    said = rf"row 2: {ids_of.split('.')[1]} holds {huge}, expected"
    with pytest.raises(ValueError, match=said):
        IDS_OF[ids_of](ids)


@pytest.mark.parametrize("ids_of", IDS_OF)
@pytest.mark.parametrize("ids", [[0, 0.7, 1, 1], np.array([0.0, 1.0, math.nan, 1.0]), ["a"] * 4])
def test_ids_that_are_no_integers_are_refused(ids_of: str, ids: Any) -> None:
    with pytest.raises(TypeError, match=rf"{ids_of.split('.')[1]} holds .*, expected integers"):
        IDS_OF[ids_of](ids)


def test_seconds_are_no_stamps_even_in_a_list() -> None:
    log = lf.MessageLog()
    for stamps in ([0.1, 0.2, 0.3, 0.4], STAMPS / 1e9):
        with pytest.raises(TypeError, match="stamp_ns holds float64, expected integers"):
            log.add_velocities(stamps, ONES, ONES)
        with pytest.raises(TypeError, match="begin_ns holds float64"):
            log.add_increments(stamps, STAMPS, np.zeros((4, 3)))
        with pytest.raises(TypeError, match="arrival_ns holds float64"):
            log.add_velocities(STAMPS, ONES, ONES, stamps)
    assert len(log) == 0
    log.add_velocities([], [], [], [])  # an empty list is none of either


@pytest.mark.parametrize("field", ["Range.range", "Range.sigma"])
def test_a_negative_range_or_sigma_is_named_by_row(field: str) -> None:
    with pytest.raises(ValueError, match=rf"row 2: {field}"):
        ADD[field](lf.MessageLog(), -0.5)


@pytest.mark.parametrize("field", sorted(NOT_MEASURED))
def test_a_sigma_below_zero_is_named_by_row(field: str) -> None:
    with pytest.raises(ValueError, match=rf"row 2: {field}"):
        ADD[field](lf.MessageLog(), -0.5)


def test_a_sigma_of_zero_on_one_axis_alone_is_named_by_row() -> None:
    field = "PoseObservation.(covariance|sigma)"
    with pytest.raises(ValueError, match=rf"row 2: {field}"):
        ADD[field](lf.MessageLog(), 0.0)


def test_sightings_may_lack_a_name_a_range_or_a_bearing_but_not_both() -> None:
    log, ids = lf.MessageLog(), np.array([-1, 0, 1, 2], dtype=np.int32)
    log.add_sightings(STAMPS, ids, column(math.nan), ONES)
    log.add_sightings(STAMPS, ids, ONES, column(math.nan))
    assert len(log) == 8
    with pytest.raises(ValueError, match="row 2: RangeBearing has neither"):
        log.add_sightings(STAMPS, ids, column(math.nan), column(math.nan))
    with pytest.raises(ValueError, match=r"row 2: RangeBearing.range \[m\] is inf"):
        log.add_sightings(STAMPS, ids, column(math.inf), ONES)
    with pytest.raises(ValueError, match="sigma_range and sigma_bearing"):
        log.add_sightings(STAMPS, ids, ONES, ONES, ONES)
    assert len(log) == 8


def test_columns_of_other_lengths_are_refused_with_both_shapes() -> None:
    log = lf.MessageLog()
    with pytest.raises(ValueError, match=r"forward has shape \(3,?\), expected \(4,\)"):
        log.add_velocities(STAMPS, ONES[:3], ONES)
    with pytest.raises(ValueError, match=r"motion has shape \(4, 2\), expected \(4, 3\)"):
        log.add_increments(STAMPS, STAMPS, np.ones((4, 2)))
    with pytest.raises(ValueError, match=r"arrival_ns has shape \(2,?\), expected \(4,\)"):
        log.add_velocities(STAMPS, ONES, ONES, STAMPS[:2])
    with pytest.raises(ValueError, match=r"position has shape \(4,?\)"):
        log.add_positions(STAMPS, ONES, ONES)
    assert len(log) == 0


def test_stamps_that_are_not_integers_are_not_rounded_in_silence() -> None:
    with pytest.raises((TypeError, ValueError)):
        lf.MessageLog().add_velocities(np.array([0.5, 1.5, 2.5, 3.5]), ONES, ONES)


def test_a_log_in_use_refuses_to_change() -> None:
    """Growing a log while a replay read it, GIL released, once crashed the interpreter."""
    rows = 40_000
    stamp = np.arange(rows, dtype=np.int64) * 1_000_000
    log = lf.MessageLog()
    log.add_velocities(stamp, np.full(rows, 0.1), np.zeros(rows))
    refused = []

    def grow(done: int, so_far: Callable[[], lf.RunLog]) -> None:
        with pytest.raises(RuntimeError, match="in use by another call"):
            log.add_velocities(stamp, np.full(rows, 0.1), np.zeros(rows))
        refused.append(done)

    lf.replay(make_ekf(), log, record=False, progress=grow)
    assert refused
    assert len(log) == rows
    log.add_velocities(stamp[:1], np.zeros(1), np.zeros(1))  # free again
    assert len(log) == rows + 1


def test_several_replays_of_one_log_go_on_at_once() -> None:
    log, _ = drive()
    inner = []

    def again(done: int, so_far: Callable[[], lf.RunLog]) -> None:
        inner.append(lf.replay(make_ekf(), log, record=False).last.pose)

    rows = 40_000
    stamp = 30_000_000_000 + np.arange(rows, dtype=np.int64) * 1_000_000
    log.add_velocities(stamp, np.zeros(rows), np.zeros(rows))
    outer = lf.replay(make_ekf(), log, record=False, progress=again)
    assert inner
    assert all(pose == outer.last.pose for pose in inner)


def test_verdict_columns_compare_with_the_enumeration() -> None:
    log, _ = drive()
    record = lf.replay(make_ekf(), log)
    assert np.count_nonzero(record.verdict == lf.Verdict.FUSED) > 400
