# SPDX-License-Identifier: Apache-2.0
"""Absolute position error of two trajectories with their own stamps, aligned only if asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import NANOSECONDS, FloatArray, Trajectory

ALIGNMENTS = ("none", "se2", "sim2")


@dataclass(frozen=True)
class Ape:
    """Absolute position errors and the alignment behind them.

    `error` (n,) are distances between the `matched` pairs of positions; it and its statistics are
    in metres. `alignment` is ``none``, ``se2`` or ``sim2``; it takes a position p of the estimate
    to scale * R(rotation) p + translation, in radians and metres.
    """

    error: FloatArray
    rmse: float
    mean: float
    median: float
    p95: float
    max: float
    matched: int
    alignment: str
    scale: float
    rotation: float
    translation: FloatArray


def ape(
    estimate: Trajectory, truth: Trajectory, alignment: str = "none", max_difference_s: float = 0.01
) -> Ape:
    """Match two trajectories by stamp, align if asked, and measure distances.

    `alignment` is ``none``, ``se2`` or ``sim2``: move the estimate onto the truth with least
    squares, rigidly or also with a scale. Stamps that differ by more than `max_difference_s` are
    not matched. Raises ValueError if fewer than two poses match, or `alignment` is not known.
    """
    if alignment not in ALIGNMENTS:
        raise ValueError(f"alignment is {alignment!r}, expected one of {', '.join(ALIGNMENTS)}")
    rows, truth_rows = associate(estimate, truth, max_difference_s)
    if len(rows) < 2:
        raise ValueError(
            f"{len(rows)} poses match within {max_difference_s:g} s, expected at least 2: "
            "do both files count time from the same origin?"
        )
    p, q = estimate.position[rows], truth.position[truth_rows]
    scale, rotation, translation = 1.0, 0.0, np.zeros(2)
    if alignment != "none":
        scale, rotation, translation = umeyama(p, q, with_scale=alignment == "sim2")
        cos, sin = np.cos(rotation), np.sin(rotation)
        p = scale * p @ np.array([[cos, sin], [-sin, cos]]) + translation
    error = np.hypot(*(p - q).T)
    return Ape(
        error=error,
        rmse=float(np.sqrt(np.mean(error**2))),
        mean=float(np.mean(error)),
        median=float(np.median(error)),
        p95=float(np.percentile(error, 95)),
        max=float(error.max()),
        matched=len(error),
        alignment=alignment,
        scale=scale,
        rotation=rotation,
        translation=translation,
    )


def associate(
    a: Trajectory, b: Trajectory, max_difference_s: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Match each pose of the shorter trajectory with the nearest in time of the longer.

    Returns the rows of `a` and those of `b`, pair by pair.
    """
    if len(a) > len(b):
        of_b, of_a = associate(b, a, max_difference_s)
        return of_a, of_b
    if len(a) == 0:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    after = np.minimum(np.searchsorted(b.stamp_ns, a.stamp_ns), len(b) - 1)
    before = np.maximum(after - 1, 0)
    to_after = np.abs(b.stamp_ns[after] - a.stamp_ns)
    to_before = np.abs(b.stamp_ns[before] - a.stamp_ns)
    row = np.where(to_before <= to_after, before, after)
    near = np.minimum(to_before, to_after) <= max_difference_s * NANOSECONDS
    return np.flatnonzero(near), row[near]


def umeyama(p: FloatArray, q: FloatArray, with_scale: bool) -> tuple[float, float, FloatArray]:
    """Return scale, rotation and translation that bring p closest to q (Umeyama, 1991), in 2D.

    `p` and `q` have shape (n, 2); the rotation is in radians. Raises ValueError if all points of
    `p`, or all of `q`, are the same: every rotation fits.
    """
    p_mean, q_mean = p.mean(axis=0), q.mean(axis=0)
    p0, q0 = p - p_mean, q - q_mean
    spread = float(np.sum(p0**2))
    # In the plane the best rotation is the angle of sum of conj(p) q as complex numbers.
    along = float(np.sum(p0 * q0))
    across = float(np.sum(p0[:, 0] * q0[:, 1] - p0[:, 1] * q0[:, 0]))
    if spread == 0.0 or (along == 0.0 and across == 0.0):
        raise ValueError("the trajectory does not move, so no rotation can be found; use 'none'")
    rotation = float(np.arctan2(across, along))
    scale = float(np.hypot(across, along)) / spread if with_scale else 1.0
    cos, sin = np.cos(rotation), np.sin(rotation)
    translation: FloatArray = q_mean - scale * np.array([[cos, -sin], [sin, cos]]) @ p_mean
    return scale, rotation, translation
