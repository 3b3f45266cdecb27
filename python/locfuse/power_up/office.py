# SPDX-License-Identifier: Apache-2.0
"""Power-ups in a real office, whose reference is first settled on its map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from locfuse.claims import Claim, absent, share
from locfuse.eval.ape import umeyama
from locfuse.power_up.runs import recording
from locfuse.power_up.scans import judged, power_up_states
from locfuse.start import returns_of
from locfuse.types import FloatArray, GridMap, Log, LogError, wrap_angle

OFFICE_FRAMES = 200  # those that are published as CSV


def office_claims(configs: Path) -> Iterator[Claim]:
    try:
        config, log = recording(configs, "mrpt_office.yaml")
    except LogError as error:
        yield absent("start_office", "office power-ups", str(error))
        return
    log = _first_scans(log, OFFICE_FRAMES)
    states = power_up_states(log, config)
    stated = judged(states, log, 0.3, 3.0)
    matched = judged(states, _settled_truth(log), 0.3, 3.0)
    for key, text, found, required in (
        ("", "office power-ups (real): right, or not ready", matched, 0.98),
        ("_stated", "the same against the reference as published", stated, None),
    ):
        good = found.fits | ~found.ready
        row = share(f"start_office{key}", text, int(good.sum()), len(good), required or 0.0)
        yield row if required is not None else replace(row, required="-")
    yield share("start_office_ready", "office power-ups (real): ready at once",
                int(matched.ready.sum()), len(matched.ready), 0.5)  # fmt: skip


def _first_scans(log: Log, count: int) -> Log:
    scans = {name: values[:count] for name, values in log["scans"].items()}
    return replace(log, tables={**log.tables, "scans": scans})


def _settled_truth(log: Log) -> Log:
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

    By jump flooding: cells tell one another the nearest they know of, in halving jumps.
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
                heard = np.full_like(nearest, 1e9)
                to = np.s_[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
                of = np.s_[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
                heard[to] = nearest[of]
                closer = np.sum((heard - at) ** 2, axis=-1) < np.sum((nearest - at) ** 2, axis=-1)
                nearest[closer] = heard[closer]
        jump //= 2
    return grid.to_world(nearest + 0.5)
