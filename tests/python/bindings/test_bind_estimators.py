# SPDX-License-Identifier: Apache-2.0
"""The pose EKF from Python: sensors of one's own, epochs in one call, snapshots."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

import locfuse as lf
from locfuse.types import FloatArray

ANCHORS = [[0.0, 0.0, 2.0], [8.0, 0.0, 2.5], [4.0, 6.0, 1.8]]
TAG_IN_BODY = np.array([0.2, -0.1, 1.1])
STEP = 100_000_000


def make_ekf(gate: float = 0.999) -> lf.PoseEkf:
    config = lf.PoseEkfConfig()
    config.range.sigma_m, config.range.sigma_relative = 0.05, 0.01
    config.range.gate = gate
    anchors = lf.AnchorMap([lf.Anchor(i, at) for i, at in enumerate(ANCHORS)])
    start = lf.PoseEstimate(0, lf.Pose2(3.0, 2.0, 0.3), np.diag([0.3, 0.2, 0.1]) ** 2)
    return lf.PoseEkf(config, lf.World(anchors, [lf.Tag(0, TAG_IN_BODY.tolist())]), start)


def bits(ekf: lf.PoseEkf) -> tuple[int, bytes, bytes]:
    return ekf.belief.stamp, ekf.belief.x.tobytes(), ekf.belief.P.tobytes()


def range_by_hand(pose: lf.Pose2, anchor: int, range_m: float) -> lf.Linearization:
    """Return what the built-in range model says, derived and written out once more."""
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    forward, left, up = TAG_IN_BODY
    tag = np.array([pose.x + c * forward - s * left, pose.y + s * forward + c * left, up])
    to_tag = tag - ANCHORS[anchor]
    distance = float(np.linalg.norm(to_tag))
    turned = np.array([-s * forward - c * left, c * forward - s * left])
    row = [to_tag[0], to_tag[1], to_tag[:2] @ turned]
    jacobian: FloatArray = np.array([row]) / distance
    return lf.Linearization([range_m - distance], jacobian, [[0.05**2 + (0.01 * distance) ** 2]])


def test_a_sensor_prototyped_in_python_gives_the_belief_of_the_built_in_one() -> None:
    built_in, prototype = make_ekf(), make_ekf()
    gate = lf.Gate(0.999)
    rng = np.random.default_rng(3)
    fused = 0
    for k in range(1, 200):
        stamp = k * STEP
        motion = lf.Increment(stamp - STEP, stamp, lf.Pose2(0.02, 0.0, 0.05))
        built_in.on(motion)
        prototype.on(motion)
        anchor = k % 3
        ahead = prototype.estimate(stamp).pose
        expected = float(np.linalg.norm([ahead.x - ANCHORS[anchor][0],
                                         ahead.y - ANCHORS[anchor][1],
                                         1.1 - ANCHORS[anchor][2]]))  # fmt: skip
        range_m = expected + 0.05 * float(rng.standard_normal())

        ours = built_in.on(lf.Range(stamp, tag=0, anchor=anchor, range=range_m))
        theirs = prototype.fuse(stamp, range_by_hand(ahead, anchor, range_m), gate)

        assert ours.verdict == theirs.verdict
        assert theirs.nis == pytest.approx(ours.nis, rel=1e-9, abs=1e-12)
        fused += theirs.verdict == lf.Verdict.FUSED
    assert fused > 150
    np.testing.assert_allclose(prototype.belief.x, built_in.belief.x, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(prototype.belief.P, built_in.belief.P, rtol=1e-9, atol=1e-14)


def test_a_wrong_sign_in_the_prototype_gives_another_belief() -> None:
    built_in, prototype = make_ekf(1.0), make_ekf(1.0)
    right = range_by_hand(lf.Pose2(3.0, 2.0, 0.3), 0, 4.0)
    wrong = lf.Linearization(right.residual, -right.jacobian, right.noise)

    built_in.on(lf.Range(0, tag=0, anchor=0, range=4.0))
    prototype.fuse(0, wrong, lf.Gate(1.0))

    assert abs(built_in.belief.x - prototype.belief.x).max() > 0.01


def test_update_of_a_belief_is_the_same_as_that_of_the_estimator() -> None:
    ekf = make_ekf()
    belief = lf.GaussianBelief()
    body = belief.add("body", lf.SlotKind.POSE2, ekf.belief.x, ekf.belief.P)
    z = lf.Range(0, tag=0, anchor=1, range=5.5)
    lin = ekf.range_model.linearize(lf.Pose2(3.0, 2.0, 0.3), z)
    assert lin is not None

    ekf.on(z)
    lf.update(belief, lin, [body], lf.Gate(0.999))

    np.testing.assert_allclose(belief.x, ekf.belief.x, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(belief.P, ekf.belief.P, rtol=0.0, atol=1e-16)


@pytest.mark.parametrize("columns", [1, 2, 4])
def test_a_jacobian_that_is_not_of_three_columns_is_refused(columns: int) -> None:
    ekf = make_ekf()
    before = bits(ekf)
    lin = lf.Linearization([0.1], np.ones((1, columns)), [[1.0]])
    with pytest.raises(ValueError, match=f"{columns} columns, expected 3"):
        ekf.fuse(0, lin, lf.Gate(0.99))
    assert bits(ekf) == before


def test_an_epoch_in_one_call_is_the_same_as_its_messages() -> None:
    one, many = make_ekf(), make_ekf()
    motion = lf.Pose2(0.05, 0.0, 0.02)
    ranges = [3.6, 5.6, 4.2]

    outcomes = one.on_epoch(0, STEP, motion, [0, 1, 2], ranges)
    expected = [many.on(lf.Increment(0, STEP, motion))]
    expected += [many.on(lf.Range(STEP, 0, i, value)) for i, value in enumerate(ranges)]

    assert bits(one) == bits(many)
    assert [o.verdict for o in outcomes] == [o.verdict for o in expected]


def test_an_epoch_with_one_bad_range_is_refused_whole() -> None:
    ekf = make_ekf()
    before = bits(ekf)
    for bad in (math.nan, -1.0):
        with pytest.raises(ValueError, match="Range"):
            ekf.on_epoch(0, STEP, lf.Pose2(0.05, 0, 0), [0, 1], [3.6, bad])
    with pytest.raises(ValueError, match=r"ranges has shape \(3,?\), expected \(2,\)"):
        ekf.on_epoch(0, STEP, lf.Pose2(0.05, 0, 0), [0, 1], [3.6, 5.5, 1.0])
    with pytest.raises(ValueError, match="row 1: anchors holds 4294967297"):  # not anchor 1
        ekf.on_epoch(0, STEP, lf.Pose2(0.05, 0, 0), [0, 2**32 + 1], [3.6, 5.5])
    assert bits(ekf) == before
    assert ekf.estimate().stamp == 0


def test_a_copy_is_a_snapshot_that_later_messages_do_not_reach() -> None:
    ekf = make_ekf()
    snapshot = copy.copy(ekf)
    before = bits(snapshot)
    ekf.on(lf.Range(STEP, tag=0, anchor=0, range=3.6))
    assert bits(snapshot) == before
    assert bits(ekf) != before


def test_the_belief_that_is_handed_out_is_a_copy() -> None:
    ekf = make_ekf()
    before = bits(ekf)
    belief = ekf.belief
    belief.x[:] = 1e9
    lf.update(belief, lf.Linearization([1.0], np.ones((1, 3)), [[1.0]]),
              [belief.slot("body")], lf.Gate(1.0))  # fmt: skip
    assert bits(ekf) == before


def test_an_estimate_of_the_past_is_refused() -> None:
    ekf = make_ekf()
    ekf.on(lf.Range(STEP, tag=0, anchor=0, range=3.6))
    with pytest.raises(ValueError, match="before the belief"):
        ekf.estimate(STEP - 1)


@pytest.mark.parametrize("pose", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_a_start_that_is_not_finite_is_refused(pose: tuple[float, float, float]) -> None:
    start = lf.PoseEstimate(0, lf.Pose2(*pose), np.eye(3))
    with pytest.raises(ValueError, match="finite"):
        lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)


@pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
def test_a_start_without_a_proper_covariance_is_refused(scale: float) -> None:
    start = lf.PoseEstimate(0, lf.Pose2(), np.diag([1.0, scale, 1.0]))
    with pytest.raises(ValueError, match="covariance"):
        lf.PoseEkf(lf.PoseEkfConfig(), lf.World(), start)


def test_duplicate_ids_and_places_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError, match="anchor 4 is given twice"):
        lf.AnchorMap([lf.Anchor(4, [0, 0, 0]), lf.Anchor(4, [1, 0, 0])])
    with pytest.raises(ValueError, match="anchor 4"):
        lf.AnchorMap([lf.Anchor(4, [0, math.nan, 0])])
    start = lf.PoseEstimate(0, lf.Pose2(), np.eye(3))
    for tags in ([lf.Tag(1, [0, 0, 0])] * 2, [lf.Tag(1, [math.inf, 0, 0])]):
        with pytest.raises(ValueError, match="tag 1"):
            lf.PoseEkf(lf.PoseEkfConfig(), lf.World(tags=tags), start)


def test_a_linearization_that_is_no_measurement_is_refused() -> None:
    good: tuple[Any, Any, Any] = ([0.1], [[1.0, 0.0, 0.0]], [[1.0]])
    lf.Linearization(*good)
    wrong: tuple[Any, Any, Any]
    for wrong in (
        ([], np.zeros((0, 3)), np.zeros((0, 0))),
        ([0.1, 0.2], [[1.0, 0.0, 0.0]], [[1.0]]),
        ([math.nan], [[1.0, 0.0, 0.0]], [[1.0]]),
        ([0.1], [[1.0, math.inf, 0.0]], [[1.0]]),
        ([0.1], [[1.0, 0.0, 0.0]], [[math.nan]]),
        ([0.1], [[1.0, 0.0, 0.0]], [[0.0]]),
        ([0.1], [[1.0, 0.0, 0.0]], [[-1.0]]),
    ):
        with pytest.raises(ValueError, match="Linearization"):
            lf.Linearization(*wrong)


def test_a_deep_copy_is_a_snapshot() -> None:
    ekf = lf.PoseEkf(
        lf.PoseEkfConfig(), lf.World(), lf.PoseEstimate(0, lf.Pose2(1, 2, 0), np.eye(3))
    )
    snapshot = copy.deepcopy(ekf)
    ekf.on(lf.Increment(0, 1_000_000_000, lf.Pose2(0.5, 0, 0)))
    assert snapshot.estimate().pose == lf.Pose2(1, 2, 0)
    assert ekf.estimate().pose == lf.Pose2(1.5, 2, 0)
