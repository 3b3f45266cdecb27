# SPDX-License-Identifier: Apache-2.0
"""Rows become columns chunk by chunk."""

from __future__ import annotations

import numpy as np

from locfuse.ros.columns import CHUNK, Rows


def test_rows_of_many_chunks_become_one_column_each() -> None:
    rows = Rows(stamp_ns=np.int64, name=np.str_, ranges_m=np.float64)
    n = 2 * CHUNK + 7
    for k in range(n):
        rows.add(k, "a" * (1 + k // CHUNK), np.array([k, np.nan]))
    assert len(rows) == n
    columns = rows.columns()
    assert np.array_equal(columns["stamp_ns"], np.arange(n))
    assert columns["stamp_ns"].dtype == np.int64
    assert (columns["name"][0], columns["name"][-1]) == ("a", "aaa")
    assert columns["ranges_m"].shape == (n, 2)
    assert columns["ranges_m"][-1, 0] == n - 1


def test_no_rows_are_empty_columns_of_the_right_type() -> None:
    columns = Rows(stamp_ns=np.int64, name=np.str_).columns()
    assert columns["stamp_ns"].dtype == np.int64
    assert columns["name"].dtype.kind == "U"
    assert columns["name"].shape == (0,)


def test_the_lag_is_the_median_of_record_minus_stamp() -> None:
    rows = Rows(stamp_ns=np.int64, record_ns=np.int64)
    for k in range(CHUNK + 1):
        rows.add(k, k + (1000 if k == 3 else 5))
    assert rows.lag_ns() == 5.0
