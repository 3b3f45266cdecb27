# SPDX-License-Identifier: Apache-2.0
"""Picture of a survey: anchors and landmarks with their ellipses, the drive, the next stop."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from locfuse.report.decimation import stride
from locfuse.report.plot import style
from locfuse.report.plot.labels import Label, join_same_spot, place_labels
from locfuse.report.plot.path import draw_ellipse
from locfuse.report.plot.world import box_around, draw_map, drawable, world_figure
from locfuse.report.text import short
from locfuse.run.survey_result import SurveyResult
from locfuse.types import GridMap

_MAX_POINTS = 20000
_SIGMAS = 3.0


def plot_survey(result: SurveyResult, grid: GridMap | None = None) -> Figure:
    """Draw what a survey found, in its frame, metres, perhaps on a map.

    Ellipses are of three standard deviations. An anchor that may also be elsewhere has its other
    place hollow, and a dashed line between both; a star is where a further drive would help.
    """
    placed = [a for a in result.anchors if a.word != "not placed"]
    others = [a for a in placed if a.other is not None]
    way = result.estimate.position
    shown = [way, *(a.position[None, :2] for a in placed), result.landmarks.position,
             *(a.other[None, :2] for a in others if a.other is not None)]  # fmt: skip
    low, high = box_around(np.vstack(shown), 0.1, 0.4, 0.9)
    figure, axes = world_figure(low, high, 1.3)
    style.title(axes, result.frame[:1].upper() + result.frame[1:])
    if grid is not None:
        draw_map(axes, drawable(grid, (high - low)[0]))
        axes.grid(visible=False)
    handles: list[style.Handle] = []
    few = way[stride(len(way), _MAX_POINTS)]
    handles += axes.plot(*few.T, color=style.ESTIMATE, lw=1.2, label="drive", zorder=2)
    labels = []
    for a in placed:
        draw_ellipse(axes, a.position[:2], a.covariance[:2, :2], _SIGMAS, fill=False,
                     ec=style.ANCHOR, lw=1.2, zorder=3)  # fmt: skip
        labels.append(Label(f"{short(a.name)}: {a.word}", a.position[:2], style.INK))
    if placed:
        at = np.array([a.position[:2] for a in placed])
        handles += style.marks(axes, at, "^", 9, style.ANCHOR, "anchor, three sigma")
    for row, a in enumerate(others):
        assert a.other is not None
        ends = np.array([a.position[:2], a.other[:2]])
        axes.plot(*ends.T, ls=style.DASHED, color=style.MUTED, lw=1.0, zorder=1)
        axes.plot(*a.other[:2], "^", ms=9, mfc="none", mec=style.ANCHOR, zorder=3)
        if row == 0:
            handles.append(Line2D([], [], ls="", marker="^", ms=9, mfc="none", mec=style.ANCHOR,
                                  label="or here"))  # fmt: skip
    for name, at, P in zip(result.landmarks.name.tolist(), result.landmarks.position,
                           result.landmarks.covariance, strict=True):  # fmt: skip
        draw_ellipse(axes, at, P, _SIGMAS, fill=False, ec=style.MUTED, lw=1.0, zorder=3)
        labels.append(Label(short(name), at, style.MUTED))
    if len(result.landmarks):
        handles += style.marks(axes, result.landmarks.position, "o", 6, style.MUTED, "landmark")
    if result.stop is not None:
        text = "drive by here next"
        handles += style.marks(axes, result.stop, "*", 15, style.REJECTED, text)
    style.legend(figure, handles)
    place_labels(figure, axes, join_same_spot(labels), few)
    return figure
