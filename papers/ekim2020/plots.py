# SPDX-License-Identifier: Apache-2.0
"""Pictures of starts: solvers against the bound, two heading searches, what a bad start costs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    INK,
    REJECTED,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.types import FloatArray


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
        ("odometry", "told, odometry alone", REJECTED, "-"),
        ("filter", "told, odometry and ranges", ANCHOR, "-"),
        ("auto", "started from nothing", ESTIMATE, "--"),
    ):
        handles += axes.plot(degrees, ends_m[name], marker="o", markersize=4, color=colour, ls=line,
                             label=label)  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel("heading error of the start, believed to 2 degrees [deg]")
    axes.set_ylabel("position error at the end [m]")
    legend(figure, handles)
    return figure
