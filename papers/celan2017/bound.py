# SPDX-License-Identifier: Apache-2.0
"""How near any filter can come on wheels and fixes of tags: the posterior Cramer-Rao bound."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from locfuse.sim.sensors import relative_poses, seconds
from locfuse.sim.trajectory import Drive
from locfuse.types import Columns, FloatArray, StampArray
from papers.celan2017.world import (
    SIGMA_LONGITUDINAL,
    SIGMA_PER_SQRT_M,
    SIGMA_PER_SQRT_RAD,
    SIGMA_ROTATION,
    SIGMA_SCALE,
    SIGMA_TURN_BIAS_RADPS,
    TAGS,
)

SIGMA_WRONG = (SIGMA_SCALE, SIGMA_ROTATION, SIGMA_TURN_BIAS_RADPS)  # of wheels, all the time


def least_covariances(
    drive: Drive, stamp_ns: StampArray, fixes: Columns, sigma_start: tuple[float, float, float]
) -> FloatArray:
    """Return the covariance of the pose that no causal estimator goes below along a drive.

    The information recursion over (x, y, heading, scale, turn scale, turn bias) with the Jacobians
    where the body is and the noise of `wheels` and `radios` (Tichavsky, Muravchik and Nehorai,
    1998, of a known path): of whatever knows this noise and takes the motion from the wheels.

    Parameters
    ----------
    drive : Drive
    stamp_ns : int64 array, shape (n,)
        Of the wheels, from the start on.
    fixes : columns
        As in `Lap`, in order of time, told when they are measured.
    sigma_start : (x, y, heading)
        Metres and radians.

    Returns
    -------
    float64 array, shape (n - 1, 3, 3)
        Of (x, y, heading) at every stamp but the first, fixes of that stamp included.
    """
    events = np.union1d(stamp_ns, fixes["stamp_ns"])
    pose = drive.pose_at(seconds(events))
    motion, dt_s = relative_poses(pose), np.diff(seconds(events))
    P = np.diag(np.square([*sigma_start, *SIGMA_WRONG]))
    found = []
    for k, stamp in enumerate(events[1:].tolist()):
        F, Q = _moved(pose[k, 2], motion[k], dt_s[k])
        P = F @ P @ F.T + Q
        for row in np.flatnonzero(fixes["stamp_ns"] == stamp).tolist():
            arm = TAGS[str(fixes["tag"][row])]
            P = _known(P, _by_pose(pose[k + 1, 2], arm), fixes["covariance"][row])
        found.append(P[:3, :3])
    return np.array(found)[np.isin(events[1:], stamp_ns)]


def _moved(heading: float, motion: FloatArray, dt_s: float) -> tuple[FloatArray, FloatArray]:
    """Return F and Q of a motion in body: docs/models/odometry.md, eq. (2), (3) and (8)."""
    turn = _turn(heading)
    dx, dy = turn @ motion[:2]
    F = np.eye(6)
    F[:2, 2] = -dy, dx
    F[:2, 3] = -dx, -dy
    F[2, 4:] = -motion[2], -dt_s
    distance, angle = float(np.hypot(*motion[:2])), abs(float(motion[2]))
    Q = np.zeros((6, 6))
    Q[:2, :2] = SIGMA_LONGITUDINAL**2 * distance * np.outer(turn[:, 0], turn[:, 0])
    Q[2, 2] = SIGMA_PER_SQRT_M**2 * distance + SIGMA_PER_SQRT_RAD**2 * angle
    return F, Q


def _by_pose(heading: float, arm: tuple[float, float, float]) -> FloatArray:
    """Return how the place of a tag in world depends on the six states."""
    x, y = _turn(heading) @ np.array(arm[:2])
    return np.array([[1.0, 0.0, -y, 0.0, 0.0, 0.0], [0.0, 1.0, x, 0.0, 0.0, 0.0]])


def _known(P: FloatArray, H: FloatArray, R: NDArray[np.float64]) -> FloatArray:
    """Return the covariance once a measurement is known."""
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    kept = np.eye(len(P)) - K @ H
    return np.asarray(kept @ P @ kept.T + K @ R @ K.T)


def _turn(heading: float) -> FloatArray:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s], [s, c]])
