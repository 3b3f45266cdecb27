# SPDX-License-Identifier: Apache-2.0
"""Picture of the verdicts: which anchor or source was rejected when."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from locfuse.eval.verdicts import MessageRow, message_rows
from locfuse.report.plot import style
from locfuse.report.text import VERDICT_LABELS, count, percent, seconds, short, start_ns
from locfuse.types import NANOSECONDS, FloatArray, RunResult, StampArray

VERDICT_COLOURS = {
    "gated": style.REJECTED,
    "not_modelled": "#CC79A7",
    "stale": "#E69F00",
    "ignored": "#8c8c8c",
    "implausible": "#0072B2",
}
TIME_BINS = 600

_MIN_BAR = 0.3


def plot_outcomes(result: RunResult) -> Figure:
    """Draw which messages were rejected when: one row per anchor or source.

    Time runs to the right. Pale: messages arrived. Strong: some were not fused; the height is their
    share in that slice of time (at least 30 % of the row, so that a single one is seen). At the
    right of each row stand the rejected share and the number of messages. Lines across all rows:
    UWB took over from scans.
    """
    rows = message_rows(result.outcomes)
    if not rows:
        return style.sentence("The run received no message.")
    figure = style.new_figure(0.34 * len(rows) + 1.6)
    axes = figure.add_subplot()
    style.dress(axes)
    axes.grid(visible=False, axis="y")
    first, last = int(result.outcomes.stamp_ns.min()), int(result.outcomes.stamp_ns.max())
    last = max(last, first + NANOSECONDS)
    seen: set[str] = set()
    for level, row in enumerate(rows):
        seen |= _draw_row(axes, level, row, first, last, start_ns(result))
        colour = style.REJECTED if row.suspect else style.INK if row.rejected else style.MUTED
        _beside(axes, level, 58, percent(row.rejected_share), colour, bold=row.suspect)
        _beside(axes, level, 118, count(len(row.stamp_ns)), style.MUTED)
    _beside(axes, -0.75, 58, "rejected", style.MUTED)
    _beside(axes, -0.75, 118, "messages", style.MUTED)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_yticks(range(len(rows)))
    axes.set_yticklabels([short(row.label) for row in rows], parse_math=False)
    axes.tick_params(axis="y", length=0)
    for name, row in zip(axes.get_yticklabels(), rows, strict=True):
        if row.suspect:
            name.set_color(style.REJECTED)
            name.set_fontweight("bold")
    style.time_axis(axes, seconds(np.array([first, last]), start_ns(result)))
    handles: list[style.Handle] = [Patch(facecolor=style.ESTIMATE_PALE, label="message arrived")]
    switched = result.outcomes.stamp_ns[result.outcomes.source == "switch"]
    for at in seconds(switched, start_ns(result)).tolist():
        mark = axes.axvline(at, color=style.ANCHOR, lw=1.6, label="UWB took over")
        handles[1:] = [mark]
    handles += [
        Patch(facecolor=colour, label=VERDICT_LABELS[verdict])
        for verdict, colour in VERDICT_COLOURS.items()
        if verdict in seen
    ]
    style.legend(figure, handles)
    return figure


def _draw_row(
    axes: Axes, level: int, row: MessageRow, first_ns: int, last_ns: int, origin_ns: int
) -> set[str]:
    """Draw one row; return the verdicts other than fused that it shows."""
    slices = (row.stamp_ns - first_ns) * TIME_BINS // (last_ns - first_ns + 1)
    arrived = np.bincount(slices, minlength=TIME_BINS)
    left_s, right_s = _slice_edges(row.stamp_ns, first_ns, last_ns, arrived)
    shift_s = (first_ns - origin_ns) / NANOSECONDS
    left_s, right_s = left_s + shift_s, right_s + shift_s
    base = np.full(TIME_BINS, level + 0.4)
    whole = np.full(TIME_BINS, 0.8)
    _bars(axes, arrived > 0, left_s, right_s, base, whole, style.ESTIMATE_PALE)
    seen: set[str] = set()
    for verdict, colour in VERDICT_COLOURS.items():
        members = np.bincount(slices[row.verdict == verdict], minlength=TIME_BINS)
        if not members.any():
            continue
        seen.add(verdict)
        share = members / np.maximum(arrived, 1)
        share = np.where(members > 0, np.maximum(share, _MIN_BAR), 0.0)
        height = np.minimum(0.8 * share, base - (level - 0.4))
        _bars(axes, members > 0, left_s, right_s, base, height, colour)
        base = base - height
    return seen


def _slice_edges(
    stamp_ns: StampArray, first_ns: int, last_ns: int, arrived: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return where the slices of a row begin and end, seconds after `first_ns`.

    A slice with a message reaches to the next one with a message if that comes on time, so a
    steady source is one block and a silence is a gap.
    """
    step = (last_ns - first_ns + 1) / NANOSECONDS / TIME_BINS
    left: FloatArray = np.arange(TIME_BINS, dtype=np.float64) * step
    right: FloatArray = left + step
    intervals = np.diff(stamp_ns)
    intervals = intervals[intervals > 0]
    if len(intervals):
        on_time = 1.6 * float(np.median(intervals)) / NANOSECONDS
        at = np.flatnonzero(arrived)
        following = np.append(left[at[1:]], left[at[-1]] + on_time)
        late = following - left[at] > on_time + step
        right[at] = np.where(late, left[at] + np.maximum(step, on_time / 1.6), following)
    return left, right


def _bars(
    axes: Axes,
    chosen: NDArray[np.bool_],
    left_s: FloatArray,
    right_s: FloatArray,
    base: FloatArray,
    height: FloatArray,
    colour: str,
) -> None:
    """Fill time slices with bars that grow from `base` upwards in a picture whose y points down."""
    at = np.flatnonzero(chosen)
    x0, x1 = left_s[at], right_s[at]
    y0, y1 = base[at], base[at] - height[at]
    corners = np.stack([x0, y0, x0, y1, x1, y1, x1, y0], axis=1).reshape(-1, 4, 2)
    # Without smoothing neighbours join seamlessly; a slice is wider than a pixel, so none is lost.
    axes.add_collection(
        PolyCollection(list(corners), facecolors=colour, linewidths=0, antialiaseds=False),
        autolim=False,
    )


def _beside(
    axes: Axes, level: float, offset: float, text: str, colour: str, *, bold: bool = False
) -> None:
    """Write right-aligned text `offset` points right of the axes at the height of a row."""
    axes.annotate(
        text,
        (1.0, level),
        xycoords=axes.get_yaxis_transform(),
        xytext=(offset, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=9,
        color=colour,
        fontweight="bold" if bold else "normal",
        annotation_clip=False,
    )
