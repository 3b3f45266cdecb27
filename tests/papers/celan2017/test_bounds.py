# SPDX-License-Identifier: Apache-2.0
"""The bound of eights: closed forms, what tightens it, and that filters stand at it or above."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from locfuse.sim.sensors import stamps
from locfuse.sim.trajectory import drive_of
from locfuse.types import Columns, FloatArray, StampArray
from papers.celan2017 import figure_eights
from papers.celan2017.methods import covariance_bounds
from papers.celan2017.world import ODOMETRY_HZ, SIGMA_LONGITUDINAL, SIGMA_SCALE, TAGS

START = (0.02, 0.03, 0.05)
SIGMA_FIX_M = 0.1


def fixes_at(stamp_ns: StampArray) -> Columns:
    """Return fixes of all tags."""
    covariance = SIGMA_FIX_M**2 * np.eye(2)
    return {
        "stamp_ns": np.repeat(stamp_ns, len(TAGS)),
        "tag": np.tile(np.array(list(TAGS)), len(stamp_ns)),
        "covariance": np.tile(covariance, (len(TAGS) * len(stamp_ns), 1, 1)),
    }


def bound(speed_mps: float, fixes: Columns, duration_s: float = 4.0) -> FloatArray:
    drive = drive_of((1.0, 2.0, 0.0), [(duration_s, speed_mps, 0.0)])
    return covariance_bounds(drive, stamps(ODOMETRY_HZ, duration_s), fixes, START)


def test_at_rest_fixes_of_all_tags_add_their_information() -> None:
    arms = np.array(list(TAGS.values()))[:, :2]
    H = np.concatenate([[[1.0, 0.0, -y], [0.0, 1.0, x]] for x, y in arms])
    information = np.diag(1.0 / np.square(START))
    epochs = stamps(1.0, 4.0)[1:]
    found = bound(0.0, fixes_at(epochs))
    after_one, after_all = (information + n * H.T @ H / SIGMA_FIX_M**2 for n in (1, len(epochs)))
    np.testing.assert_allclose(found[6, :2, :2], np.diag(np.square(START))[:2, :2])
    np.testing.assert_allclose(np.linalg.inv(found[7])[:2, :2], after_one[:2, :2], rtol=1e-2,
                               atol=1e-9)  # fmt: skip
    assert np.linalg.inv(found[-1])[2, 2] < after_all[2, 2], "a gyro's bias turns it"
    np.testing.assert_allclose(np.linalg.inv(found[-1])[:2, :2], after_all[:2, :2], rtol=2e-2,
                               atol=1e-9)  # fmt: skip


def test_without_fixes_a_straight_way_is_as_unsure_as_its_noise_and_scale() -> None:
    way_m = 2.0
    found = bound(0.5, fixes_at(np.array([], np.int64)))
    expected = START[0] ** 2 + SIGMA_LONGITUDINAL**2 * way_m + (SIGMA_SCALE * way_m) ** 2
    assert found[-1, 0, 0] == pytest.approx(expected)
    assert found[-1, 1, 1] > START[1] ** 2 + (START[2] * way_m) ** 2


def test_one_row_for_each_stamp_of_the_wheels_with_the_fixes_until_then() -> None:
    between = np.array([1_000_000_000], np.int64)  # 7.5 ticks
    found = bound(0.5, fixes_at(between))
    assert len(found) == len(stamps(ODOMETRY_HZ, 4.0)) - 1
    sigma = np.sqrt(found[:, 1, 1])
    assert sigma[6] > START[1], "at 0.93 s no fix has arrived yet"
    assert sigma[7] < 0.9 * sigma[6], "at 1.07 s it has"


def test_the_rigid_body_stands_at_the_bound_and_twelve_states_above() -> None:
    """It stood at 1.3 while fixes within an increment came after its end, and were dropped."""
    rides = [figure_eights.ride(seed) for seed in range(4)]
    least = np.mean([figure_eights.bound_of(of) ** 2 for of in rides], axis=0)

    def over(method: str) -> FloatArray:
        off = [figure_eights.errors_of(of, figure_eights.METHODS[method](of)) for of in rides]
        return np.asarray(np.sqrt(np.mean([np.mean(one**2, axis=0) for one in off], axis=0)
                                  / least))  # fmt: skip

    rigid = over("rigid")
    assert np.all((rigid > 0.9) & (rigid < 1.2)), rigid
    for worse in ("triangle", "kindest"):
        assert np.all(over(worse) > np.maximum(rigid, 1.1)), worse
    silent = [replace(of, fixes={k: v[: len(v) // 2] for k, v in of.fixes.items()}) for of in rides]
    assert np.all(
        np.mean([figure_eights.bound_of(of) for of in silent], axis=0) > 1.5 * np.sqrt(least)
    )
