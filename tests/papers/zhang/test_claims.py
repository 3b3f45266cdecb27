# SPDX-License-Identifier: Apache-2.0
"""The rows: what counts as found, that the methods rank as they should, and the pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from locfuse import _core
from locfuse.types import FloatArray
from papers.claims import Claim
from papers.zhang.claims import comparison_claims, line_claims
from papers.zhang.experiments import (
    METHODS,
    NEAR_RAD,
    Runs,
    compare,
    line_ekf,
    spreads,
    tracked_by_lines,
)
from papers.zhang.figures import Particles, draw_figures, plot_convergence, plot_particles
from papers.zhang.methods import tracking_settings
from papers.zhang.world import ITERATIONS, world

SEEDS = 6


@pytest.fixture(scope="module")
def claims() -> dict[str, Claim]:
    return {claim.id: claim for claim in comparison_claims(compare(SEEDS), spreads(2))}


def test_found_is_from_where_on_an_estimate_stays_right() -> None:
    errors = np.zeros((4, ITERATIONS, 2))
    errors[1, :7, 0] = 0.6
    errors[2, 20, 1] = 1.1 * NEAR_RAD
    errors[3, -1, 0] = 3.0
    runs = Runs(errors, np.zeros((4, ITERATIONS)))
    assert runs.converged().tolist() == [1.0, 8.0, 22.0, ITERATIONS + 1.0]


def test_the_papers_method_and_ours_find_what_standard_mcl_does_not(
    claims: dict[str, Claim],
) -> None:
    found, cost = (
        {name: claims[f"zhang_{name}_{what}"].ours_median or 0.0 for name in METHODS}
        for what in ("found_19", "cost")
    )
    assert found["standard"] < 50.0 <= min(found["paper"], found["ours"])
    assert 0.0 < cost["ours"] < cost["paper"]


def test_rows_are_numbers_with_names_of_their_own(claims: dict[str, Claim]) -> None:
    rows = json.loads(json.dumps([claim.row() for claim in claims.values()], allow_nan=False))
    assert len(rows) == 3 * (2 + 1 + 4 + 1 + 1)
    assert all(row["ours_low"] <= row["ours_median"] <= row["ours_high"] for row in rows)


def test_rows_break_where_nothing_is_found() -> None:
    lost = Runs(np.full((20, ITERATIONS, 2), 5.0), np.ones((20, ITERATIONS)))
    spread_m = {name: np.ones(2) for name in METHODS}
    rows = {c.id: c for c in comparison_claims(dict.fromkeys(METHODS, lost), spread_m)}
    assert rows["zhang_standard_found_19"].met
    for name in ("paper_found_19", "paper_iterations", "ours_found_10", "ours_iterations"):
        assert rows[f"zhang_{name}"].met is False


PAPER_M = 0.0034  # error of the paper's method in results/accuracy.md


def tracked(seeds: int) -> tuple[FloatArray, FloatArray]:
    """Return the errors [m] of `line_ekf` after `ITERATIONS`, and their NEES."""
    rows = []
    for seed in range(seeds):
        of = world(seed)
        lines = line_ekf(of, seed)
        for step in of.steps:
            lines.on(step)
        truth = of.steps[-1].truth
        rows.append([np.hypot(*(lines.estimate() - truth)[:2]), lines.nees(truth)])
    errors, nees = np.array(rows).T
    return errors, nees


def test_lines_in_each_particle_are_as_precise_as_the_papers_and_honest() -> None:
    errors, nees = tracked(40)
    precise, honest = list(line_claims(np.full(40, PAPER_M), errors, nees))[1:]
    assert precise.met
    assert honest.met


def test_lines_that_are_counted_twice_are_neither(monkeypatch: pytest.MonkeyPatch) -> None:
    def twice(seed: int) -> _core.MclConfig:
        config = tracking_settings(seed)
        config.proposal = _core.ScanProposal.LINE_EKF_PAPER
        return config

    monkeypatch.setattr("papers.zhang.experiments.tracking_settings", twice)
    errors, nees = tracked(40)
    precise, honest = list(line_claims(np.full(40, PAPER_M), errors, nees))[1:]
    assert precise.met is False
    assert honest.met is False


def test_rows_of_lines_are_those_of_their_runs() -> None:
    paper, errors, nees = tracked_by_lines(2)
    assert np.all(paper < 0.05)
    np.testing.assert_array_equal((errors, nees), tracked(2))


def test_pictures_are_drawn(tmp_path: Path) -> None:
    names = {path.name for path in draw_figures(tmp_path, SEEDS)}
    assert names == {"zhang_global.png", "zhang_error.png", "zhang_tracking.png"}
    assert all((tmp_path / name).stat().st_size > 10_000 for name in names)


def test_panels_show_every_particle_and_the_robot() -> None:
    of = world(0, people=0)
    shown = Particles("some", np.tile(of.start, (7, 1)), of.start)
    axes = plot_particles(of.grid, [[shown, shown]]).axes
    assert len(axes) == 2
    assert [len(np.asarray(line.get_xdata())) for line in axes[0].lines if
            line.get_marker() == "o"] == [7, 1]  # fmt: skip


def test_the_share_of_runs_that_found_the_robot_grows_to_its_end() -> None:
    errors = {name: np.full((4, ITERATIONS), 0.3) for name in METHODS.values()}
    converged = {name: np.array([2.0, 5.0, 9.0, 31.0]) for name in METHODS.values()}
    right = plot_convergence(errors, converged, 0.5).axes[1]
    assert np.asarray(right.lines[0].get_ydata())[-1] == 75.0
