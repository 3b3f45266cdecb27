# SPDX-License-Identifier: Apache-2.0
"""What holds for all estimators, logs and configurations; Hypothesis looks for counterexamples.

The same run always tries the same examples. ``fuzz`` tries what is not plausible in C++.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import locfuse as lf
from locfuse.config.load import load_config, parse_config
from locfuse.io.log_folder import read_log, write_log
from locfuse.types import Log

SETTINGS = settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
MS = 1_000_000
HISTORY = 60_000 * MS

plausible = st.floats(-50.0, 50.0)
anything = st.one_of(plausible, st.floats(allow_nan=False, allow_infinity=False))
sigmas = st.floats(1e-3, 10.0)
stamps = st.integers(0, 3_000).map(lambda ms: ms * MS)


def covariances(size: int) -> st.SearchStrategy[Any]:
    """Return covariances of any shape, by the root of one."""
    numbers = st.lists(st.floats(-3.0, 3.0), min_size=size * size, max_size=size * size)

    def make(values: list[float], sigma: float) -> Any:
        root = np.reshape(values, (size, size))
        return root @ root.T + sigma**2 * np.eye(size)

    return st.builds(make, numbers, sigmas)


def messages(number: st.SearchStrategy[float]) -> st.SearchStrategy[Any]:
    """Return messages of every kind whose numbers come from a strategy."""
    poses = st.builds(lf.Pose2, number, number, number)
    return st.one_of(
        st.builds(lf.Velocity, stamps, number, number),
        st.builds(
            lambda begin, took, motion: lf.Increment(begin, begin + took, motion),
            stamps,
            st.integers(0, 500).map(lambda ms: ms * MS),
            poses,
        ),
        st.builds(
            lf.Range,
            stamps,
            st.integers(0, 1),
            st.integers(0, 3),
            number.map(abs),
            st.none() | sigmas,
        ),
        st.builds(lf.PositionFix, stamps, st.tuples(number, number), covariances(2)),
        st.builds(lf.PoseObservation, stamps, poses, covariances(3)),
        st.builds(lf.RangeBearing, stamps, st.none() | st.integers(0, 2), number.map(abs), number),
    )


def make_ekf() -> lf.PoseEkf:
    """Return a filter that knows three anchors and two landmarks."""
    places = [[0, 0, 2], [8, 0, 2], [4, 6, 2]]
    anchors = lf.AnchorMap([lf.Anchor(i, place) for i, place in enumerate(places)])
    landmarks = lf.LandmarkMap([lf.Landmark(0, [5.0, 5.0]), lf.Landmark(1, [-3.0, 2.0])])
    start = lf.PoseEstimate(0, lf.Pose2(3.0, 2.0, 0.3), np.diag([0.3, 0.3, 0.1]) ** 2)
    sight = lf.LandmarkSensor(landmarks, lf.Pose2(0.1, 0.0, 0.0))
    return lf.PoseEkf(
        lf.PoseEkfConfig(), lf.World(anchors, [lf.Tag(0, [0.2, 0.1, 1.0])], sight), start
    )


def bits(ekf: lf.PoseEkf) -> bytes:
    """Return all that a filter says of the pose now, its own stamp included."""
    now = ekf.estimate(ekf.belief.stamp)
    pose = np.array([now.pose.x, now.pose.y, now.pose.heading])
    belief = ekf.belief
    return (
        b"".join([pose.tobytes(), now.covariance.tobytes(), belief.x.tobytes(), belief.P.tobytes()])
        + repr((now.stamp, belief.stamp)).encode()
    )


def assert_sound(ekf: lf.PoseEkf) -> None:
    """Assert that state and covariance are those of a Gaussian."""
    P = ekf.belief.P
    assert np.isfinite(ekf.belief.x).all()
    assert np.isfinite(P).all()
    np.testing.assert_array_equal(P, P.T)
    np.linalg.cholesky(P)


@SETTINGS
@given(st.lists(messages(plausible), max_size=25))
def test_whatever_is_plausible_leaves_a_gaussian_and_what_is_not_fused_no_trace(
    stream: list[Any],
) -> None:
    ekf = make_ekf()
    for message in stream:
        before = bits(ekf)
        outcome = ekf.on(message)
        assert_sound(ekf)
        assert outcome.verdict == lf.Verdict.FUSED or bits(ekf) == before


@SETTINGS
@given(st.lists(messages(anything), max_size=15))
def test_what_is_refused_leaves_no_trace(stream: list[Any]) -> None:
    ekf = make_ekf()
    for message in stream:
        before = bits(ekf)
        try:
            outcome = ekf.on(message)
        except (ValueError, lf.NumericalError):
            assert bits(ekf) == before
        else:
            assert outcome.verdict == lf.Verdict.FUSED or bits(ekf) == before
        assert np.isfinite(ekf.belief.x).all()
        assert np.isfinite(ekf.belief.P).all()


def log_of(rows: list[tuple[int, int, float, float]], arrival: list[int] | None) -> lf.MessageLog:
    """Return a log of velocities and ranges that arrive in that order, or when they were taken."""
    log = lf.MessageLog()
    for k, (kind, stamp, first, second) in enumerate(rows):
        when = None if arrival is None else [arrival[k]]
        if kind == 0:
            log.add_velocities([stamp], [first], [second], arrival_ns=when)
        elif kind == 1:
            log.add_ranges([stamp], [0], [k % 3], [abs(first)], arrival_ns=when)
        else:
            log.add_positions([stamp], [[first, second]], [0.5], arrival_ns=when)
    log.sort()
    return log


@SETTINGS
@given(
    st.lists(st.tuples(st.integers(0, 2), stamps, plausible, plausible), min_size=1, max_size=40),
    st.randoms(use_true_random=False),
)
def test_late_messages_make_the_bits_of_the_sorted_log(
    rows: list[tuple[int, int, float, float]], random: Any
) -> None:
    # Messages of one instant keep their order of arrival: so let there be one of each stamp.
    rows = list({row[1]: row for row in rows}.values())
    arrival = [k * MS for k in range(len(rows))]
    random.shuffle(arrival)

    sorted_run = lf.replay(make_ekf(), log_of(rows, None), history=HISTORY)
    late_run = lf.replay(make_ekf(), log_of(rows, arrival), history=HISTORY)

    assert late_run.last.covariance.tobytes() == sorted_run.last.covariance.tobytes()
    assert late_run.last.stamp == sorted_run.last.stamp
    assert repr(late_run.last.pose) == repr(sorted_run.last.pose)


names = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1, max_size=9)
good_names = names.filter(lambda name: not (set('#,"') & set(name)))
numbers = st.floats(-100.0, 100.0).map(lambda value: value + 0.0)  # without -0


@st.composite
def logs(draw: st.DrawFn) -> Log:
    """Draw logs of odometry, ranges and truth."""
    count = draw(st.integers(1, 6))
    stamp = np.cumsum(draw(st.lists(st.integers(1, 10**12), min_size=count, max_size=count)))
    column = st.lists(numbers, min_size=count, max_size=count).map(np.array)
    name = st.lists(good_names, min_size=count, max_size=count).map(np.array)
    return Log(
        tables={
            "odometry": {"stamp_ns": stamp, "v_mps": draw(column), "omega_radps": draw(column)},
            "ranges": {
                "stamp_ns": stamp,
                "tag": draw(name),
                "anchor": draw(name),
                "range_m": np.abs(draw(column)),
            },
            "truth": {"stamp_ns": stamp, "x_m": draw(column), "y_m": draw(column)},
        }
    )


@SETTINGS
@given(logs())
def test_a_log_is_read_back_bit_for_bit(log: Log) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_log(log, folder)
        found = read_log(folder)
    for stem, table in log.tables.items():
        for name, values in table.items():
            np.testing.assert_array_equal(found[stem][name], values)


@SETTINGS
@given(
    st.fixed_dictionaries(
        {
            "range": st.fixed_dictionaries({"gate": st.floats(0.5, 1.0)}),
            "hold_s": st.floats(1e-3, 1e3),
            "sigma_lost_xy_per_sqrt_s": st.floats(1e-3, 1e3),
        }
    ),
    st.floats(1.0, 1e3),
)
def test_a_configuration_is_read_back_as_it_was_saved(
    estimator: dict[str, float], duration: float
) -> None:
    config = parse_config({"estimator": estimator, "simulation": {"duration_s": duration}})
    saved = config.model_dump(mode="json", exclude_unset=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "config.yaml")
        path.write_text(yaml.safe_dump(saved))
        assert load_config(path) == config
