# SPDX-License-Identifier: Apache-2.0
"""Tags from Python: rigid fit, which tag is which, conditioning, the filter of twelve states."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import locfuse.core as lf

SECOND = 1_000_000_000
TAGS = [lf.Tag(1, [0.6, 0.0, 1.0]), lf.Tag(2, [-0.3, 0.4, 1.0]), lf.Tag(3, [-0.3, -0.2, 1.0])]
BODY = np.array([tag.position[:2] for tag in TAGS])
POSE = lf.Pose2(3.0, 2.0, 0.7)
WORLD = np.array([POSE.act(point) for point in BODY])
START = lf.PoseEstimate(0, POSE, np.diag([0.1, 0.1, 0.05]) ** 2)


def epoch(stamp: int = 0, sigma: float = 0.1) -> list[lf.PositionFix]:
    """Return a fix of each tag."""
    return [lf.PositionFix(stamp, at, sigma**2 * np.eye(2), tag.id)
            for tag, at in zip(TAGS, WORLD, strict=True)]  # fmt: skip


def ekf(config: lf.TagTriangleEkfConfig | None = None) -> lf.TagTriangleEkf:
    return lf.TagTriangleEkf(config or lf.TagTriangleEkfConfig(), lf.World(tags=TAGS), START)


# The rigid fit ----------------------------------------------------------------------------------


def test_a_rigid_fit_takes_a_covariance_of_all_or_of_each_point() -> None:
    each = np.array([np.diag([0.01, 0.04]), np.diag([0.02, 0.01]), [[0.02, 0.01], [0.01, 0.03]]])
    whole = np.zeros((6, 6))
    for i in range(3):
        whole[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = each[i]
    off = WORLD + [[0.1, 0.0], [0.0, -0.1], [0.05, 0.0]]
    a, b = lf.rigid_fit(BODY, off, whole), lf.rigid_fit(BODY, off, each)
    assert a.status == b.status == lf.RigidFitStatus.FITTED
    assert lf.local(a.pose, b.pose).tolist() == [0.0, 0.0, 0.0]
    assert a.nis == b.nis > 0.0
    assert a.dof == 3
    assert np.abs(lf.local(a.pose, POSE)).max() < 0.2
    assert a.covariance.shape == (3, 3)
    assert "RigidFit(" in repr(a)


def test_a_mirrored_triangle_is_reported() -> None:
    fit = lf.rigid_fit(BODY, BODY * [1, -1], 1e-4 * np.eye(6))
    assert fit.status == lf.RigidFitStatus.MIRRORED
    assert fit.nis > 16.3


@pytest.mark.parametrize(
    ("body", "world", "covariance", "what"),
    [
        (BODY, WORLD[:2], np.eye(6), r"world has shape \(2, 2\), expected \(3, 2\)"),
        (BODY, WORLD, np.eye(4), r"covariance has shape \(4, 4\), expected \(6, 6\)"),
        (BODY, WORLD, np.ones((2, 2, 2)), r"\(2, 2, 2\), expected \(3, 2, 2\)"),
        (BODY, WORLD, -np.eye(6), "positive definite"),
        (BODY[:1], WORLD[:1], np.eye(2), "at least 2"),
        (np.ones((3, 2)), WORLD, np.eye(6), "one place"),
    ],
)
def test_what_is_no_rigid_fit_is_refused(
    body: np.ndarray, world: np.ndarray, covariance: np.ndarray, what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        lf.rigid_fit(body, world, covariance)


# Which tag is which -----------------------------------------------------------------------------


def test_swapped_ids_are_named() -> None:
    right = lf.tag_order(TAGS, epoch(sigma=0.02))
    assert right.verdict == lf.TagOrderVerdict.FITS
    swapped = epoch(sigma=0.02)
    swapped[0], swapped[1] = (
        lf.PositionFix(0, z.position, z.covariance, tag)
        for z, tag in ((swapped[0], 2), (swapped[1], 1))
    )
    order = lf.tag_order(TAGS, swapped)
    assert order.verdict == lf.TagOrderVerdict.SWAPPED
    assert (list(order.given), list(order.ids)) == ([2, 1, 3], [1, 2, 3])
    assert order.nis > order.limit > order.best
    assert "as tags 1, 2, 3" in str(order)
    with pytest.raises(ValueError, match="as tags 1, 2, 3"):
        lf.TagTriangleEkf(lf.TagTriangleEkfConfig(), lf.World(tags=TAGS), swapped)


# Conditioning -----------------------------------------------------------------------------------


def test_a_conditioner_passes_rejects_and_recognises() -> None:
    config = lf.TagConditionerConfig()
    config.cutoff_hz, config.bias_x_m, config.bias_y_m = 0.0, 0.5, -0.5
    conditioner = lf.TagConditioner(config, TAGS)
    conditioner.on(lf.Velocity(0, 0.5, 0.0))
    first = conditioner.on(lf.PositionFix(0, [1.0, 2.0], np.eye(2), 1))
    assert first.verdict == lf.TagVerdict.PASSED
    assert first.fix is not None
    assert first.fix.position.tolist() == [0.5, 2.5]
    assert first.fix.tag == 1
    frozen = conditioner.on(lf.PositionFix(SECOND, [1.0, 2.0], np.eye(2), 1))
    jump = conditioner.on(lf.PositionFix(SECOND, [9.0, 2.0], np.eye(2), 1))
    unknown = conditioner.on(lf.PositionFix(SECOND, [1.0, 2.0], np.eye(2)))
    assert [out.verdict.name for out in (frozen, jump, unknown)] == [
        "FROZEN", "JUMP", "UNKNOWN_TAG",
    ]  # fmt: skip
    assert frozen.fix is jump.fix is unknown.fix is None
    assert (frozen.distance, frozen.limit) == (0.0, config.frozen_motion_m)
    assert jump.distance == 8.0
    assert jump.limit == pytest.approx(1.4 + 0.8)
    conditioner.on(lf.Increment(0, SECOND, lf.Pose2(0.1, 0.0, 0.0)))
    config.restart_after = 0
    with pytest.raises(ValueError, match="restart_after"):
        lf.TagConditioner(config, TAGS)


# The filter -------------------------------------------------------------------------------------


def test_every_message_is_fused() -> None:
    anchors = lf.AnchorMap([lf.Anchor(7, [0.0, 0.0, 2.0])])
    filt = lf.TagTriangleEkf(lf.TagTriangleEkfConfig(), lf.World(anchors, TAGS), epoch())
    assert filt.sides.dof == 3
    far = float(np.hypot(np.hypot(*WORLD[0]), 1.0))
    assert filt.on(lf.Velocity(0, 0.1, 0.0)).verdict == lf.Verdict.FUSED
    driven = lf.Increment(0, SECOND, lf.Pose2(0.1, 0.0, 0.0))
    assert filt.on(driven).verdict == lf.Verdict.FUSED
    for fix in epoch(SECOND):
        assert filt.on(fix).verdict == lf.Verdict.FUSED
    assert filt.on(lf.Range(SECOND, 1, 7, far + 0.1)).verdict == lf.Verdict.FUSED
    assert np.abs(lf.local(filt.pose(), POSE)).max() < 0.2
    assert filt.estimate(2 * SECOND).stamp == 2 * SECOND
    assert filt.fit().status == lf.RigidFitStatus.FITTED
    assert [tag.id for tag in filt.tags] == [1, 2, 3]


def test_slots_have_names_in_the_order_of_the_paper() -> None:
    belief = ekf().belief
    names = [f"tag{i}.{what}" for what in ("position", "velocity") for i in range(3)]
    np.testing.assert_array_equal(belief.mean([belief.slot(name) for name in names]), belief.x)
    np.testing.assert_allclose(belief.x[:6], WORLD.ravel())
    assert belief.P.shape == (12, 12)


def test_a_copy_is_a_snapshot() -> None:
    filt = ekf()
    before = copy.copy(filt)
    filt.on(lf.Velocity(SECOND, 0.2, 0.0))
    assert before.estimate().stamp == 0
    assert filt.estimate().stamp == SECOND
    assert filt.hold_sides().dof == 3
    assert "TagTriangleEkf" in repr(copy.deepcopy(filt))


def test_configuration_holds_the_sides_of_a_tape() -> None:
    config = lf.TagTriangleEkfConfig()
    assert config.sides_m is None
    sides = np.array([np.linalg.norm(BODY[i] - BODY[(i + 1) % 3]) for i in range(3)])
    config.sides_m = sides
    assert ekf(config).sides.verdict == lf.Verdict.IGNORED  # none was fused yet
    config.sides_m = sides + 0.1
    with pytest.raises(ValueError, match=r"sides_m has .* from tag 1 to tag 2"):
        ekf(config)
    flat = [lf.Tag(i, [0.5 * i, 0.0, 0.0]) for i in range(3)]
    with pytest.raises(ValueError, match="line"):
        lf.TagTriangleEkf(lf.TagTriangleEkfConfig(), lf.World(tags=flat), START)


def test_models_give_what_the_filter_fuses() -> None:
    config = lf.VelocityConfig()
    velocity = lf.VelocityModel(config)
    lin = velocity.linearize(np.zeros(6), 0.7, [0.3, 0.0, 0.2], BODY)
    np.testing.assert_allclose(
        lin.residual, np.ravel([lf.VelocityModel.predict(0.7, [0.3, 0.0, 0.2], at) for at in BODY])
    )
    side = lf.PointDistanceModel(lf.PointDistanceConfig())
    assert side.linearize([0, 0], [0, 0], 1.0) is None
    assert lf.PointDistanceModel.predict([0, 0], [3, 4]) == 5.0
    fix = lf.PositionFix(0, [1.0, 2.0], np.eye(2), 1)
    model = lf.PositionModel(lf.PositionConfig(), TAGS)
    of_point = model.linearize_point([1.0, 1.0], fix)
    assert of_point is not None
    assert of_point.residual.tolist() == [0.0, 1.0]
    assert model.predict(POSE, 9) is None
    assert model.linearize(POSE, lf.PositionFix(0, [1.0, 2.0], np.eye(2), 9)) is None
    found = model.predict(POSE, 1)
    assert found is not None
    np.testing.assert_allclose(found, WORLD[0])
