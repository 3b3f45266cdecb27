# SPDX-License-Identifier: Apache-2.0
"""gadau2022: three landmarks are enough from a wrong start; the paper's mistakes are not ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from locfuse.gadau import draw_pictures, gadau_claims, kidnapping
from locfuse.gadau.runs import microsimulation, ray_simulation
from locfuse.gadau.world import SPEEDS


@pytest.mark.parametrize("layout", ["triangle", "square, near", "five, far"])
def test_three_landmarks_and_more_find_the_pose_from_a_wrong_start(layout: str) -> None:
    runs = [microsimulation(layout, "circle", seed) for seed in range(5)]
    assert all(run.converged_s() < 5.0 for run in runs)
    assert max(run.off_m[-1] for run in runs) < 0.1


def test_one_landmark_does_not_tell_where_around_it_the_robot_is() -> None:
    runs = [microsimulation("one", "circle", seed) for seed in range(5)]
    assert np.median([run.off_m[100] for run in runs]) > 0.2


def test_the_derivatives_of_the_paper_diverge_from_the_right_start() -> None:
    right = microsimulation("square, near", "circle", 1, wrong=False)
    theirs = microsimulation("square, near", "circle", 1, wrong=False, mistake="derivatives")
    surface = microsimulation("square, near", "circle", 1, wrong=False, mistake="surface")
    assert right.off_m.max() < 0.1
    assert theirs.off_m.max() > 10.0
    assert surface.nees > 10.0


@pytest.mark.parametrize("speed_mps", SPEEDS)
def test_discs_seen_by_rays_never_let_it_diverge(speed_mps: float) -> None:
    run = ray_simulation("5", speed_mps, 1)
    assert run.off_m.max() < 0.05


def test_claims_tell_progress() -> None:
    told: list[tuple[int, int]] = []
    claims = gadau_claims(2, lambda done, total: told.append((done, total)))
    assert told[-1][0] == told[-1][1] == len(told) - 1
    assert len({claim.id for claim in claims}) == len(claims)


@pytest.mark.parametrize("world", list(kidnapping.WORLDS))
def test_a_robot_that_was_carried_off_notices_and_finds_itself_again(world: str) -> None:
    runs = [kidnapping.kidnap(world, seed) for seed in range(3)]
    assert max(run.noticed_s() for run in runs) <= kidnapping.NOTICED_S
    assert max(run.found_s() for run in runs) <= kidnapping.FOUND_S
    assert sum(run.false_alarms() for run in runs) == 0


def test_an_alarm_that_is_hard_of_hearing_shows() -> None:
    run = kidnapping.kidnap("triangle", 0, measurements_per_false_alarm=1e300)
    assert run.noticed_s() > kidnapping.NOTICED_S


def test_pictures_are_drawn(tmp_path: Path) -> None:
    paths = draw_pictures(tmp_path, 1)
    assert [path.stem for path in paths] == ["gadau_start", "gadau_mistakes", "gadau_kidnapped"]
    assert all(path.stat().st_size > 20_000 for path in paths)
