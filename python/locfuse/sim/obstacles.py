# SPDX-License-Identifier: Apache-2.0
"""Obstacles that a map does not show as a laser sees them: glass walls, walking people."""

from __future__ import annotations

import numpy as np

from locfuse.config.scenario import Glass, People
from locfuse.sim.room import touched
from locfuse.sim.space import cell_of, largest_part, middle_of, room_for
from locfuse.types import OCCUPIED, ConfigError, FloatArray, GridMap

PIECE_M = 1.0  # walls become glass by pieces in squares of this side
STEP_S = 0.1  # of a walk, at most
TURN_PER_SQRT_S = 0.5  # standard deviation of a walker's turning, rad/sqrt(s)


def clearness(grid: GridMap, glass: Glass, rng: np.random.Generator) -> FloatArray:
    """Return the probability with which a beam passes each cell, 0 where there is no glass.

    The shape is (height, width); `rng` chooses the share of the walls. Raises ConfigError where a
    pane touches no wall of the map.
    """
    walls = grid.cells == OCCUPIED
    clear = np.zeros(walls.shape, np.bool_)
    for pane in glass.panes:
        cells = walls & touched(grid, [pane])
        if not cells.any():
            raise ConfigError(
                f"a pane of glass from {pane[:2]} to {pane[2:]} touches no wall of the map; "
                "expected panes where walls are"
            )
        clear |= cells
    side = max(1, round(PIECE_M / grid.resolution_m))
    row, column = np.nonzero(walls)
    pieces, piece = np.unique(row // side * walls.shape[1] + column // side, return_inverse=True)
    chosen = rng.permutation(len(pieces)) < round(glass.share * len(pieces))
    clear[row, column] |= chosen[piece]
    return np.where(clear, glass.probability, 0.0)


def walk(
    grid: GridMap, people: People, seconds: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return where people are on their random walks through the free space.

    The result, shape (n, people, 2), is x and y in world, metres, at each of `seconds`, none before
    0, where the walks begin. All are in the largest part of the map that has room for them; raises
    ConfigError where there is none.
    """
    room = largest_part(room_for(grid, people.radius_m))
    places = np.argwhere(room)
    if len(places) == 0:
        raise ConfigError(
            f"there is no room on the map for people of radius_m {people.radius_m}; expected free "
            "space of that size"
        )
    fits = np.pad(room, 1)
    step = min(STEP_S, grid.resolution_m / people.speed_mps)  # never over a cell
    count = int(np.ceil(seconds.max(initial=0.0) / step)) + 1
    at = middle_of(grid, places[rng.integers(len(places), size=people.count)])
    heading = rng.uniform(-np.pi, np.pi, people.count)
    way = np.empty((count + 1, people.count, 2))
    way[0] = at
    for k in range(1, count + 1):
        heading = heading + TURN_PER_SQRT_S * np.sqrt(step) * rng.standard_normal(people.count)
        anew = rng.uniform(-np.pi, np.pi, people.count)
        ahead = at + people.speed_mps * step * np.column_stack([np.cos(heading), np.sin(heading)])
        row, column = np.clip(cell_of(grid, ahead) + 1, 0, np.array(fits.shape) - 1).T
        goes = fits[row, column]
        at = np.where(goes[:, None], ahead, at)
        heading = np.where(goes, heading, anew)
        way[k] = at
    before = np.minimum((seconds / step).astype(np.int64), count - 1)
    share = (seconds / step - before)[:, None, None]
    return np.asarray((1.0 - share) * way[before] + share * way[before + 1])


def hidden_by(
    people: FloatArray, radius_m: float, start: FloatArray, direction: FloatArray
) -> FloatArray:
    """Return how far beams go until they enter a disc, shape (n, b), metres.

    `people`, shape (n, p, 2), are middles of p discs at each of n instants, `start`, shape (n, 2),
    is where the beams of each begin, metres, and `direction`, shape (n, b), their headings in
    world, radians. Infinite where no disc is met, 0 inside of one.
    """
    nearest = np.full(direction.shape, np.inf)
    c, s = np.cos(direction), np.sin(direction)
    for person in np.moveaxis(people, 1, 0):
        off = person - start
        ahead = c * off[:, :1] + s * off[:, 1:]
        aside = c * off[:, 1:] - s * off[:, :1]
        half = np.sqrt(np.maximum(radius_m**2 - aside**2, 0.0))
        met = (np.abs(aside) <= radius_m) & (ahead + half >= 0.0)
        nearest = np.minimum(nearest, np.where(met, np.maximum(ahead - half, 0.0), np.inf))
    return nearest
