# SPDX-License-Identifier: Apache-2.0
"""Picture of the anchors' layout: dilution of precision over the floor, best place for one more."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from locfuse.check.layout import Layout
from locfuse.report.decimation import stride
from locfuse.report.plot import style
from locfuse.report.plot.labels import Label, join_same_spot, place_labels
from locfuse.report.plot.world import box_around, draw_map, world_figure
from locfuse.report.text import short

_MAX_NAMED = 60
_MAX_POINTS = 20000
_STEPS = (0.7, 0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
_WIDE = 2.5  # ratio of dilutions from which the steps are those above

_PALE_TO_BLUE = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.7, 256)))


def plot_layout(layout: Layout) -> Figure:
    """Draw the horizontal dilution of precision over the floor, and what it comes from.

    The axes of the floor have equal scales, metres, and a bar of colours. Places where ranges fix
    no position, or to worse than 20 times a range, are darkest.
    """
    floor = np.array([[layout.x[0], layout.y[0]], [layout.x[-1], layout.y[-1]]])
    low, high = box_around(np.vstack([floor, layout.anchors[:, :2]]), 0.05, 0.3, 0.9)
    figure, axes = world_figure(low, high, 1.3, 0.8)
    axes.grid(visible=False)
    style.title(axes, f"Tag at {layout.height:g} m. One more anchor at {layout.gain()}")
    bar = figure.colorbar(_draw_dilution(axes, layout), ax=axes, shrink=0.85, pad=0.02)
    bar.set_label("error of a position / error of a range (HDOP)", fontsize=10)
    bar.ax.yaxis.set_major_formatter("{x:.3g}")
    bar.ax.tick_params(labelsize=9, color=style.MUTED, labelcolor=style.INK)
    handles = _draw_marks(axes, layout)
    style.legend(figure, handles)
    places = zip(layout.names, layout.anchors[:, :2], strict=True)
    labels = [Label(short(name), at, style.INK) for name, at in places]
    if len(labels) > _MAX_NAMED:
        labels = []
    labels.append(Label("one more", layout.best[:2], style.REJECTED))
    place_labels(figure, axes, join_same_spot(labels), layout.hull)
    return figure


def _draw_dilution(axes: Axes, layout: Layout) -> QuadContourSet:
    shown = np.ma.masked_invalid(np.minimum(layout.hdop, _STEPS[-1]))
    levels = _levels(shown)
    filled = axes.contourf(
        layout.x, layout.y, shown, levels=levels, cmap=_PALE_TO_BLUE, zorder=0, extend="neither",
        norm=BoundaryNorm(levels, 256),
    )  # fmt: skip
    lines = axes.contour(
        layout.x, layout.y, shown, levels=levels[1:-1], colors="white", linewidths=0.8, zorder=1
    )
    axes.clabel(lines, fmt="%g", fontsize=8, colors=style.INK, inline=True)
    return filled


def _levels(shown: np.ma.MaskedArray[Any, Any]) -> list[float]:
    """Return at least two rising numbers around all that is shown."""
    low, high = float(shown.min()), float(shown.max())
    if high > _WIDE * low or high >= _STEPS[-1]:
        inner = [step for step in _STEPS[:-1] if min(low, 5.0) < step < high]
        return [min(_rounded(low, -1), 5.0), *inner, min(_rounded(high, 1), _STEPS[-1])]
    ticks = MaxNLocator(5).tick_values(low, max(high, low + 0.02))
    return [float(np.round(tick, 6)) for tick in ticks]


def _rounded(value: float, way: int) -> float:
    """Return the next hundredth below (-1) or above (1) a value."""
    return float(np.floor(value * 100.0 + 0.5 * (1 + way) + 0.1 * way) / 100.0)


def _draw_marks(axes: Axes, layout: Layout) -> list[style.Handle]:
    handles: list[style.Handle] = []
    if layout.grid is not None:
        draw_map(axes, layout.grid, ("none", "none", style.INK), zorder=3)
        handles.append(Patch(facecolor=style.INK, label="occupied in the map"))
    for row, (x1, y1, x2, y2) in enumerate(layout.walls.tolist()):
        (line,) = axes.plot([x1, x2], [y1, y2], color=style.INK, lw=3.0, label="wall", zorder=3)
        handles += [line] if row == 0 else []
    if layout.path is not None and len(layout.path):
        path = layout.path[stride(len(layout.path), _MAX_POINTS)]
        dotted: dict[str, Any] = {"ls": (0, (1, 1.5)), "lw": 1.0, "color": style.INK}
        handles += axes.plot(*path.T, label="truth", zorder=4, **dotted)
    if len(layout.hull) > 2:
        ring = np.vstack([layout.hull, layout.hull[:1]])
        dashed: dict[str, Any] = {"ls": style.DASHED, "lw": 1.2, "color": style.ANCHOR}
        handles += axes.plot(
            *ring.T, label="hull of the anchors", zorder=5, clip_on=False, **dashed
        )
    anchors, best = layout.anchors[:, :2], layout.best[:2]
    handles += style.marks(axes, anchors, "^", 10, style.ANCHOR, "anchor", clip_on=False)
    text = "best place for one more"
    handles += style.marks(axes, best, "*", 16, style.REJECTED, text, clip_on=False)
    return handles
