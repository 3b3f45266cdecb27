# SPDX-License-Identifier: Apache-2.0
"""Pictures of celan2017: laps over a map, doubt in a room and over time, eights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse import _core
from locfuse.report.decimation import evenly_along
from locfuse.report.plot.path import draw_ellipse
from locfuse.report.plot.style import (
    ANCHOR,
    DASHED,
    ESTIMATE,
    GRID,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.report.plot.world import box_around, draw_map, drawable
from locfuse.types import FloatArray, GridMap

_COLOURS = (ESTIMATE, REJECTED, ANCHOR, "#CC79A7", "#E69F00")
_ELLIPSES, _ELLIPSE_SIGMAS = 14, 2.0
_LEAST_M = 0.01  # the axis of sigmas begins here


@dataclass(frozen=True)
class Track:
    """What a panel shows: title, poses (n, 3) true and estimated, covariances, injections."""

    text: str
    truth: FloatArray
    pose: FloatArray
    covariance: FloatArray | None = None
    injections: Sequence[_core.Injection] = ()


def plot_laps(grid: GridMap, anchors: FloatArray, tracks: Sequence[Track]) -> Figure:
    """Draw a lap as each set-up believes it to be, on the map, one panel each.

    Parameters
    ----------
    grid : GridMap
    anchors : float64 array, shape (m, 2)
    tracks : sequence of Track
        An even number.
    """
    every = [track.pose[:, :2] for track in tracks] + [_corners(grid)]
    low, high = box_around(np.concatenate(every), 0.01)
    rows = len(tracks) // 2
    figure = new_figure(rows * (0.5 * 9.6 * (high - low)[1] / (high - low)[0] + 0.45) + 0.6)
    handles: list[Handle] = []
    panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    for axes, track in zip(panels.ravel(), tracks, strict=True):
        handles = _floor(axes, grid, anchors, low, high)
        handles += axes.plot(*track.truth.T[:2], color=TRUTH, lw=2.2, alpha=0.3, label="truth")
        handles += axes.plot(*track.pose.T[:2], color=ESTIMATE, lw=1.0, label="estimate")
        handles += axes.plot(*track.pose[-1, :2], marker="s", markersize=7, ls="none", zorder=6,
                             color=REJECTED, markerfacecolor="none", label="end")  # fmt: skip
        title(axes, track.text)
    for axes in panels[-1]:
        axes.set_xlabel("x [m]")
    for axes in panels[:, 0]:
        axes.set_ylabel("y [m]")
    legend(figure, handles)
    return figure


def plot_radios(grid: GridMap, anchors: FloatArray, track: Track, fixes: FloatArray) -> Figure:
    """Draw where UWB has the robot, beside a lap as a set-up believes it to be.

    Parameters
    ----------
    grid : GridMap
    anchors : float64 array, shape (m, 2)
    track : Track
    fixes : float64 array, shape (k, 2)
    """
    low, high = box_around(np.concatenate([_corners(grid), fixes]), 0.01)
    figure = new_figure(9.4 * (high - low)[1] / (high - low)[0] + 1.0)
    axes = figure.subplots()
    handles = _floor(axes, grid, anchors, low, high)
    handles += axes.plot(*track.pose.T[:2], color=ESTIMATE, lw=1.4, label="estimate")
    handles += axes.plot(*fixes.T, color=REJECTED, marker="o", markersize=2.5, ls="none",
                         label="UWB, three tags together")  # fmt: skip
    axes.set(xlabel="x [m]", ylabel="y [m]")
    title(axes, track.text)
    legend(figure, handles)
    return figure


def plot_doubt(grid: GridMap, anchors: FloatArray, tracks: Sequence[Track]) -> Figure:
    """Draw what each set-up states of itself where the anchors are, side by side.

    Parameters
    ----------
    grid : GridMap
    anchors : float64 array, shape (m, 2)
    tracks : sequence of Track
        With covariances.
    """
    low, high = box_around(anchors, 0.15)
    figure = new_figure(9.4 / len(tracks) * (high - low)[1] / (high - low)[0] + 1.0)
    panels = figure.subplots(1, len(tracks), sharex=True, sharey=True, squeeze=False)[0]
    handles: list[Handle] = []
    for axes, track in zip(panels, tracks, strict=True):
        handles = _floor(axes, grid, anchors, low, high)
        handles += axes.plot(*track.truth.T[:2], color=TRUTH, lw=2.6, alpha=0.3, label="truth")
        handles += axes.plot(*track.pose.T[:2], color=ESTIMATE, lw=1.2, label="estimate")
        assert track.covariance is not None
        shown = np.flatnonzero(np.all((track.truth[:, :2] > low) & (track.truth[:, :2] < high), 1))
        for row in shown[evenly_along(track.truth[shown, :2], _ELLIPSES)].tolist():
            ellipse = draw_ellipse(axes, track.pose[row, :2], track.covariance[row, :2, :2],
                                   _ELLIPSE_SIGMAS, facecolor="none", edgecolor=REJECTED,
                                   linewidth=1.0, label=f"{_ELLIPSE_SIGMAS:g}-sigma ellipse",
                                   zorder=4)  # fmt: skip
        handles.append(ellipse)
        marks = _injections(axes, track.injections)
        handles += [mark for mark in marks if axes is panels[-1]]
        title(axes, track.text)
        axes.set_xlabel("x [m]")
    panels[0].set_ylabel("y [m]")
    legend(figure, handles)
    return figure


def _injections(axes: Axes, injections: Sequence[_core.Injection]) -> list[Handle]:
    """Draw what each injection put in place of what."""
    handles: list[Handle] = []
    for one in injections:
        before, after = one.before.pose, one.after.pose
        handles = [*axes.plot([before.x, after.x], [before.y, after.y], color=ANCHOR, lw=1.2,
                              ls=DASHED, marker="", label="injection", zorder=5)]  # fmt: skip
        for estimate, colour, what in (
            (one.before, REJECTED, "before"),
            (one.after, ANCHOR, "after"),
        ):
            at = np.array([estimate.pose.x, estimate.pose.y])
            handles.append(draw_ellipse(
                axes, at, estimate.covariance[:2, :2], _ELLIPSE_SIGMAS, facecolor=(colour, 0.3),
                edgecolor=colour, linewidth=1.8, zorder=5, label=f"{what} it"))  # fmt: skip
    return handles


def plot_sigmas(
    time_s: Mapping[str, FloatArray], sigma_m: Mapping[str, FloatArray], grey_s: FloatArray
) -> Figure:
    """Draw what set-ups state of their errors ahead and to the side, over time.

    Parameters
    ----------
    time_s : mapping of name to float64 array, shape (n,)
    sigma_m : mapping of name to float64 array, shape (n, 2)
        Standard deviations in the frame of the body, metres; at most five.
    grey_s : float64 array, shape (k, 2)
        Times between which the background is grey: in the room with the anchors.
    """
    figure = new_figure(5.4)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    handles: list[Handle] = []
    for axis, (axes, what) in enumerate(zip(panels, ("ahead", "to the side"), strict=True)):
        dress(axes)
        for begin, end in grey_s.tolist():
            grey = axes.axvspan(begin, end, color=GRID, lw=0.0, label="in the room with anchors")
        handles = [] if len(grey_s) == 0 else [grey]
        for (name, sigma), colour in zip(sigma_m.items(), _coloured(sigma_m), strict=True):
            handles += axes.plot(time_s[name], np.maximum(sigma[:, axis], _LEAST_M), color=colour,
                                 lw=1.0, label=name)  # fmt: skip
        axes.set(yscale="log", ylabel="sigma [m]")
        axes.yaxis.set_major_formatter("{x:g}")
        title(axes, f"standard deviation {what}")
    panels[-1].set_xlabel("time since start [s]")
    panels[-1].set_xlim(min(t[0] for t in time_s.values()), max(t[-1] for t in time_s.values()))
    legend(figure, handles)
    return figure


def plot_eight(truth: FloatArray, tracks: Mapping[str, FloatArray], what: str) -> Figure:
    """Draw a stretch of an eight as it was driven, and as methods believe it to be.

    Parameters
    ----------
    truth : float64 array, shape (n, 2)
    tracks : mapping of name to float64 array, shape (k, 2)
        At most five; few points are marked one by one.
    what : str
        Title.
    """
    figure = new_figure(6.0)
    axes = figure.subplots()
    dress(axes)
    handles: list[Handle] = [*axes.plot(*truth.T, color=TRUTH, lw=3.0, alpha=0.3, label="truth")]
    for (name, at), colour in zip(tracks.items(), _coloured(tracks), strict=True):
        marker = "o" if len(at) < 60 else ""
        handles += axes.plot(*at.T, color=colour, lw=1.2, marker=marker, markersize=4,
                             ls=DASHED if marker else "-", label=name)  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    title(axes, what)
    legend(figure, handles)
    return figure


def _coloured(shown: Mapping[str, FloatArray]) -> tuple[str, ...]:
    """Return a colour for each; fewer if there are more than colours."""
    return _COLOURS[: len(shown)]


def _floor(
    axes: Axes, grid: GridMap, anchors: FloatArray, low: FloatArray, high: FloatArray
) -> list[Handle]:
    dress(axes)
    axes.grid(visible=False)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    draw_map(axes, drawable(grid, 2.0 * (high - low)[0]), ("white", GRID, MUTED), zorder=0)
    return [*axes.plot(*anchors.T, marker="^", markersize=7, color=ANCHOR, ls="none", mec="white",
                       label="anchor", zorder=7)]  # fmt: skip


def _corners(grid: GridMap) -> FloatArray:
    height, width = grid.cells.shape
    return grid.to_world(np.array([[0.0, 0.0], [width, height]]))
