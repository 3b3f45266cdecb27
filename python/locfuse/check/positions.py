# SPDX-License-Identifier: Apache-2.0
"""Positions from the ranges of one moment, and the bound on how well they can be known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray

EPOCH_S = 0.25  # ranges of one tag within this time count as taken at once
BRIDGED_S = 1.5
MOST_EPOCHS = 1500

_ITERATIONS = 12
_THINNEST = 0.05  # anchors of an epoch that are less wide than this share of their length


@dataclass(frozen=True)
class Located:
    """Positions of many epochs; NaN where too few ranges or anchors in one line give none."""

    position: FloatArray
    cost: FloatArray


def cramer_rao(
    anchors: ArrayLike, points: ArrayLike, sigma: ArrayLike, height: float | None = None
) -> FloatArray:
    """Return the smallest covariance that positions from ranges can have.

    Parameters
    ----------
    anchors : array, shape (m, 2) or (m, 3)
        Metres.
    points : array, shape (k, 2) or (k, 3)
    sigma : float or array, shape (m,)
        Standard deviation of a range, metres.
    height : float, optional
        Known height of the points; anchors are (m, 3), points (k, 2).

    Returns
    -------
    float64 array, shape (k, d, d)
        Square metres; infinite where the ranges do not fix the point.
    """
    away = _offsets(anchors, points, height)
    distance = np.linalg.norm(away, axis=2, keepdims=True)
    direction = np.divide(away, distance, out=np.zeros_like(away), where=distance > 1e-9)
    direction = direction[:, :, : np.shape(points)[1]]
    weight = 1.0 / np.square(np.broadcast_to(np.asarray(sigma, float), away.shape[1:2]))
    information = np.einsum("kmi,m,kmj->kij", direction, weight, direction)
    known = np.linalg.eigvalsh(information)[:, 0] > 1e-9 * weight.max(initial=0.0)
    bound: FloatArray = np.full_like(information, np.inf)
    bound[known] = np.linalg.inv(information[known])
    return bound


def _offsets(anchors: ArrayLike, points: ArrayLike, height: float | None) -> FloatArray:
    at, seen = np.asarray(anchors, float), np.asarray(points, float)
    if height is not None:
        seen = np.column_stack([seen, np.full(len(seen), height)])
    offsets: FloatArray = seen[:, None, :] - at[None, :, :]
    return offsets


def dop(bound: FloatArray) -> FloatArray:
    """Return the root of the trace of each bound, infinite where the bound is."""
    trace = np.trace(bound, axis1=1, axis2=2)
    value: FloatArray = np.sqrt(np.where(np.isfinite(trace) & (trace >= 0.0), trace, np.inf))
    return value


def epochs(
    table: Columns, anchor: NDArray[np.intp], distance: FloatArray, anchors: int
) -> tuple[StampArray, FloatArray]:
    """Group the ranges of one tag into moments with each anchor at most once.

    Parameters
    ----------
    table : columns with ``stamp_ns``, sorted
    anchor : int array, shape (n,)
        Index of the anchor of each row.
    distance : float64 array, shape (n,)
    anchors : int
        How many there are.

    Returns
    -------
    stamp_ns : int64 array, shape (k,)
        Mean stamp of each moment.
    ranges : float64 array, shape (k, anchors)
        NaN where an anchor was not heard.
    """
    stamp = table["stamp_ns"]
    group = np.zeros(len(stamp), np.intp)
    begin, heard, index = 0, set[int](), -1
    for row, (at, of) in enumerate(zip(stamp.tolist(), anchor.tolist(), strict=True)):
        if index < 0 or of in heard or at - begin > EPOCH_S * NANOSECONDS:
            begin, heard, index = at, set(), index + 1
        heard.add(of)
        group[row] = index
    ranges = np.full((index + 1, anchors), np.nan)
    ranges[group, anchor] = distance
    first = np.searchsorted(group, np.arange(index + 1))
    last = np.searchsorted(group, np.arange(index + 1), side="right") - 1
    middle: StampArray = stamp[first] + (stamp[last] - stamp[first]) // 2
    thin = np.unique(np.linspace(0, index, min(index + 1, MOST_EPOCHS)).astype(np.intp))
    return middle[thin], ranges[thin]


def interpolated(
    table: Columns, anchor: NDArray[np.intp], distance: FloatArray, anchors: int
) -> tuple[StampArray, FloatArray]:
    """Interpolate the ranges to each anchor, for radios that hear one anchor at a time.

    Parameters and returns as of `epochs`; NaN between ranges that are more than `BRIDGED_S` apart.
    """
    stamp = np.unique(table["stamp_ns"])
    stamp = stamp[np.unique(np.linspace(0, len(stamp) - 1, MOST_EPOCHS).astype(np.intp))]
    ranges = np.full((len(stamp), anchors), np.nan)
    for index in range(anchors):
        known, first = np.unique(table["stamp_ns"][anchor == index], return_index=True)
        if len(known) < 2:
            continue
        after = np.clip(np.searchsorted(known, stamp), 1, len(known) - 1)
        bridged = known[after] - known[after - 1] <= BRIDGED_S * NANOSECONDS
        inside = (stamp >= known[0]) & (stamp <= known[-1]) & bridged
        heard = distance[anchor == index][first]
        ranges[inside, index] = np.interp(stamp[inside] - known[0], known - known[0], heard)
    return stamp, ranges


def locate_batch(
    anchors: FloatArray, ranges: FloatArray, sigma: float, *, height: float
) -> Located:
    """Return least-squares positions in the plane of a known height.

    Parameters
    ----------
    anchors : float64 array, shape (m, 3)
    ranges : float64 array, shape (n, m)
        NaN where missing.
    sigma : float
        Metres; scales the cost.
    height : float
        Of the tag, metres.
    """
    heard = np.isfinite(ranges)
    flat, rise = anchors[:, :2], anchors[:, 2] - height
    known = _wide(flat, heard)
    position = np.full((len(ranges), 2), np.nan)
    measured, weight = np.where(heard, ranges, 0.0)[known], heard[known].astype(float)
    x = _linear_start(flat, rise, measured, weight)
    for _ in range(_ITERATIONS):
        x = x + _step(x, flat, rise, measured, weight)
    position[known] = x
    left = residuals_of(anchors, ranges, position, height)
    cost = np.nansum(np.square(left / sigma), axis=1)
    return Located(position, np.where(known, cost, np.nan))


def residuals_of(
    anchors: FloatArray, ranges: FloatArray, position: FloatArray, height: float
) -> FloatArray:
    """Return range minus distance, NaN where either is unknown."""
    reach = np.linalg.norm(position[:, None, :] - anchors[None, :, :2], axis=2)
    left: FloatArray = ranges - np.hypot(reach, anchors[:, 2] - height)
    return left


def _wide(flat: FloatArray, heard: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which epochs heard anchors that span the plane."""
    weight = heard / np.maximum(heard.sum(axis=1, keepdims=True), 1)
    off = flat[None] - (weight @ flat)[:, None, :]
    spread = np.linalg.eigvalsh(np.einsum("nm,nmi,nmj->nij", weight, off, off))
    wide: NDArray[np.bool_] = spread[:, 0] > _THINNEST**2 * np.maximum(spread[:, 1], 1e-9)
    wide &= heard.sum(axis=1) >= 3
    return wide


def _linear_start(
    flat: FloatArray, rise: FloatArray, measured: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return the solution of the squared ranges' differences to their mean."""
    share = weight / weight.sum(axis=1, keepdims=True)
    square = np.sum(flat**2, axis=1) + rise**2 - measured**2
    off = flat[None] - (share @ flat)[:, None, :]
    right = 0.5 * (square - np.sum(share * square, axis=1, keepdims=True))
    matrix = np.einsum("nm,nmi,nmj->nij", share, off, off)
    vector = np.einsum("nm,nmi,nm->ni", share, off, right)
    return _solve(matrix, vector)


def _step(
    x: FloatArray, flat: FloatArray, rise: FloatArray, measured: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return one damped Gauss-Newton step."""
    off = x[:, None, :] - flat[None]
    distance = np.maximum(np.hypot(np.linalg.norm(off, axis=2), rise), 1e-6)
    jacobian = off / distance[:, :, None]
    matrix = np.einsum("nm,nmi,nmj->nij", weight, jacobian, jacobian) + 1e-3 * np.eye(2)
    vector = np.einsum("nm,nmi,nm->ni", weight, jacobian, measured - distance)
    return _solve(matrix, vector)


def _solve(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the solutions of many symmetric systems of two equations."""
    a, b, c = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 1]
    u, v = vector[:, 0], vector[:, 1]
    solved: FloatArray = np.column_stack([c * u - b * v, a * v - b * u])
    solved /= (a * c - b * b)[:, None]
    return solved
