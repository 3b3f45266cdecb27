# SPDX-License-Identifier: Apache-2.0
"""Motion of many poses at once: results/zhang.md eq. (4) and (6)."""

from __future__ import annotations

import numpy as np

from locfuse.types import FloatArray
from papers.zhang.world import control_variance


def drive(pose: FloatArray, control: FloatArray) -> FloatArray:
    """Return poses after a turn and then a way straight ahead: eq. (4).

    Parameters
    ----------
    pose : float64 array, shape (..., 3)
        x, y [m], heading [rad].
    control : float64 array, shape (..., 2)
        Distance [m] and turn [rad].

    Returns
    -------
    float64 array, shape (..., 3)
        Headings are not wrapped.
    """
    heading = pose[..., 2] + control[..., 1]
    x = pose[..., 0] + control[..., 0] * np.cos(heading)
    y = pose[..., 1] + control[..., 0] * np.sin(heading)
    return np.stack([x, y, heading], axis=-1)


def jacobians(pose: FloatArray, control: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of `drive` by pose, eq. (6), and by control.

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    control : float64 array, shape (2,)

    Returns
    -------
    float64 arrays, shapes (n, 3, 3) and (n, 3, 2)
    """
    heading = pose[:, 2] + control[1]
    c, s = np.cos(heading), np.sin(heading)
    F = np.tile(np.eye(3), (len(pose), 1, 1))
    F[:, 0, 2], F[:, 1, 2] = -control[0] * s, control[0] * c
    G = np.zeros((len(pose), 3, 2))
    G[:, 0], G[:, 1] = np.stack([c, F[:, 0, 2]], axis=1), np.stack([s, F[:, 1, 2]], axis=1)
    G[:, 2, 1] = 1.0
    return F, G


def predict(
    pose: FloatArray, covariance: FloatArray, controls: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of each pose after some controls: the EKF's prediction.

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    covariance : float64 array, shape (n, 3, 3)
    controls : float64 array, shape (m, 2)
    """
    for control in controls:
        F, G = jacobians(pose, control)
        Q = (G * control_variance(control)) @ G.swapaxes(1, 2)
        covariance = F @ covariance @ F.swapaxes(1, 2) + Q
        pose = drive(pose, control)
    return pose, covariance


def sample(pose: FloatArray, controls: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw where each pose may have come to: line 4 of Table 1.

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    controls : float64 array, shape (m, 2)
    rng : numpy Generator
    """
    for control in controls:
        noise = np.sqrt(control_variance(control)) * rng.standard_normal((len(pose), 2))
        pose = drive(pose, control + noise)
    return pose
