# SPDX-License-Identifier: Apache-2.0
"""Range-only positioning from Python: shapes, names and what C++ says come through unchanged."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import locfuse.core as lf

ROOM = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [5.0, 0.0]])
CUBE = np.array([[x, y, z] for x in (0.0, 10.0) for y in (0.0, 10.0) for z in (0.0, 10.0)])
UNIQUE = lf.PositionStatus.UNIQUE


def distances(anchors: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(points[:, None] - anchors, axis=2))


def noisy(anchors: np.ndarray, sigma: float, seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform(1.0, 9.0, (n, anchors.shape[1]))
    return points, distances(anchors, points) + rng.normal(0.0, sigma, (n, len(anchors)))


@pytest.mark.parametrize("anchors", [ROOM, CUBE], ids=["2d", "3d"])
@pytest.mark.parametrize("solver", ["newton", "ceres"])
def test_maximum_likelihood_equals_scipy(anchors: np.ndarray, solver: str) -> None:
    points, ranges = noisy(anchors, 0.1, 1, 20)
    batch = lf.locate_batch(anchors, ranges, 0.1, solver=solver)
    for point, row, position in zip(points, ranges, batch.position, strict=True):

        def residuals(x: Any, row: np.ndarray = row) -> np.ndarray:
            return np.asarray(np.linalg.norm(x - anchors, axis=1) - row)

        peer = least_squares(residuals, point, xtol=1e-12, ftol=1e-12)
        np.testing.assert_allclose(position, peer.x, atol=1e-6)


@pytest.mark.parametrize("loss", ["none", "huber", "one_sided"])
def test_a_batch_by_ceres_has_its_minimum_and_covariance(loss: str) -> None:
    _, ranges = noisy(ROOM, 0.3, 4, 50)
    batch = lf.locate_batch(ROOM, ranges, 0.3, solver="ceres", loss=loss)
    ours = lf.locate_batch(ROOM, ranges, 0.3, solver="newton", loss=loss)
    for k, row in enumerate(ranges):
        best = lf.locate(ROOM, row, 0.3, ml="ceres", loss=loss).hypotheses[0]
        np.testing.assert_array_equal(batch.position[k], best.position)
        if batch.status[k] == UNIQUE:
            np.testing.assert_allclose(batch.covariance[k], best.covariance, rtol=1e-9, atol=1e-15)
    assert np.all(batch.status == ours.status)
    unique = batch.status == UNIQUE
    assert np.mean(unique) > 0.8
    assert np.mean(batch.covariance[unique] != ours.covariance[unique]) > 0.5
    np.testing.assert_allclose(batch.position, ours.position, atol=1e-4)


def test_both_returns_ours_and_says_how_far_ceres_ends() -> None:
    _, ranges = noisy(ROOM, 0.3, 5, 1)
    both, ours, ceres = (
        lf.locate(ROOM, ranges[0], 0.3, ml=ml) for ml in ("both", "newton", "ceres")
    )
    mine, theirs, compared = ours.hypotheses[0], ceres.hypotheses[0], both.ml_comparison
    for same in (lf.locate(ROOM, ranges[0], 0.3), both):
        np.testing.assert_array_equal(same.hypotheses[0].position, mine.position)
        np.testing.assert_array_equal(same.hypotheses[0].covariance, mine.covariance)
    assert compared is not None
    np.testing.assert_array_equal(compared.ceres_position, theirs.position)
    np.testing.assert_array_equal(compared.ceres_covariance, theirs.covariance)
    assert compared.distance == pytest.approx(np.linalg.norm(mine.position - theirs.position))
    assert 0.0 < compared.sigmas < 1e-3
    assert ours.ml_comparison is None
    assert ceres.ml_comparison is None


@pytest.mark.parametrize("solver", ["srls", "srwls"])
def test_squared_ranges_equal_scipy(solver: str) -> None:
    points, ranges = noisy(ROOM, 0.1, 2, 20)
    batch = lf.locate_batch(ROOM, ranges, 0.1, solver=solver)
    for point, row, position in zip(points, ranges, batch.position, strict=True):
        variance = 4.0 * 0.01 * row**2 + 2.0 * 0.0001
        weight = np.ones(5) if solver == "srls" else 1.0 / variance

        def residuals(x: Any, row: np.ndarray = row, weight: np.ndarray = weight) -> np.ndarray:
            return np.asarray(np.sqrt(weight) * (((x - ROOM) ** 2).sum(1) - row**2))

        peer = least_squares(residuals, point, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        np.testing.assert_allclose(position, peer.x, atol=1e-6)


def test_locate_batch_and_solver_say_the_same() -> None:
    _, ranges = noisy(CUBE, 0.1, 3, 30)
    batch = lf.locate_batch(CUBE, ranges, 0.1)
    solver = lf.Multilateration(CUBE, 0.1)
    for i, row in enumerate(ranges):
        one, full = solver.solve(row), lf.locate(CUBE, row, 0.1)
        assert batch.status[i] == one.status == full.status == UNIQUE
        assert full.position is not None
        assert one.position is not None
        np.testing.assert_allclose(one.position, batch.position[i], atol=1e-9)
        np.testing.assert_allclose(full.position, batch.position[i], atol=1e-5)
        # Linearized one step before the end, which is not the same step in both: 1e-4 sigma apart.
        np.testing.assert_allclose(
            one.covariance, batch.covariance[i], rtol=0.0, atol=1e-6 * one.covariance.max()
        )


def test_batch_has_shapes_and_dtypes_as_documented() -> None:
    _, ranges = noisy(CUBE, 0.1, 4, 7)
    batch = lf.locate_batch(CUBE, ranges)
    assert batch.position.shape == (7, 3)
    assert batch.covariance.shape == (7, 3, 3)
    assert batch.cost.shape == batch.status.shape == (7,)
    planar = lf.locate_batch(CUBE, ranges, height=1.0)
    assert planar.position.shape == (7, 2)
    assert lf.locate_batch(CUBE, np.empty((0, 8))).position.shape == (0, 3)


def test_each_epoch_may_bring_its_own_anchors() -> None:
    rng = np.random.default_rng(5)
    anchors = rng.uniform(0.0, 10.0, (50, 8, 3))
    points = rng.uniform(0.0, 10.0, (50, 3))
    ranges = np.linalg.norm(points[:, None] - anchors, axis=2)
    batch = lf.locate_batch(anchors, ranges, 0.01)
    sure = batch.status == UNIQUE
    assert sure.sum() > 45
    np.testing.assert_allclose(batch.position[sure], points[sure], atol=1e-8)


def test_epochs_without_a_position_are_nan_and_their_status_says_why() -> None:
    _, ranges = noisy(ROOM, 0.1, 6, 3)
    ranges[0, 1:] = np.nan
    ranges[1, 2] = -1.0
    batch = lf.locate_batch(ROOM, ranges)
    status = [lf.PositionStatus(s).name for s in batch.status]
    assert status == ["UNDERDETERMINED", "BAD_RANGE", "UNIQUE"]
    assert np.isnan(batch.position[:2]).all()
    assert np.isfinite(batch.position[2]).all()


def test_position_is_none_unless_it_is_the_only_one() -> None:
    line = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]])
    ranges = distances(line, np.array([[3.0, 4.0]]))[0]
    solution = lf.locate(line, ranges)
    assert solution.status == lf.PositionStatus.AMBIGUOUS
    assert solution.position is None
    assert solution.covariance is None
    assert len(solution.hypotheses) == 2
    boxed = lf.locate(line, ranges, box=([0.0, 0.0], [9.0, 9.0]))
    assert boxed.position is not None
    np.testing.assert_allclose(boxed.position, [3.0, 4.0], atol=1e-6)


def test_the_wrong_range_is_named() -> None:
    anchors = np.vstack([ROOM, [[5.0, 10.0]]])
    ranges = distances(anchors, np.array([[3.0, 4.0]]))[0]
    ranges[3] += 1.0
    solution = lf.locate(anchors, ranges, 0.05)
    assert solution.status == lf.PositionStatus.INCONSISTENT
    assert solution.culprit is not None
    assert solution.culprit.index == 3
    assert solution.culprit.explains
    np.testing.assert_allclose(solution.culprit.without, [3.0, 4.0], atol=1e-6)
    assert "range 3" in solution.reason


def test_batches_let_other_threads_run() -> None:
    _, ranges = noisy(ROOM, 0.1, 7, 20_000)
    results: list[np.ndarray] = []
    threads = [
        threading.Thread(target=lambda: results.append(lf.locate_batch(ROOM, ranges).position))
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(results[0], results[1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ranges": np.ones(4)}, "ranges has shape (4,), expected (5,)"),
        ({"ranges": [1.0, 2.0, np.nan, 1.0, 1.0]}, "range 2 is nan"),
        ({"ranges": [1.0, 0.0, 1.0, 1.0, 1.0]}, "range 1 is 0.0"),
        ({"sigma": 0.0}, "sigma of range 0 is 0.0"),
        ({"sigma": np.ones(3)}, "sigma has shape (3,), expected (5,)"),
        ({"height": 1.0}, "height is 1.0"),
        ({"loss": "l1"}, "loss is 'l1', expected one of 'none', 'huber', 'cauchy', 'one_sided'"),
        ({"loss_scale": -1.0}, "loss_scale is -1.0"),
        ({"ml": "slow"}, "ml is 'slow'"),
        ({"weights": "w"}, "weights is 'w'"),
        ({"prior": ([0.0], [1.0])}, "prior has mean"),
        ({"box": ([0.0, 1.0], [1.0, 0.0])}, "box is from"),
        ({"anchors": np.ones(5)}, "anchors have 1 dimensions"),
        ({"anchors": ROOM * np.nan}, "anchor 0 has a coordinate nan"),
    ],
)
def test_mistakes_are_named(change: dict[str, Any], words: str) -> None:
    arguments = {"anchors": ROOM, "ranges": np.full(5, 5.0)} | change
    with pytest.raises(ValueError, match=r".") as error:
        lf.locate(**arguments)
    assert words in str(error.value)


def test_bounds_are_those_of_the_jacobian() -> None:
    point = np.array([[3.0, 4.0, 2.0]])
    u = (point - CUBE) / np.linalg.norm(point - CUBE, axis=1)[:, None]
    expected = np.linalg.inv(u.T @ u / 0.05**2)
    np.testing.assert_allclose(lf.cramer_rao(CUBE, point, 0.05)[0], expected, rtol=1e-12)
    planar = np.linalg.inv(u[:, :2].T @ u[:, :2] / 0.05**2)
    np.testing.assert_allclose(
        lf.cramer_rao(CUBE, point[:, :2], 0.05, height=2.0)[0], planar, rtol=1e-12
    )
