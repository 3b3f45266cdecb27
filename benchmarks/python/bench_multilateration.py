# SPDX-License-Identifier: Apache-2.0
"""Range-only positioning from Python, call by call and in bulk, beside scipy and gtsam."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse as lf

ANCHORS = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [5.0, 0.0]])
SIGMA = 0.1
CENTRE = np.array([5.0, 5.0])
RNG = np.random.default_rng(100)
TRUTH = RNG.uniform(0.5, 9.5, (10_000, 2))
RANGES = np.abs(
    np.linalg.norm(TRUTH[:, None] - ANCHORS, axis=2) + RNG.normal(0.0, SIGMA, (10_000, 5))
)
FEW = 200  # epochs for what takes long
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
