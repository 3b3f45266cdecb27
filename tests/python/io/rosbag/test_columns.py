# SPDX-License-Identifier: Apache-2.0
"""Blocks of rows become columns."""

from __future__ import annotations

import numpy as np

from locfuse.io.rosbag.columns import Blocks


def test_blocks_become_one_column_each_and_are_gone_then() -> None:
    blocks = Blocks()
    for k in range(3):
        blocks.add({"stamp_ns": np.arange(k * 5, k * 5 + 5), "name": np.array(["a" * (k + 1)] * 5),
                    "ranges_m": np.full((5, 2), float(k))})  # fmt: skip
    assert len(blocks) == 15
    columns = blocks.columns()
    assert np.array_equal(columns["stamp_ns"], np.arange(15))
    assert (columns["name"][0], columns["name"][-1]) == ("a", "aaa")
    assert columns["ranges_m"].shape == (15, 2)
    assert columns["ranges_m"][-1, 0] == 2.0
    assert len(blocks) == 0


def test_the_lag_is_the_median_of_record_minus_stamp() -> None:
    blocks = Blocks()
    for late in (5, 1000, 5):
        blocks.add({"record_ns": np.array([7 + late]), "stamp_ns": np.array([7])})
    assert blocks.lag_ns() == 5.0
