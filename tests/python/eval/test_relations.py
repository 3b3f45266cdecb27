# SPDX-License-Identifier: Apache-2.0
"""Errors of relative poses: by hand, in any frame, and the figures published with a recording."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from locfuse.eval.relations import relation_errors, relation_metrics, relations_along
from locfuse.io.csv_table import read_table
from locfuse.types import NANOSECONDS, Columns, FloatArray, Trajectory, wrap_angle
from support_runs import recording


def track(stamp_s: list[float], poses: list[list[float]]) -> Trajectory:
    values = np.array(poses, np.float64)
    stamp_ns = np.rint(np.array(stamp_s) * NANOSECONDS).astype(np.int64)
    return Trajectory(stamp_ns, values[:, :2], wrap_angle(values[:, 2]))


def relations(*rows: tuple[float, float, float, float, float]) -> dict[str, Any]:
    """Return relations of (begin_s, end_s, dx_m, dy_m, dheading_rad)."""
    begin, end, dx, dy, turn = np.array(rows, np.float64).T
    return {
        "begin_ns": np.rint(begin * NANOSECONDS).astype(np.int64),
        "end_ns": np.rint(end * NANOSECONDS).astype(np.int64),
        "dx_m": dx,
        "dy_m": dy,
        "dheading_rad": turn,
    }


# A quarter to the left at (2, 0), then 1 m to the north.
CORNER = track(
    [0.0, 2.0, 4.0, 5.0], [[0, 0, 0], [2, 0, 0], [2, 0, math.pi / 2], [2, 1, math.pi / 2]]
)


def test_errors_known_by_head() -> None:
    found = relation_errors(CORNER, relations(
        (0.0, 5.0, 2.0, 1.0, math.pi / 2),  # as driven
        (5.0, 0.0, -1.0, 2.0, -math.pi / 2),  # the same backwards
        (4.0, 5.0, 1.3, 0.4, -0.25),
        (1.0, 3.0, 1.0, 0.0, math.pi / 4),  # between rows: half of 2 m, half of the turn
    ))  # fmt: skip

    np.testing.assert_array_equal(found.row, [0, 1, 2, 3])
    np.testing.assert_array_equal(found.seconds, [5.0, 5.0, 1.0, 2.0])
    np.testing.assert_allclose(found.translation, [0.0, 0.0, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.rotation, [0.0, 0.0, 0.25, 0.0], atol=1e-12)


def test_a_rotation_error_is_taken_the_short_way_across_the_cut() -> None:
    turning = track([0.0, 1.0], [[0, 0, 0], [0, 0, 3.1]])

    found = relation_errors(turning, relations((0.0, 1.0, 0.0, 0.0, -3.1)))

    assert found.rotation[0] == pytest.approx(2.0 * math.pi - 6.2)


def test_the_frame_of_the_trajectory_does_not_matter() -> None:
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.normal(0.0, 5.0, (50, 2)), rng.uniform(-3.0, 3.0, 50)])
    stamps = np.arange(50.0)
    ends = rng.uniform(0.0, 49.0, (40, 2))
    asked = relations(*np.column_stack([ends, rng.normal(0.0, 1.0, (40, 3))]))
    c, s = math.cos(2.0), math.sin(2.0)
    moved = poses @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [7.0, -3.0, 2.0]

    before = relation_errors(track(stamps.tolist(), poses.tolist()), asked)
    after = relation_errors(track(stamps.tolist(), moved.tolist()), asked)

    np.testing.assert_allclose(after.translation, before.translation, atol=1e-9)
    np.testing.assert_allclose(after.rotation, before.rotation, atol=1e-9)


def test_relations_that_leave_the_trajectory_or_lie_in_a_gap_are_not_compared() -> None:
    gap = track([0.0, 1.0, 4.0, 5.0], [[0, 0, 0], [1, 0, 0], [4, 0, 0], [5, 0, 0]])
    asked = relations((0, 5, 5, 0, 0), (0, 2, 2, 0, 0), (-1, 1, 2, 0, 0), (1, 4, 3, 0, 0))

    np.testing.assert_array_equal(relation_errors(gap, asked).row, [0, 3])
    np.testing.assert_array_equal(relation_errors(gap, asked, longest_gap_s=3.0).row, [0, 1, 3])


def test_metrics_keep_short_relations_and_loops_apart() -> None:
    still = track([0.0, 2.0, 4.0, 61.0], [[0, 0, 0]] * 4)
    asked = relations(
        (0, 2, 0.1, 0, 0.0), (2, 4, 0.2, 0, 0.1), (0, 4, 0.6, 0, 0.2),  # short
        (0, 61, 3.0, 4.0, 1.0),  # loop
        (2, 61, 1.0, 0.0, 0.0),  # neither
    )  # fmt: skip

    found = relation_metrics(relation_errors(still, asked, longest_gap_s=60.0))

    assert {name: part["count"] for name, part in found.items()} == {
        "all": 5, "short": 3, "loop": 1
    }  # fmt: skip
    assert found["short"]["translation_mean_m"] == pytest.approx(0.3)
    assert found["short"]["translation_std_m"] == pytest.approx(math.sqrt(0.14 / 3.0))
    assert found["short"]["translation_median_m"] == pytest.approx(0.2)
    assert found["short"]["rotation_mean_deg"] == pytest.approx(math.degrees(0.1))
    assert found["loop"]["translation_mean_m"] == pytest.approx(5.0)
    assert found["loop"]["rotation_median_deg"] == pytest.approx(math.degrees(1.0))
    assert found["all"]["translation_median_m"] == pytest.approx(0.6)


def test_metrics_of_no_relation_are_unknown() -> None:
    found = relation_metrics(relation_errors(CORNER, relations((0.0, 1.0, 1.0, 0.0, 0.0))))["loop"]

    assert found.pop("count") == 0
    assert set(found.values()) == {None}


def test_what_cannot_be_compared_is_refused() -> None:
    asked = relations((0.0, 1.0, 1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="no headings"):
        relation_errors(Trajectory(CORNER.stamp_ns, CORNER.position), asked)
    with pytest.raises(ValueError, match="none of 1 relations lies on the estimate"):
        relation_errors(CORNER, relations((10.0, 11.0, 1.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="no column 'end_ns'"):
        relation_errors(CORNER, {k: v for k, v in asked.items() if k != "end_ns"})
    with pytest.raises(ValueError, match=r"'dy_m' .* shape \(2,\), expected \(1,\)"):
        relation_errors(CORNER, {**asked, "dy_m": np.zeros(2)})
    with pytest.raises(ValueError, match="'dx_m' of the relations, row 0: nan"):
        relation_errors(CORNER, {**asked, "dx_m": np.array([np.nan])})
    with pytest.raises(ValueError, match="is empty"):
        relation_errors(Trajectory(np.empty(0, np.int64), np.empty((0, 2)), np.empty(0)), asked)


# Figures published with the Intel Research Lab ----------------------------------------------------


def published(name: str) -> FloatArray:
    """Return a file of the recording as columns."""
    table = read_table(recording("intel-lab") / f"{name}.csv.gz")
    return np.array(table.columns("f" * len(table.header)))


@pytest.fixture(scope="module")
def asked() -> Columns:
    """Return the relations at the times as recorded."""
    return relations(*published("relations").T)


def as_recorded(name: str) -> Trajectory:
    """Return a trajectory sorted by the times as recorded, the first row of those that repeat."""
    _, t_s, x, y, theta = published(name)
    stamp_ns, first = np.unique(np.rint(t_s * NANOSECONDS).astype(np.int64), return_index=True)
    return Trajectory(stamp_ns, np.column_stack([x, y])[first], wrap_angle(theta[first]))


@pytest.mark.parametrize(
    ("name", "part", "mean_m", "std_m", "median_m", "mean_deg", "std_deg"),
    [
        ("odometry", "all", 7.39, 14.34, None, 39, None),
        ("odometry", "short", 0.051, 0.065, 0.032, 2.02, None),
        ("trajectory_gmapping", "all", 0.063, 0.063, None, 2.31, 2.79),
        ("trajectory_gmapping", "short", 0.057, 0.065, None, 2.26, None),
        ("trajectory_refined", "all", 0.052, 0.060, None, 1.29, 2.76),
        ("trajectory_refined", "short", 0.049, 0.062, 0.028, 1.36, None),
    ],
)
def test_the_published_figures_come_out_to_the_last_digit(
    name: str, part: str, mean_m: float, std_m: float, median_m: float | None, mean_deg: float,
    std_deg: float | None, asked: Columns,
) -> None:  # fmt: skip
    found = relation_metrics(relation_errors(as_recorded(name), asked, longest_gap_s=3.0))

    assert {key: values["count"] for key, values in found.items()} == {
        "all": 2984, "short": 1732, "loop": 1210
    }  # fmt: skip
    digits = 2 if mean_m > 1.0 else 3
    ours = found[part]
    assert round(ours["translation_mean_m"], digits) == mean_m
    assert round(ours["translation_std_m"], digits) == std_m
    assert median_m is None or round(ours["translation_median_m"], 3) == median_m
    assert round(ours["rotation_mean_deg"], 0 if mean_deg == 39 else 2) == mean_deg
    assert std_deg is None or round(ours["rotation_std_deg"], 2) == std_deg


# Relations along a trajectory ------------------------------------------------------------------


def test_a_trajectory_agrees_with_its_own_relations() -> None:
    close = track([0.0, 1.0, 2.0, 3.0], [[0, 0, 3.1], [1, 0, -3.1], [2, 1, -2.0], [2, 2, 0.3]])
    found = relations_along(close, 0.5)
    assert len(found["begin_ns"]) == 6
    assert np.all(np.abs(found["dheading_rad"]) <= math.pi)  # across the cut, too
    errors = relation_errors(close, found)
    assert errors.translation == pytest.approx(0.0, abs=1e-12)
    assert errors.rotation == pytest.approx(0.0, abs=1e-12)


def test_there_is_no_relation_across_a_gap() -> None:
    gap = track([0.0, 1.0, 6.0, 7.0], [[0, 0, 0], [1, 0, 0], [6, 0, 0], [7, 0, 0]])
    found = relations_along(gap, 1.0)
    assert (found["begin_ns"] / NANOSECONDS).tolist() == [0.0, 6.0]


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan])
def test_relations_along_need_a_time(seconds: float) -> None:
    with pytest.raises(ValueError, match="expected > 0"):
        relations_along(CORNER, seconds)


def test_relations_along_need_headings() -> None:
    bare = Trajectory(CORNER.stamp_ns, CORNER.position)
    with pytest.raises(ValueError, match="no headings"):
        relations_along(bare, 1.0)
