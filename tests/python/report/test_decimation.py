# SPDX-License-Identifier: Apache-2.0
"""Decimation: fewer rows, and still first, last, extremes and proportions."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.report.decimation import evenly_along, keep_cloud, keep_extremes, stride


@pytest.mark.parametrize(("n", "most"), [(0, 5), (1, 5), (5, 5), (1000, 7)])
def test_stride_keeps_the_ends_and_no_more_than_asked(n: int, most: int) -> None:
    rows = stride(n, most)
    assert len(rows) == min(n, most)
    if n:
        assert rows[0] == 0
        assert rows[-1] == (n - 1 if n > 1 else 0)


def test_extremes_of_a_long_line_stay() -> None:
    values = np.sin(np.arange(50_000) / 9_000.0)
    values[[4_321, 40_007]] = [7.0, -9.0]
    rows = keep_extremes(values, 1000)

    assert len(rows) <= 1002
    assert {0, 4_321, 40_007, 49_999} <= set(rows.tolist())


def test_decimating_a_cloud_keeps_each_of_three_anchors_that_take_turns() -> None:
    turns = np.tile([1.0, 2.0, 3.0], 20_000)
    kept = turns[keep_cloud(turns, 4000)]
    assert len(kept) == pytest.approx(4000, abs=50)
    assert np.array([np.mean(kept == v) for v in (1.0, 2.0, 3.0)]) == pytest.approx(1 / 3, abs=0.02)


def test_decimating_a_cloud_keeps_its_highest_points() -> None:
    values = np.ones(60_000)
    highest = np.arange(7, 60_000, 3001)[:20]
    values[highest] = 100.0
    assert set(highest.tolist()) <= set(keep_cloud(values, 500).tolist())


def test_rows_along_a_way_are_even_in_metres() -> None:
    x = np.concatenate([np.zeros(500), np.linspace(0.0, 10.0, 101)])
    rows = evenly_along(np.column_stack([x, np.zeros_like(x)]), 11)
    assert x[rows] == pytest.approx(np.arange(11.0), abs=0.11)


def test_a_robot_that_never_moved_has_one_row() -> None:
    assert evenly_along(np.ones((9, 2)), 30).tolist() == [8]
