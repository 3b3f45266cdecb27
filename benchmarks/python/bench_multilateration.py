# SPDX-License-Identifier: Apache-2.0
"""Range-only positioning from Python, in bulk and call by call, compared to scipy and gtsam."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse.core as lf

ANCHORS = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [5.0, 0.0]])
SIGMA = 0.1
CENTRE = np.array([5.0, 5.0])
RNG = np.random.default_rng(100)
TRUTH = RNG.uniform(0.5, 9.5, (10_000, 2))
RANGES = np.abs(
    np.linalg.norm(TRUTH[:, None] - ANCHORS, axis=2) + RNG.normal(0.0, SIGMA, (10_000, 5))
)
FEW = 200  # epochs for slow peers
RMSE_M = 0.12


def rmse(found: Any) -> float:
    return float(np.sqrt(((np.asarray(found) - TRUTH[: len(found)]) ** 2).sum(1).mean()))


def run_each(benchmark: Any, solve: Any, epochs: int) -> None:
    benchmark.extra_info["items"] = epochs
    rows = list(RANGES[:epochs])
    found = benchmark(lambda: [solve(row) for row in rows])
    benchmark.extra_info["rmse_m"] = rmse(found)
    assert benchmark.extra_info["rmse_m"] < RMSE_M


def test_locate_batch(benchmark: Any) -> None:
    benchmark.extra_info["items"] = len(RANGES)
    found = benchmark(lambda: lf.locate_batch(ANCHORS, RANGES, SIGMA).position)
    benchmark.extra_info["rmse_m"] = rmse(found)
    assert benchmark.extra_info["rmse_m"] < RMSE_M


def test_locate_call(benchmark: Any) -> None:
    solver = lf.Multilateration(ANCHORS, SIGMA)
    run_each(benchmark, lambda row: solver.solve(row).position, len(RANGES))


def test_locate_full(benchmark: Any) -> None:
    run_each(benchmark, lambda row: lf.locate(ANCHORS, row, SIGMA).hypotheses[0].position, FEW)


def test_locate_scipy(benchmark: Any) -> None:
    optimize = pytest.importorskip("scipy.optimize", reason="scipy is not installed")

    def solve(row: Any) -> Any:
        def residuals(x: Any) -> Any:
            return np.linalg.norm(x - ANCHORS, axis=1) - row

        def jacobian(x: Any) -> Any:
            d = x - ANCHORS
            return d / np.linalg.norm(d, axis=1)[:, None]

        return optimize.least_squares(residuals, CENTRE, jac=jacobian, method="lm").x

    run_each(benchmark, solve, FEW)


def test_locate_gtsam(benchmark: Any) -> None:
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed")
    noise = gtsam.noiseModel.Isotropic.Sigma(1, SIGMA)
    parameters = gtsam.LevenbergMarquardtParams()

    def solve(row: Any) -> Any:
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        values.insert(0, CENTRE)
        for i, anchor in enumerate(ANCHORS, 1):
            values.insert(i, anchor)
            graph.add(gtsam.NonlinearEqualityPoint2(i, anchor))
            graph.add(gtsam.RangeFactor2(0, i, row[i - 1], noise))
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters)
        return optimizer.optimize().atPoint2(0)

    run_each(benchmark, solve, FEW)


@pytest.mark.parametrize(("dimensions", "seed"), [(2, 200), (3, 201)])
def test_random_layouts(benchmark: Any, dimensions: int, seed: int) -> None:
    """Count wrong minima over random layouts: five anchors anywhere in the box.

    The right minimum is what Levenberg and Marquardt's method finds from the truth; a wrong one
    costs 0.5 more.
    """
    rng = np.random.RandomState(seed)
    anchors = rng.uniform(0.0, 10.0, (10_000, 5, dimensions))
    truth = rng.uniform(0.0, 10.0, (10_000, dimensions))
    exact = np.linalg.norm(truth[:, None] - anchors, axis=2)
    ranges = np.maximum(exact + SIGMA * rng.standard_normal(exact.shape), 1e-3)
    benchmark.extra_info["items"] = len(truth)
    found = benchmark(lambda: lf.locate_batch(anchors, ranges, SIGMA).position)
    least = cost(anchors, ranges, minimum_near(anchors, ranges, truth))
    wrong = ~(cost(anchors, ranges, found) <= least + 0.5)  # true for NaN, too
    benchmark.extra_info["wrong"] = float(wrong.mean())


def cost(anchors: Any, ranges: Any, position: Any) -> Any:
    residuals = np.linalg.norm(position[:, None] - anchors, axis=2) - ranges
    return 0.5 * (residuals**2).sum(axis=1) / SIGMA**2


def minimum_near(anchors: Any, ranges: Any, position: Any) -> Any:
    damping = np.full(len(position), 1e-3)
    least = cost(anchors, ranges, position)
    for _ in range(60):
        offset = position[:, None] - anchors
        distance = np.linalg.norm(offset, axis=2)
        jacobian = offset / distance[..., None]
        normal = np.einsum("nmi,nmj->nij", jacobian, jacobian)
        normal += damping[:, None, None] * np.eye(position.shape[1])
        gradient = np.einsum("nmi,nm->ni", jacobian, distance - ranges)
        moved = position - np.linalg.solve(normal, gradient[..., None])[..., 0]
        there = cost(anchors, ranges, moved)
        better = there <= least
        position = np.where(better[:, None], moved, position)
        least = np.where(better, there, least)
        damping = np.where(better, damping / 3.0, damping * 4.0)
    return position
