# SPDX-License-Identifier: Apache-2.0
"""Picture of a map, the drive that it was made of, and the places that were seen again."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from locfuse.report.decimation import stride
from locfuse.report.plot import style
from locfuse.report.plot.world import box_around, draw_map, drawable, world_figure
from locfuse.run.mapping import MapResult
from locfuse.types import FloatArray, GridMap

_MAX_POINTS = 20000


def plot_map(result: MapResult) -> Figure:
    """Draw a map in its frame, metres.

    Thin lines join places where the same was seen; those that were rejected are red. With a map
    that was continued, walls that are new and walls that are gone have colours of their own.
    """
    grid = result.grid
    known = np.argwhere(grid.cells >= 0)
    corners = (
        np.array([known.min(axis=0), known.max(axis=0) + 1]) if len(known) else np.zeros((2, 2))
    )
    way = result.estimate.position
    low, high = box_around(np.vstack([way, _in_world(grid, corners)]), 0.02, 0.2, 0.9)
    figure, axes = world_figure(low, high, 1.3)
    handles: list[style.Handle] = []
    draw_map(axes, drawable(grid, (high - low)[0]))
    axes.grid(visible=False)
    few = way[stride(len(way), _MAX_POINTS)]
    handles += axes.plot(*few.T, color=style.ESTIMATE, lw=1.0, label="drive", zorder=2)
    for kept, color, label in ((True, style.MUTED, "seen again"),
                               (False, style.REJECTED, "rejected")):  # fmt: skip
        ends = [_ends(result, one.from_ns, one.to_ns) for one in result.loops
                if one.kept is kept and one.from_ns is not None]  # fmt: skip
        if ends:
            axes.add_collection(LineCollection(ends, colors=color, linewidths=0.6, zorder=3))
            handles.append(Line2D([], [], color=color, lw=0.6, label=label))
    for cells, color, label in ((result.appeared, style.ANCHOR, "new wall"),
                                (result.vanished, style.REJECTED, "wall gone")):  # fmt: skip
        if cells is not None and cells.any():
            at = _in_world(grid, np.argwhere(cells) + 0.5)
            handles += style.marks(axes, at[stride(len(at), _MAX_POINTS)], "s", 2, color, label)
    style.legend(figure, handles)
    return figure


def _in_world(grid: GridMap, cells: NDArray[Any]) -> FloatArray:
    """Return the places of (row, column), which may have fractions."""
    x, y, yaw = grid.origin
    across = grid.resolution_m * np.asarray(cells, np.float64)[:, ::-1]
    c, s = np.cos(yaw), np.sin(yaw)
    at: FloatArray = across @ np.array([[c, s], [-s, c]]) + [x, y]
    return at


def _ends(result: MapResult, begin_ns: int, end_ns: int) -> FloatArray:
    rows = np.searchsorted(result.estimate.stamp_ns, [begin_ns, end_ns])
    ends: FloatArray = result.estimate.position[np.minimum(rows, len(result.estimate) - 1)]
    return ends
