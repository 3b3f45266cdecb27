# SPDX-License-Identifier: Apache-2.0
"""Where the map begins, and which fixes are of an antenna beside the body's origin."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag import encode
from locfuse.io.rosbag.decode import MessageError, TransformRow
from locfuse.io.rosbag.fixes import Fixes, is_beside
from locfuse.io.rosbag.frames import FrameTree
from support_bags import T0
from support_ros import message

FORWARD = (0.0, 0.0, 0.0, 1.0)


def fix(second: float, latitude: float, longitude: float = 8.4, status: int = 0) -> Any:
    stamp = T0 + round(second * 1e9)
    fields = {"header": encode.header(stamp, "gps"), "status": {"status": status, "service": 1},
              "latitude": latitude, "longitude": longitude, "altitude": 0.0,
              "position_covariance": np.diag([1.0, 1.0, 4.0]).ravel(),
              "position_covariance_type": 2}  # fmt: skip
    return message(fields)


def test_the_first_of_two_that_agree_is_the_origin() -> None:
    fixes = Fixes(None)
    for at in (0.0, 0.2):  # zeros before the first fix
        with pytest.raises(MessageError, match="latitude and longitude are 0"):
            fixes.rows(fix(at, 0.0, 0.0))
    assert fixes.rows(fix(0.5, 48.0)) == []  # where it was switched off
    assert fixes.rows(fix(1.0, 49.0)) == []
    assert not fixes.sentence
    first, second = fixes.rows(fix(2.0, 49.0 + 10.0 / 111_200.0))
    assert (first.x, first.y) == (0.0, 0.0)
    assert second.y == pytest.approx(10.0, abs=0.02)
    assert fixes.origin == (49.0, 8.4, 0.0)
    assert "49.0" in fixes.sentence
    (third,) = fixes.rows(fix(3.0, 50.0))  # what comes later is for the gate
    assert third.y > 1e5


def test_a_vehicle_may_have_driven_between_two_fixes() -> None:
    for seconds, metres, agree in ((10.0, 900.0, True), (1.0, 900.0, False), (0.1, 12.0, True)):
        fixes = Fixes(None)
        fixes.rows(fix(0.0, 49.0))
        found = fixes.rows(fix(seconds, 49.0 + metres / 111_200.0))
        assert (len(found) == 2) == agree


def test_what_is_no_fix_changes_nothing() -> None:
    fixes = Fixes(None)
    fixes.rows(fix(0.0, 49.0))
    assert fixes.rows(fix(1.0, 0.0, status=-1)) == []
    with pytest.raises(MessageError, match="nan"):
        fixes.rows(fix(1.5, math.nan))
    assert len(fixes.rows(fix(2.0, 49.0))) == 2


def test_a_fix_alone_is_the_origin_in_the_end() -> None:
    fixes = Fixes(None)
    fixes.rows(fix(0.0, 49.0))
    (row,) = fixes.last_row()
    assert (row.x, row.y) == (0.0, 0.0)
    assert fixes.last_row() == []
    assert "49.0" in fixes.sentence


def test_a_given_origin_stays() -> None:
    fixes = Fixes((49.0, 8.4, 0.0))
    (row,) = fixes.rows(fix(0.0, 49.0 + 1.0 / 111_200.0))
    assert row.y == pytest.approx(1.0, abs=0.01)
    assert fixes.last_row() == []
    assert not fixes.sentence


def test_an_antenna_is_beside_where_transforms_place_it_in_the_plane() -> None:
    tree = FrameTree("base_link")
    tree.add([TransformRow("base_link", "mast", 0.0, 0.0, 2.0, FORWARD),
              TransformRow("mast", "front", 0.5, 0.0, 0.0, FORWARD)])  # fmt: skip
    assert is_beside("front", tree)
    assert not is_beside("mast", tree)  # above the origin
    assert not is_beside("elsewhere", tree)
    assert not is_beside("", tree)
