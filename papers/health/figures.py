# SPDX-License-Identifier: Apache-2.0
"""Figures of health: alarms that trade misses for false ones, and one drive that went wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from locfuse.report.plot.health import STATE_COLORS, draw_states
from locfuse.report.plot.style import (
    ESTIMATE,
    INK,
    MUTED,
    REJECTED,
    dress,
    legend,
    new_figure,
    panels,
    time_axis,
    title,
)
from locfuse.types import NANOSECONDS
from papers.figures import save_figures
from papers.health.alarms import roc
from papers.health.claims import pooled
from papers.health.scenarios import LIMIT_M, drive

SEED = 1
STRETCH_S = (140.0, 170.0)


def draw_figures(folder: Path, seeds: int) -> list[Path]:
    """Draw into a folder; return the paths."""
    figures = {"trust_roc": _roc(seeds), "trust_kidnapped": _kidnapped()}
    return save_figures(figures.items(), folder)


def _roc(seeds: int) -> Figure:
    wrong, hit, threshold = roc(pooled(seeds))
    figure = new_figure(5.0)
    axes = figure.subplots()
    dress(axes)
    least = 0.5 / len(wrong)
    axes.plot(np.maximum(wrong, least), hit, color=ESTIMATE, lw=1.5)
    row = int(np.searchsorted(-threshold, -0.5, side="right")) - 1
    axes.plot(max(wrong[row], least), hit[row], "o", color=REJECTED, ms=6)
    axes.annotate("called wrong below even chance", (max(wrong[row], least), hit[row]),
                  xytext=(10, -16), textcoords="offset points", fontsize=9, color=INK)  # fmt: skip
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel(f"points within {LIMIT_M:g} m that are called wrong")
    axes.set_ylabel(f"points beyond {LIMIT_M:g} m that are")
    title(axes, f"All scenarios, seeds 0 to {seeds - 1}: every threshold of the probability that "
                f"the error is below {LIMIT_M:g} m")  # fmt: skip
    return figure


def _kidnapped() -> Figure:
    of = drive("kidnapped", SEED)
    time = (of.health.stamp_ns - of.health.stamp_ns[0]) / NANOSECONDS
    shown = (time >= STRETCH_S[0]) & (time <= STRETCH_S[1])
    at = time[shown]
    figure, column = panels(2, 2.2)
    error, trust = column
    error.plot(at, of.distance[shown], color=ESTIMATE, lw=1.2)
    level = np.hypot(*of.health.protection[shown, :2].T)
    error.plot(at, level, color=MUTED, lw=1.0)
    draw_states(error, at, of.health.state[shown])
    error.set_ylabel("position error [m]")
    error.set_ylim(0.0, 1.15 * float(of.distance[shown].max()))
    title(error, "Carried off after 150 s, with ranges to six anchors at 5 Hz")
    trust.plot(at, of.health.within[shown], color=ESTIMATE, lw=1.2)
    trust.set_ylim(-0.03, 1.03)
    trust.set_ylabel(f"error < {LIMIT_M:g} m")
    title(trust, f"Probability that the position error is below {LIMIT_M:g} m, by itself")
    time_axis(trust, at)
    handles = [Line2D([], [], color=ESTIMATE, lw=1.2, label="error, probability"),
               Line2D([], [], color=MUTED, lw=1.0, label="protection level"),
               *(Line2D([], [], color=STATE_COLORS[state], lw=6, label=state.replace("_", " "))
                 for state in dict.fromkeys(of.health.state[shown].tolist()))]  # fmt: skip
    legend(figure, handles)
    return figure
