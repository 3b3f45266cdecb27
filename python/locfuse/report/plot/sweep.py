# SPDX-License-Identifier: Apache-2.0
"""Pictures of a sweep: errors against a varied key, their distributions, NEES, calibration."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

from locfuse.eval.intervals import median_interval
from locfuse.eval.scores import LEVELS
from locfuse.io.whole import whole_file
from locfuse.report.decimation import keep_cloud
from locfuse.report.plot import style
from locfuse.report.text import count, percent, short
from locfuse.sweep.summary import Group, calibration, groups_of, known, nees_band
from locfuse.sweep.table import Trials
from locfuse.sweep.vary import Axis
from locfuse.types import FloatArray

ERRORS = (("position_rmse_m", "position RMSE [m]"), ("heading_rmse_deg", "heading RMSE [deg]"))
CURVES = (
    style.ESTIMATE,
    style.REJECTED,
    style.ANCHOR,
    "#CC79A7",
    "#E69F00",
    style.INK,
    "#56B4E9",
    style.MUTED,
)
MAX_CURVES = len(CURVES)  # of values with a curve each
_MAX_TICKS = 12
_WIDE = 4.0  # ratio of errors from which their axis is logarithmic


def draw_sweep(trials: Trials, folder: Path) -> list[Path]:
    """Draw the pictures of a sweep into a folder; return their paths.

    `folder` is created if missing.
    """
    drawn = {f"error_{re.sub(r'[^0-9A-Za-z]+', '_', axis.key)}": plot_against(trials, axis)
             for axis in trials.axes}  # fmt: skip
    drawn |= {"cdf": plot_cdfs(trials), "nees": plot_nees(trials),
              "calibration": plot_calibration(trials)}  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in drawn.items():
        if figure is not None:
            paths.append(folder / f"{name}.png")
            with whole_file(paths[-1]) as part:
                style.save(figure, part)
    return paths


def plot_against(trials: Trials, axis: Axis) -> Figure | None:
    """Draw errors against a varied key: median with its interval, spread, each trial as a point.

    `axis` is one of the trials' own. Numbers stand at their values, texts side by side. None if no
    trial has an error.
    """
    shown = [(name, label) for name, label in ERRORS if len(known(trials, name))]
    if not shown:
        return None
    figure, column = style.panels(len(shown), 2.9)
    groups = groups_of(trials, axis)
    for axes, (name, label) in zip(column, shown, strict=True):
        _draw_against(axes, trials, groups, name)
        axes.set_ylabel(label)
        _scale(axes.yaxis, known(trials, name))
    _key_axis(column[-1], axis, groups)
    figure.align_ylabels(column)
    slices = f"{len(groups)} slices of {axis.key} with equally many trials"
    style.title(column[0], _trial_counts(trials, f"by {axis.key}" if axis.values else slices))
    style.legend(figure, [
        Line2D([], [], color=style.MUTED, ls="none", marker="o", ms=4, alpha=0.6, label="a trial"),
        Patch(facecolor=style.ESTIMATE_PALE, label="5 % to 95 % of the trials"),
        Line2D([], [], color=style.ESTIMATE, lw=1.6, marker="o", ms=4,
               label="median and its 95 % interval"),
    ])  # fmt: skip
    return figure


def _key_axis(axes: Axes, axis: Axis, groups: Sequence[Group]) -> None:
    """Label the axis of a key."""
    axes.set_xlabel(axis.key, parse_math=False)
    if axis.kind == "string":
        axes.set_xticks(range(len(groups)), [short(g.label) for g in groups], parse_math=False)
        axes.set_xlim(-0.6, len(groups) - 0.4)
        return
    if axis.log:
        axes.set_xscale("log")
        _plain(axes.xaxis)
    if axis.values and len(groups) <= _MAX_TICKS:
        axes.set_xticks([g.low for g in groups], [f"{g.low:.3g}" for g in groups])
        axes.xaxis.set_minor_locator(NullLocator())


def _plain(axis: XAxis | YAxis) -> None:
    """Label a logarithmic axis with plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _scale(axis: XAxis | YAxis, values: FloatArray) -> None:
    """Choose the axis of errors: logarithmic where a linear one hides the small ones."""
    low, high = np.quantile(values, [0.05, 1.0])
    name = axis.axis_name
    if low > 0.0 and high / low > _WIDE:
        axis.axes.set(**{f"{name}scale": "log"})
        _plain(axis)
    else:
        axis.axes.set(**{f"{name}lim": (0.0, None)})


def _draw_against(axes: Axes, trials: Trials, groups: Sequence[Group], name: str) -> None:
    middle, found = [], []
    for place, group in enumerate(groups):
        some = trials.some(group.rows)
        values = known(some, name)
        if len(values) == 0:
            continue
        at = np.full(len(values), float(place))
        if np.isfinite(group.low):
            at = some[group.axis.key][np.isfinite(some[name])].astype(np.float64)
        middle.append(float(np.median(at)))
        found.append(values)
        rows = keep_cloud(values, style.MAX_POINTS // len(groups))
        axes.plot(_spread(at, groups)[rows], values[rows], ls="none", marker="o", ms=2.4, mew=0,
                  color=style.MUTED, alpha=0.5, zorder=2)  # fmt: skip
        low, high = np.quantile(values, [0.05, 0.95])
        if np.isnan(group.low) or group.low == group.high:
            axes.errorbar(middle[-1], low, [[0.0], [high - low]], fmt="none", elinewidth=16,
                          ecolor=style.ESTIMATE_PALE, zorder=1)  # fmt: skip
        else:
            axes.fill_between([group.low, group.high], low, high, color=style.ESTIMATE_PALE, lw=0,
                              zorder=1)  # fmt: skip
    x, median = np.array(middle), np.array([np.median(values) for values in found])
    ends = [median_interval(v) or (m, m) for v, m in zip(found, median, strict=True)]
    below, above = np.array(ends).T
    words = all(np.isnan(group.low) for group in groups)
    axes.errorbar(x, median, [median - below, above - median], fmt="o" if words else "o-", ms=4,
                  color=style.ESTIMATE, lw=1.6, capsize=4, zorder=4)  # fmt: skip


def _spread(at: FloatArray, groups: Sequence[Group]) -> FloatArray:
    """Move points sideways that would hide one another."""
    if not groups[0].axis.values or len(at) < 2:
        return at
    aside = np.linspace(-1.0, 1.0, len(at))
    if np.isnan(groups[0].low):
        return at + 0.022 * aside
    low, high = min(g.low for g in groups), max(g.high for g in groups)
    if groups[0].axis.log:
        return at * (high / low) ** (0.005 * aside)
    return at + 0.005 * (high - low) * aside


def plot_cdfs(trials: Trials) -> Figure | None:
    """Draw the cumulative distributions of the errors over trials.

    Position RMSE, largest position error and heading RMSE, a curve for each value of the first key
    with up to eight of them. Trials that failed count as larger than anything. None if no trial has
    an error.
    """
    scores = (("position_rmse_m", "position RMSE [m]"),
              ("position_max_m", "largest position error [m]"),
              ("heading_rmse_deg", "heading RMSE [deg]"))  # fmt: skip
    shown = [(name, label) for name, label in scores if len(known(trials, name))]
    if not shown:
        return None
    curves, of = _curves(trials)
    figure = style.new_figure(4.2)
    row = list(figure.subplots(1, len(shown), sharey=True, squeeze=False)[0])
    handles: list[style.Handle] = []
    for axes, (name, label) in zip(row, shown, strict=True):
        style.dress(axes)
        handles = []
        for (text, some), color in zip(curves, CURVES, strict=False):
            values = np.sort(known(some, name))
            share = np.arange(1, len(values) + 1) / len(some)
            axes.step(values, share, where="post", color=color, lw=1.5)
            handles.append(Line2D([], [], color=color, lw=1.5, label=short(text)))
        _scale(axes.xaxis, known(trials, name))
        axes.set_xlabel(label)
        axes.set_ylim(0.0, 1.02)
    row[0].set_ylabel("share of trials")
    style.title(row[0], _trial_counts(trials, of))
    style.legend(figure, handles)
    return figure


def _curves(trials: Trials) -> tuple[list[tuple[str, Trials]], str]:
    """Return the trials of each curve with its label, and what the curves are split by."""
    for axis in trials.axes:
        groups = groups_of(trials, axis)
        if axis.values and 1 < len(groups) <= MAX_CURVES:
            named = [(group.label, trials.some(group.rows)) for group in groups]
            return [(text, some) for text, some in named if len(some)], f"by {axis.key}"
    return [("all trials", trials)], ""


def plot_nees(trials: Trials) -> Figure | None:
    """Draw the mean NEES of all trials over the drive, against the band of consistent ones.

    None if no trial has a NEES.
    """
    found = nees_band(trials)
    if found is None:
        return None
    figure, (axes,) = style.panels(1, 2.7)
    share = np.linspace(0.0, 100.0, len(found.mean))
    axes.axhspan(found.low, found.high, color=style.ESTIMATE_PALE, lw=0, zorder=0)
    axes.axhline(found.dof, color=style.MUTED, lw=1.0, ls=style.DASHED, zorder=1)
    axes.plot(share, found.mean, "o-", color=style.ESTIMATE, lw=1.4, ms=4, zorder=3)
    if found.mean.max() > 10.0 * found.dof:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
    else:
        axes.set_ylim(0.0, 1.15 * max(float(found.mean.max()), found.high))
    axes.set_xlabel("part of the drive [%]")
    axes.set_ylabel("mean NEES")
    inside = round(found.inside * len(found.mean))
    where = f"band {found.low:.3g} to {found.high:.3g}, where 95 % should be"
    instants = f"{inside} of {len(found.mean)} instants inside the {where}"
    style.title(axes, f"{count(found.trials)} trials: {instants}")
    style.legend(figure, [
        Line2D([], [], color=style.ESTIMATE, lw=1.4, marker="o", ms=4, label="mean over trials"),
        Line2D([], [], color=style.MUTED, lw=1.0, ls=style.DASHED, label="expected"),
        Patch(facecolor=style.ESTIMATE_PALE, label="two-sided 95 % band of the mean"),
    ])  # fmt: skip
    return figure


def plot_calibration(trials: Trials) -> Figure | None:
    """Draw which share of errors is inside the ellipsoid that should hold a nominal share.

    A curve for each value of the first key with up to eight of them; above the diagonal the
    covariance is too large, below it too small. None if no trial has a covariance to judge.
    """
    if not calibration(trials):
        return None
    curves, of = _curves(trials)
    figure, (axes,) = style.panels(1, 3.7)
    axes.plot([0, 1], [0, 1], color=style.MUTED, lw=1.0, ls=style.DASHED, zorder=1)
    handles: list[style.Handle] = [
        Line2D([], [], color=style.MUTED, lw=1.0, ls=style.DASHED, label="as it says")
    ]
    lowest = 0.4
    for place, ((text, some), color) in enumerate(zip(curves, CURVES, strict=False)):
        points = calibration(some)
        if not points:
            continue
        level, share, low, high = (
            np.array([point[key] for point in points]) for key in ("level", "share", "low", "high")
        )
        lowest = min(lowest, float(low.min()))
        level = level + 0.003 * (place - 0.5 * (len(curves) - 1))  # so that intervals are seen
        axes.errorbar(level, share, [share - low, high - share], fmt="o-", ms=4, lw=1.4, capsize=3,
                      color=color, zorder=3)  # fmt: skip
        handles.append(Line2D([], [], color=color, lw=1.4, marker="o", ms=4, label=short(text)))
    axes.set_xlim(0.45, 1.02)
    axes.set_ylim(lowest - 0.03, 1.03)
    axes.set_xticks(LEVELS, [f"{100 * level:g}" for level in LEVELS])
    axes.yaxis.set_major_formatter(lambda value, place: f"{100 * value:g}")
    axes.set_xlabel("errors that should be inside [%]")
    axes.set_ylabel("errors that are [%]")
    for x, y, side, text in ((0.02, 0.9, "left", "large"), (0.98, 0.05, "right", "small")):
        axes.text(x, y, f"covariance too {text}", fontsize=9, color=style.MUTED, ha=side,
                  transform=axes.transAxes)  # fmt: skip
    style.title(axes, _trial_counts(trials, of))
    style.legend(figure, handles)
    return figure


def _trial_counts(trials: Trials, of: str) -> str:
    failed = int(trials.failed.sum())
    ended = f", {percent(failed / len(trials))} of them failed" if failed else ""
    return f"{count(len(trials))} trials{ended}" + (f", {of}" if of else "")
