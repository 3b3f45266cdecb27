# SPDX-License-Identifier: Apache-2.0
"""Picture of health over time: probability of a small error, and protection levels."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from locfuse._core import PoseWatch
from locfuse.report.plot.style import ESTIMATE, MUTED, Handle, legend, panels, time_axis, title
from locfuse.report.text import percent, seconds, start_ns
from locfuse.types import FloatArray, Health, RunResult, Watched

STATE_COLORS = {
    "initializing": "#d9d9d9",
    "ok": "#cdeadd",
    "degraded": "#f3e6b3",
    "ambiguous": "#ead1e3",
    "dead_reckoning": "#f6d3b0",
    "lost": "#f0a58a",
}


def plot_health(result: RunResult) -> Figure | None:
    """Draw the probability that the error is below the limit, and the protection levels.

    The background is the state. None if the run has no health.
    """
    return _draw(result.health, result, "the position error is")


def plot_watched(result: RunResult) -> Figure | None:
    """Draw the same of watched poses, and how far they are from the estimate; else None."""
    watched = result.watched
    figure = _draw(watched, result, "errors of position and heading are", rows=3)
    if watched is None or figure is None:
        return None
    off = figure.axes[2]
    time_s = seconds(watched.stamp_ns, start_ns(result))
    off.plot(time_s, np.hypot(watched.error[:, 0], watched.error[:, 1]), color=ESTIMATE, lw=1.0)
    off.set_ylabel("distance [m]")
    title(off, "from the poses to the estimate")
    draw_states(off, time_s, watched.state)
    return figure


def _draw(health: Health | None, result: RunResult, what: str, rows: int = 2) -> Figure | None:
    if health is None or len(health) == 0:
        return None
    time_s = seconds(health.stamp_ns, start_ns(result))
    figure, panel = panels(rows, 2.1)
    within, level = panel[:2]
    limit = float(result.config["health"]["limit_m"])
    risk = float(result.config["health"]["risk"])
    within.plot(time_s, health.within, color=ESTIMATE, lw=1.0)
    within.set_ylim(-0.03, 1.03)
    within.set_ylabel("probability")
    states, counts = np.unique(health.state, return_counts=True)
    shares = ", ".join(f"{state.replace('_', ' ')} {percent(count / len(health))}"
                       for state, count in zip(states.tolist(), counts, strict=True))  # fmt: skip
    bound = f" and {PoseWatch.max_heading_error:g} rad" if isinstance(health, Watched) else ""
    title(within, f"that {what} below {limit:g} m{bound}; {shares}")
    names, colors = ("x", "y"), (ESTIMATE, MUTED)
    for axis in range(2):
        level.plot(time_s, health.protection[:, axis], color=colors[axis], lw=1.0)
    finite = health.protection[:, :2][np.isfinite(health.protection[:, :2])]
    level.set_ylim(0.0, 1.15 * float(np.quantile(finite, 0.99)) if len(finite) else 1.0)
    level.set_ylabel("protection level [m]")
    title(level, f"errors exceed these with at most probability {risk:g}; none where unknown")
    for axes in (within, level):
        draw_states(axes, time_s, health.state)
    time_axis(panel[-1], time_s)
    handles: list[Handle] = [Line2D([], [], color=color, lw=1.0, label=name)
                             for name, color in zip(names, colors, strict=True)]  # fmt: skip
    handles += [Patch(facecolor=STATE_COLORS[state], label=state.replace("_", " "))
                for state in states.tolist()]  # fmt: skip
    legend(figure, handles)
    return figure


def draw_states(axes: Axes, time_s: FloatArray, state: NDArray[np.str_]) -> None:
    """Colour the background by the state."""
    edges = np.flatnonzero(np.concatenate([[True], state[1:] != state[:-1]]))
    ends = np.append(time_s[edges[1:]], time_s[-1])
    for begin, end, name in zip(time_s[edges], ends, state[edges].tolist(), strict=True):
        axes.axvspan(begin, end, color=STATE_COLORS[name], linewidth=0, zorder=0)
