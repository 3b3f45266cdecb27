# SPDX-License-Identifier: Apache-2.0
"""Figures of gadau2022: wrong starts, GPS or laser, its mistakes, kidnapping, rays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.report.plot.style import (
    ANCHOR,
    DASHED,
    ESTIMATE,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle
from papers.figures import save_figures
from papers.gadau2022.experiments import kidnap, marks_of, microsimulation, ray_simulation
from papers.gadau2022.world import DURATION_S, LAYOUTS, SENSORS, SPEEDS, STEP_NS

SHOWN = 600  # steps of a kidnapping: the last minute


def draw_figures(folder: Path) -> list[Path]:
    """Draw the first run of each kind."""
    time_s = np.arange(1, round(DURATION_S * 10) + 1) / 10.0
    starts = {name: microsimulation(name, "circle", 0).off_m for name in LAYOUTS}
    right = {
        "ours": microsimulation("square, near", "circle", 0, wrong=False).off_m,
        "derivatives of Fig. 2": microsimulation(
            "square, near", "circle", 0, wrong=False, mistake="derivatives"
        ).off_m,
        "ranges to the surface": microsimulation(
            "square, near", "circle", 0, wrong=False, mistake="surface"
        ).off_m,
    }
    rays = {
        f"theirs at {speed:g} m/s": ray_simulation(
            "5", speed, 0, by_rule=("derivatives", "surface")
        ).off_m
        for speed in SPEEDS
    }
    rays |= {f"ours at {speed:g} m/s": ray_simulation("5", speed, 0).off_m for speed in SPEEDS}
    figures = [
        ("gadau_start", plot_errors(time_s, starts, "start 2 m and 60 degrees wrong")),
        ("gadau_sensors", _sensors(time_s)),
        ("gadau_mistakes", plot_errors(time_s, right, "right start, four landmarks")),
        ("gadau_kidnapped", _kidnapped()),
        ("gadau_rays", plot_errors(time_s, rays, "five discs, 151 rays")),
    ]
    return save_figures(figures, folder)


def _sensors(time_s: FloatArray) -> Figure:
    runs = {name: microsimulation("triangle", "circle", 0, sensors=SENSORS[name][1])
            for name in ("GPS", "laser")}  # fmt: skip
    found = {name: run.found for name, run in runs.items()}
    gps = runs["GPS"]
    return plot_sensors(marks_of("triangle"), gps.fixes, time_s, gps.truth, found)


def _kidnapped() -> Figure:
    ours = kidnap("triangle", 0, beside=True)
    assert ours.alone is not None
    first = len(ours.truth) - SHOWN
    time_s = np.arange(first + 1, len(ours.truth) + 1) * STEP_NS / NANOSECONDS
    found = {"RecoveringEkf": ours.found[first:], "PoseEkf alone": ours.alone[first:]}
    return plot_kidnapping(marks_of("triangle"), time_s, ours.truth[first:], found,
                           ours.put_down - first)  # fmt: skip


_COLOURS = (ESTIMATE, REJECTED, ANCHOR, MUTED, TRUTH, "#CC79A7")
_MIN_M = 1e-3  # the axis begins here


def plot_errors(time_s: FloatArray, off_m: Mapping[str, FloatArray], what: str) -> Figure:
    """Draw errors of position over time, on a logarithmic axis up to 100 m.

    Parameters
    ----------
    time_s : float64 array, shape (n,)
    off_m : mapping of name to float64 array, shape (n,)
        At most six.
    what : str
        Title.
    """
    figure = new_figure(3.8)
    axes = figure.subplots()
    legend(figure, _errors(axes, time_s, off_m))
    title(axes, what)
    return figure


def plot_kidnapping(
    marks: FloatArray, time_s: FloatArray, truth: FloatArray, found: Mapping[str, FloatArray],
    put_down: int,
) -> Figure:  # fmt: skip
    """Draw where a robot is and believes to be, before and after it is carried off.

    Parameters
    ----------
    marks : float64 array, shape (m, 2)
        The landmarks.
    time_s : float64 array, shape (n,)
    truth : float64 array, shape (n, 3)
    found : mapping of name to float64 array, shape (n, 3)
        NaN where a method says that it is lost.
    put_down : int
        The first row after it was carried off.
    """
    figure = new_figure(5.4)
    floor, errors = figure.subplots(1, 2, width_ratios=[1.0, 1.3])
    handles = _floor(floor, marks, _broken(truth, put_down),
                     [_broken(pose, put_down) for pose in found.values()])  # fmt: skip
    floor.annotate("", truth[put_down, :2], truth[put_down - 1, :2],
                   arrowprops={"arrowstyle": "->", "color": MUTED, "ls": "--"})  # fmt: skip
    title(floor, "the floor; carried along the arrow")
    handles += _errors(errors, time_s, _off_m(truth, found))
    errors.axvline(time_s[put_down], color=MUTED, lw=1.0, ls=DASHED)
    title(errors, "error of position; a gap where it is lost")
    legend(figure, handles)
    return figure


def plot_sensors(
    marks: FloatArray, fixes: FloatArray, time_s: FloatArray, truth: FloatArray,
    found: Mapping[str, FloatArray],
) -> Figure:  # fmt: skip
    """Draw one drive as several sensors see it: the floor, and errors of position and heading.

    Parameters
    ----------
    marks : float64 array, shape (m, 2)
        The landmarks.
    fixes : float64 array, shape (k, 2)
        Of the GPS.
    time_s : float64 array, shape (n,)
    truth : float64 array, shape (n, 3)
    found : mapping of name to float64 array, shape (n, 3)
        At most six.
    """
    figure = new_figure(5.4)
    parts = figure.subplot_mosaic([["floor", "errors"], ["floor", "turns"]],
                                  width_ratios=[1.0, 1.3])  # fmt: skip
    handles = _floor(parts["floor"], marks, truth, list(found.values()))
    handles += parts["floor"].plot(fixes[:, 0], fixes[:, 1], "x", color=MUTED, ms=5, label="fixes")
    title(parts["floor"], "the floor")
    handles += _errors(parts["errors"], time_s, _off_m(truth, found))
    title(parts["errors"], "error of position")
    dress(parts["turns"])
    for pose, colour in zip(found.values(), _COLOURS, strict=False):
        off = np.rad2deg(wrap_angle(pose[:, 2] - truth[:, 2]))
        parts["turns"].plot(time_s, off, color=colour, lw=1.2)
    parts["turns"].set(xlabel="time [s]", ylabel="error [deg]")
    title(parts["turns"], "error of heading")
    legend(figure, handles)
    return figure


def _floor(
    axes: Axes, marks: FloatArray, truth: FloatArray, found: Sequence[FloatArray]
) -> list[Handle]:
    dress(axes)
    handles: list[Handle] = []
    handles += axes.plot(*truth.T[:2], color=TRUTH, lw=2.6, alpha=0.35, label="truth")
    axes.plot(marks[:, 0], marks[:, 1], "o", color=ANCHOR, ms=9, mec="white")
    for pose, colour in zip(found, _COLOURS, strict=False):
        axes.plot(*pose.T[:2], color=colour, lw=1.1)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    return handles


def _off_m(truth: FloatArray, found: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    return {name: np.hypot(*(pose - truth)[:, :2].T) for name, pose in found.items()}


def _broken(pose: FloatArray, put_down: int) -> FloatArray:
    """Return poses with a gap where the robot was carried."""
    return np.insert(pose, put_down, np.nan, axis=0)


def _errors(axes: Axes, time_s: FloatArray, off_m: Mapping[str, FloatArray]) -> Sequence[Handle]:
    dress(axes)
    handles: list[Handle] = []
    for (name, off), colour in zip(off_m.items(), _COLOURS, strict=False):
        handles += axes.plot(time_s, np.maximum(off, _MIN_M), color=colour, lw=1.2, label=name)
    axes.set(yscale="log", ylim=(_MIN_M, 100.0), xlabel="time [s]", ylabel="error [m]")
    return handles
