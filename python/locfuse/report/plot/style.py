# SPDX-License-Identifier: Apache-2.0
"""What the pictures have in common: sizes, axes, legends, files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from locfuse.report.palette import ANCHOR as ANCHOR
from locfuse.report.palette import ESTIMATE as ESTIMATE
from locfuse.report.palette import ESTIMATE_PALE as ESTIMATE_PALE
from locfuse.report.palette import GRID as GRID
from locfuse.report.palette import INK as INK
from locfuse.report.palette import MEAN as MEAN
from locfuse.report.palette import MUTED as MUTED
from locfuse.report.palette import REJECTED as REJECTED
from locfuse.report.palette import TRUTH as TRUTH
from locfuse.types import FloatArray

Handle: TypeAlias = Line2D | Patch

WIDTH_IN = 10.0
DASHED = (0, (4, 2))
MAX_POINTS = 4000  # of a line or cloud; a picture is 1300 pixels wide

_DPI = 130


def new_figure(height_in: float) -> Figure:
    """Return an empty figure of the common width with a constrained layout."""
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=_DPI)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.08)
    figure.set_facecolor("white")
    FigureCanvasAgg(figure)
    return figure


def sentence(text: str) -> Figure:
    """Return a figure with a sentence instead of a picture."""
    figure = new_figure(1.2)
    figure.text(0.5, 0.5, text, ha="center", va="center", fontsize=11, color=MUTED)
    return figure


def panels(count: int, each_in: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes one above the other over a common time axis."""
    figure = new_figure(each_in * count + 0.9)
    column = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axes in column:
        dress(axes)
    return figure, column


def marks(
    axes: Axes, at: FloatArray, marker: str, size: float, colour: str, label: str, **look: Any
) -> list[Line2D]:
    """Draw points (n, 2) as marks with a white edge, or as `look` says; return their handle."""
    look = {"mec": "white", "zorder": 8, **look}
    return axes.plot(*at.T, marker, ms=size, mfc=colour, ls="none", label=label, **look)


def dress(axes: Axes) -> None:
    """Give axes the common look."""
    axes.grid(visible=True, color=GRID, lw=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
    axes.tick_params(labelsize=9, color=MUTED, labelcolor=INK)
    axes.xaxis.label.set_fontsize(10)
    axes.yaxis.label.set_fontsize(10)


def title(axes: Axes, text: str) -> None:
    """Write the title of an axes literally: names may contain signs of formulas."""
    axes.set_title(text, loc="left", fontsize=9, color=INK, parse_math=False)


def time_axis(axes: Axes, time_s: FloatArray) -> None:
    """Label the time axis and end it where the data end."""
    axes.set_xlabel("time since start [s]")
    low, high = float(time_s.min()), float(time_s.max())
    margin = 0.01 * (high - low) if high > low else 0.5
    axes.set_xlim(low - margin, high + margin)


def legend(figure: Figure, handles: Sequence[Handle]) -> None:
    """Explain the marks below the picture."""
    figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=len(handles) if len(handles) <= 7 else 4,
        frameon=False,
        fontsize=9,
    )


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, without version marks, so that equal runs give equal files."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # shown as an empty box
        figure.savefig(path, format="png", dpi=_DPI, metadata={"Software": None})
