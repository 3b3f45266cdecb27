# SPDX-License-Identifier: Apache-2.0
"""What the page draws of a scene: the world at once, map and way of the robot a little later."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.schema import RunConfig
from locfuse.io.maps import read_map
from locfuse.report.player.world import map_picture
from locfuse.run.run import load_log
from locfuse.sim.scenario import check_way, grid_of, true_drive
from locfuse.studio.coverage import Coverage, coverage, floor_of
from locfuse.studio.document import Data, Draft, checked
from locfuse.studio.drawing import nlos_walls
from locfuse.studio.scene import Scene
from locfuse.studio.workspace import places
from locfuse.types import NANOSECONDS, ConfigError, FloatArray, GridMap, Log

_MAX_POINTS = 3000  # of the way that is drawn
_MAX_MAP_BYTES = 2_000_000


def world_of(scene: Scene) -> dict[str, Any]:
    """Return what can be drawn and dragged; without a simulation only that there is none."""
    scenario = scene.config.simulation
    if scenario is None:
        return {"simulated": False, "log": scene.data.get("log")}
    path = scenario.path
    return {
        "simulated": True,
        "room": list(scenario.room_m),
        "anchors": {name: list(at) for name, at in scenario.anchors.items()},
        "landmarks": {name: list(at) for name, at in scenario.landmarks.items()},
        "radius": scenario.landmark_radius_m,
        "walls": [] if scenario.map is None else [list(wall) for wall in scenario.map.walls],
        "nlos": [[fault, index, *wall] for fault, index, wall in nlos_walls(scene)],
        "path": {
            "shape": path.shape,
            "points": [list(point) for point in getattr(path, "points_m", [])],
            "closed": getattr(path, "closed", False),
            "center": list(path.center_m) if hasattr(path, "center_m") else None,
        },
    }


def ground_of(config: RunConfig, base: Path) -> dict[str, Any]:
    """Return the map and the way that the robot drives, or has driven; may take seconds.

    With a ``message`` if it cannot drive that way. Raises ConfigError or LogError if the map or the
    log cannot be read or made, or the robot cannot drive on it.
    """
    return _ground(config.model_dump_json(include={"simulation", "log", "ros", "seed"}), base)


@lru_cache(maxsize=8)
def _ground(text: str, base: Path) -> dict[str, Any]:
    config = RunConfig.model_validate_json(text)
    if config.simulation is None:
        return {} if config.log is None else _ground_of_log(log_of(config, base))
    grid = grid_of(config.simulation, base)
    drive = true_drive(config.simulation, config.seed, grid)
    duration_s = config.simulation.duration_s
    time_s = np.linspace(0.0, duration_s, min(_MAX_POINTS, 2 + int(10 * duration_s)))
    way = drive.pose_at(time_s)
    stamp_ns = np.round(time_s * NANOSECONDS).astype(np.int64)
    try:
        check_way(
            config.simulation, grid, {"stamp_ns": stamp_ns, "x_m": way[:, 0], "y_m": way[:, 1]}
        )
    except ConfigError as error:
        return {**_drawn(grid, way), "message": str(error)}
    return _drawn(grid, way)


def _ground_of_log(log: Log) -> dict[str, Any]:
    truth = log.tables.get("truth")
    way = np.empty((0, 3))
    if truth is not None:
        rows = np.unique(np.linspace(0, len(truth["x_m"]) - 1, _MAX_POINTS).astype(np.intp))
        heading = truth.get("heading_rad", np.zeros(len(truth["x_m"])))
        way = np.column_stack([truth["x_m"][rows], truth["y_m"][rows], heading[rows]])
    named: dict[str, dict[str, list[float]]] = {}
    for stem, name in (("anchors", "anchor"), ("landmarks", "landmark")):
        table = log.tables.get(stem)
        named[stem] = {} if table is None else places(table, name, "xy")
    counts = {stem: len(next(iter(table.values()))) for stem, table in log.tables.items()}
    return {**_drawn(log.grid, way), **named, "counts": counts, "description": log.description}


@lru_cache(maxsize=2)
def _log_of(text: str, base: Path) -> Log:
    return load_log(RunConfig.model_validate_json(text), base, 0)


def log_of(config: RunConfig, base: Path) -> Log:
    """Return the recorded log of a configuration; the last ones are remembered."""
    return _log_of(config.model_dump_json(include={"log", "ros"}), base)


def replaying(scene: Scene, path: str, name: str, base: Path) -> Data:
    """Return the document that replays a log as a scene would, once the log has been read.

    Raises ConfigError, LogError or RefusedError if it cannot be read as that.
    """
    draft = Draft(scene.data, scene.config)
    for key in ("simulation", "description"):
        draft.remove((key,))
    draft.set(("name",), name)
    draft.set(("log",), path)
    config = checked(draft.data)
    if "truth" not in log_of(config, base) and config.start == "truth":
        draft.set(("start",), "auto")
    return draft.data


def _drawn(grid: GridMap | None, way: FloatArray) -> dict[str, Any]:
    at = np.round(way, 3)
    return {
        "map": None if grid is None else map_picture(grid, _MAX_MAP_BYTES),
        "way": at[:, :2].tolist(),
        "start": at[0].tolist() if len(at) else None,
    }


def coverage_of(scene: Scene, moved: dict[str, tuple[float, float]], base: Path) -> Coverage | None:
    """Return the coverage of a simulated scene, with some anchors moved; None without anchors."""
    scenario = scene.config.simulation
    if scenario is None or not scenario.anchors:
        return None
    grid = _file_map(scenario.map.file, base) if scenario.map and scenario.map.file else None
    anchors = {name: (*moved.get(name, at[:2]), at[2]) for name, at in scenario.anchors.items()}
    walls = [wall for _, _, wall in nlos_walls(scene)]
    return coverage(anchors, walls, floor_of(scenario, grid), grid)


@lru_cache(maxsize=2)
def _file_map(file: str, base: Path) -> GridMap:
    return read_map(base / file)
