# SPDX-License-Identifier: Apache-2.0
"""A motion of one's own moves a belief: the closed form, what it depends on, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import locfuse.core as lf


def belief_of_three() -> tuple[lf.GaussianBelief, list[lf.Slot]]:
    belief = lf.GaussianBelief()
    slots = [belief.add(name, lf.SlotKind.SCALAR, np.array([mean]), np.array([[variance]]))
             for name, mean, variance in (("place", 1.0, 0.5), ("rate", 2.0, 0.2),
                                          ("lamp", 7.0, 0.3))]  # fmt: skip
    return belief, slots


def test_what_moves_is_as_the_closed_form_has_it_and_the_rest_stays() -> None:
    belief, (place, rate, _) = belief_of_three()
    F = np.array([[1.0, 0.1], [0.0, 0.9]])
    for _ in range(2):
        step = lf.BodyPropagation(F @ belief.x[:2], F, np.diag([0.01, 0.02]))
        lf.predict(belief, step, [place, rate])
    once = F @ np.diag([0.5, 0.2]) @ F.T + np.diag([0.01, 0.02])
    expected = F @ once @ F.T + np.diag([0.01, 0.02])
    np.testing.assert_allclose(belief.P[:2, :2], expected)
    np.testing.assert_allclose(belief.x, [*(F @ F @ [1.0, 2.0]), 7.0])
    np.testing.assert_allclose(belief.P[2], [0.0, 0.0, 0.3])


def test_a_motion_may_depend_on_what_it_does_not_move() -> None:
    belief, (place, rate, _) = belief_of_three()
    lf.predict(belief, lf.BodyPropagation([1.4], [[1.0, 0.2]], [[0.01]]), [place, rate])
    np.testing.assert_allclose(belief.x, [1.4, 2.0, 7.0])
    np.testing.assert_allclose(belief.P[:2, :2], [[0.5 + 0.04 * 0.2 + 0.01, 0.04], [0.04, 0.2]])


@pytest.mark.parametrize(("moved", "jacobian", "noise", "why"), [
    ([], np.empty((0, 0)), np.empty((0, 0)), "0 variables"),
    ([1.0, 2.0], np.eye(2)[:1], np.eye(2), "jacobian of 1 x 2"),
    ([1.0, 2.0], np.eye(2)[:, :1], np.eye(2), "jacobian of 2 x 1"),
    ([1.0], [[1.0]], np.eye(2), "noise of 2 x 2"),
    ([np.nan], [[1.0]], [[1.0]], "not finite"),
    ([1.0], [[np.inf]], [[1.0]], "not finite"),
    ([1.0], [[1.0]], [[np.inf]], "not finite"),
    ([1.0, 2.0], np.eye(2), [[1.0, 0.5], [0.0, 1.0]], "noise is not symmetric"),
    # Fused as it was, this left a belief of which no variance is negative that knows -3 of a - b.
    ([1.0, 2.0], np.eye(2), [[1.0, 5.0], [5.0, 1.0]], "positive semidefinite"),
    ([1.0, 2.0], np.eye(2), [[0.0, 1e-9], [1e-9, 1.0]], "positive semidefinite"),
    ([1.0], [[1.0]], [[-0.1]], "positive semidefinite"),
    # Symmetric but for 1e-9 of the largest number only.
    ([1.0, 2.0, 3.0], np.eye(3), [[1e20, 0, 0], [0, 1, 0.5], [0, 0, 1]], "not symmetric"),
])  # fmt: skip
def test_what_is_no_step_is_refused(
    moved: list[float], jacobian: list[list[float]], noise: list[list[float]], why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        lf.BodyPropagation(np.array(moved), np.array(jacobian), np.array(noise))


def test_noise_may_be_nothing_or_that_of_one_cause() -> None:
    cause = np.array([0.1, 1e-7, 3e5])
    for noise in (np.zeros((3, 3)), np.outer(cause, cause), np.diag([0.0, 1.0, 0.0])):
        np.testing.assert_array_equal(lf.BodyPropagation(cause, np.eye(3), noise).noise, noise)


def test_a_linearization_of_which_large_noise_hides_that_it_is_not_symmetric_is_refused() -> None:
    noise = np.array([[1e20, 0, 0], [0, 1, 0.5], [0, 0, 1]])
    with pytest.raises(ValueError, match="not symmetric positive definite"):
        lf.Linearization(np.zeros(3), np.eye(3), noise)


def test_slots_that_do_not_match_are_refused_and_change_nothing() -> None:
    belief, (place, rate, lamp) = belief_of_three()
    with pytest.raises(ValueError, match=r"slots|variables"):
        lf.predict(belief, lf.BodyPropagation([1.0], [[1.0]], [[0.1]]), [place, rate, lamp])
    with pytest.raises(lf.NumericalError):
        lf.predict(belief, lf.BodyPropagation([1.0], [[0.0]], [[0.0]]), [place])
    np.testing.assert_array_equal(belief.x, [1.0, 2.0, 7.0])
