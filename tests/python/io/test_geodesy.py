# SPDX-License-Identifier: Apache-2.0
"""Degrees become metres: along meridian and parallel, whose lengths are known."""

from __future__ import annotations

import math

import pytest

from locfuse.io.geodesy import SEMI_MAJOR_M, to_plane


def test_a_degree_of_the_equator_and_of_the_meridian_are_as_long_as_they_are() -> None:
    x, y = to_plane(0.0, 1e-3, 0.0, (0.0, 0.0, 0.0))
    assert (x, y) == pytest.approx((SEMI_MAJOR_M * math.radians(1e-3), 0.0), abs=1e-6)
    # One degree of latitude is 110.574 km at the equator and 111.694 km at the poles.
    assert to_plane(1e-3, 0.0, 0.0, (0.0, 0.0, 0.0))[1] == pytest.approx(110.574, abs=1e-3)
    assert to_plane(89.999, 0.0, 0.0, (90.0, 0.0, 0.0))[1] == pytest.approx(-111.694, abs=1e-3)


def test_a_parallel_is_shorter_towards_the_pole_and_longer_up_a_hill() -> None:
    origin = (60.0, 25.0, 0.0)
    x, _ = to_plane(60.0, 25.001, 0.0, origin)
    assert x == pytest.approx(55.80, abs=0.01)  # 55.80 km per degree at 60 deg
    high, _ = to_plane(60.0, 25.001, 1000.0, origin)
    assert high / x == pytest.approx(1.0 + 1000.0 / 6.39e6, abs=1e-6)


def test_the_map_may_be_turned() -> None:
    north = to_plane(48.001, 11.0, 0.0, (48.0, 11.0, 0.0))[1]
    assert to_plane(48.001, 11.0, 0.0, (48.0, 11.0, 30.0)) == pytest.approx(
        (0.5 * north, math.sqrt(0.75) * north), abs=1e-6
    )
