# SPDX-License-Identifier: Apache-2.0
"""From a scenario to a log: drive, sense, break."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.scenario import Kidnap, LaserFault, Nlos, Scenario
from locfuse.io.maps import read_map
from locfuse.sim import laser, sensors
from locfuse.sim.faults import World, with_faults
from locfuse.sim.maps import GENERATORS
from locfuse.sim.room import room_grid, touched
from locfuse.sim.space import cell_of
from locfuse.sim.trajectory import Drive, carried, plan
from locfuse.types import (
    FREE,
    NANOSECONDS,
    OCCUPIED,
    Columns,
    ConfigError,
    FloatArray,
    GridMap,
    Log,
    StampArray,
)


def simulate(scenario: Scenario, rng: np.random.Generator, base: Path | None = None) -> Log:
    """Return the log of a simulated drive.

    Path, odometry, ranges, poses, positions, faults, laser, sightings, IMU, altimeter and headings
    draw from children of `rng`, always spawned in that order: switching one off changes no bit of
    the others.

    Parameters
    ----------
    scenario : Scenario
    rng : numpy Generator
        Spawns the children, so a second call with the same one gives another drive; equal fresh
        generators give equal bits.
    base : Path, optional
        Folder that the file of the map is relative to.

    Returns
    -------
    Log
        With tables ``odometry``, ``ranges``, ``poses``, ``positions``, ``landmark_sightings``,
        ``altitudes``, ``headings``, ``scans``, ``imu`` (those that are switched on), ``truth`` at
        every stamp of any of them but ``imu``, dropped out or not, ``anchors`` and ``landmarks``;
        and with the grid, if there is a map.

    Raises
    ------
    LogError
        If the file of the map cannot be read.
    ConfigError
        If the map cannot be made or has no free cell, the robot starts outside of it or drives
        into one of its walls, or a fault of the laser finds no wall or no room on it.

    Examples
    --------
    >>> log = simulate(Scenario(duration_s=1.0), np.random.default_rng(7))
    >>> len(log["ranges"]["range_m"])  # 5 anchors, 6 epochs
    30
    """
    for_path, for_odometry, for_ranges, for_poses, for_positions, *others = rng.spawn(11)
    for_faults, for_laser, for_sightings, for_imu, for_altitudes, for_headings = others
    grid = grid_of(scenario, base)
    driven = plan(scenario.path, scenario.room_m, scenario.duration_s, for_path, grid)
    drive = _kidnapped(driven, scenario)
    flight = scenario.flight
    makers: dict[str, Callable[[StampArray, Any], Columns]] = {
        "odometry": lambda t, sensor: sensors.odometry(driven, t, sensor, for_odometry),
        "ranges": lambda t, sensor: sensors.ranges(
            drive, t, scenario.tags, scenario.anchors, sensor, for_ranges, flight
        ),
        "poses": lambda t, sensor: sensors.poses(drive, t, sensor, for_poses),
        "positions": lambda t, sensor: sensors.positions(
            drive, t, scenario.tags, sensor, for_positions
        ),
        "landmark_sightings": lambda t, sensor: sensors.sightings(
            drive, t, scenario.landmarks, sensor, for_sightings, flight, scenario.landmark_height_m
        ),
        "altitudes": lambda t, sensor: sensors.altitudes(flight, t, sensor, for_altitudes),
        "headings": lambda t, sensor: sensors.headings(
            drive, t, sensor, scenario.positions, for_headings
        ),
        "imu": lambda t, sensor: sensors.imu(driven, t, sensor, for_imu, flight),
    }
    named = {name: getattr(scenario, name) for name in makers}
    epochs = {name: sensors.stamps(sensor.rate_hz, scenario.duration_s)
              for name, sensor in named.items() if sensor is not None}  # fmt: skip
    measured = {name: make(epochs[name], named[name])
                for name, make in makers.items() if name in epochs}  # fmt: skip
    epochs.pop("imu", None)
    scanners = scenario.scanners
    turns = {name: laser.stamps(sensor, scenario.duration_s, number / len(scanners))
             for number, (name, sensor) in enumerate(scanners.items())}  # fmt: skip
    odometry_ns = epochs.get("odometry", np.empty(0, np.int64))
    world = World(drive, scenario.tags, scenario.anchors, odometry_ns)
    faults = list(zip(scenario.faults, for_faults.spawn(len(scenario.faults)), strict=True))
    tables = with_faults(measured, faults, world)
    all_ns = np.unique(np.concatenate([*epochs.values(), *turns.values()]))
    truth = sensors.truth(drive, all_ns, flight)
    check_way(scenario, grid, truth)
    landmarks = np.array(list(scenario.landmarks.values()), np.float64).reshape(-1, 2)
    has_discs = scenario.landmark_radius_m > 0.0
    if scanners and grid is not None:
        seen = [(fault, child) for fault, child in faults if isinstance(fault, LaserFault)]
        discs = (landmarks, scenario.landmark_radius_m) if has_discs else None
        children = [for_laser] if "" in scanners else for_laser.spawn(len(scanners))
        # Each sees the same people and glass: faults draw for each of them the same.
        tables["scans"] = laser.together({
            name: laser.scans(drive, turns[name], grid, sensor, child, deepcopy(seen), discs)
            for (name, sensor), child in zip(scanners.items(), children, strict=True)
        }, scanners)  # fmt: skip
    tables["truth"] = truth
    if scenario.anchors:
        at = np.array(list(scenario.anchors.values()), dtype=np.float64)
        tables["anchors"] = {
            "anchor": np.array(list(scenario.anchors)),
            "x_m": at[:, 0],
            "y_m": at[:, 1],
            "z_m": at[:, 2],
        }
    if scenario.landmarks:
        table = {
            "landmark": np.array(list(scenario.landmarks)),
            "x_m": landmarks[:, 0],
            "y_m": landmarks[:, 1],
        }
        if flight is not None or scenario.landmark_height_m != 0.0:
            table["z_m"] = np.full(len(landmarks), scenario.landmark_height_m)
        if has_discs:
            table["radius_m"] = np.full(len(landmarks), scenario.landmark_radius_m)
        tables["landmarks"] = table
    return Log(
        tables=tables,
        tags=dict(scenario.tags),
        landmark_sensor=_landmark_sensor(scenario),
        laser=None if scenario.laser is None else laser.geometry(scenario.laser),
        lasers={name: laser.geometry(sensor) for name, sensor in scenario.lasers.items()},
        map=None if grid is None else "map.yaml",
        grid=grid,
        description=f"Simulated: {scenario.path.shape}, {scenario.duration_s:g} s",
        origin="simulation",
    )


def true_drive(scenario: Scenario, seed: int, grid: GridMap | None = None) -> Drive:
    """Return where the robot of `simulate` is in truth, without simulating anything else.

    `seed` is of the generator that `simulate` is given; `grid` is as of `grid_of`.
    """
    (for_path,) = np.random.default_rng(seed).spawn(1)
    drive = plan(scenario.path, scenario.room_m, scenario.duration_s, for_path, grid)
    return _kidnapped(drive, scenario)


def _kidnapped(drive: Drive, scenario: Scenario) -> Drive:
    """Return where the robot is in truth; the wheels measure the planned drive."""
    carries = [fault for fault in scenario.faults if isinstance(fault, Kidnap)]
    for fault in sorted(carries, key=lambda fault: fault.at_s):
        x, y, heading_deg = fault.to
        drive = carried(drive, fault.at_s, (x, y, float(np.deg2rad(heading_deg))))
    return drive


def _landmark_sensor(scenario: Scenario) -> dict[str, list[float]] | None:
    if scenario.landmark_sightings is None:
        return None
    x, y, heading_deg = scenario.landmark_sightings.pose_in_body
    return {"pose_in_body": [x, y, float(np.deg2rad(heading_deg))]}


def grid_of(scenario: Scenario, base: Path | None = None) -> GridMap | None:
    """Return the map of a scenario, read from its file or made; None without one.

    Raises LogError where the file cannot be read, and ConfigError where what was asked for cannot
    be made, as of a room that is too small.
    """
    if scenario.map is None:
        return None
    asked = scenario.map
    if asked.file is not None:
        return read_map((Path() if base is None else base) / asked.file)
    walls = [wall for fault in scenario.faults if isinstance(fault, Nlos) for wall in fault.walls]
    if asked.generate is None:
        return room_grid(scenario.room_m, [*asked.walls, *walls], asked.resolution_m)
    make, rng = GENERATORS[asked.generate], np.random.default_rng(asked.seed)
    try:
        grid = make(rng, scenario.room_m, asked.resolution_m)
    except ValueError as error:
        raise ConfigError(f"simulation.map: {error}; room_m is the size of the map") from error
    grid.cells[touched(grid, [*asked.walls, *walls])] = OCCUPIED
    return grid


def check_way(scenario: Scenario, grid: GridMap | None, truth: Columns) -> None:
    """Raise ConfigError if a map or the room does not allow the way that a robot drives.

    `truth` has the columns ``stamp_ns``, ``x_m`` and ``y_m``.
    """
    if grid is not None:
        _check_on_map(grid, truth)
    elif any(isinstance(fault, Kidnap) for fault in scenario.faults):  # other paths fit in
        _check_room(scenario.room_m, truth)


def _check_on_map(grid: GridMap, truth: Columns) -> None:
    """Raise ConfigError if the robot starts outside of the map or is ever in a wall of it."""
    if not (grid.cells == FREE).any():
        raise ConfigError("simulation.map has no free cell; expected some for the robot to be in")
    point = np.column_stack([truth["x_m"], truth["y_m"]])
    row, column = cell_of(grid, point).T
    height, width = grid.cells.shape
    on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    if not on_map[0]:
        raise ConfigError(
            f"the robot starts at {_place(point[0])}, outside of the map; change simulation.path, "
            "or the map"
        )
    in_wall = np.zeros(len(point), np.bool_)
    in_wall[on_map] = grid.cells[row[on_map], column[on_map]] == OCCUPIED
    if in_wall.any():
        hit = int(np.argmax(in_wall))
        when = float(truth["stamp_ns"][hit]) / NANOSECONDS
        how = f"drives, after {when:.1f} s, into" if hit > 0 else "starts in"
        raise ConfigError(
            f"the robot {how} a wall of the map at {_place(point[hit])}; change simulation.path "
            "(the shape roam keeps clear of walls), or the map"
        )


def _check_room(room_m: tuple[float, float], truth: Columns) -> None:
    """Raise ConfigError if the robot, once carried elsewhere, drives out of the room."""
    point = np.column_stack([truth["x_m"], truth["y_m"]])
    slack = 1e-9  # a path may touch the walls
    outside = np.any((point < -slack) | (point > np.array(room_m) + slack), axis=1)
    if outside.any():
        first = int(np.argmax(outside))
        when = float(truth["stamp_ns"][first]) / NANOSECONDS
        raise ConfigError(
            f"the robot, kidnapped, drives after {when:.1f} s out of the room at "
            f"{_place(point[first])}; change the fault's 'to', or simulation.path"
        )


def _place(point: FloatArray) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f})"
