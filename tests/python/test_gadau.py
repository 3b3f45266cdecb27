# SPDX-License-Identifier: Apache-2.0
"""gadau2022: three landmarks are enough from a wrong start; the paper's mistakes are not ours."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse import gadau


@pytest.mark.parametrize("layout", ["triangle", "square, near", "five, far"])
def test_three_landmarks_and_more_find_the_pose_from_a_wrong_start(layout: str) -> None:
    runs = [gadau.microsimulation(layout, "circle", seed) for seed in range(5)]
    assert all(run.converged_s() < 5.0 for run in runs)
    assert max(run.off_m[-1] for run in runs) < 0.1


def test_one_landmark_does_not_tell_where_around_it_the_robot_is() -> None:
    runs = [gadau.microsimulation("one", "circle", seed) for seed in range(5)]
    assert np.median([run.off_m[100] for run in runs]) > 0.2


def test_the_derivatives_of_the_paper_diverge_from_the_right_start() -> None:
    right = gadau.microsimulation("square, near", "circle", 1, wrong=False)
    theirs = gadau.microsimulation("square, near", "circle", 1, wrong=False, mistake="derivatives")
    surface = gadau.microsimulation("square, near", "circle", 1, wrong=False, mistake="surface")
    assert right.off_m.max() < 0.1
    assert theirs.off_m.max() > 10.0
    assert surface.nees > 10.0


@pytest.mark.parametrize("speed_mps", gadau.SPEEDS)
def test_discs_seen_by_rays_never_let_it_diverge(speed_mps: float) -> None:
    run = gadau.ray_simulation("5", speed_mps, 1)
    assert run.off_m.max() < 0.05


def test_claims_tell_progress() -> None:
    told: list[tuple[int, int]] = []
    claims = gadau.gadau_claims(2, lambda done, total: told.append((done, total)))
    assert told[-1][0] == told[-1][1] == len(told) - 1
    assert len({claim.id for claim in claims}) == len(claims)
