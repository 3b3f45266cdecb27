# SPDX-License-Identifier: Apache-2.0
"""Reference trajectories that lie elsewhere than their map, moved onto it.

None of the localizers or matchers that they judge takes part.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.eval.ape import umeyama
from locfuse.run.start import returns_of
from locfuse.types import OCCUPIED, FloatArray, GridMap, Log, wrap_angle

OFFICE_FRAMES = 200  # those that are published as CSV


def registration(log: Log) -> FloatArray:
    """Return how the Gazebo map lies in the world: shift (x, y) [m] and turn [rad].

    The world holds nine columns of 0.15 m radius on a grid of 1.1 m about its origin; a circle is
    fitted to the occupied cells around each. Neither laser nor matcher takes part.
    """
    grid = log.grid
    assert grid is not None
    cells = grid.to_world(np.argwhere(grid.cells == OCCUPIED)[:, ::-1].astype(float) + 0.5)
    known = np.array([[x, y] for x in (-1.1, 0.0, 1.1) for y in (-1.1, 0.0, 1.1)])
    seen = []
    for column in known:
        near = cells[np.hypot(*(cells - column).T) < 0.35]
        design = np.column_stack([2.0 * near, np.ones(len(near))])
        seen.append(np.linalg.lstsq(design, np.sum(near**2, axis=1), rcond=None)[0][:2])
    _, turn, shift = umeyama(known, np.array(seen), with_scale=False)
    return np.array([*shift, turn])


def moved_truth(log: Log) -> Log:
    """Return the log with its truth moved into the frame of its map, which lies elsewhere."""
    by = registration(log)
    truth = log["truth"]
    c, s = np.cos(by[2]), np.sin(by[2])
    x, y = truth["x_m"], truth["y_m"]
    moved = {
        **truth,
        "x_m": c * x - s * y + by[0],
        "y_m": s * x + c * y + by[1],
        "heading_rad": wrap_angle(truth["heading_rad"] + by[2]),
    }
    return replace(log, tables={**log.tables, "truth": moved})


def settled_truth(log: Log) -> Log:
    """Return the log with each reference pose moved to where its own scan lies on the map.

    Some reference poses are off by 0.2 m and 4 degrees, which their scans show. Plain point to
    point ICP (Besl and McKay, 1992) from the reference, on the cells of the map: nothing of the
    matcher that is judged.
    """
    truth, grid = log["truth"], log.grid
    assert grid is not None
    nearest = _nearest_of_cells(grid)
    pose = np.column_stack([truth["x_m"], truth["y_m"], truth["heading_rad"]])
    for row, stamp in enumerate(truth["stamp_ns"][:OFFICE_FRAMES]):
        if (log["scans"]["stamp_ns"] == stamp).any():
            pose[row] = _icp(grid, nearest, returns_of(log, int(stamp)), pose[row])
    moved = {**truth, "x_m": pose[:, 0], "y_m": pose[:, 1], "heading_rad": wrap_angle(pose[:, 2])}
    return replace(log, tables={**log.tables, "truth": moved})


def _icp(grid: GridMap, nearest: FloatArray, scan: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the pose after 50 steps on the nearer four fifths of the beams."""
    x, y, heading = pose
    for _ in range(50):
        c, s = np.cos(heading), np.sin(heading)
        seen = scan @ np.array([[c, s], [-s, c]]) + [x, y]
        cell = np.floor(grid.to_grid(seen)).astype(int)
        cell = np.clip(cell, 0, np.array(grid.cells.shape[::-1]) - 1)
        walls = nearest[cell[:, 1], cell[:, 0]]
        distance = np.hypot(*(walls - seen).T)
        kept = distance <= np.quantile(distance, 0.8)
        _, turn, shift = umeyama(seen[kept], walls[kept], with_scale=False)
        c, s = np.cos(turn), np.sin(turn)
        x, y = np.array([[c, -s], [s, c]]) @ [x, y] + shift
        heading += turn
    return np.array([x, y, heading])


def _nearest_of_cells(grid: GridMap) -> FloatArray:
    """Return the centre of the occupied cell nearest to each cell, (height, width, 2) [m].

    By jump flooding: cells exchange the nearest they know of, in halving jumps.
    """
    height, width = grid.cells.shape
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    at = np.stack([column, row], axis=-1).astype(float)
    nearest = np.where((grid.cells > 50)[..., None], at, 1e9)
    jump = 1 << ((max(height, width) - 1).bit_length() - 1)
    while jump >= 1:
        for dy in (-jump, 0, jump):
            for dx in (-jump, 0, jump):
                if abs(dy) >= height or abs(dx) >= width:
                    continue
                offered = np.full_like(nearest, 1e9)
                to = np.s_[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
                of = np.s_[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
                offered[to] = nearest[of]
                closer = np.sum((offered - at) ** 2, axis=-1) < np.sum((nearest - at) ** 2, axis=-1)
                nearest[closer] = offered[closer]
        jump //= 2
    return grid.to_world(nearest + 0.5)
