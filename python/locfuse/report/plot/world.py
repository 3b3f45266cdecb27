# SPDX-License-Identifier: Apache-2.0
"""What pictures of the world have in common: limits, axes and map."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from locfuse.report.plot import style
from locfuse.types import OCCUPIED, UNKNOWN, FloatArray, GridMap

_PIXELS = 1000  # approximate width of the axes of a picture


def box_around(
    points: FloatArray, margin: float, flattest: float = 0.0, tallest: float = np.inf
) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box around finite points, shape (n, 2).

    The margin is a share of the longer side, or of 1 m if that is more; the box is grown until it
    is `flattest` to `tallest` times as high as wide.
    """
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    rim = margin * max(float((high - low).max()), 1.0)
    low, high = low - rim, high + rim
    width, height = (high - low).tolist()
    grow = np.array([max(height / tallest - width, 0.0), max(width * flattest - height, 0.0)]) / 2.0
    return low - grow, high + grow


def world_figure(
    low: FloatArray, high: FloatArray, more_in: float, share: float = 0.94
) -> tuple[Figure, Axes]:
    """Return a figure with axes of the world between two corners [m], its scales equal.

    The axes take a `share` of its width; it is `more_in` higher than they are.
    """
    width, height = (high - low).tolist()
    figure = style.new_figure(share * style.WIDTH_IN * height / width + more_in)
    axes = figure.add_subplot()
    style.dress(axes)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="x in world [m]", ylabel="y in world [m]")
    return figure, axes


def drawable(grid: GridMap, width_m: float) -> GridMap:
    """Return the map in cells of at least a pixel of a picture of that width.

    Walls that are thinner would fall between pixels.
    """
    pixel_m = width_m / _PIXELS
    return grid if grid.resolution_m >= pixel_m else grid.resampled(pixel_m)


def draw_map(
    axes: Axes,
    grid: GridMap,
    colours: tuple[str, str, str] = ("white", style.GRID, style.MUTED),
    zorder: float = 0,
) -> None:
    """Draw free, unknown and occupied cells, and leave the limits of the axes as they are."""
    height, width = grid.cells.shape
    x, y, yaw = grid.origin
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(
        np.select([grid.cells == OCCUPIED, grid.cells == UNKNOWN], [2, 1], 0),
        origin="lower",
        extent=(0.0, width, 0.0, height),
        transform=Affine2D().scale(grid.resolution_m).rotate(yaw).translate(x, y) + axes.transData,
        cmap=ListedColormap(list(colours)),
        vmin=0,
        vmax=2,
        zorder=zorder,
        interpolation="nearest",
    )
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])
