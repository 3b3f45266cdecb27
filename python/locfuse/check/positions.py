# SPDX-License-Identifier: Apache-2.0
"""Ranges of one moment, and the positions that they give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray

EPOCH_S = 0.25  # ranges of one tag within this time count as taken at once
BRIDGED_S = 1.5
MAX_EPOCHS = 1500


def dop(bound: FloatArray) -> FloatArray:
    """Return the root of the trace of each bound, infinite where the bound is."""
    trace = np.trace(bound, axis1=1, axis2=2)
    return np.sqrt(np.where(np.isfinite(trace) & (trace >= 0.0), trace, np.inf))


def epochs(
    table: Columns, anchor: NDArray[np.intp], distance: FloatArray, anchors: int
) -> tuple[StampArray, FloatArray]:
    """Group the ranges of one tag into moments with each anchor at most once.

    `table` has ``stamp_ns``, sorted; `anchor` (n,) is the index, below `anchors`, of that of each
    row, and `distance` (n,) its range. Returns the mean stamp of each moment (k,), and its ranges
    (k, anchors), NaN where an anchor was not received.
    """
    stamp = table["stamp_ns"]
    group = np.zeros(len(stamp), np.intp)
    begin, received, index = 0, set[int](), -1
    for row, (at, of) in enumerate(zip(stamp.tolist(), anchor.tolist(), strict=True)):
        if index < 0 or of in received or at - begin > EPOCH_S * NANOSECONDS:
            begin, received, index = at, set(), index + 1
        received.add(of)
        group[row] = index
    ranges = np.full((index + 1, anchors), np.nan)
    ranges[group, anchor] = distance
    first = np.searchsorted(group, np.arange(index + 1))
    last = np.searchsorted(group, np.arange(index + 1), side="right") - 1
    middle: StampArray = stamp[first] + (stamp[last] - stamp[first]) // 2
    thin = np.unique(np.linspace(0, index, min(index + 1, MAX_EPOCHS)).astype(np.intp))
    return middle[thin], ranges[thin]


def interpolated(
    table: Columns, anchor: NDArray[np.intp], distance: FloatArray, anchors: int
) -> tuple[StampArray, FloatArray]:
    """Interpolate the ranges to each anchor, for radios that range to one anchor at a time.

    Parameters and returns as of `epochs`; NaN between ranges that are more than `BRIDGED_S` apart.
    """
    stamp = np.unique(table["stamp_ns"])
    stamp = stamp[np.unique(np.linspace(0, len(stamp) - 1, MAX_EPOCHS).astype(np.intp))]
    ranges = np.full((len(stamp), anchors), np.nan)
    for index in range(anchors):
        known, first = np.unique(table["stamp_ns"][anchor == index], return_index=True)
        if len(known) < 2:
            continue
        after = np.clip(np.searchsorted(known, stamp), 1, len(known) - 1)
        bridged = known[after] - known[after - 1] <= BRIDGED_S * NANOSECONDS
        inside = (stamp >= known[0]) & (stamp <= known[-1]) & bridged
        received = distance[anchor == index][first]
        ranges[inside, index] = np.interp(stamp[inside] - known[0], known - known[0], received)
    return stamp, ranges


def limit_of(sigma: float) -> float:
    """Return the residual beyond which no noise of this sigma explains a range, metres.

    Walls and bodies lengthen ranges by some decimetres, and a sigma may be given too small.
    """
    return max(5.0 * sigma, 0.3)


def located(
    anchors: FloatArray, ranges: FloatArray, sigma: float, *, height: float
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return positions in the plane of a known height, their covariances, and whether ranges agree.

    Where the ranges of a moment contradict one another, the worst are left out until the others
    agree, at least two more than are left out; without such others all count. `anchors` (m, 3),
    `ranges` (n, m), NaN where missing, `sigma` of a range and `height` of the tag are in metres.
    Positions (n, 2) are NaN where not exactly one fits, covariances are (n, 2, 2).
    """
    position, covariance, _ = _fitted(anchors, ranges, sigma, height)
    explained = _agree(anchors, ranges, sigma, position, height)
    rest, rows = ranges.copy(), np.flatnonzero(~explained)
    for left_out in range(1, len(anchors)):
        rows = rows[np.isfinite(ranges[rows]).sum(axis=1) >= 2 * left_out + 2]
        trials = np.repeat(rest[rows, None, :], len(anchors), axis=1)
        trials[:, np.eye(len(anchors), dtype=np.bool_)] = np.nan
        *_, cost = _fitted(anchors, trials.reshape(-1, len(anchors)), sigma, height)
        cost = np.where(np.isnan(rest[rows]), np.inf, cost.reshape(rest[rows].shape))
        rest[rows, np.argmin(cost, axis=1)] = np.nan
        at, spread, _ = _fitted(anchors, rest[rows], sigma, height)
        agree = _agree(anchors, rest[rows], sigma, at, height)
        found, rows = rows[agree], rows[~agree]
        position[found], covariance[found], explained[found] = at[agree], spread[agree], True
    return position, covariance, explained


def _fitted(
    anchors: FloatArray, ranges: FloatArray, sigma: float, height: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the positions by least squares, their covariances and costs, infinite without one."""
    found = _core.locate_batch(anchors, ranges, sigma, height=height)
    status = _core.PositionStatus
    several = np.isin(found.status, [int(status.AMBIGUOUS), int(status.UNDERDETERMINED)])
    position: FloatArray = np.where(several[:, None], np.nan, found.position)
    cost: FloatArray = np.where(np.isfinite(position[:, 0]), found.cost, np.inf)
    return position, found.covariance.copy(), cost


def _agree(
    anchors: FloatArray, ranges: FloatArray, sigma: float, position: FloatArray, height: float
) -> NDArray[np.bool_]:
    """Return at which moments no range is off from the position by more than noise explains."""
    off = np.abs(residuals_of(anchors, ranges, position, height)) > limit_of(sigma)
    return np.asarray(np.isfinite(position[:, 0]) & ~np.any(off, axis=1))


def residuals_of(
    anchors: FloatArray, ranges: FloatArray, position: FloatArray, height: float
) -> FloatArray:
    """Return range minus distance, NaN where either is unknown."""
    reach = np.linalg.norm(position[:, None, :] - anchors[None, :, :2], axis=2)
    return np.asarray(ranges - np.hypot(reach, anchors[:, 2] - height))
