# SPDX-License-Identifier: Apache-2.0
"""Pictures of gadau2022: how far off methods are over time, and a robot that is carried off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.plot.style import (
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
from locfuse.types import FloatArray

_COLOURS = (ESTIMATE, REJECTED, ANCHOR, MUTED, TRUTH)
_LEAST_M = 1e-3  # the axis begins here


def plot_errors(time_s: FloatArray, off_m: Mapping[str, FloatArray], what: str) -> Figure:
    """Draw errors of position over time, on a logarithmic axis up to 100 m.

    Parameters
    ----------
    time_s : float64 array, shape (n,)
    off_m : mapping of name to float64 array, shape (n,)
        At most five.
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
    dress(floor)
    handles: list[Handle] = floor.plot(*_broken(truth, put_down).T[:2], color=TRUTH, lw=2.6,
                                       alpha=0.35, label="truth")  # fmt: skip
    floor.plot(marks[:, 0], marks[:, 1], "o", color=ANCHOR, ms=9, mec="white")
    for (_, pose), colour in zip(found.items(), _COLOURS, strict=False):
        floor.plot(*_broken(pose, put_down).T[:2], color=colour, lw=1.1)
    floor.annotate("", truth[put_down, :2], truth[put_down - 1, :2],
                   arrowprops={"arrowstyle": "->", "color": MUTED, "ls": "--"})  # fmt: skip
    floor.set_aspect("equal")
    floor.set(xlabel="x [m]", ylabel="y [m]")
    title(floor, "the floor; carried along the arrow")
    off = {name: np.hypot(*(pose - truth)[:, :2].T) for name, pose in found.items()}
    handles += _errors(errors, time_s, off)
    errors.axvline(time_s[put_down], color=MUTED, lw=1.0, ls=DASHED)
    title(errors, "error of position; a gap where it is lost")
    legend(figure, handles)
    return figure


def _broken(pose: FloatArray, put_down: int) -> FloatArray:
    """Return poses with a gap where the robot was carried."""
    return np.insert(pose, put_down, np.nan, axis=0)


def _errors(axes: Axes, time_s: FloatArray, off_m: Mapping[str, FloatArray]) -> Sequence[Handle]:
    dress(axes)
    handles: list[Handle] = []
    for (name, off), colour in zip(off_m.items(), _COLOURS, strict=False):
        handles += axes.plot(time_s, np.maximum(off, _LEAST_M), color=colour, lw=1.2, label=name)
    axes.set(yscale="log", ylim=(_LEAST_M, 100.0), xlabel="time [s]", ylabel="error [m]")
    return handles
