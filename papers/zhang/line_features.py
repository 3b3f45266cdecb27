# SPDX-License-Identifier: Apache-2.0
"""Lines of scans and maps, and an EKF on them; results/zhang.md eq. (10) to (13)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FREE, FloatArray, GridMap, wrap_angle
from papers.zhang.world import BEAM_RAD

TOLERANCE_M = 0.06  # of a reading beside its line: 3 sigma of the laser
JUMP_M = 0.3  # between neighbours of a line
MIN_POINTS = 6
MIN_LENGTH_M = 0.5
SIGMA_READING_M = 0.03  # across a line, as the laser's data sheet says


@dataclass(frozen=True)
class Lines:
    """Straight pieces of walls, seen from their free side: x cos(alpha) + y sin(alpha) = r.

    Attributes
    ----------
    r : float64 array, shape (k,)
        Distance of the line from the origin along its normal, metres.
    alpha : float64 array, shape (k,)
        Direction of the normal, which points from the free side into the wall, radians.
    middle : float64 array, shape (k, 2)
        Of the piece, metres.
    half_m : float64 array, shape (k,)
        Half of its length.
    covariance : float64 array, shape (k, 2, 2)
        Of (r, alpha).
    """

    r: FloatArray
    alpha: FloatArray
    middle: FloatArray
    half_m: FloatArray
    covariance: FloatArray

    def __len__(self) -> int:
        return len(self.r)


def scan_lines(ranges: FloatArray) -> Lines:
    """Return the lines of a scan in body, the longest first.

    Parameters
    ----------
    ranges : float64 array, shape (181,)
        Metres; NaN where there was no return.
    """
    seen = ~np.isnan(ranges)
    beam = np.column_stack([np.cos(BEAM_RAD), np.sin(BEAM_RAD)])
    points = (ranges[:, None] * beam)[seen]
    ends = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) > JUMP_M) + 1
    return _lines([piece for part in np.split(points, ends)
                   for piece in split_and_merge(part, TOLERANCE_M)])  # fmt: skip


def map_lines(grid: GridMap) -> Lines:
    """Return the lines between free cells and others, in world, the longest first."""
    pieces = []
    for loop in outlines(grid):
        corner = np.flatnonzero(np.any(np.roll(loop, -1, 0) - loop != loop - np.roll(loop, 1, 0),
                                       axis=1))[0]  # fmt: skip
        loop = np.roll(loop, -corner, axis=0)
        closed = grid.to_world(np.concatenate([loop, loop[:1]]).astype(np.float64))
        pieces += split_and_merge(closed, 0.5 * grid.resolution_m)
    return _lines(pieces)


def outlines(grid: GridMap) -> Iterator[NDArray[np.int64]]:
    """Yield the closed ways around free space along edges of cells, free cells on the left.

    Yields
    ------
    int64 array, shape (n, 2)
        Corners of cells: column and row.
    """
    free = np.pad(grid.cells == FREE, 1)
    begins, ends = [], []
    for row, column, begin, end in ((-1, 0, (0, 0), (1, 0)), (0, 1, (1, 0), (1, 1)),
                                    (1, 0, (1, 1), (0, 1)), (0, -1, (0, 1), (0, 0))):  # fmt: skip
        cell = np.argwhere(free & ~np.roll(free, (-row, -column), axis=(0, 1)))[:, ::-1] - 1
        begins.append(cell + begin)
        ends.append(cell + end)
    following: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for a, b in zip(np.vstack(begins).tolist(), np.vstack(ends).tolist(), strict=True):
        following.setdefault(tuple(a), []).append(tuple(b))
    while following:
        at = next(iter(following))
        way = []
        while at in following:
            way.append(at)
            after = following[at].pop()
            if not following[at]:
                del following[at]
            at = after
        yield np.array(way)


def split_and_merge(points: FloatArray, tolerance_m: float) -> list[FloatArray]:
    """Cut a chain of points where it bends; join neighbours that one line fits.

    Parameters
    ----------
    points : float64 array, shape (n, 2)
        In order, metres.
    tolerance_m : float
        Of a point beside its line.

    Returns
    -------
    list of float64 arrays, shapes (n_i, 2)

    Examples
    --------
    >>> corner = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [3, 2], [3, 3]], float)
    >>> [piece.tolist() for piece in split_and_merge(corner, 0.1)]
    [[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]], [[3.0, 1.0], [3.0, 2.0], [3.0, 3.0]]]
    """
    merged: list[FloatArray] = []
    for piece in _split(points, tolerance_m):
        both = np.concatenate([merged[-1], piece]) if merged else piece
        if merged and _across(both).max() <= tolerance_m:
            merged[-1] = both
        else:
            merged.append(piece)
    return merged


def _split(points: FloatArray, tolerance_m: float) -> list[FloatArray]:
    if len(points) < 3:
        return [points]
    along = points[-1] - points[0]
    off = points - points[0]
    length = np.hypot(*along)
    across = np.abs(along[0] * off[:, 1] - along[1] * off[:, 0]) / length if length else (
        np.hypot(*off.T))  # fmt: skip
    at = int(np.argmax(across))
    if across[at] <= tolerance_m:
        return [points]
    return [*_split(points[: at + 1], tolerance_m), *_split(points[at + 1 :], tolerance_m)]


def _across(points: FloatArray) -> FloatArray:
    """Return how far points lie beside the line that fits them best."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return np.abs((points - points.mean(axis=0)) @ axes[-1]) if len(points) > 2 else np.zeros(1)


def _lines(pieces: list[FloatArray]) -> Lines:
    """Fit each piece by total least squares; leave out those that are short."""
    found = [_fitted(piece) for piece in pieces if len(piece) >= MIN_POINTS
             and np.hypot(*(piece[-1] - piece[0])) >= MIN_LENGTH_M]  # fmt: skip
    found.sort(key=lambda line: -line[3])
    return Lines(
        np.array([line[0] for line in found]),
        np.array([line[1] for line in found]),
        np.array([line[2] for line in found]).reshape(-1, 2),
        np.array([line[3] for line in found]),
        np.array([line[4] for line in found]).reshape(-1, 2, 2),
    )


def _fitted(points: FloatArray) -> tuple[float, float, FloatArray, float, FloatArray]:
    """Return r, alpha, middle, half length and covariance, eq. (11), of the line through points."""
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    along = axes[0] * np.sign(axes[0] @ (points[-1] - points[0]))
    normal = np.array([along[1], -along[0]])  # what is free lies to the left
    J = np.array([[1.0, along @ middle], [0.0, 1.0]])
    noise = SIGMA_READING_M**2 * np.diag([1.0 / len(points), 1.0 / spread[0] ** 2])
    half = 0.5 * float(np.ptp(points @ along))
    alpha = float(np.arctan2(normal[1], normal[0]))
    return float(normal @ middle), alpha, middle, half, J @ noise @ J.T


GATE = 9.21  # of chi-square with 2 degrees of freedom: 99 %
BEYOND_M = 0.5  # that a line that is seen may lie beyond the end of its wall


def expected_lines(pose: FloatArray, walls: Lines) -> tuple[FloatArray, FloatArray]:
    """Return r [m] and alpha [rad] of walls as seen from poses: eq. (10).

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    walls : Lines
        k of them, in world.

    Returns
    -------
    float64 arrays, shape (n, k)
    """
    normal = np.stack([np.cos(walls.alpha), np.sin(walls.alpha)])
    return walls.r - pose[:, :2] @ normal, wrap_angle(walls.alpha - pose[:, 2:])


def line_jacobians(walls: Lines) -> FloatArray:
    """Return the derivatives of (r, alpha) by pose, eq. (12), shape (k, 2, 3)."""
    H = np.zeros((len(walls), 2, 3))
    H[:, 0, 0], H[:, 0, 1] = -np.cos(walls.alpha), -np.sin(walls.alpha)
    H[:, 1, 2] = -1.0
    return H


def correct(
    pose: FloatArray, covariance: FloatArray, seen: Lines, walls: Lines
) -> tuple[FloatArray, FloatArray]:
    """Correct each pose by the lines that it sees, one after another.

    Each line is taken for the wall that fits it best from the pose as corrected so far, if one
    does.

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    covariance : float64 array, shape (n, 3, 3)
    seen : Lines
        In body.
    walls : Lines
        In world.

    Returns
    -------
    float64 arrays, shapes (n, 3) and (n, 3, 3)
    """
    jacobian = line_jacobians(walls)
    every = np.arange(len(pose))
    for line in range(len(seen)):
        R = seen.covariance[line]
        r, alpha = expected_lines(pose, walls)
        residual = np.stack([seen.r[line] - r, wrap_angle(seen.alpha[line] - alpha)], axis=-1)
        S = jacobian @ covariance[:, None] @ jacobian.swapaxes(1, 2) + R
        nis = np.einsum("nki,nki->nk", residual, np.linalg.solve(S, residual[..., None])[..., 0])
        nis[~_possible(pose, seen, line, walls, r)] = np.inf
        wall = nis.argmin(axis=1)
        H, e = jacobian[wall], residual[every, wall]
        K = np.linalg.solve(S[every, wall], H @ covariance).swapaxes(1, 2)
        K[nis[every, wall] > GATE] = 0.0
        A = np.eye(3) - K @ H
        pose = pose + (K @ e[..., None])[..., 0]
        covariance = A @ covariance @ A.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2)
    return pose, covariance


def _possible(
    pose: FloatArray, seen: Lines, line: int, walls: Lines, r: FloatArray
) -> NDArray[np.bool_]:
    """Return which walls, shape (n, k), stand where a line is seen, their free side to the pose."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x, y = seen.middle[line]
    at = pose[:, :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
    along = np.stack([-np.sin(walls.alpha), np.cos(walls.alpha)])
    off = at @ along - np.sum(walls.middle.T * along, axis=0)
    return np.asarray((np.abs(off) <= walls.half_m + BEYOND_M) & (r > 0.0))
