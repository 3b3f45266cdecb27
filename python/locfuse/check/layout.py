# SPDX-License-Identifier: Apache-2.0
"""How well ranges fix a position over the floor, and where one more anchor would help most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse import _core
from locfuse.check.context import Context
from locfuse.check.grid import known
from locfuse.check.positions import dop
from locfuse.check.rules_anchors import hull
from locfuse.types import FloatArray, GridMap

_CELLS = 80  # of the picture along the longer side
_COARSE = 24  # of the search
WORST = 20.0  # dilution beyond which a place counts as lost


@dataclass(frozen=True)
class Layout:
    """Horizontal dilution of precision over the floor, for a tag of known height.

    Attributes
    ----------
    names : list of str
    anchors : float64 array, shape (m, 3)
    height, sigma : float
        Of the tag, and of a typical range, metres.
    x, y : float64 arrays, shapes (columns,), (rows,)
        Of the grid, metres.
    hdop : float64 array, shape (rows, columns)
        Error of a position over error of a range; infinite where ranges fix none, NaN where the
        map has no floor.
    hull : float64 array, shape (k, 2)
        Corners of the anchors' convex hull.
    walls : float64 array, shape (n, 4)
        Of the simulation: x1, y1, x2, y2.
    grid : GridMap or None
        Map of the log.
    path : float64 array, shape (n, 2), or None
        Truth, where known.
    best : float64 array, shape (3,)
        Place of one more anchor that lowers the mean dilution most.
    mean, worst : tuples of 2 floats
        Dilution over the floor now and with it; places beyond 20 count as 20.
    """

    names: list[str]
    anchors: FloatArray
    height: float
    sigma: float
    x: FloatArray
    y: FloatArray
    hdop: FloatArray
    hull: FloatArray
    walls: FloatArray
    grid: GridMap | None
    path: FloatArray | None
    best: FloatArray
    mean: tuple[float, float]
    worst: tuple[float, float]

    def sentence(self) -> str:
        """Return the picture in words."""
        return (
            f"dilution over the floor: mean {_times(self.mean[0])}, worst {_times(self.worst[0])} "
            f"(times {self.sigma:.2g} m of a range); one more anchor helps most at {self.gain()}"
        )

    def gain(self) -> str:
        """Return the best place for one more anchor, and what it gives, in words."""
        x, y, z = self.best
        mean, worst = (f"{_times(now)} to {_times(then)}" for now, then in (self.mean, self.worst))
        return f"({x:.2f}, {y:.2f}, {z:.2f}): mean {mean}, worst {worst}"


def layout_of(context: Context) -> Layout | None:
    """Return the layout of the anchors, None without anchors or floor."""
    if len(context.anchors) == 0 or context.floor is None or context.used("ranges") is None:
        return None
    low, high = context.floor
    x, y = _axes(low, high, _CELLS)
    points = _points(x, y)
    fine = dop(_core.cramer_rao(context.anchors, points, 1.0, context.height))
    grid = context.log.grid
    if grid is not None:
        fine[~known(grid, points)] = np.nan
    best, before, after = _one_more(context)
    scenario = context.config.simulation
    walls = [wall for fault in (scenario.faults if scenario else [])
             for wall in getattr(fault, "walls", [])]  # fmt: skip
    truth = None if context.frame_of_truth is not None else context.truth
    return Layout(
        names=context.names,
        anchors=context.anchors,
        height=context.height,
        sigma=context.typical_sigma,
        x=x,
        y=y,
        hdop=fine.reshape(len(y), len(x)),
        hull=hull(context.anchors[:, :2]),
        walls=np.array(walls, dtype=np.float64).reshape(-1, 4),
        grid=grid,
        path=None if truth is None else truth.position,
        best=best,
        mean=(float(before.mean()), float(after.mean())),
        worst=(float(before.max()), float(after.max())),
    )


def _times(dilution: float) -> str:
    return f"{dilution:.2f}" if dilution < WORST else f"over {WORST:g}"


def _axes(low: FloatArray, high: FloatArray, cells: int) -> tuple[FloatArray, FloatArray]:
    """Return the coordinates of a grid of about square cells, borders included."""
    step = float((high - low).max()) / cells
    counts = np.maximum(np.round((high - low) / step), 1.0).astype(int) + 1
    return np.linspace(low[0], high[0], counts[0]), np.linspace(low[1], high[1], counts[1])


def _points(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _one_more(context: Context) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the best place for one more anchor, and the dilution without and with it.

    Tried on a grid over the floor, borders included, at the anchors' median height; the mean over
    the same grid decides.
    """
    assert context.floor is not None
    places = _points(*_axes(*context.floor, _COARSE))
    if context.log.grid is not None:
        floor = known(context.log.grid, places)
        places = places[floor] if floor.any() else places
    level = float(np.median(context.anchors[:, 2]))
    found = information(context.anchors, places, context.height).sum(axis=1)
    candidates = np.column_stack([places, np.full(len(places), level)])
    added = information(candidates, places, context.height)
    trials = dilution(found[:, None] + added)
    best = int(np.argmin(trials.mean(axis=0)))
    return candidates[best], dilution(found), trials[:, best]


def information(anchors: FloatArray, points: FloatArray, height: float) -> FloatArray:
    """Return the information of each range at each point, for a unit sigma.

    `anchors` (m, 3), `points` (k, 2) and `height` of the tag in metres. The result (k, m, 3) is
    u u' of the direction u in the plane, as xx, xy, yy.
    """
    off = points[:, None, :] - anchors[None, :, :2]
    square = np.sum(off**2, axis=2) + (anchors[:, 2] - height) ** 2
    xx, xy, yy = off[..., 0] ** 2, off[..., 0] * off[..., 1], off[..., 1] ** 2
    found: FloatArray = np.stack([xx, xy, yy], axis=-1)
    found /= np.maximum(square, 1e-9)[..., None]
    return found


def dilution(found: FloatArray) -> FloatArray:
    """Return the root of the trace of the inverse of information (..., 3), at most `WORST`."""
    xx, xy, yy = np.moveaxis(found, -1, 0)
    determinant = np.maximum(xx * yy - xy**2, 1e-12)
    return np.asarray(np.minimum(np.sqrt((xx + yy) / determinant), WORST))
