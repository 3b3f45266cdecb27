# SPDX-License-Identifier: Apache-2.0
"""The figures of celan2017 with our runs: laps (9 to 12), uncertainty (13, 14), eights (15)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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
from locfuse.sim.sensors import seconds
from locfuse.types import NANOSECONDS, FloatArray, GridMap
from papers.celan2017.experiments import SETUPS, Run, runs_of
from papers.celan2017.figure_eights import METHODS, NAMES, ride
from papers.celan2017.world import BLIND_S, MIN_RANGES, SEEN_S, Lap, lap, tag_poses
from papers.figures import save_figures

SEED = 11  # whose wheels drift as theirs did
LAPS = ("odometry", "lidar", "covered", "covered_switch", "hall", "hall_switch")
UNCERTAIN = ("hall", "hall_switch")
SIGMAS = ("hall", "hall_switch", "covered")
STRETCH_S = (12.0, 34.0)  # of Fig. 15


def draw_figures(folder: Path) -> list[Path]:
    """Draw one lap and one ride into a folder; return the paths."""
    of, runs = lap(SEED), runs_of(SEED)
    figures = {
        "celan_laps": _laps(of, runs),
        "celan_radios": _radios(of, runs),
        "celan_doubt": _uncertainty(of, runs),
        "celan_sigmas": _sigmas(runs),
        "celan_eight": _eight(),
    }
    return save_figures(figures.items(), folder)


def _laps(of: Lap, runs: dict[str, Run]) -> Figure:
    tracks = [Track(_caption(name, runs[name]), runs[name].truth, runs[name].estimate)
              for name in LAPS]  # fmt: skip
    return plot_laps(of.floor.map, _anchors(of), tracks)


def _caption(name: str, run: Run) -> str:
    metres, degrees = np.hypot(*run.end[:2]), abs(np.rad2deg(run.end[2]))
    acted = "" if "switch" not in name else f", {len(run.injections)} injections"
    return f"{SETUPS[name].text}: {metres:.2f} m, {degrees:.1f} deg{acted}"


def _radios(of: Lap, runs: dict[str, Run]) -> Figure:
    fixes = np.array([[z.pose.x, z.pose.y] for z in tag_poses(of.fixes)])
    track = Track(f"{SETUPS['lidar'].text}, and UWB where {MIN_RANGES} anchors are received",
                  runs["lidar"].truth, runs["lidar"].estimate)  # fmt: skip
    return plot_radios(of.floor.map, _anchors(of), track, fixes)


def _uncertainty(of: Lap, runs: dict[str, Run]) -> Figure:
    tracks = []
    for name in UNCERTAIN:
        run = runs[name]
        last = seconds(run.stamp_ns) > of.duration_s - BLIND_S - SEEN_S
        tracks.append(Track(f"{SETUPS[name].text}: the end", run.truth[last], run.estimate[last],
                            run.covariance[last], run.injections))  # fmt: skip
    return plot_uncertainty(of.floor.map, _anchors(of), tracks)


def _sigmas(runs: dict[str, Run]) -> Figure:
    run = runs[SIGMAS[0]]
    edges = np.flatnonzero(np.diff(run.in_room.astype(int), prepend=0, append=0))
    time_s = seconds(run.stamp_ns)
    grey = time_s[np.minimum(edges, len(time_s) - 1)].reshape(-1, 2)
    return plot_sigmas({SETUPS[name].text: seconds(runs[name].stamp_ns) for name in SIGMAS},
                       {SETUPS[name].text: runs[name].sigma_in_body for name in SIGMAS},
                       grey)  # fmt: skip


def _eight() -> Figure:
    of = ride(SEED)
    begin, end = STRETCH_S
    tracks = {}
    for name, method in METHODS.items():
        found = method(of)
        time_s = found.stamp_ns / NANOSECONDS
        tracks[NAMES[name]] = found.position[(time_s >= begin) & (time_s <= end)]
    truth = of.drive.pose_at(np.linspace(begin, end, 400))[:, :2]
    return plot_eight(truth, tracks, f"from {begin:g} s to {end:g} s of an eight")


def _anchors(of: Lap) -> FloatArray:
    return np.array(list(of.floor.anchors.values()))[:, :2]


_COLOURS = (ESTIMATE, REJECTED, ANCHOR, "#CC79A7", "#E69F00")
_ELLIPSES, _ELLIPSE_SIGMAS = 14, 2.0
_MIN_M = 0.01  # the axis of sigmas begins here


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


def plot_uncertainty(grid: GridMap, anchors: FloatArray, tracks: Sequence[Track]) -> Figure:
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
    """Draw the estimate before and after each injection."""
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
            handles += axes.plot(time_s[name], np.maximum(sigma[:, axis], _MIN_M), color=colour,
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
