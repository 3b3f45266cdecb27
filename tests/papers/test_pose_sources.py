# SPDX-License-Identifier: Apache-2.0
"""Poses of another localizer leave the EKF no worse than the better of its parts, and honest."""

from __future__ import annotations

import numpy as np
import pytest

from papers.consistency import pose_sources
from papers.consistency.pose_sources import (
    MAX_RATIO,
    NEES_BAND,
    SITUATIONS,
    Compared,
    compare,
    pose_source_claims,
    turned_map,
)

SEEDS = 6


def ratio_and_nees(runs: list[Compared]) -> tuple[float, float]:
    fused, poses, others = (
        float(np.sqrt(np.mean([getattr(run, of)[0] for run in runs])))
        for of in ("fused", "poses", "others")
    )
    return fused / min(poses, others), float(np.mean([run.nees for run in runs]))


@pytest.mark.parametrize("name", SITUATIONS)
def test_beside_four_anchors_poses_make_nothing_worse(name: str) -> None:
    ratio, nees = ratio_and_nees([compare(SITUATIONS[name], 4, seed) for seed in range(SEEDS)])
    assert ratio <= MAX_RATIO
    assert NEES_BAND[0] <= nees <= NEES_BAND[1]


@pytest.mark.parametrize(
    "name", ["errors of 5 s", "errors of 5 s, twice the stated", "map turned by a degree",
             "stamps 0.3 s late"]
)  # fmt: skip
def test_poses_that_are_fused_as_independent_do(name: str) -> None:
    runs = [compare(SITUATIONS[name], 4, seed, correlation_s=0.0) for seed in range(SEEDS)]
    ratio, nees = ratio_and_nees(runs)
    assert ratio > MAX_RATIO
    assert nees > NEES_BAND[1]


def test_rows_name_situation_anchors_and_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pose_sources, "SITUATIONS", {"turned": turned_map})
    monkeypatch.setattr(pose_sources, "DURATION_S", 30.0)
    rows = pose_source_claims(1, lambda done, total: None)
    assert [row.id for row in rows if "turned" in row.id] == [
        f"turned_{anchors}_{what}" for anchors in (2, 4) for what in ("ratio", "nees")
    ]
    assert sum("own_particles" in row.id for row in rows) == 6
    assert all(row.met is not None for row in rows)
