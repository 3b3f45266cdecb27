# SPDX-License-Identifier: Apache-2.0
"""The picture of the verdicts: who was rejected stands in the right row at the right time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from locfuse.report import plot
from locfuse.report.plot.outcomes import TIME_BINS, VERDICT_COLOURS
from locfuse.report.plot.style import ESTIMATE_PALE, REJECTED
from locfuse.report.text import VERDICT_LABELS
from support_figures import corners, legend_of, texts
from support_results import make_result


def _bars(figure: Figure, colour: str) -> list[tuple[float, float, float, float]]:
    """Return the boxes (left, right, lowest, highest) of one colour."""
    boxes: list[tuple[float, float, float, float]] = []
    for collection in figure.axes[0].collections:
        assert isinstance(collection, PolyCollection)
        if np.allclose(np.asarray(collection.get_facecolor()), to_rgba(colour)):
            for polygon in corners(collection):
                (x0, y0), (x1, y1) = polygon.min(axis=0), polygon.max(axis=0)
                boxes.append((float(x0), float(x1), float(y0), float(y1)))
    return boxes


def test_rejections_are_drawn_in_the_row_of_the_anchor_when_they_happened() -> None:
    figure = plot.plot_outcomes(make_result(rejected={"A2": (3.0, 12.0)}))

    labels = figure.axes[0].get_yticklabels()
    assert [t.get_text() for t in labels] == ["anchor A1", "anchor A2", "anchor A3", "anchor A10"]
    assert [t.get_color() == REJECTED for t in labels] == [False, True, False, False]
    boxes = np.array(_bars(figure, REJECTED))
    assert boxes[:, 0].min() == pytest.approx(3.0, abs=0.1)
    assert boxes[:, 1].max() == pytest.approx(12.0, abs=0.1)
    assert (boxes[:, 2] > 0.5).all()  # row 1 lies between 0.5 and 1.5
    assert (boxes[:, 3] < 1.5).all()
    assert (boxes[:, 1] - boxes[:, 0]).sum() == pytest.approx(9.0, abs=0.2)
    assert texts(figure).count("45.0 %") == 1
    assert texts(figure).count("0.0 %") == 3


def test_height_of_a_mark_is_the_rejected_share_and_never_vanishes() -> None:
    result = make_result(n=60_000, anchors=("half", "one"))
    verdict = np.full(len(result.outcomes), "fused", dtype="<U16")
    half = np.flatnonzero(result.outcomes.anchor == "half")
    verdict[half[::2]] = "gated"
    verdict[np.flatnonzero(result.outcomes.anchor == "one")[777]] = "gated"
    figure = plot.plot_outcomes(replace(result, outcomes=replace(result.outcomes, verdict=verdict)))

    boxes = np.array(_bars(figure, REJECTED))
    height = boxes[:, 3] - boxes[:, 2]
    first, second = boxes[:, 3] < 0.5, boxes[:, 3] > 0.5
    assert height[first] == pytest.approx(np.full(TIME_BINS, 0.4))
    assert height[second] == pytest.approx([0.24])
    assert texts(figure).count("<0.1 %") == 1


def test_a_silent_anchor_leaves_a_gap_and_a_steady_one_none() -> None:
    result = make_result(n=300, anchors=("A",))
    kept = (np.arange(300) < 100) | (np.arange(300) >= 200)
    outcomes = replace(result.outcomes, **{k: v[kept] for k, v in vars(result.outcomes).items()})
    boxes = sorted(_bars(plot.plot_outcomes(replace(result, outcomes=outcomes)), ESTIMATE_PALE))

    gaps = [b[0] - a[1] for a, b in pairwise(boxes)]
    assert sum(gap > 1e-9 for gap in gaps) == 1
    assert max(gaps) == pytest.approx(10.0, abs=0.2)


def test_every_other_verdict_has_its_own_colour_and_name() -> None:
    result = make_result(n=10, anchors=("A",))
    others = [verdict for verdict in VERDICT_LABELS if verdict != "fused"]
    verdict = np.array([*["fused"] * (10 - len(others)), *others])
    figure = plot.plot_outcomes(replace(result, outcomes=replace(result.outcomes, verdict=verdict)))

    names = {VERDICT_LABELS[verdict] for verdict in others}
    assert set(legend_of(figure)) == {"message arrived", *names}
    for colour in VERDICT_COLOURS.values():
        assert len(_bars(figure, colour)) == 1


def test_a_run_without_messages_is_said_in_a_sentence() -> None:
    (text,) = plot.plot_outcomes(make_result(anchors=())).texts
    assert text.get_text() == "The run received no message."


def test_names_with_signs_of_formula_and_markup_are_drawn_as_they_are(tmp_path: Path) -> None:
    figure = plot.plot_outcomes(make_result(anchors=("$\\frac$", "<b>")))
    plot.save(figure, tmp_path / "x.png")
    names = [t.get_text() for t in figure.axes[0].get_yticklabels()]
    assert names == ["anchor $\\frac$", "anchor <b>"]
