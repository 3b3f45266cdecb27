# SPDX-License-Identifier: Apache-2.0
"""The paper's Figs. 3, 4, 5 and 8, with ours beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    GRID,
    INK,
    MUTED,
    REJECTED,
    Handle,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.report.plot.world import draw_map
from locfuse.types import FloatArray, GridMap
from papers.figures import save_figures
from papers.zhang.experiments import METHODS, NEAR_M, compare, localizer
from papers.zhang.world import ITERATIONS, World, world

SHOWN = (5, 10, 15)  # iterations of Figs. 3 and 4
AROUND_M = 0.1  # the robot that is tracked, shown
SEED = 0


def draw_figures(folder: Path, seeds: int) -> list[Path]:
    """Write the pictures as PNG files; return their paths.

    ``zhang_global.png``: Figs. 3 and 4, particles from a uniform start; ``zhang_error.png``: Fig.
    5, errors over iterations; ``zhang_tracking.png``: Fig. 8, particles about a robot whose start
    was known.
    """
    of = world(SEED)
    runs = compare(seeds)
    figures = {
        "zhang_global": plot_particles(of.grid, list(_sets(of, False, SHOWN))),
        "zhang_error": plot_convergence(
            {text: runs[name].errors[:, :, 0] for name, text in METHODS.items()},
            {text: runs[name].converged() for name, text in METHODS.items()},
            NEAR_M,
        ),
        "zhang_tracking": plot_particles(
            of.grid, [[last for (last,) in _sets(of, True, (ITERATIONS,))]], AROUND_M
        ),
    }
    return save_figures(figures.items(), folder)


def _sets(of: World, known_start: bool, shown: tuple[int, ...]) -> Iterator[list[Particles]]:
    """Yield for each method its particles after some iterations."""
    for name, text in METHODS.items():
        method = localizer(name, of, SEED, known_start)
        row = []
        for iteration, step in enumerate(of.steps, 1):
            method.on(step)
            if iteration in shown:
                row.append(Particles(f"{text}, iteration {iteration}", method.particles.copy(),
                                     step.truth))  # fmt: skip
        yield row


ARROW = 0.045  # of a heading, as a fraction of the panel
COLOURS = (REJECTED, ANCHOR, ESTIMATE)


@dataclass(frozen=True)
class Particles:
    """What one panel shows: poses, shape (n, 3), and the true one, in metres and radians."""

    text: str
    pose: FloatArray
    truth: FloatArray


def plot_particles(
    grid: GridMap, rows: Sequence[Sequence[Particles]], reach_m: float | None = None
) -> Figure:
    """Draw sets of particles on a map, one panel each.

    Parameters
    ----------
    grid : GridMap
    rows : sequence of sequences of Particles
        All of one length.
    reach_m : float, optional
        How far around the robot is shown; by default the whole map.
    """
    figure = new_figure(3.5 * len(rows) + 0.9)
    panels = figure.subplots(len(rows), len(rows[0]), sharex=True, sharey=True, squeeze=False)
    handles: list[Handle] = []
    for row, axes_row in zip(rows, panels, strict=True):
        for shown, axes in zip(row, axes_row, strict=True):
            handles = _draw(axes, grid, shown, reach_m)
        axes_row[0].set_ylabel("y in world [m]")
    for axes in panels[-1]:
        axes.set_xlabel("x in world [m]")
    legend(figure, handles)
    return figure


def _draw(axes: Axes, grid: GridMap, shown: Particles, reach_m: float | None) -> list[Handle]:
    dress(axes)
    axes.grid(visible=False)
    axes.set_aspect("equal", adjustable="box")
    title(axes, shown.text)
    height, width = grid.cells.shape
    low, high = grid.to_world(np.array([[0.0, 0.0], [width, height]]))
    if reach_m is not None:
        low, high = shown.truth[:2] - reach_m, shown.truth[:2] + reach_m
    arrow_m = ARROW * float(high[0] - low[0])
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    draw_map(axes, grid, ("white", GRID, MUTED), zorder=0)
    x, y, heading = shown.pose.T
    tip = arrow_m * np.array([np.cos(heading), np.sin(heading)])
    axes.plot([x, x + tip[0]], [y, y + tip[1]], color=ESTIMATE, lw=0.8, alpha=0.5, zorder=3)
    handles: list[Handle] = []
    handles += axes.plot(x, y, ls="none", marker="o", markersize=3, color=INK, zorder=4,
                         label="particle and where it heads")  # fmt: skip
    x, y, heading = shown.truth
    tip = 2.0 * arrow_m * np.array([np.cos(heading), np.sin(heading)])
    axes.plot([x, x + tip[0]], [y, y + tip[1]], color=REJECTED, lw=2.0, zorder=5)
    handles += axes.plot(x, y, ls="none", marker="o", markersize=11, markeredgewidth=2.0,
                         markerfacecolor="none", color=REJECTED, zorder=5,
                         label="robot")  # fmt: skip
    return handles


def plot_convergence(errors_m: Mapping[str, FloatArray], converged: Mapping[str, FloatArray],
                     near_m: float) -> Figure:  # fmt: skip
    """Draw position errors over iterations, and how many runs have found the robot by each.

    Parameters
    ----------
    errors_m : mapping of name to float64 array, shape (runs, iterations)
        Metres; the band is from the 25 % to the 75 % quantile.
    converged : mapping of name to float64 array, shape (runs,)
        From which iteration on each run is right.
    near_m : float
        What is right, metres.
    """
    figure = new_figure(4.6)
    left, right = figure.subplots(1, 2)
    handles: list[Handle] = []
    for (name, values), colour in zip(errors_m.items(), COLOURS, strict=True):
        at = np.arange(1, values.shape[1] + 1)
        low, median, high = np.quantile(values, [0.25, 0.5, 0.75], axis=0)
        left.fill_between(at, low, high, color=colour, alpha=0.15, lw=0.0)
        handles += left.plot(at, median, color=colour, marker="o", markersize=3.5, label=name)
        found = 100.0 * np.mean(converged[name][:, None] <= at, axis=0)
        right.step(at, found, where="post", color=colour)
    left.axhline(near_m, color=MUTED, ls="--", lw=1.0)
    left.set_yscale("log")
    left.yaxis.set_major_formatter("{x:g}")
    left.set_ylabel("position error [m]")
    right.set_ylabel("runs that have found the robot [%]")
    right.set_ylim(0.0, 102.0)
    title(left, "median, and the middle half of the runs; dashed: found")
    title(right, "found, and not lost again")
    for axes in (left, right):
        dress(axes)
        axes.set_xlabel("iteration")
        axes.set_xlim(left=1.0)
    legend(figure, handles)
    return figure
