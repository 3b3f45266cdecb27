# SPDX-License-Identifier: Apache-2.0
"""Messages from Python: keywords, what is refused, and that they cannot be changed later."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import locfuse as lf

NOT_FINITE = [math.nan, math.inf, -math.inf]
EYE2, EYE3 = np.eye(2), np.eye(3)


def test_a_stamp_keeps_every_nanosecond() -> None:
    stamp = 1_700_000_000_123_456_789
    assert lf.Range(stamp, tag=0, anchor=1, range=2.0).stamp == stamp
    assert lf.Increment(begin=stamp, stamp=stamp + 1, motion=lf.Pose2()).stamp == stamp + 1


def test_fields_come_back_as_given() -> None:
    z = lf.Range(stamp=1, tag=2, anchor=3, range=4.5, sigma=0.25)
    assert (z.stamp, z.tag, z.anchor, z.range, z.sigma) == (1, 2, 3, 4.5, 0.25)
    assert lf.Range(stamp=1, tag=2, anchor=3, range=4.5).sigma is None
    u = lf.Velocity(stamp=1, forward=0.5, turn_rate=-0.25)
    assert (u.stamp, u.forward, u.turn_rate) == (1, 0.5, -0.25)
    fix = lf.PositionFix(stamp=1, position=[2.0, 3.0], covariance=4.0 * EYE2)
    np.testing.assert_array_equal(fix.position, [2.0, 3.0])
    np.testing.assert_array_equal(fix.covariance, 4.0 * EYE2)
    seen = lf.PoseObservation(stamp=1, pose=lf.Pose2(2.0, 3.0, 0.5), covariance=4.0 * EYE3)
    assert (seen.pose.x, seen.pose.y, seen.pose.heading) == (2.0, 3.0, 0.5)
    post = lf.RangeBearing(stamp=1, landmark=7, range=2.0, bearing=-0.5, covariance=EYE2)
    assert (post.stamp, post.landmark, post.range, post.bearing) == (1, 7, 2.0, -0.5)
    np.testing.assert_array_equal(post.covariance, EYE2)
    assert lf.RangeBearing(1, bearing=0.5).landmark is None
    assert repr(lf.RangeBearing(1, bearing=0.5)) == "RangeBearing(stamp=1, bearing=0.5)"
    with pytest.raises(ValueError, match="neither range nor bearing"):
        lf.RangeBearing(1, 7)


def test_a_message_cannot_be_changed() -> None:
    z = lf.Range(0, tag=0, anchor=1, range=2.0)
    with pytest.raises(AttributeError):
        z.range = -1.0  # type: ignore[misc]


def test_translation_then_rotation_is_equation_6_of_the_paper() -> None:
    u = lf.Increment.from_drive_then_turn(begin=0, stamp=1, trans=0.5, rot=0.25)
    assert (u.motion.x, u.motion.y, u.motion.heading) == (0.5, 0.0, 0.25)


MAKERS: dict[str, Callable[[float], Any]] = {
    "Velocity.forward": lambda v: lf.Velocity(0, v, 0.0),
    "Velocity.turn_rate": lambda v: lf.Velocity(0, 0.0, v),
    "Increment.motion.x": lambda v: lf.Increment(0, 1, lf.Pose2(v, 0, 0)),
    "Increment.motion.y": lambda v: lf.Increment(0, 1, lf.Pose2(0, v, 0)),
    "Increment.motion.heading": lambda v: lf.Increment(0, 1, lf.Pose2(0, 0, v)),
    "Range.range": lambda v: lf.Range(0, 0, 1, v),
    "Range.sigma": lambda v: lf.Range(0, 0, 1, 2.0, v),
    "PositionFix.position.x": lambda v: lf.PositionFix(0, [v, 0], EYE2),
    "PositionFix.position.y": lambda v: lf.PositionFix(0, [0, v], EYE2),
    "PositionFix.covariance": lambda v: lf.PositionFix(0, [0, 0], np.diag([1.0, v])),
    "PoseObservation.pose.x": lambda v: lf.PoseObservation(0, lf.Pose2(v, 0, 0), EYE3),
    "PoseObservation.pose.y": lambda v: lf.PoseObservation(0, lf.Pose2(0, v, 0), EYE3),
    "PoseObservation.pose.heading": lambda v: lf.PoseObservation(0, lf.Pose2(0, 0, v), EYE3),
    "PoseObservation.covariance": lambda v: lf.PoseObservation(
        0, lf.Pose2(), np.diag([1.0, 1.0, v])
    ),
    "RangeBearing.range": lambda v: lf.RangeBearing(0, 1, v, 0.0),
    "RangeBearing.bearing": lambda v: lf.RangeBearing(0, None, None, v),
    "RangeBearing.covariance": lambda v: lf.RangeBearing(0, None, 1, 1, np.diag([1.0, v])),
}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        (field, value)
        for field in MAKERS
        for value in NOT_FINITE
        # An infinite variance says that this was not measured.
        if value != math.inf
        or field not in ("PositionFix.covariance", "PoseObservation.covariance")
    ],
)
def test_a_number_that_is_not_finite_is_refused_by_name(field: str, value: float) -> None:
    MAKERS[field](0.5)
    with pytest.raises(ValueError, match=field.replace(".", r"\.")):
        MAKERS[field](value)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("Range.range", -0.001),
        ("Range.sigma", 0.0),
        ("Range.sigma", -0.1),
        ("PositionFix.covariance", 0.0),
        ("PositionFix.covariance", -1.0),
        ("PoseObservation.covariance", 0.0),
        ("PoseObservation.covariance", -1.0),
    ],
)
def test_a_number_out_of_bounds_is_refused_with_its_value(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field.replace(".", r"\.")) as caught:
        MAKERS[field](value)
    assert f"{value:g}" in str(caught.value)


def test_a_covariance_that_is_not_symmetric_or_not_definite_is_refused() -> None:
    for wrong in ([[1.0, 0.5], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]):
        with pytest.raises(ValueError, match="symmetric positive definite"):
            lf.PositionFix(0, [0, 0], wrong)


def test_a_motion_that_ends_before_it_begins_is_refused() -> None:
    with pytest.raises(ValueError, match="ends at 4 ns, before it begins at 5 ns"):
        lf.Increment(begin=5, stamp=4, motion=lf.Pose2())


def test_repr_names_every_field() -> None:
    assert repr(lf.Range(1, 2, 3, 4.5, 0.25)) == (
        "Range(stamp=1, tag=2, anchor=3, range=4.5, sigma=0.25)"
    )
    assert "forward=0.5" in repr(lf.Velocity(0, 0.5, 0.0))
    assert "begin=1" in repr(lf.Increment(1, 2, lf.Pose2()))
    assert "stamp=7" in repr(lf.PositionFix(7, [0, 0], EYE2))
    assert "stamp=7" in repr(lf.PoseObservation(7, lf.Pose2(), EYE3))
