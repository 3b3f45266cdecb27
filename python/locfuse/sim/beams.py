# SPDX-License-Identifier: Apache-2.0
"""Beams on a grid map, some of whose walls may be glass."""

from __future__ import annotations

import numpy as np

from locfuse import _core
from locfuse.types import FREE, FloatArray, GridMap


def cast(
    grid: GridMap,
    start: FloatArray,
    direction: FloatArray,
    reach: float,
    glass: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return how far beams go until they enter an occupied cell, (n,), metres; infinite if never.

    `start` (n, 2) is x and y in world, metres, where a beam in an occupied cell goes 0; `direction`
    (n,) is its heading, radians; beams end at `reach`, metres. Unknown cells and the outside let
    them pass, and so do with `glass`, (clearness (height, width), luck (n,)), both between 0 and 1,
    cells whose clearness is above the beam's luck. Raises ValueError if a number is not finite.
    """
    if glass is None:
        return _core.RayCaster(grid.occupancy_grid()).cast(start, direction, reach)
    clearness, luck = glass
    levels = np.unique(np.append(clearness, 0.0))  # as many as there are kinds of glass, and one
    level_of = np.searchsorted(levels, luck, side="right") - 1
    hit = np.empty(len(start))
    for i, level in enumerate(levels):
        solid = np.where(clearness > level, FREE, grid.cells).astype(np.int8)
        beams = level_of == i
        seen = GridMap(solid, grid.resolution_m, grid.origin).occupancy_grid()
        hit[beams] = _core.RayCaster(seen).cast(start[beams], direction[beams], reach)
    return hit
