# SPDX-License-Identifier: Apache-2.0
"""Picture of what `tune` found: intervals against the configuration, and NIS before and after."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.report.plot import style
from locfuse.tune.held_out import HeldOut
from locfuse.tune.judge import Judged
from locfuse.tune.result import TuneResult

_ROW_IN = 0.3
_FACTOR = 20.0  # of a sigma, at either end of the axis


def plot_tune(result: TuneResult) -> Figure:
    """Draw sigmas over those of the configuration, other quantities, and NIS of what is held out.

    Bars are 95 % intervals; what the recordings do not say is grey.
    """
    sigmas = [one for one in result.quantities if one.quantity.is_sigma]
    others = [one for one in result.quantities if not one.quantity.is_sigma]
    rows = [max(len(part), 1) for part in (sigmas, others, result.held_out)]
    figure = Figure(figsize=(9.0, 2.2 + _ROW_IN * sum(rows)), layout="constrained")
    axes = figure.subplots(3, 1, height_ratios=[row + 1.5 for row in rows])
    _draw_sigmas(axes[0], sigmas)
    _draw_others(axes[1], others)
    _draw_nis(axes[2], result.held_out)
    return figure


def _draw_sigmas(axes: Axes, sigmas: list[Judged]) -> None:
    style.title(axes, "Sigma, in units of the configuration's")
    axes.set_xscale("log")
    axes.set_xlim(1.0 / _FACTOR, _FACTOR)
    axes.axvline(1.0, color=style.MUTED, lw=1.0, ls=style.DASHED)
    for row, one in enumerate(sigmas):
        unit = one.quantity.now if one.quantity.now > 0.0 else max(one.value, 1e-12)
        _bar(axes, row, one, one.value / unit, max(one.low / unit, 1e-9), one.high / unit)
    _names(axes, sigmas)


def _draw_others(axes: Axes, others: list[Judged]) -> None:
    style.title(axes, "Others, less the configuration's, in units of their 95 % interval")
    axes.axvline(0.0, color=style.MUTED, lw=1.0, ls=style.DASHED)
    for row, one in enumerate(others):
        half = max(0.5 * (one.high - one.low), 1e-12)
        at = (0.5 * (one.low + one.high) - one.quantity.now) / half
        _bar(axes, row, one, at, at - 1.0, at + 1.0)
    _names(axes, others)


def _bar(axes: Axes, row: int, one: Judged, at: float, low: float, high: float) -> None:
    colour = style.ESTIMATE if one.changes else style.MUTED
    if one.word == "at most":
        low, at = 1e-9, high
    if not (one.word == "not observed" and one.quantity.is_sigma):
        axes.plot([low, high], [row, row], color=colour, lw=2.0, solid_capstyle="butt")
    axes.plot(at, row, "o", ms=6, color=colour)


def _names(axes: Axes, rows: list[Judged]) -> None:
    names = [f"{one.quantity.key.removeprefix('estimator.')}: {one.word}" for one in rows]
    axes.set_yticks(np.arange(len(rows)), names)
    axes.set_ylim(len(rows) - 0.5, -0.5)


def _draw_nis(axes: Axes, held_out: tuple[HeldOut, ...]) -> None:
    style.title(axes, "Mean NIS of what was held out, 1 is right")
    axes.axvline(1.0, color=style.MUTED, lw=1.0, ls=style.DASHED)
    if not held_out:
        axes.set_axis_off()
        return
    rows = np.arange(len(held_out))
    axes.plot([one.before.nis for one in held_out], rows, "o", mfc="none", mec=style.REJECTED,
              ms=7, label="before")  # fmt: skip
    axes.plot([one.after.nis for one in held_out], rows, "o", color=style.ESTIMATE, ms=7,
              label="after")  # fmt: skip
    axes.set_yticks(rows, [one.source for one in held_out])
    axes.set_ylim(len(held_out) - 0.5, -0.5)
    axes.set_xlim(left=0.0)
    axes.legend(loc="upper right", frameon=False)
