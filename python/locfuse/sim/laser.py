# SPDX-License-Identifier: Apache-2.0
"""What a 2D laser scanner sees of a grid map: beams walked from cell to cell, plus noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.config.scenario import LaserSensor
from locfuse.sim.sensors import point_in_world, seconds
from locfuse.sim.trajectory import Drive
from locfuse.types import OCCUPIED, Columns, FloatArray, GridMap, StampArray

PASSAGE, WALL, OUTSIDE = 0, 1, 2


def geometry(sensor: LaserSensor) -> dict[str, Any]:
    """Return what ``laser`` of a log says of a scanner."""
    x, y, heading_deg = sensor.pose_in_body
    view = float(np.deg2rad(sensor.field_of_view_deg))
    steps = sensor.beams if sensor.field_of_view_deg == 360.0 else sensor.beams - 1
    return {
        "pose_in_body": [x, y, float(np.deg2rad(heading_deg))],
        "angle_min_rad": -0.5 * view,
        "angle_increment_rad": view / steps,
        "range_min_m": sensor.range_min_m,
        "range_max_m": sensor.range_max_m,
    }


def scans(
    drive: Drive,
    stamp_ns: StampArray,
    grid: GridMap,
    sensor: LaserSensor,
    rng: np.random.Generator,
) -> Columns:
    """Return what the laser sees at each stamp, all beams at that instant.

    Parameters
    ----------
    drive : Drive
    stamp_ns : int64 array, shape (n,)
    grid : GridMap
    sensor : LaserSensor
    rng : numpy Generator

    Returns
    -------
    columns
        n rows of ranges_m, shape (n, beams): metres to where each beam enters an occupied cell,
        plus noise; NaN where there was no return.
    """
    seen = geometry(sensor)
    x, y, heading = seen["pose_in_body"]
    pose = drive.pose_at(seconds(stamp_ns))
    start = point_in_world(pose, (x, y, 0.0))[:, :2]
    beam = seen["angle_min_rad"] + seen["angle_increment_rad"] * np.arange(sensor.beams)
    direction = pose[:, 2:] + heading + beam
    reach = sensor.range_max_m + 10.0 * sensor.sigma_m  # noise may bring back what is just beyond
    distance = cast(grid, np.repeat(start, sensor.beams, axis=0), direction.ravel(), reach).reshape(
        direction.shape
    )
    measured = distance + sensor.sigma_m * rng.standard_normal(direction.shape)
    lost = rng.random(direction.shape) < sensor.dropout
    lost |= (measured < sensor.range_min_m) | (measured > sensor.range_max_m)
    return {"stamp_ns": stamp_ns, "ranges_m": np.where(lost, np.nan, measured)}


def cast(grid: GridMap, start: FloatArray, direction: FloatArray, reach: float) -> FloatArray:
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

    Returns
    -------
    float64 array, shape (n,)
        Metres; infinite where nothing is hit. Unknown cells and the outside let beams pass.
    """
    at, along = _in_cells(grid, start, direction)
    height, width = grid.cells.shape
    codes = np.full((height + 2, width + 2), OUTSIDE, np.int8)
    codes[1:-1, 1:-1] = np.where(grid.cells == OCCUPIED, WALL, PASSAGE)
    travelled = _way_in(at, along, (width, height))
    hit = np.full(len(at), np.inf)
    beam = np.flatnonzero(travelled * grid.resolution_m <= reach)
    state = np.vstack([at[beam].T, along[beam].T])
    entry = state[:2] + travelled[beam] * state[2:]
    cell = np.clip(np.floor(entry).astype(np.int64), 0, [[width - 1], [height - 1]])
    travelled = travelled[beam]
    while len(beam) > 0:
        code = codes[cell[1] + 1, cell[0] + 1]
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


def _in_cells(
    grid: GridMap, start: FloatArray, direction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return start and unit direction in the map's frame, one cell long per unit."""
    turned = direction - grid.origin[2]
    return grid.to_grid(start), np.column_stack([np.cos(turned), np.sin(turned)])
