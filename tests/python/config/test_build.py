# SPDX-License-Identifier: Apache-2.0
"""Anchors: places from the log, errors of their ranges from the configuration."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.config.build import build_anchors
from locfuse.config.schema import RangeError
from locfuse.types import ConfigError

TABLE = {
    "anchor": np.array(["b", "a"]),
    "x_m": np.array([1.0, 4.0]),
    "y_m": np.array([2.0, 5.0]),
    "z_m": np.array([3.0, 6.0]),
}


def test_an_anchor_gets_the_id_of_its_name_and_the_place_of_its_row() -> None:
    anchors = build_anchors(TABLE, ["a", "b"], {}).anchors

    assert [anchor.id for anchor in anchors] == [0, 1]
    np.testing.assert_array_equal(anchors[0].position, [4.0, 5.0, 6.0])
    np.testing.assert_array_equal(anchors[1].position, [1.0, 2.0, 3.0])
    assert [(anchor.offset, anchor.scale) for anchor in anchors] == [(0.0, 1.0)] * 2


def test_all_holds_for_those_that_are_not_named() -> None:
    errors = {"all": RangeError(offset_m=0.1), "a": RangeError(scale=1.5)}

    a, b = build_anchors(TABLE, ["a", "b"], errors).anchors

    assert (a.offset, a.scale) == (0.0, 1.5)
    assert (b.offset, b.scale) == (0.1, 1.0)


def test_an_error_of_an_anchor_that_is_not_there_is_refused_with_the_nearest_name() -> None:
    table = {**TABLE, "anchor": np.array(["north", "south"])}
    with pytest.raises(ConfigError, match=r"no anchor 'nroth'.*'north'"):
        build_anchors(table, ["north", "south"], {"nroth": RangeError()})


def test_without_a_table_there_are_no_anchors() -> None:
    assert len(build_anchors(None, [], {})) == 0
