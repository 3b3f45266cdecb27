# SPDX-License-Identifier: Apache-2.0
"""metrics.json from runs whose every number is known."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from locfuse.eval.metrics import metrics
from locfuse.types import RunResult, Trajectory
from support_results import EPOCH_NS, make_result

ACCURACY = (
    "position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg", "nees_mean",
    "nees_in_band",
)  # fmt: skip


def of(result: RunResult) -> dict[str, object]:
    return metrics(result.estimate, result.truth, result.outcomes, 20.0, 0.5)


def test_a_constant_error_is_every_position_figure() -> None:
    found = of(make_result(error=(0.3, -0.4, 0.1)))
    for key in ("position_rmse_m", "position_p95_m", "position_max_m"):
        assert found[key] == pytest.approx(0.5, abs=1e-12)
    assert found["heading_rmse_deg"] == pytest.approx(math.degrees(0.1), abs=1e-10)


def test_the_rmse_is_of_distances_and_p95_and_max_are_of_the_worst() -> None:
    result = make_result(n=100, error=(0.0, 0.0, 0.0))
    moved = result.estimate.position.copy()
    moved[:10, 0] += 1.0
    moved[0, 1] += 1.0
    found = of(replace(result, estimate=replace(result.estimate, position=moved)))
    assert found["position_rmse_m"] == pytest.approx(math.sqrt(11.0 / 100.0))
    assert found["position_max_m"] == pytest.approx(math.sqrt(2.0))
    assert found["position_p95_m"] == pytest.approx(1.0)


def test_nees_is_the_error_in_its_own_sigmas() -> None:
    found = of(make_result(error=(0.1, -0.2, 0.05), sigma=(0.1, 0.1, 0.1)))
    assert found["nees_mean"] == pytest.approx(1.0 + 4.0 + 0.25)
    assert (found["nees_dof"], found["nees_in_band"]) == (3, 1.0)
    over_confident = of(make_result(error=(0.1, -0.2, 0.05), sigma=(0.01, 0.01, 0.01)))
    assert over_confident["nees_in_band"] == 0.0


def test_a_truth_without_headings_is_compared_in_two_dimensions() -> None:
    found = of(make_result(error=(0.1, -0.2, 0.05), sigma=(0.1, 0.1, 0.1), truth_heading=False))
    assert found["heading_rmse_deg"] is None
    assert (found["nees_mean"], found["nees_dof"]) == (pytest.approx(5.0), 2)


def test_without_truth_errors_are_null_and_said_to_be_unknown() -> None:
    found = of(make_result(with_truth=False))
    assert all(found[key] is None for key in ACCURACY)
    assert "no truth" in str(found["truth"])
    assert found["duration_s"] == 20.0


def test_a_truth_of_another_time_gives_null_not_zero() -> None:
    result = make_result()
    assert result.truth is not None
    later = Trajectory(result.truth.stamp_ns + 10**15, result.truth.position, result.truth.heading)
    found = of(replace(result, truth=later))
    assert all(found[key] is None for key in ACCURACY)
    assert "do not overlap" in str(found["truth"])


def test_it_is_said_how_many_stamps_were_compared() -> None:
    result = make_result(n=200)
    truth = result.truth
    assert truth is not None
    assert truth.heading is not None
    half = Trajectory(truth.stamp_ns[:50], truth.position[:50], truth.heading[:50])
    assert "at 50 of 200 stamps" in str(of(replace(result, truth=half))["truth"])


def test_counts_and_rejections_are_those_of_the_outcomes() -> None:
    found = of(make_result(n=100, rejected={"A2": (2.0, 4.5)}, every_source=True))
    counts = found["counts"]
    assert counts == {
        "odometry": {"fused": 100},
        "poses": {"fused": 100},
        "positions": {"fused": 100},
        "ranges": {"fused": 375, "gated": 25},
    }
    rejected = found["rejected"]
    assert isinstance(rejected, dict)
    assert rejected["A2"] == {"count": 25, "share": 0.25}
    assert rejected["A1"] == {"count": 0, "share": 0.0}
    assert (found["messages"], found["messages_per_second"]) == (700, 1400.0)


def test_nis_is_averaged_over_fused_messages_of_each_source() -> None:
    result = make_result(n=100, rejected={"A2": (2.0, 4.5)}, every_source=True)
    o = result.outcomes
    found = of(result)["nis_mean"]
    assert isinstance(found, dict)
    assert set(found) == {"ranges", "positions", "poses"}, "odometry has no innovation"
    for source, mean in found.items():
        fused = (o.source == source) & (o.verdict == "fused")
        assert mean == pytest.approx(float(o.nis[fused].mean()))
    all_gated = of(make_result(n=10, anchors=("A",), rejected={"A": (0.0, 99.0)}))
    assert all_gated["nis_mean"] == {"ranges": None}


def test_everything_is_ready_for_json() -> None:
    for result in (make_result(every_source=True), make_result(with_truth=False)):
        text = json.dumps(of(result), allow_nan=False)
        assert set(ACCURACY) <= set(json.loads(text))


def test_stamps_since_1970_lose_nothing_to_rounding() -> None:
    result = make_result(n=5, error=(0.0, 0.0, 0.0))
    truth = Trajectory(
        EPOCH_NS + np.array([0, 400_000_001], dtype=np.int64),
        np.array([[0.0, 0.0], [4.00000001, 0]]),
    )
    estimate = Trajectory(
        EPOCH_NS + np.array([1, 100_000_000], dtype=np.int64),
        np.array([[1e-8, 0.0], [1.0, 0.0]]),
        np.zeros(2),
        np.tile(np.eye(3), (2, 1, 1)),
    )
    found = metrics(estimate, truth, result.outcomes, 1.0, 1.0)
    assert found["position_max_m"] == pytest.approx(0.0, abs=1e-12)
