# SPDX-License-Identifier: Apache-2.0
"""The picture of a layout: dilution as computed, marks named, one more anchor where it helps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import Layout, check
from locfuse.check.grid import known
from locfuse.config.load import parse_config
from locfuse.core import cramer_rao
from locfuse.report import plot
from locfuse.report.plot.style import ANCHOR, INK, REJECTED
from locfuse.types import FREE, OCCUPIED, UNKNOWN, FloatArray, GridMap
from support_figures import colours_at, legend_of, texts

SQUARE = {"A1": [0, 0, 0], "A2": [8, 0, 0], "A3": [8, 8, 0], "A4": [0, 8, 0]}


def layout_of(anchors: Mapping[str, Sequence[float]], **scenario: Any) -> Layout:
    data = {"room_m": [8, 8], "anchors": anchors, "duration_s": 10,
            "path": {"shape": "circle", "center_m": [4, 4], "radius_m": 2}, **scenario}  # fmt: skip
    layout = check(parse_config({"simulation": data})).layout
    assert layout is not None
    return layout


def mean_with(layout: Layout, at: FloatArray) -> float:
    """Return the mean dilution over the grid of the picture with one more anchor."""
    x, y = np.meshgrid(layout.x, layout.y)
    bound = cramer_rao(np.vstack([layout.anchors, at]), np.column_stack([x.ravel(), y.ravel()]),
                       1.0, layout.height)  # fmt: skip
    return float(np.minimum(np.sqrt(np.trace(bound, axis1=1, axis2=2)), 20.0).mean())


def test_dilution_is_one_in_the_middle_of_four_anchors_around() -> None:
    layout = layout_of(SQUARE)
    row, column = np.argmin(np.abs(layout.y - 4.0)), np.argmin(np.abs(layout.x - 4.0))
    assert layout.hdop[row, column] == pytest.approx(1.0, abs=1e-3)
    assert layout.hdop.shape == (len(layout.y), len(layout.x))


def test_dilution_is_infinite_on_the_line_of_two_anchors_and_finite_beside_it() -> None:
    layout = layout_of({"A1": [0, 0, 0], "A2": [8, 0, 0]})
    assert np.isinf(layout.hdop[0, 1:-1]).all()
    assert np.isfinite(layout.hdop[1:]).all()


@pytest.mark.parametrize(
    "anchors",
    [
        {k: SQUARE[k] for k in ("A1", "A2", "A3")},
        {"A1": [0, 0, 2], "A2": [8, 0, 2]},
        {"A1": [0, 1, 2.5], "A2": [8, 1, 2.5], "A3": [4, 2, 2.5], "A4": [2, 0, 2.5]},
    ],
)
def test_no_other_place_on_the_floor_helps_more_than_the_one_named(
    anchors: Mapping[str, Sequence[float]],
) -> None:
    layout = layout_of(anchors)
    best = mean_with(layout, layout.best)
    rng = np.random.default_rng(3)
    for place in rng.uniform([0, 0], [8, 8], (60, 2)):
        assert mean_with(layout, np.array([*place, layout.best[2]])) > best - 0.02
    assert layout.mean[1] < layout.mean[0]


def test_the_sentence_states_the_place_and_the_gain() -> None:
    layout = layout_of({"A1": [0, 0, 0], "A2": [8, 0, 0], "A3": [4, 1, 0]})
    said = layout.sentence()
    assert f"({layout.best[0]:.2f}, {layout.best[1]:.2f}, 0.00)" in said
    assert f"mean {layout.mean[0]:.2f} to {layout.mean[1]:.2f}" in said


def test_every_part_of_the_picture_is_named() -> None:
    fault = {"kind": "nlos", "walls": [[2, 4, 6, 4], [2, 5, 2, 7]], "extra_m": 0.2}
    figure = plot.plot_layout(layout_of(SQUARE, faults=[fault]))
    assert legend_of(figure) == ["wall", "truth", "hull of the anchors", "anchor",
                                 "best place for one more"]  # fmt: skip
    assert {"A1", "A2", "A3", "A4", "one more"} <= set(texts(figure))
    assert figure.axes[0].get_aspect() == 1.0
    assert "HDOP" in figure.axes[1].get_ylabel()


def test_marks_stand_where_the_anchors_are() -> None:
    layout = layout_of(SQUARE)
    axes = plot.plot_layout(layout).axes[0]
    marks = {
        str(line.get_markerfacecolor()): line
        for line in axes.lines
        if line.get_linestyle() == "None"
    }
    assert np.asarray(marks[ANCHOR].get_xdata()) == pytest.approx([0, 8, 8, 0])
    assert np.asarray(marks[REJECTED].get_ydata()) == pytest.approx([layout.best[1]])


def test_the_hull_closes_around_the_anchors() -> None:
    inner = {**SQUARE, "A5": [4, 4, 0]}
    figure = plot.plot_layout(layout_of(inner))
    (line,) = [line for line in figure.axes[0].lines if line.get_label() == "hull of the anchors"]
    x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
    assert sorted(zip(x[:-1], y[:-1], strict=True)) == [(0, 0), (0, 8), (8, 0), (8, 8)]
    assert (x[0], y[0]) == (x[-1], y[-1])


def test_a_map_is_drawn_and_moves_no_limit() -> None:
    cells = np.full((16, 16), FREE, np.int8)
    cells[:, :4] = UNKNOWN
    cells[0] = cells[-1] = OCCUPIED
    grid = GridMap(cells, 0.5)
    layout = layout_of(SQUARE)
    figure = plot.plot_layout(replace(layout, grid=grid))
    assert "occupied in the map" in legend_of(figure)
    assert figure.axes[0].get_xlim() == plot.plot_layout(layout).axes[0].get_xlim()
    assert known(grid, np.array([[1.0, 3.0], [3.0, 3.0], [9.0, 3.0]])).tolist() == [
        False, True, False]  # fmt: skip


def test_a_turned_map_is_drawn_where_it_lies() -> None:
    cells = np.full((16, 16), FREE, np.int8)
    cells[4] = OCCUPIED  # a wall 2.25 m to the north-west of the diagonal
    layout = replace(layout_of(SQUARE), grid=GridMap(cells, 0.5, (0.0, 0.0, np.pi / 4.0)))
    figure = plot.plot_layout(layout)
    x = np.array([0.5, 2.5, 3.5])
    assert colours_at(figure, np.column_stack([x, x + 2.25 * np.sqrt(2.0)])) == 3 * [INK]
    assert INK not in colours_at(figure, np.column_stack([x + 4.0, np.full(3, 2.25)]))


def test_layouts_that_fix_nothing_are_drawn_too(tmp_path: Path) -> None:
    for anchors in ({"A1": [4, 4, 0]}, {"A1": [1, 2, 3], "A2": [7, 2, 3], "A3": [5, 2, 3]}):
        plot.save(plot.plot_layout(layout_of(anchors)), tmp_path / "layout.png")
    assert (tmp_path / "layout.png").stat().st_size > 10000


def test_equal_layouts_give_equal_files(tmp_path: Path) -> None:
    for name in ("one.png", "two.png"):
        plot.save(plot.plot_layout(layout_of(SQUARE)), tmp_path / name)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
