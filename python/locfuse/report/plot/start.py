# SPDX-License-Identifier: Apache-2.0
"""Picture of global initialization: the hypotheses on the way, and the pose that remained."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from locfuse.report.palette import ELLIPSE_SIGMAS
from locfuse.report.plot.path import draw_ellipse
from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    GRID,
    INK,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.report.plot.world import box_around, draw_map
from locfuse.run.start import returns_of
from locfuse.types import NANOSECONDS, OCCUPIED, FloatArray, Hypothesis, RunResult, Start

_MAX_SHOWN = 60  # hypotheses of one moment


def plot_start(result: RunResult) -> Figure | None:
    """Draw the moment with the most hypotheses on the left and the start on the right.

    Two axes over the map and the anchors: each pose that fitted as an arrow with its ellipse, the
    scan as seen from it. Of ``srls_headings`` the left is the sum of distances over the heading.
    None if the run was not started from nothing.
    """
    start = result.start
    if start is None:
        return None
    stamp, widest = max(start.steps, key=lambda step: (len(step[1]), -step[0]))
    figure = new_figure(5.6)
    in_world = start.sums_m is None
    left, right = figure.subplots(1, 2, sharex=in_world, sharey=in_world)
    found = (Hypothesis(start.pose, start.covariance, 1.0),)
    after = (stamp - start.stamp_ns) / NANOSECONDS + start.seconds
    handles: dict[str, Handle] = {}
    panels = [
        (left, widest, stamp, f"after {after:.3g} s: {_poses(len(widest))}"),
        (right, found, start.stamp_ns, f"ready after {start.seconds:.3g} s"),
    ]
    if start.sums_m is not None:
        _draw_sums(left, start.sums_m)
        panels = panels[1:]
    for axes, poses, seen_ns, text in panels:
        dress(axes)
        axes.set_aspect("equal", adjustable="box")
        axes.set_xlabel("x in world [m]")
        title(axes, text)
        if result.log.grid is not None:
            draw_map(axes, result.log.grid, ("white", GRID, MUTED), zorder=0)
        scan = returns_of(result.log, seen_ns) if start.used_scans else np.empty((0, 2))
        for handle in _draw_poses(axes, poses, scan):
            handles[str(handle.get_label())] = handle
    panels[0][0].set_ylabel("y in world [m]")
    _limit(panels[0][0], result, widest)
    for axes, *_ in panels:
        for handle in _draw_world(axes, result, start):
            handles[str(handle.get_label())] = handle
    legend(figure, list(handles.values()))
    return figure


def _draw_sums(axes: Axes, sums_m: FloatArray) -> None:
    dress(axes)
    heading_deg = (np.arange(36) * 10 + 180) % 360 - 180
    best = int(np.argmin(sums_m))
    colours = np.where(np.arange(36) == best, ESTIMATE, MUTED)
    axes.bar(heading_deg, sums_m, width=8.0, color=colours.tolist())
    axes.set_xticks(range(-180, 181, 90))
    axes.set_xlabel("heading [deg]")
    axes.set_ylabel("sum of distances from the map [m]")
    title(axes, f"best of 36 headings: {heading_deg[best]} deg")


def _poses(count: int) -> str:
    return "one pose fits" if count == 1 else f"{count} poses fit"


def _draw_poses(axes: Axes, poses: tuple[Hypothesis, ...], scan: FloatArray) -> list[Handle]:
    handles: list[Handle] = []
    for one in poses[:_MAX_SHOWN]:
        x, y, heading = one.pose.tolist()
        c, s = np.cos(heading), np.sin(heading)
        if len(scan) and len(poses) <= 8:
            seen = scan @ np.array([[c, s], [-s, c]]) + [x, y]
            handles += axes.plot(*seen.T, ls="none", marker=".", markersize=2.5, color=REJECTED,
                                 label="scan", zorder=3)  # fmt: skip
        draw_ellipse(axes, one.pose[:2], one.covariance[:2, :2], ELLIPSE_SIGMAS, facecolor="none",
                     edgecolor=ESTIMATE, linewidth=0.8, zorder=4)  # fmt: skip
        handles += axes.plot(x, y, marker="o", markersize=7, color=ESTIMATE, ls="none",
                             markeredgecolor="white", label="pose that fits", zorder=6)  # fmt: skip
        axes.annotate("", (x, y), (34.0 * c, 34.0 * s), textcoords="offset points", zorder=5,
                      arrowprops={"arrowstyle": "<|-", "color": ESTIMATE, "lw": 1.8,
                                  "shrinkA": 0.0, "shrinkB": 0.0})  # fmt: skip
        if len(poses) > 1:
            axes.annotate(f"{100 * one.probability:.0f} %", (x, y), (47.0 * c, 44.0 * s),
                          textcoords="offset points", ha="center", va="center", fontsize=8,
                          color=INK, zorder=7)  # fmt: skip
    return handles


def _draw_world(axes: Axes, result: RunResult, start: Start) -> list[Handle]:
    handles: list[Handle] = []
    if "anchors" in result.log:
        table = result.log["anchors"]
        handles += axes.plot(table["x_m"], table["y_m"], ls="none", marker="^", markersize=8,
                             color=ANCHOR, markeredgecolor="white", label="anchor",
                             zorder=5)  # fmt: skip
    if "landmarks" in result.log:
        table = result.log["landmarks"]
        handles += axes.plot(table["x_m"], table["y_m"], ls="none", marker="D", markersize=6,
                             color=MUTED, markeredgecolor="white", label="landmark",
                             zorder=5)  # fmt: skip
    if result.truth is not None and len(result.truth):
        row = int(np.argmin(np.abs(result.truth.stamp_ns - start.stamp_ns)))
        x, y = result.truth.position[row].tolist()
        handles += axes.plot(x, y, marker="x", markersize=9, color=TRUTH, ls="none",
                             label="truth", zorder=8)  # fmt: skip
    return handles


def _limit(axes: Axes, result: RunResult, poses: tuple[Hypothesis, ...]) -> None:
    """Show anchors, landmarks, poses and the occupied part of the map, with a margin."""
    points: list[FloatArray] = [np.array([one.pose[:2] for one in poses])]
    for places in {"anchors", "landmarks"} & set(result.log.tables):
        table = result.log[places]
        points.append(np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64))
    grid = result.log.grid
    if grid is not None:
        points.append(grid.to_world(np.argwhere(grid.cells == OCCUPIED)[:, ::-1].astype(float)))
    low, high = box_around(np.vstack(points), 0.05)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
