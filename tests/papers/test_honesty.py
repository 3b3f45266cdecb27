# SPDX-License-Identifier: Apache-2.0
"""How honest a run was: what its errors say of its covariance, its levels and its health."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.run.run import run
from locfuse.types import RunResult
from papers.consistency.recordings import READY, honesty, recorded_claims

SETTINGS = {
    "odometry": {"sigma_lateral_per_sqrt_m": 0.01},
    "range": {"sigma_m": 0.1, "sigma_relative": 0.015},
}


@pytest.fixture(scope="module")
def drive() -> RunResult:
    return run(parse_config({"simulation": {"duration_s": 60, "poses": None}, "seed": 3,
                             "estimator": SETTINGS}))  # fmt: skip


def test_a_run_by_its_own_noise_is_honest(drive: RunResult) -> None:
    found = honesty(drive)
    assert found.dof == 3
    assert 0.5 < found.nees < 5.0
    assert found.beyond < 1.5
    assert found.sure < 2.0


def test_a_reference_that_goes_elsewhere_for_a_while_is_seen(drive: RunResult) -> None:
    """The wrong variant: a metre off for 15 of 60 s, of which nothing tells the filter."""
    assert drive.truth is not None
    seconds = (drive.truth.stamp_ns - drive.truth.stamp_ns[0]) / 1e9
    off = ((seconds >= 30.0) & (seconds < 45.0)).astype(float)
    moved = drive.truth.position + off[:, None] * np.array([1.0, 0.0])
    found = honesty(replace(drive, truth=replace(drive.truth, position=moved)))
    assert found.beyond == pytest.approx(25.0, abs=1.5)
    assert found.sure == pytest.approx(25.0, abs=2.0)
    assert found.longest_s == pytest.approx(15.0, abs=0.2)
    assert found.nees > 20.0


def test_without_headings_two_components_count(drive: RunResult) -> None:
    assert drive.truth is not None
    assert honesty(replace(drive, truth=replace(drive.truth, heading=None))).dof == 2


def test_recordings_that_are_not_there_are_said(tmp_path: Path) -> None:
    for name in READY:
        (tmp_path / f"{name}.yaml").write_text("log: {dataset: plaza, path: nowhere}\n")
    claims = recorded_claims(lambda done, total: None, tmp_path)
    assert len(claims) > len(READY)
    assert all(claim.met is None and claim.note for claim in claims)
