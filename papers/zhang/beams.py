# SPDX-License-Identifier: Apache-2.0
"""What beams say of poses: docs/models/zhang.md eq. (7) and (8)."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray, GridMap
from papers.zhang.world import BEAM_RAD, RANGE_MAX_M

SIGMA_M = 0.2  # of a reading about its expectation: laser, map and a particle's share of the space
SHARE_GAUSSIAN = 0.95  # lambda_g
SHARE_MAXIMUM = 1.0 - SHARE_GAUSSIAN  # lambda_d
PEAK = float(np.log(SHARE_GAUSSIAN / (SIGMA_M * np.sqrt(2.0 * np.pi))))  # of what is as expected


class RangeMap:
    """What each beam would read from each pose, to half a cell.

    Beams go as far at once as the distance to the nearest wall lets them, which is several times as
    fast as from cell to cell; eq. (8) is wider than a cell.

    Parameters
    ----------
    grid : GridMap
    """

    def __init__(self, grid: GridMap) -> None:
        self._field = _core.DistanceField(grid.occupancy_grid(), 0.0)
        self._resolution_m = grid.resolution_m

    def expected(self, pose: FloatArray) -> FloatArray:
        """Return the expectation of each beam from poses, shape (n, 3).

        Returns
        -------
        float64 array, shape (n, 181)
            Metres, at most `RANGE_MAX_M`.
        """
        direction = (pose[:, 2:] + BEAM_RAD).ravel()
        along = np.column_stack([np.cos(direction), np.sin(direction)])
        start = np.repeat(pose[:, :2], len(BEAM_RAD), axis=0)
        travelled = np.zeros(len(direction))
        left = np.arange(len(direction))
        while len(left) > 0:
            at = start[left] + travelled[left, None] * along[left]
            free = self._field.distance(at)
            # The look-up goes from middle to middle of cells: either may be half a diagonal off.
            step = np.maximum(free - np.sqrt(2.0) * self._resolution_m, 0.5 * self._resolution_m)
            goes = (free > 0.0) & (travelled[left] < RANGE_MAX_M)
            left = left[goes]
            travelled[left] += step[goes]
        overshoot = 0.25 * self._resolution_m  # on average
        travelled = np.clip(travelled - overshoot, 0.0, RANGE_MAX_M)
        return travelled.reshape(len(pose), len(BEAM_RAD))


def log_likelihoods(ranges: FloatArray, expected: FloatArray) -> FloatArray:
    """Return the logarithm of eq. (8) for each beam; their sum over beams is that of eq. (7).

    The delta of a reading without return has the same value from every pose, which is taken as 1.

    Parameters
    ----------
    ranges : float64 array, shape (181,)
        NaN where there was no return.
    expected : float64 array, shape (n, 181)

    Returns
    -------
    float64 array, shape (n, 181)
    """
    gaussian = PEAK - 0.5 * ((ranges - expected) / SIGMA_M) ** 2
    return np.where(np.isnan(ranges), np.log(SHARE_MAXIMUM), gaussian)
