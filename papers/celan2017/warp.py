# SPDX-License-Identifier: Apache-2.0
"""A map that is bent a little, as a robot draws it: right in one place, off elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from locfuse.sim.space import cell_of, middle_of
from locfuse.types import OCCUPIED, UNKNOWN, FloatArray, GridMap

Box: TypeAlias = tuple[float, float, float, float]
Shift: TypeAlias = Callable[[FloatArray], FloatArray]

WAVES = 6
LONGEST_M, SHORTEST_M = 60.0, 30.0  # waves
FADE_M = 15.0  # from the rim of where the map is right to where it bends fully


def bend(
    rng: np.random.Generator, around: Box, right: Box, most_m: float, rim_m: float = 1.0
) -> Shift:
    """Return by how much a map shifts each point of the world: a sum of long waves.

    Parameters
    ----------
    rng : numpy Generator
    around : (x1, y1, x2, y2)
        In which no shift is longer than `most_m`, and one is as long; metres.
    right : (x1, y1, x2, y2)
        In which no point is shifted, nor within `rim_m` of it.
    most_m, rim_m : float

    Returns
    -------
    callable
        Takes points, shape (n, 2), and returns their shifts, shape (n, 2); metres, world.

    Raises
    ------
    ValueError
        If a length is negative, or the map would be right everywhere.
    """
    if not (most_m >= 0.0 and rim_m >= 0.0):
        raise ValueError(f"most_m is {most_m} and rim_m is {rim_m}, expected neither below 0")
    length = rng.uniform(SHORTEST_M, LONGEST_M, WAVES)
    towards = rng.uniform(-np.pi, np.pi, WAVES)
    wave = 2.0 * np.pi / length * np.stack([np.cos(towards), np.sin(towards)])
    phase = rng.uniform(-np.pi, np.pi, WAVES)
    height = rng.standard_normal((WAVES, 2))

    def whole(point: FloatArray) -> FloatArray:
        outside = np.maximum(np.array(right[:2]) - point, point - np.array(right[2:]))
        off = np.hypot(*np.maximum(outside, 0.0).T) - rim_m
        share = np.clip(off / FADE_M, 0.0, 1.0)
        fade = share**2 * (3.0 - 2.0 * share)
        return np.asarray(fade[:, None] * (np.sin(point @ wave + phase) @ height))

    axes = (
        np.arange(low, high + 0.5, 0.5) for low, high in zip(around[:2], around[2:], strict=True)
    )
    lattice = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    longest = float(np.hypot(*whole(lattice).T).max())
    if longest == 0.0:
        raise ValueError(f"the map is right in {right} and around it, which leaves nothing to bend")
    scale = most_m / longest
    return lambda point: scale * whole(point)


def bent(grid: GridMap, shift: Shift, margin_m: float) -> GridMap:
    """Return a map on which each point of another one is shifted.

    A wall stays closed: the cells are occupied into which the shifted quarters of its cells fall,
    too. No cell is free that was not.

    Parameters
    ----------
    grid : GridMap
    shift : callable
        As of `bend`.
    margin_m : float
        By which the new map reaches beyond the other one on every side, unknown at first.
    """
    rim = int(np.ceil(margin_m / grid.resolution_m))
    cells = np.pad(grid.cells, rim, constant_values=UNKNOWN)
    x, y = grid.to_world(np.array([-float(rim), -float(rim)])).tolist()
    wide = GridMap(cells, grid.resolution_m, (x, y, grid.origin[2]))
    rows, columns = cells.shape
    every = np.argwhere(np.ones_like(cells, np.bool_))
    at = middle_of(wide, every)
    from_row, from_column = np.clip(cell_of(wide, at - shift(at)), 0, [rows - 1, columns - 1]).T
    new = cells[from_row, from_column].reshape(rows, columns)
    walls = middle_of(wide, np.argwhere(cells == OCCUPIED))
    walls = walls + shift(walls)
    for quarter in 0.25 * grid.resolution_m * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]):
        row, column = np.clip(cell_of(wide, walls + quarter), 0, [rows - 1, columns - 1]).T
        new[row, column] = OCCUPIED
    return GridMap(new, grid.resolution_m, wide.origin)
