# SPDX-License-Identifier: Apache-2.0
"""A sweep in numbers and pictures, of rows whose figures are known beforehand."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.eval.intervals import mean_interval, median_interval, share_interval
from locfuse.eval.scores import LEVELS
from locfuse.report.plot.style import ESTIMATE, MUTED
from locfuse.report.plot.sweep import (
    draw_sweep,
    plot_against,
    plot_calibration,
    plot_cdfs,
    plot_nees,
)
from locfuse.sweep.summary import SLICES, calibration, groups_of, nees_band, score, summarize
from locfuse.sweep.table import Trials, trials_of
from locfuse.sweep.trial import COVERAGE, INSTANTS, Row, Trial, empty_row
from locfuse.sweep.vary import Axis
from support_figures import legend_of, line_of

GRID = Axis("a.grid", (0.1, 0.2, 0.4))
DRAW = Axis("a.draw", (), 0.01, 1.0, log=True)
WORD = Axis("a.word", ("left", "right"))
AXES = (GRID, DRAW, WORD)


def made(count: int, scale: float = 1.0, failing: int = 0) -> Trials:
    """Return trials whose position RMSE is that of the grid times 1 + k / count.

    NEES are of errors `scale` times as large as the covariance says; every `failing`-th one failed.
    """
    rng = np.random.default_rng(4)
    rows: list[Row] = []
    for k in range(count):
        values = (GRID.values[k % 3], DRAW.draw(1, k, 1), WORD.values[k % 2])
        row = empty_row(AXES, Trial(k, k, values))
        if failing and k % failing == 0:
            rows.append({**row, "error": "ValueError: broken", "wall_s": 0.1})
            continue
        nees = scale**2 * rng.chisquare(3, INSTANTS)
        row |= {"position_rmse_m": values[0] * (1 + k / count), "position_max_m": 1.0,
                "heading_rmse_deg": 2.0, "nees_mean": float(nees.mean()), "nees_dof": 3,
                "nees_at": nees.tolist(), "wall_s": 0.1}  # fmt: skip
        row |= COVERAGE
        rows.append(row)
    return trials_of(rows, AXES)


def test_scores_are_those_of_numpy_with_their_intervals() -> None:
    values = np.random.default_rng(0).normal(size=200)
    found = score(values)
    assert found["n"] == 200
    assert found["mean"] == pytest.approx(values.mean())
    assert (found["mean_low"], found["mean_high"]) == mean_interval(values)
    assert (found["median_low"], found["median_high"]) == median_interval(values)
    assert found["p05"] == pytest.approx(np.quantile(values, 0.05))
    assert score(values[:4])["median_low"] is None


def test_a_summary_says_what_the_rows_say() -> None:
    trials = made(60, failing=4)
    found = summarize(trials)
    assert found["trials"] == 60
    low, high = share_interval(15, 60)
    assert found["failed"] == {"count": 15, "share": 0.25, "low": low, "high": high,
                               "errors": {"ValueError: broken": 15}}  # fmt: skip
    assert found["scores"]["position_rmse_m"]["n"] == 45
    assert "recover_s" not in found["scores"]
    by_grid = found["by_key"]["a.grid"]
    assert [row["value"] for row in by_grid] == ["0.1", "0.2", "0.4"]
    for place, row in enumerate(by_grid):
        of = trials["position_rmse_m"][place::3]
        known = of[np.isfinite(of)]
        assert row["scores"]["position_rmse_m"]["median"] == pytest.approx(np.median(known))
        assert row["failed"]["count"] == 20 - len(known)
    assert [row["value"] for row in found["by_key"]["a.word"]] == ["left", "right"]
    json.dumps(found, allow_nan=False)


def test_draws_are_grouped_into_slices_that_hold_every_trial_once() -> None:
    trials = made(50)
    groups = groups_of(trials, DRAW)
    assert len(groups) == SLICES
    assert sorted(np.concatenate([group.rows for group in groups])) == list(range(50))
    assert max(len(g.rows) for g in groups) - min(len(g.rows) for g in groups) <= 1
    assert all(a.high <= b.low for a, b in pairwise(groups))
    assert len(groups_of(made(13), DRAW)) == 2
    assert len(groups_of(made(3), DRAW)) == 1


def test_the_nees_of_a_consistent_filter_is_in_its_band_and_of_others_it_is_not() -> None:
    for scale, least, most in ((1.0, 0.8, 1.0), (1.5, 0.0, 0.0), (0.6, 0.0, 0.0)):
        found = nees_band(made(200, scale))
        assert found is not None
        assert least <= found.inside <= most


def test_there_is_no_band_of_different_components() -> None:
    trials = made(4)
    mixed = np.array([2.0, 3.0, 3.0, 3.0])
    assert nees_band(Trials(AXES, {**trials.columns, "nees_dof": mixed})) is None


def test_the_calibration_is_the_mean_over_trials() -> None:
    points = calibration(made(20))
    assert [point["level"] for point in points] == list(LEVELS)
    assert [point["share"] for point in points] == pytest.approx(LEVELS)


@pytest.mark.parametrize("failing", [0, 1])
def test_pictures_are_drawn_of_what_there_is(tmp_path: Path, failing: int) -> None:
    paths = draw_sweep(made(30, failing=failing), tmp_path)
    expected = ["error_a_grid", "error_a_draw", "error_a_word", "cdf", "nees", "calibration"]
    assert [path.stem for path in paths] == ([] if failing else expected)
    assert all(path.stat().st_size > 10_000 for path in paths)


def test_the_picture_of_a_key_shows_each_trial_and_the_medians() -> None:
    trials = made(60)
    figure = plot_against(trials, GRID)
    assert figure is not None
    points = [line for line in figure.axes[0].lines if line.get_color() == MUTED]
    assert sum(len(np.asarray(line.get_ydata())) for line in points) == 60
    medians = [line for line in figure.axes[0].lines
               if line.get_color() == ESTIMATE and line.get_linestyle() == "-"]  # fmt: skip
    expected = [np.median(trials["position_rmse_m"][k::3]) for k in range(3)]
    assert np.asarray(medians[0].get_ydata()) == pytest.approx(expected)
    assert np.asarray(medians[0].get_xdata()) == pytest.approx(GRID.values)
    assert figure.axes[1].get_xlabel() == "a.grid"
    assert legend_of(figure)[0] == "a trial"


def test_the_picture_of_words_stands_them_side_by_side() -> None:
    figure = plot_against(made(20), WORD)
    assert figure is not None
    assert [label.get_text() for label in figure.axes[-1].get_xticklabels()] == ["left", "right"]


def test_failed_trials_keep_distributions_from_reaching_one() -> None:
    figure = plot_cdfs(made(60, failing=4))
    assert figure is not None
    tops = [float(np.asarray(line.get_ydata())[-1]) for line in figure.axes[0].lines]
    assert tops == pytest.approx([15 / 20] * 3)
    assert "25.0 % of them failed" in figure.axes[0].get_title(loc="left")
    assert legend_of(figure) == ["0.1", "0.2", "0.4"]


def test_the_picture_of_nees_shows_the_mean_of_the_trials() -> None:
    trials = made(40)
    figure = plot_nees(trials)
    assert figure is not None
    _, mean = line_of(figure, 0, ESTIMATE)
    assert mean == pytest.approx(trials["nees_at"].mean(axis=0))


def test_the_picture_of_calibration_shows_a_curve_for_each_value() -> None:
    figure = plot_calibration(made(40))
    assert figure is not None
    assert legend_of(figure) == ["as it says", "0.1", "0.2", "0.4"]
    curves: list[Any] = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert np.asarray(curves[0].get_ydata()) == pytest.approx(LEVELS)
