# SPDX-License-Identifier: Apache-2.0
"""Beams on a grid map, walked from cell to cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from locfuse.types import OCCUPIED, FloatArray, GridMap

PASSAGE, WALL, OUTSIDE = 0, 1, 2


def cast(
    grid: GridMap,
    start: FloatArray,
    direction: FloatArray,
    reach: float,
    glass: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return how far beams go until they enter an occupied cell.

    J. Amanatides and A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987;
    each crossing is computed from the beam's start, so that no error adds up.

    Parameters
    ----------
    grid : GridMap
    start : float64 array, shape (n, 2)
        x and y in world, metres; may lie outside of the map. Inside an occupied cell: 0.
    direction : float64 array, shape (n,)
        Heading in world, radians.
    reach : float
        Beams end there, metres.
    glass : (clearness, luck), optional
        float64 arrays, shapes (height, width) and (n,). A beam passes the occupied cells whose
        clearness is above its luck.

    Returns
    -------
    float64 array, shape (n,)
        Metres; infinite where nothing is hit. Unknown cells and the outside let beams pass.
    """
    at, turned = grid.to_grid(start), direction - grid.origin[2]
    along = np.column_stack([np.cos(turned), np.sin(turned)])
    height, width = grid.cells.shape
    codes = np.full((height + 2, width + 2), OUTSIDE, np.int8)
    codes[1:-1, 1:-1] = np.where(grid.cells == OCCUPIED, WALL, PASSAGE)
    travelled = _way_in(at, along, (width, height))
    hit = np.full(len(at), np.inf)
    beam = np.flatnonzero(travelled * grid.resolution_m <= reach)
    clearness, luck = (None, None) if glass is None else (np.pad(glass[0], 1), glass[1])
    state = np.vstack([at[beam].T, along[beam].T])
    entry = state[:2] + travelled[beam] * state[2:]
    cell = np.clip(np.floor(entry).astype(np.int64), 0, [[width - 1], [height - 1]])
    travelled = travelled[beam]
    while len(beam) > 0:
        code = codes[cell[1] + 1, cell[0] + 1]
        if clearness is not None and luck is not None:
            passed = (code == WALL) & (clearness[cell[1] + 1, cell[0] + 1] > luck[beam])
            code = np.where(passed, PASSAGE, code)
        travelled = travelled * grid.resolution_m
        ends = (code == WALL) & (travelled <= reach)
        hit[beam[ends]] = travelled[ends]
        left = (code == PASSAGE) & (travelled <= reach)
        beam, state, cell = beam[left], state[:, left], cell[:, left]
        travelled = _step(state, cell)
    return hit


def _step(state: FloatArray, cell: NDArray[np.int64]) -> FloatArray:
    """Move beams into the next cell; return how far from their start they enter it, in cells."""
    at, along = state[:2], state[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (cell + (along > 0.0) - at) / along
    x[along[0] == 0.0] = np.inf
    y[along[1] == 0.0] = np.inf
    sideways = x <= y
    cell += np.where([sideways, ~sideways], np.where(along > 0.0, 1, -1), 0)
    return np.asarray(np.where(sideways, x, y), dtype=np.float64)


def _way_in(at: FloatArray, along: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return how far beams go until they are on the map, in cells; infinite if they never are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = -at / along, (np.array(shape) - at) / along
    within = (at >= 0.0) & (at < np.array(shape))
    standing = along == 0.0
    enters = np.where(standing, np.where(within, -np.inf, np.inf), np.minimum(first, last))
    leaves = np.where(standing, np.inf, np.maximum(first, last))
    begin, end = np.maximum(enters.max(axis=1), 0.0), leaves.min(axis=1)
    begin[begin > end] = np.inf
    return np.asarray(begin, dtype=np.float64)
