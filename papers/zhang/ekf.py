# SPDX-License-Identifier: Apache-2.0
"""The EKF's correction by lines of the map; docs/models/zhang.md eq. (10) to (13)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from locfuse.types import FloatArray, wrap_angle
from papers.zhang.lines import Lines

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
