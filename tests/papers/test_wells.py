# SPDX-License-Identifier: Apache-2.0
"""wells: cylinders determine position and heading; one beam and the wheels' heading do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from papers.wells import draw_figures, wells_claims
from papers.wells.experiments import FINER, by_arc, by_beam, drive_both


def rmse(position: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.sum((position - truth[:, :2]) ** 2, axis=1))))


@pytest.mark.parametrize("slip", [False, True])
def test_cylinders_localize_the_robot_whatever_the_odometry(slip: bool) -> None:
    drive = drive_both(3, slip=slip)
    two = drive.cylinders >= 2
    assert 0.3 < np.mean(two) < 0.9
    assert rmse(drive.ours[two, :2], drive.truth[two]) < 0.003
    assert rmse(drive.ours[:, :2], drive.truth) < (0.02 if slip else 0.01)
    turned = np.abs(np.rad2deg(drive.odometry[-1, 2] - drive.truth[-1, 2]))
    assert (min(turned, 360.0 - turned) > 40.0) == slip


def test_the_papers_method_errs_by_its_beam_and_its_heading() -> None:
    clean, slipping = drive_both(3, slip=False), drive_both(3, slip=True)
    assert rmse(clean.laser, clean.truth) > 5.0 * rmse(clean.ours[:, :2], clean.truth)
    assert rmse(slipping.paper[:, :2], slipping.truth) > 1.0


def test_the_arc_and_not_finer_beams_mends_the_laser() -> None:
    """One beam's error is noise: the minimum of many ranges is any of those near the middle."""
    exact, one, fine, arc = by_beam(2, noisy=False), by_beam(2), by_beam(2, FINER), by_arc(2)
    assert exact < 0.02
    assert one > 0.05
    assert fine > 0.5 * one
    assert arc < 0.005


def test_claims_and_pictures(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    claims = wells_claims(2, lambda done, total: steps.append((done, total)))
    assert steps[-1] == (4, 4)
    assert {claim.id for claim in claims} >= {"wells", "wells_heading", "wells_spoilt_two"}
    assert all(claim.met for claim in claims if not claim.id.endswith("_nees"))
    for path in draw_figures(tmp_path):
        assert path.stat().st_size > 20_000
