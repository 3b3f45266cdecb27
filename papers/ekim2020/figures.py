# SPDX-License-Identifier: Apache-2.0
"""Figures of ekim2020: the room, solvers against the bound, heading searches, bad starts."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from locfuse.eval.errors import errors_against
from locfuse.report.plot import plot_start
from locfuse.report.plot.style import (
    ANCHOR,
    DASHED,
    ESTIMATE,
    INK,
    REJECTED,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import run
from locfuse.sim.scenario import simulate
from locfuse.types import FloatArray, LogError
from papers.ekim2020.experiments import (
    bad_starts,
    heading_errors,
    noise_sweep,
    places_of,
    pose_source_errors,
)
from papers.ekim2020.world import room_config, square_room
from papers.figures import save_figures
from papers.scores import rms
from papers.starts import drawn_start


def draw_figures(folder: Path, configs: Path | None) -> list[Path]:
    """Write the figures of the rows that can be run, as PNG files; return their paths.

    ``room_paths.png``: the room; ``start_bound.png``: solvers against the Cramer-Rao bound;
    ``start_ambiguous.png``: a room that looks the same from four sides; ``start_searches.png``: the
    paper's heading search and ours; ``start_bad.png``: what a wrong heading costs.
    """
    ambiguous = plot_start(run(square_room(), seed=1))
    assert ambiguous is not None
    figures = {
        "room_paths": _room(),
        "start_bound": plot_bound(*noise_sweep()),
        "start_ambiguous": ambiguous,
    }
    if configs is not None:
        with suppress(LogError):  # the rows say which recordings are absent
            errors = heading_errors(configs)
            figures["start_searches"] = plot_searches(errors.ten_degrees, errors.ours)
            figures["start_bad"] = plot_bad_starts(*bad_starts(configs))
    return save_figures(figures.items(), folder)


def _room() -> Figure:
    """Draw the eight of the first seed, as the paper's Figs. 2 and 9."""
    config = room_config("eight")
    assert config.simulation is not None
    log = simulate(config.simulation, np.random.default_rng(0))
    truth = truth_of(log)
    assert truth is not None
    result = run(config, log, start=drawn_start(config, truth, to_messages(log, config), 0))
    ours = 100.0 * rms(errors_against(result.estimate, truth).position)
    source = 100.0 * rms(pose_source_errors(log, truth))
    return plot_room(places_of(log["anchors"]), truth.position, places_of(log["poses"]),
                       result.estimate.position,
                       f"2 m of it; RMSE: source {source:.1f} cm, EKF {ours:.1f} cm")  # fmt: skip


def plot_room(
    anchors: FloatArray, truth: FloatArray, poses: FloatArray, ours: FloatArray, close_up: str
) -> Figure:
    """Draw the floor of one drive, and 2 m of it.

    Parameters
    ----------
    anchors : float64 array, shape (m, 2)
    truth, poses, ours : float64 arrays, shape (n, 2), (k, 2), (n, 2)
        The other localizer's `poses`.
    close_up : str
        Title of the second panel.
    """
    figure = new_figure(5.6)
    whole, close = figure.subplots(1, 2)
    handles = []
    for axes in (whole, close):
        dress(axes)
        handles = axes.plot(*truth.T, color=INK, lw=1.2, ls=DASHED, label="truth", zorder=3)
        handles += axes.plot(*poses.T, "^", color=REJECTED, ms=4, label="pose source")
        handles += axes.plot(*ours.T, color=ESTIMATE, lw=1.5, label="EKF")
        handles += axes.plot(*anchors.T, "s", color=ANCHOR, ms=8, label="anchor")
        axes.set_aspect("equal")
        axes.set(xlabel="x [m]", ylabel="y [m]")
    middle = truth[len(truth) // 4]
    close.set(xlim=middle[0] + np.array([-1.0, 1.0]), ylim=middle[1] + np.array([-1.0, 1.0]))
    title(whole, "the drive")
    title(close, close_up)
    legend(figure, handles)
    return figure


def plot_bound(levels_m: FloatArray, rmse_m: Mapping[str, FloatArray]) -> Figure:
    """Draw the RMSE of each solver over the noise, and as a multiple of the Cramer-Rao bound.

    Parameters
    ----------
    levels_m : float64 array, shape (n,)
        Sigma of a range.
    rmse_m : mapping of ``bound``, ``ceres``, ``srwls``, ``srls`` to float64 arrays, shape (n,)
    """
    figure = new_figure(4.6)
    left, right = figure.subplots(1, 2)
    style = {
        "bound": ("Cramer-Rao bound", INK, "--", ""),
        "ceres": ("maximum likelihood (Ceres)", ESTIMATE, "-", "o"),
        "srwls": ("weighted SR-LS", ANCHOR, "-", "s"),
        "srls": ("SR-LS", REJECTED, "-", "^"),
    }
    handles = []
    for name, (label, colour, line, marker) in style.items():
        look = {"color": colour, "ls": line, "marker": marker, "markersize": 5}
        handles += left.plot(levels_m, rmse_m[name], label=label, **look)
        right.plot(levels_m, rmse_m[name] / rmse_m["bound"], **look)
    for axes in (left, right):
        dress(axes)
        axes.set_xscale("log")
        axes.set_xlabel("sigma of a range [m]")
    left.set_yscale("log")
    left.set_ylabel("position RMSE [m]")
    right.set_ylabel("RMSE / bound")
    title(left, "five anchors around a room of 10 m")
    title(right, "the same, in multiples of the bound")
    legend(figure, handles)
    return figure


def plot_searches(ten_degrees: FloatArray, ours: FloatArray) -> Figure:
    """Draw the share of scans whose heading error stays below a value, for both searches.

    Parameters
    ----------
    ten_degrees, ours : float64 arrays, shape (n,)
        Absolute heading errors, radians.
    """
    figure = new_figure(4.2)
    axes = figure.add_subplot()
    dress(axes)
    handles = []
    for values, label, colour in (
        (ours, "start from nothing", ESTIMATE),
        (ten_degrees, "search in ten-degree steps", REJECTED),
    ):
        sorted_deg = np.sort(np.rad2deg(values))
        share = 100.0 * np.arange(1, len(values) + 1) / len(values)
        handles += axes.step(np.r_[0.0, sorted_deg], np.r_[0.0, share], where="post", color=colour,
                             label=label)  # fmt: skip
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 102.0)
    axes.set_xlabel("heading error [deg]")
    axes.set_ylabel("scans with at most this error [%]")
    legend(figure, handles)
    return figure


def plot_bad_starts(degrees: FloatArray, ends_m: Mapping[str, FloatArray]) -> Figure:
    """Draw the position error at the end over the heading error that a robot was started with.

    Parameters
    ----------
    degrees : float64 array, shape (n,)
    ends_m : mapping of ``odometry``, ``filter``, ``auto`` to float64 arrays, shape (n,)
    """
    figure = new_figure(4.4)
    axes = figure.add_subplot()
    dress(axes)
    handles = []
    for name, label, colour, line in (
        ("odometry", "given, odometry alone", REJECTED, "-"),
        ("filter", "given, odometry and ranges", ANCHOR, "-"),
        ("auto", "started from nothing", ESTIMATE, "--"),
    ):
        handles += axes.plot(degrees, ends_m[name], marker="o", markersize=4, color=colour, ls=line,
                             label=label)  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel("heading error of the start, believed to 2 degrees [deg]")
    axes.set_ylabel("position error at the end [m]")
    legend(figure, handles)
    return figure
