# SPDX-License-Identifier: Apache-2.0
"""Rows on the cylinder detector: what is asked holds, and breaks with what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse import _core
from papers.wells import cylinder_detector as cylinder_worlds
from papers.wells.cylinder_detector import (
    LEG_M,
    STRIDE_M,
    cylinder_claims,
    errors_at_bound,
    false_ones,
    legs_of,
    look_for,
    scan_of,
    walked,
)


def test_beams_end_where_geometry_says() -> None:
    wall = np.array([[[4.0, -2.0], [4.0, 2.0]]])
    silent = np.random.default_rng(0)
    scan, on = scan_of(np.zeros(3), np.array([[2.0, 0.0], [-3.0, 0.0]]), [0.5, 1.0], wall, silent)
    ranges = np.array(scan.ranges)
    assert abs(ranges[180] - 1.5) < 0.05  # straight ahead: the disc hides the wall
    assert abs(ranges[0] - 2.0) < 0.05
    assert abs(ranges[200] - 4.0 / np.cos(np.deg2rad(20.0))) < 0.05  # past the disc
    assert [len(beams) for beams in on] == [29, 39]
    assert abs(on[0]).max() < np.arcsin(0.5 / 2.0)


def test_in_the_clean_world_none_is_missed_and_the_closest_beam_is_four_times_worse() -> None:
    found = look_for("wells", known=True, seeds=3)
    assert found.missed == 0
    assert found.in_view > 250
    assert np.median(found.off_m) < 0.005
    assert np.median(found.closest_off_m) > 4.0 * np.median(found.off_m)


def test_a_known_radius_reaches_the_bound_and_twice_the_noise_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = look_for("wells", known=True, seeds=10)
    assert 0.9 < np.median(found.off_m) / np.median(errors_at_bound(found)) < 1.1
    monkeypatch.setattr(cylinder_worlds, "SIGMA_BEAM_M", 0.02)
    noisy = look_for("wells", known=True, seeds=10)
    assert np.median(noisy.off_m) > 1.5 * np.median(errors_at_bound(found))


def test_a_detector_for_twice_the_noise_is_too_cautious(monkeypatch: pytest.MonkeyPatch) -> None:
    assert abs(np.mean(look_for("wells", known=True, seeds=3).nees) - 2.0) < 0.33
    detector = cylinder_worlds._detector

    def cautious(**changed: float) -> _core.CylinderDetector:
        return detector(**changed, sigma_range_m=0.02)

    monkeypatch.setattr(cylinder_worlds, "_detector", cautious)
    assert np.mean(look_for("wells", known=True, seeds=3).nees) < 1.0


def test_legs_swing_about_the_body_and_are_as_far_apart_as_a_step() -> None:
    legs = legs_of(np.arange(50) / 5.0, np.random.default_rng(1))
    left, right = legs[:, :3], legs[:, 3:]
    apart = np.hypot(*(left - right).transpose(2, 0, 1))
    assert apart.min() >= 2.0 * LEG_M
    assert 0.9 * STRIDE_M < apart.max() < 1.1 * np.hypot(STRIDE_M, 0.2)


def test_pairs_of_legs_are_left_out_and_most_poles_stay() -> None:
    poles, pairs = walked("poles", 4), walked("pairs", 4)
    assert pairs.false_ones < 0.3 * poles.false_ones
    assert pairs.missed < 0.3 * pairs.in_view
    assert walked("pillars", 4).false_ones == 0


def test_a_room_with_boxes_has_hardly_any_cylinder() -> None:
    assert sum(len(one) for one in false_ones("boxes", 5)) <= 1


def test_every_row_says_what_came_out() -> None:
    rows = cylinder_claims(1, lambda done, of: None)
    assert len({row.id for row in rows}) == len(rows)
    assert all(row.ours_median is not None for row in rows)
