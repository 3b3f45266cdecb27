# SPDX-License-Identifier: Apache-2.0
"""Faults of a robot that is localized by scans on a map: simulated drives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.types import FREE, NANOSECONDS, OCCUPIED, Log
from papers.health.scenarios import (
    DURATION_S,
    SLIPS,
    WHEELS,
    Scenario,
    carried_off,
    drives_of,
    simulated,
    with_slip_noise,
)

SIZE_M = (14.0, 10.0)
COVER_M = 0.15  # from the laser
COVERED_S = (150.0, 165.0)
BOXES = 12  # that have come, and as many that have gone
UNMODELLED_ON_MAP = "scans, wheels slip, and nobody knows"


def config_of(seed: int, *faults: dict[str, Any]) -> RunConfig:
    """Return rooms, a laser, odometry, and a start that is known to 0.2 m and 5 degrees."""
    return parse_config(
        {
            "seed": seed,
            "simulation": {
                "room_m": list(SIZE_M),
                "map": {"generate": "rooms", "seed": seed},
                "path": {"shape": "roam"},
                "duration_s": DURATION_S,
                "anchors": {},
                "ranges": None,
                "poses": None,
                "laser": {"range_max_m": 10.0},
                "faults": list(faults),
            },
            "start": "truth",
            "start_sigma": {"xy_m": 0.2, "heading_deg": 5.0},
            "estimator": {"odometry": WHEELS},
            "mcl": {},
        }
    )


def _with_faults(*faults: dict[str, Any]) -> Scenario:
    return drives_of(lambda seed: config_of(seed, *faults))


def _changed_map(seed: int) -> tuple[RunConfig, Log]:
    """Give the robot a map from which boxes have gone, and to which others have come."""
    config = config_of(seed)
    log = simulated(config, seed)
    assert log.grid is not None
    rng = np.random.default_rng([seed, 4])
    cells = log.grid.cells.copy()
    rows, columns = cells.shape
    side = round(0.6 / log.grid.resolution_m)
    for value in (FREE, OCCUPIED):
        solid = np.argwhere(cells == (OCCUPIED if value == FREE else FREE))
        for row, column in solid[rng.choice(len(solid), BOXES, replace=False)]:
            first, left = max(row - side // 2, 1), max(column - side // 2, 1)
            last, right = min(row + side // 2, rows - 1), min(column + side // 2, columns - 1)
            cells[first:last, left:right] = value
    return config, replace(log, grid=replace(log.grid, cells=cells))


def _covered(share: float) -> Scenario:
    """Put something right before a share of the beams for some seconds."""

    def scenario(seed: int) -> tuple[RunConfig, Log]:
        config = config_of(seed)
        log = simulated(config, seed)
        scans = dict(log["scans"])
        seconds = (scans["stamp_ns"] - log["truth"]["stamp_ns"][0]) / NANOSECONDS
        while_s = (seconds >= COVERED_S[0]) & (seconds < COVERED_S[1])
        ranges = scans["ranges_m"].copy()
        beams = int(share * ranges.shape[1])
        first = int(np.random.default_rng([seed, 5]).integers(ranges.shape[1]))
        hidden = (first + np.arange(beams)) % ranges.shape[1]
        ranges[np.ix_(np.flatnonzero(while_s), hidden)] = COVER_M
        scans["ranges_m"] = ranges
        return config, replace(log, tables={**log.tables, "scans": scans})

    return scenario


ON_MAP: dict[str, Scenario] = {
    "scans, clean": _with_faults(),
    "scans, twelve people": _with_faults({"kind": "people", "count": 12}),
    "scans, a map that has changed": _changed_map,
    "scans, a third of the laser covered": _covered(0.34),
    "scans, the laser covered": _covered(1.0),
    "scans, wheels slip, and it is known": drives_of(
        lambda seed: with_slip_noise(config_of(seed, SLIPS))
    ),
    UNMODELLED_ON_MAP: _with_faults(SLIPS),
    "scans, kidnapped": carried_off(config_of, "odometry", "scans", "truth"),
}  # fmt: skip
