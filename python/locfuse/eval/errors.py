# SPDX-License-Identifier: Apache-2.0
"""Estimate minus truth, at the stamps of the estimate, nothing aligned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import NANOSECONDS, FloatArray, StampArray, Trajectory, wrap_angle

LONGEST_GAP_S = 2.0  # truth is not interpolated over longer gaps


@dataclass(frozen=True)
class Errors:
    """Estimate minus truth where truth is known.

    Attributes
    ----------
    row : int array, shape (n,)
        Rows of the estimate that were compared.
    stamp_ns : int64 array, shape (n,)
    position : float64 array, shape (n, 2)
        Metres, in world.
    heading : float64 array, shape (n,), or None
        Radians in [-pi, pi); None where truth or estimate has no heading.
    sigma : float64 array, shape (n, 3), or None
        Standard deviations of x, y, heading that the estimator claims.
    height : float64 array, shape (n,), or None
        Metres; None where truth or estimate has no height.
    rotation : float64 array, shape (n, 3), or None
        Rotation from estimate to truth [rad]: about the body's x and y axes, were it level, and the
        vertical; None where truth or estimate has no orientation.
    nees : float64 array, shape (n,), or None
        Normalised estimation error squared, e' P^-1 e (Bar-Shalom, Li and Kirubarajan, 2001, eq.
        5.4.2-3), of `dof` components; None without covariance.
    dof : int
        3 with headings, else 2.
    """

    row: NDArray[np.intp]
    stamp_ns: StampArray
    position: FloatArray
    heading: FloatArray | None
    sigma: FloatArray | None
    nees: FloatArray | None
    dof: int
    height: FloatArray | None = None
    rotation: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.row)


def interpolate(
    track: Trajectory, stamp_ns: StampArray, longest_gap_s: float = LONGEST_GAP_S
) -> tuple[Trajectory, NDArray[np.bool_]]:
    """Interpolate positions and heights linearly, and headings along the shorter arc.

    Nothing is interpolated between rows further apart than `longest_gap_s`. Returns the poses,
    without covariance, at those of the strictly increasing stamps (n,) that lie on the track, and a
    mask (n,) of those stamps. Raises ValueError if the track is empty.
    """
    if len(track) == 0:
        raise ValueError("the track is empty; expected at least one pose")
    knots = track.stamp_ns
    after = np.searchsorted(knots, stamp_ns)
    on = knots[np.minimum(after, len(knots) - 1)] == stamp_ns
    before = np.maximum(np.where(on, after, after - 1), 0)
    after = np.minimum(after, len(knots) - 1)
    inside = (stamp_ns >= knots[0]) & (stamp_ns <= knots[-1])
    inside &= knots[after] - knots[before] <= round(longest_gap_s * NANOSECONDS)
    before, after, stamps = before[inside], after[inside], stamp_ns[inside]
    # Differences first: nanoseconds since 1970 do not fit a double.
    gap = np.maximum(knots[after] - knots[before], 1)
    share = (stamps - knots[before]) / gap
    start, end = track.position[before], track.position[after]
    position = start + share[:, np.newaxis] * (end - start)
    heading = None
    if track.heading is not None:
        turn = wrap_angle(track.heading[after] - track.heading[before])
        heading = wrap_angle(track.heading[before] + share * turn)
    height = None
    if track.height is not None:
        height = track.height[before] + share * (track.height[after] - track.height[before])
    orientation = None
    if track.orientation is not None:
        one, other = track.orientation[before], track.orientation[after]
        same = np.where(np.sum(one * other, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        mixed = one + share[:, np.newaxis] * (same * other - one)
        orientation = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return Trajectory(stamps, position, heading, height=height, orientation=orientation), inside


def errors_against(estimate: Trajectory, truth: Trajectory) -> Errors:
    """Compare an estimate with truth interpolated to its stamps.

    Both are in the same frame: nothing is aligned. Empty where the two do not overlap in time.
    """
    at, inside = interpolate(truth, estimate.stamp_ns)
    position = estimate.position[inside] - at.position
    heading = None
    if at.heading is not None and estimate.heading is not None:
        heading = wrap_angle(estimate.heading[inside] - at.heading)
    dof = 2 if heading is None else 3
    sigma = nees = None
    if estimate.covariance is not None:
        covariance = estimate.covariance[inside]
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        error = position if heading is None else np.column_stack([position, heading])
        nees = _mahalanobis(error, covariance[:, :dof, :dof])
    height = None
    if at.height is not None and estimate.height is not None:
        height = estimate.height[inside] - at.height
    rotation = None
    if at.orientation is not None and estimate.orientation is not None:
        assert estimate.heading is not None
        rotation = _rotation_between(estimate.orientation[inside], at.orientation,
                                     estimate.heading[inside])  # fmt: skip
    return Errors(np.flatnonzero(inside), at.stamp_ns, position, heading, sigma, nees, dof, height,
                  rotation)  # fmt: skip


def _rotation_between(one: FloatArray, other: FloatArray, heading: FloatArray) -> FloatArray:
    """Return the rotations (n, 3) from some orientations to others, about axes at a heading."""
    w, v = one[:, :1], -one[:, 1:]  # its inverse
    u, t = other[:, :1], other[:, 1:]
    real = u * w - np.sum(t * v, axis=1, keepdims=True)
    axis = u * v + w * t + np.cross(t, v)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.abs(real)) * np.sign(real)
    rotation = axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
    c, s = np.cos(heading), np.sin(heading)
    x, y, z = rotation.T
    return np.column_stack([c * x + s * y, c * y - s * x, z])


def _mahalanobis(error: FloatArray, covariance: FloatArray) -> FloatArray:
    if len(error) == 0:
        return np.empty(0)
    solved = np.linalg.solve(covariance, error[:, :, np.newaxis])[:, :, 0]
    return np.asarray(np.einsum("ni,ni->n", error, solved))
