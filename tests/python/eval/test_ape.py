# SPDX-License-Identifier: Apache-2.0
"""Absolute position errors: by hand, under known motions, and with stamps of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from locfuse.eval.ape import ALIGNMENTS, ape, associate, umeyama
from locfuse.types import FloatArray, Trajectory

SECOND = 1_000_000_000


def track(position: list[list[float]] | FloatArray, stamp_s: list[float] | None = None,
          ) -> Trajectory:  # fmt: skip
    points = np.asarray(position, dtype=np.float64).reshape(-1, 2)
    seconds = np.arange(len(points)) if stamp_s is None else np.array(stamp_s)
    return Trajectory(np.rint(seconds * SECOND).astype(np.int64), points)


def turned(points: FloatArray, scale: float, angle: float, shift: list[float]) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    moved: FloatArray = scale * points @ np.array([[c, s], [-s, c]]) + shift
    return moved


def points(n: int = 200, seed: int = 2) -> FloatArray:
    return np.random.default_rng(seed).normal(0.0, 5.0, (n, 2))


def test_figures_of_errors_known_by_head() -> None:
    truth = track([[0, 0], [1, 0], [2, 0], [3, 0]])
    estimate = track([[0, 1], [1, 2], [2, 2], [3, 5]])

    found = ape(estimate, truth)

    np.testing.assert_array_equal(found.error, [1.0, 2.0, 2.0, 5.0])
    assert found.rmse == pytest.approx(math.sqrt(34.0 / 4.0))
    assert (found.mean, found.median, found.max, found.matched) == (2.5, 2.0, 5.0, 4)
    assert found.p95 == pytest.approx(4.55)
    assert (found.alignment, found.scale, found.rotation) == ("none", 1.0, 0.0)
    np.testing.assert_array_equal(found.translation, [0.0, 0.0])


def test_nothing_is_aligned_unless_asked() -> None:
    p = points()
    assert ape(track(p + [3.0, 4.0]), track(p)).rmse == pytest.approx(5.0)


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0, math.pi - 1e-9])
def test_a_rigid_motion_is_found_and_undone(angle: float) -> None:
    truth = points()
    estimate = turned(truth, 1.0, -angle, [0.0, 0.0]) + [7.0, -3.0]

    found = ape(track(estimate), track(truth), "se2")

    assert found.rmse < 1e-12
    assert found.rotation == pytest.approx(angle, abs=1e-12)
    assert found.scale == 1.0
    moved = turned(estimate, 1.0, found.rotation, found.translation.tolist())
    np.testing.assert_allclose(moved, truth, atol=1e-11)


def test_a_scale_is_undone_only_by_sim2() -> None:
    truth = points()
    estimate = turned(truth, 0.5, 0.3, [1.0, 2.0])
    assert ape(track(estimate), track(truth), "se2").rmse > 1.0
    found = ape(track(estimate), track(truth), "sim2")
    assert found.rmse < 1e-12
    assert found.scale == pytest.approx(2.0, rel=1e-12)


def test_a_mirrored_path_is_not_mended() -> None:
    truth = points()
    assert ape(track(truth * [1.0, -1.0]), track(truth), "sim2").rmse > 1.0


def test_no_other_rigid_motion_is_closer() -> None:
    rng = np.random.default_rng(7)
    truth = points()
    estimate = turned(truth, 1.0, 0.6, [1.0, 1.0]) + rng.normal(0.0, 1.0, truth.shape)
    found = ape(track(estimate), track(truth), "se2")
    for turn, dx, dy in [(1e-3, 0, 0), (-1e-3, 0, 0), (0, 1e-2, 0), (0, -1e-2, 0), (0, 0, 1e-2)]:
        shift = found.translation + [dx, dy]
        other = turned(estimate, 1.0, found.rotation + turn, shift.tolist())
        assert np.sqrt(np.mean(np.sum((other - truth) ** 2, axis=1))) > found.rmse


def test_a_more_general_alignment_is_never_worse() -> None:
    estimate, truth = track(points(seed=3)), track(points(seed=4))
    rmse = [ape(estimate, truth, alignment).rmse for alignment in ALIGNMENTS]
    assert rmse[0] > rmse[1] > rmse[2]


def test_poses_are_matched_with_the_nearest_stamp_within_the_limit() -> None:
    a = track([[0, 0]] * 3, [0.0, 1.0, 2.0])
    b = track([[0, 0]] * 5, [0.004, 0.5, 0.995, 1.006, 2.02])
    rows_a, rows_b = associate(a, b, 0.01)
    assert (rows_a.tolist(), rows_b.tolist()) == ([0, 1], [0, 2])
    of_b, of_a = associate(b, a, 0.01)
    assert (of_b.tolist(), of_a.tolist()) == ([0, 2], [0, 1])


def test_stamps_since_1970_are_compared_to_the_nanosecond() -> None:
    at = 1_700_000_000 * SECOND
    a = Trajectory(np.array([at, at + SECOND]), np.zeros((2, 2)))
    near = Trajectory(np.array([at + 10_000_000, at + SECOND + 10_000_000]), np.zeros((2, 2)))
    far = Trajectory(np.array([at + 10_000_001, at + SECOND + 10_000_001]), np.zeros((2, 2)))
    assert len(associate(a, near, 0.01)[0]) == 2
    assert len(associate(a, far, 0.01)[0]) == 0


def test_nothing_to_compare_is_an_error_that_says_why() -> None:
    with pytest.raises(ValueError, match=r"0 poses match within 0\.01 s"):
        ape(track([[0, 0]] * 3), track([[0, 0]] * 3, [100.0, 101.0, 102.0]))
    empty = track(np.empty((0, 2)))
    with pytest.raises(ValueError, match="0 poses match"):
        ape(empty, track([[0, 0]] * 3))


def test_an_unknown_alignment_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="'se3', expected one of none, se2, sim2"):
        ape(track([[0, 0]] * 3), track([[0, 0]] * 3), "se3")


def test_a_path_that_stands_still_has_no_rotation() -> None:
    with pytest.raises(ValueError, match="does not move"):
        umeyama(np.ones((5, 2)), points(5), with_scale=False)
    with pytest.raises(ValueError, match="does not move"):
        umeyama(points(5), np.ones((5, 2)), with_scale=True)
