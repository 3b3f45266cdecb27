# SPDX-License-Identifier: Apache-2.0
"""The similar energy region: poses from which a scan could be as long as it is.

The paper's Fig. 1 names it without explaining it; docs/models/zhang.md eq. (14).
"""

from __future__ import annotations

import numpy as np

from locfuse.sim.beams import cast
from locfuse.sim.space import middle_of
from locfuse.types import FREE, FloatArray, GridMap
from papers.zhang.world import RANGE_MAX_M

SPACING_M = 0.25
HEADINGS = 72
SHARE = 0.1  # of all poses that are taken for similar


class EnergyMap:
    """Energies of poses on a lattice over the free space, computed once per map.

    Parameters
    ----------
    grid : GridMap
    """

    def __init__(self, grid: GridMap) -> None:
        every = max(1, round(SPACING_M / grid.resolution_m))
        cells = np.argwhere(grid.cells[::every, ::every] == FREE) * every
        self._spacing_m = every * grid.resolution_m
        heading = 2.0 * np.pi / HEADINGS * np.arange(HEADINGS)
        at = middle_of(grid, cells)
        distance = cast(grid, np.repeat(at, HEADINGS, axis=0), np.tile(heading, len(at)),
                        RANGE_MAX_M).reshape(len(at), HEADINGS)  # fmt: skip
        energy = 1.0 - np.minimum(distance, RANGE_MAX_M) / RANGE_MAX_M
        quarter = HEADINGS // 4
        ahead = [np.roll(energy, turn, axis=1) for turn in range(-quarter, quarter + 1)]
        self._energy: FloatArray = np.mean(ahead, axis=0).ravel()
        self._pose = np.column_stack([np.repeat(at, HEADINGS, axis=0), np.tile(heading, len(at))])

    def draw(self, ranges: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw poses whose energy is near that of a scan.

        Parameters
        ----------
        ranges : float64 array, shape (181,)
            Metres; NaN where there was no return.
        count : int
        rng : numpy Generator

        Returns
        -------
        float64 array, shape (count, 3)
            Spread over the shares of their lattice points.
        """
        energy = 1.0 - np.nanmean(ranges) / RANGE_MAX_M
        similar = max(1, round(SHARE * len(self._energy)))
        nearest = np.argpartition(np.abs(self._energy - energy), similar - 1)[:similar]
        share = [self._spacing_m, self._spacing_m, 2.0 * np.pi / HEADINGS]
        offset = share * (rng.random((count, 3)) - 0.5)
        return np.asarray(self._pose[rng.choice(nearest, count)] + offset)
