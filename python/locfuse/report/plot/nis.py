# SPDX-License-Identifier: Apache-2.0
"""Picture of the normalised innovation squared (NIS) over time, against its chi-square band."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from locfuse.eval.consistency import band, share_in_band
from locfuse.eval.verdicts import source_rank
from locfuse.report.decimation import keep_cloud
from locfuse.report.plot import style
from locfuse.report.text import VERDICT_LABELS, count, percent, seconds, start_ns
from locfuse.types import FloatArray, RunResult

_MEAN_BINS = 60
_MIN_PER_MEAN = 15


def plot_nis(result: RunResult) -> Figure:
    """Draw the normalised innovation squared of each source over time, with its 95 % band.

    One axes per source and number of degrees of freedom, logarithmic; values below an axes lie on
    its lower edge. A sentence instead if no message was compared with a prediction.
    """
    outcomes = result.outcomes
    compared = np.isfinite(outcomes.nis) & (outcomes.dof > 0)
    sources, dofs = outcomes.source[compared].tolist(), outcomes.dof[compared].tolist()
    groups = set(zip(sources, dofs, strict=True))
    if not groups:
        return style.sentence("No message was compared with a prediction, so there is no NIS.")
    figure, column = style.panels(len(groups), 2.5)
    time_s = seconds(outcomes.stamp_ns, start_ns(result))
    gated = outcomes.verdict == "gated"
    ordered = sorted(groups, key=lambda group: (source_rank(group[0]), *group))
    for axes, (source, dof) in zip(column, ordered, strict=True):
        member = compared & (outcomes.source == source) & (outcomes.dof == dof)
        nis, bad = outcomes.nis[member], gated[member]
        _draw(axes, time_s[member], nis, bad, dof)
        style.title(axes, _summary(source, dof, nis, bad))
    style.time_axis(column[-1], time_s[compared])
    figure.align_ylabels(column)
    handles: list[style.Handle] = [_dot(style.ESTIMATE, VERDICT_LABELS["fused"])]
    if (gated & compared).any():
        handles.append(_dot(style.REJECTED, VERDICT_LABELS["gated"]))
    dashed: dict[str, Any] = {"color": style.MUTED, "lw": 1.0, "ls": style.DASHED}
    handles.append(Line2D([], [], color=style.MEAN, lw=1.4, label="mean of fused"))
    handles.append(Line2D([], [], label="expected mean", **dashed))
    handles.append(Patch(facecolor=style.ESTIMATE_PALE, label="two-sided 95 % band"))
    style.legend(figure, handles)
    return figure


def _draw(
    axes: Axes, time_s: FloatArray, nis: FloatArray, gated: NDArray[np.bool_], dof: int
) -> None:
    low, high = band(dof)
    floor = low / 3.0
    axes.set_yscale("log")
    axes.axhspan(low, high, color=style.ESTIMATE_PALE, linewidth=0, zorder=0)
    axes.axhline(dof, color=style.MUTED, lw=1.0, ls=style.DASHED, zorder=1)
    good: dict[str, Any] = {"color": style.ESTIMATE, "ms": 2.2, "alpha": 0.65, "zorder": 2}
    bad: dict[str, Any] = {"color": style.REJECTED, "ms": 3.0, "alpha": 0.9, "zorder": 3}
    for chosen, look in ((~gated, good), (gated, bad)):
        rows = np.flatnonzero(chosen)
        rows = rows[keep_cloud(nis[rows], style.MAX_POINTS)]
        axes.plot(time_s[rows], np.maximum(nis[rows], floor), "o", mew=0, **look)
    axes.plot(*_binned_mean(time_s[~gated], nis[~gated]), color=style.MEAN, lw=1.4, zorder=4)
    axes.set_ylim(floor, max(3.0 * high, 1.6 * float(nis.max())))
    axes.set_ylabel("NIS")


def _summary(source: str, dof: int, nis: FloatArray, gated: NDArray[np.bool_]) -> str:
    low, high = band(dof)
    freedom = "1 degree of freedom" if dof == 1 else f"{dof} degrees of freedom"
    return (
        f"{source}, {freedom}: {percent(share_in_band(nis, dof))} of {count(len(nis))} inside the "
        f"band {low:.3g} to {high:.3g}, {percent(float(gated.mean()))} rejected"
    )


def _dot(colour: str, label: str) -> Line2D:
    return Line2D([], [], color=colour, ls="none", marker="o", markersize=5, label=label)


def _binned_mean(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of `values` in equal slices of time; empty slices give NaN, a gap."""
    slices = min(_MEAN_BINS, len(values) // _MIN_PER_MEAN)
    if slices < 2 or time_s.max() == time_s.min():
        return np.empty(0), np.empty(0)
    low, high = float(time_s.min()), float(time_s.max())
    width = (high - low) / slices
    at = np.minimum(((time_s - low) / width).astype(np.intp), slices - 1)
    members = np.bincount(at, minlength=slices)
    total = np.bincount(at, weights=values, minlength=slices)
    mean: FloatArray = np.where(members > 0, total / np.maximum(members, 1), np.nan)
    centre: FloatArray = low + (np.arange(slices, dtype=np.float64) + 0.5) * width
    return centre, mean
