# SPDX-License-Identifier: Apache-2.0
"""A body that rolls, and antennas that add to ranges: learnt exactly, derived right, consistent."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse import _core
from locfuse.eval.consistency import band
from locfuse.types import FloatArray
from papers.celan2017.methods import (
    SIGMA_SPEED_MPS,
    SIGMA_TURN_RADPS,
    SLIP_M,
    SPEED_MPS,
    SPEED_S,
    TURN_S,
    Antennas,
    Rolling,
    learn,
    rolled,
)

ANCHORS = {k: np.array([4.0 * np.cos(a), 3.0 * np.sin(a), 1.2])
           for k, a in enumerate(np.arange(8) * np.pi / 4.0)}  # fmt: skip
TAGS = [_core.Tag(0, [-0.07, -0.14, 1.0]), _core.Tag(1, [-0.07, 0.14, 1.0]),
        _core.Tag(2, [0.2, 0.14, 1.0])]  # fmt: skip
RNG = np.random.default_rng(3)
TRUE = Antennas(0.1 * RNG.standard_normal((3, 8)), 0.02, np.array([0.02, -0.03, 0.05]),
                np.array([-0.04, 0.04, 0.01]), 0.05)  # fmt: skip
SIGMA_M = 0.05


def sight(pose: FloatArray, tag: int, anchor: int) -> tuple[float, float]:
    """Return distance and direction in body: written out, not by a model."""
    x, y, z = TAGS[tag].position
    c, s = np.cos(pose[2]), np.sin(pose[2])
    dx, dy, dz = ANCHORS[anchor] - [pose[0] + c * x - s * y, pose[1] + s * x + c * y, z]
    return float(np.sqrt(dx * dx + dy * dy + dz * dz)), float(np.arctan2(dy, dx) - pose[2])


def long_by(antennas: Antennas, tag: int, anchor: int, distance: float, beta: float) -> float:
    return float(antennas.constant_m[tag, anchor] + antennas.scale * distance
                 + antennas.cosine_m[tag] * np.cos(2.0 * beta)
                 + antennas.sine_m[tag] * np.sin(2.0 * beta))  # fmt: skip


def range_at(pose: FloatArray, tag: int, anchor: int, noise: float = 0.0) -> _core.Range:
    distance, beta = sight(pose, tag, anchor)
    measured = distance + long_by(TRUE, tag, anchor, distance, beta) + noise
    return _core.Range(0, tag, anchor, measured, SIGMA_M)


@pytest.mark.parametrize("outliers", [0, 12])
def test_what_antennas_add_is_learnt_from_a_few_poses(outliers: int) -> None:
    rng = np.random.default_rng(1)
    rows = [(tag, anchor, *sight(pose, tag, anchor)) for pose in rng.uniform(-2.0, 2.0, (18, 3))
            for tag in range(3) for anchor in range(8)]  # fmt: skip
    tag, anchor, distance, beta = np.array(rows).T
    error = np.array([long_by(TRUE, int(t), int(a), d, b) for t, a, d, b in rows])
    error[rng.permutation(len(error))[:outliers]] += 2.0
    found = learn(error, distance, beta, (tag, anchor))
    within = 0.005 if outliers else 1e-9
    for name in ("constant_m", "scale", "cosine_m", "sine_m"):
        np.testing.assert_allclose(getattr(found, name), getattr(TRUE, name), atol=within)
    assert found.sigma_m < 1e-9 or outliers


def test_a_range_is_what_antennas_say_it_is_and_its_jacobian_the_difference() -> None:
    rng = np.random.default_rng(2)
    step = 1e-6
    for pose in rng.uniform([-2.0, -2.0, -np.pi], [2.0, 2.0, np.pi], (20, 3)):
        tag, anchor = int(rng.integers(3)), int(rng.integers(8))
        z = range_at(pose, tag, anchor)
        assert linearized(pose, z).residual[0] == pytest.approx(0.0, abs=1e-12)
        for column in range(3):
            ahead = pose + step * (np.arange(3) == column)
            slope = (linearized(pose, z).residual[0] - linearized(ahead, z).residual[0]) / step
            assert linearized(pose, z).jacobian[0, column] == pytest.approx(slope, abs=1e-5)


def linearized(pose: FloatArray, z: _core.Range) -> _core.Linearization:
    start = _core.PoseEstimate(0, _core.Pose2(*pose.tolist()), np.eye(3))
    lin = Rolling(start, ANCHORS, TAGS, TRUE).linearize(z)
    assert lin is not None
    return lin


def test_a_step_has_the_derivatives_of_its_mean() -> None:
    rng = np.random.default_rng(4)
    for x in rng.standard_normal((20, 5)):
        step = rolled(x, 0.1)
        for column in range(5):
            ahead = x + 1e-6 * (np.arange(5) == column)
            slope = (rolled(ahead, 0.1).moved - step.moved) / 1e-6
            np.testing.assert_allclose(step.jacobian[:, column], slope, atol=1e-5)


def test_speed_and_turn_rate_come_back_to_what_they_are_on_average() -> None:
    x, P = np.array([0.0, 0.0, 0.0, 2.0, 1.0]), np.zeros((5, 5))
    for _ in range(400):
        step = rolled(x, 0.1)
        x, P = step.moved, step.jacobian @ P @ step.jacobian.T + step.noise
    assert x[3] == pytest.approx(SPEED_MPS, abs=1e-6)
    assert x[4] == pytest.approx(0.0, abs=1e-6)
    assert np.sqrt(P[3, 3]) == pytest.approx(SIGMA_SPEED_MPS, rel=1e-6)
    assert np.sqrt(P[4, 4]) == pytest.approx(SIGMA_TURN_RADPS, rel=1e-6)


def test_in_its_own_world_it_is_consistent_and_without_antennas_it_is_not() -> None:
    seeds, known, unknown = 20, [], []
    for seed in range(seeds):
        known.append(nees_at_the_end(seed, TRUE))
        unknown.append(nees_at_the_end(seed, None))
    low, high = band(3, seeds, 0.999)
    assert low < np.mean(known) < high
    assert np.mean(unknown) > 1.5 * high


def nees_at_the_end(seed: int, antennas: Antennas | None) -> float:
    """Return that of six seconds at 5 Hz; the world is drawn from the filter's own noise."""
    rng = np.random.default_rng(seed)
    x = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0),
                  SPEED_MPS + SIGMA_SPEED_MPS * rng.standard_normal(),
                  SIGMA_TURN_RADPS * rng.standard_normal()])  # fmt: skip
    off = 0.1 * rng.standard_normal(3)
    start = _core.PoseEstimate(0, _core.Pose2(*(x[:3] + off).tolist()), 0.01 * np.eye(3))
    ekf = Rolling(start, ANCHORS, TAGS, antennas)
    ekf.tails = _core.NoiseShape(_core.NoiseKind.GAUSSIAN)  # as this world's
    for k in range(1, 31):
        for _ in range(20):
            x = wandered(x, 0.01, rng)
        for tag in range(3):
            for anchor in range(8):
                z = range_at(x, tag, anchor, SIGMA_M * rng.standard_normal())
                ekf.on(_core.Range(k * 200_000_000, tag, anchor, z.range, SIGMA_M))
    found = ekf.estimate(30 * 200_000_000)
    e = np.array([found.pose.x - x[0], found.pose.y - x[1],
                  _core.wrap_angle(found.pose.heading - x[2])])  # fmt: skip
    return float(e @ np.linalg.solve(found.covariance, e))


def wandered(x: FloatArray, seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return a small step of the world: Euler's, not the filter's."""
    px, py, heading, speed, turn = x.tolist()
    slip = SLIP_M * np.sqrt(seconds) * rng.standard_normal(2)
    px += seconds * speed * np.cos(heading) + slip[0]
    py += seconds * speed * np.sin(heading) + slip[1]
    heading += seconds * turn
    speed += (
        seconds / SPEED_S * (SPEED_MPS - speed)
        + SIGMA_SPEED_MPS * np.sqrt(2.0 * seconds / SPEED_S) * rng.standard_normal()
    )
    turn += (
        -seconds / TURN_S * turn
        + SIGMA_TURN_RADPS * np.sqrt(2.0 * seconds / TURN_S) * rng.standard_normal()
    )
    return np.array([px, py, heading, speed, turn])


def test_a_range_of_an_unknown_anchor_changes_nothing() -> None:
    start = _core.PoseEstimate(0, _core.Pose2(), np.eye(3))
    ekf = Rolling(start, ANCHORS, TAGS)
    assert ekf.on(_core.Range(0, 0, 99, 3.0, SIGMA_M)) is None
    np.testing.assert_array_equal(ekf.estimate(0).covariance, np.eye(3))
