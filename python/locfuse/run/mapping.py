# SPDX-License-Identifier: Apache-2.0
"""A map of one drive with a laser, without a map (docs/map.md)."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.io.csv_table import number_texts, write_table
from locfuse.io.maps import write_map
from locfuse.io.tum import write_tum
from locfuse.run.messages import add_odometry, as_measured, truth_of
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.odometry import scan_odometry_of, with_odometry
from locfuse.run.run import load_log
from locfuse.run.start import given_start, scans_of
from locfuse.types import (
    FREE,
    NANOSECONDS,
    OCCUPIED,
    ConfigError,
    GridMap,
    Log,
    LogError,
    Trajectory,
)

_logger = logging.getLogger(__name__)
Progress = Callable[[float], None]

_NEIGHBOURS = 2  # a wall of the old map this many cells away is the same wall


@dataclass(frozen=True)
class MapLoop:
    """A place that was seen again.

    Attributes
    ----------
    from_ns, to_ns : int
        Stamps of both scans; the first is None where a scan was placed on an old map.
    kept : bool
        Whether it agrees with the others; one that does not is left out.
    explained, agreement : float
        Fraction of the scan's returns that lie on what was seen before, and of the ends of beams
        around both places that do not contradict each other.
    """

    from_ns: int | None
    to_ns: int
    kept: bool
    explained: float
    agreement: float


@dataclass(frozen=True)
class MapResult:
    """A map, and the drive that it was made of.

    Attributes
    ----------
    grid : GridMap
    estimate : Trajectory
        The drive in the frame of the map, with covariances.
    loops : tuple of MapLoop
    keys, scans : int
        Number of scans that the map is drawn of, and of all that were used.
    findings : tuple of str
        What makes the map doubtful.
    appeared, vanished : bool array, shape of the cells, or None
        Walls that an old map has not, and those of it that are gone.
    """

    grid: GridMap
    estimate: Trajectory
    loops: tuple[MapLoop, ...]
    keys: int
    scans: int
    findings: tuple[str, ...] = ()
    appeared: NDArray[np.bool_] | None = None
    vanished: NDArray[np.bool_] | None = None

    @property
    def length_m(self) -> float:
        """Length of the drive."""
        return float(np.hypot(*np.diff(self.estimate.position, axis=0).T).sum())


def make_map(
    config: RunConfig,
    log: Log | None = None,
    *,
    base: Path | None = None,
    resolution_m: float = 0.05,
    onto: GridMap | None = None,
    progress: Progress | None = None,
) -> MapResult:
    """Make a map of the scans of a log.

    Parameters
    ----------
    config : RunConfig
        Noise of wheels and beams. Its ``start`` is where the first scan is in the frame of the
        map; a start that is to be found is the origin, and may not be with `onto`.
    log : Log, optional
        Overrides the log that the configuration names. Its own map is not used.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    resolution_m : float
        Side of a cell, metres; not used with `onto`.
    onto : GridMap, optional
        A map that is continued.
    progress : callable, optional
        Called with the fraction that is done, 0 to 1.

    Raises
    ------
    ConfigError, LogError
        If the configuration or the log cannot be used as they are.
    """
    check_resolution(resolution_m)
    log = load_log(config, base, config.seed) if log is None else log
    scans = scans_of(log)
    if not scans:
        raise LogError(f"a map is drawn of laser scans, but the log has none; "
                       f"{how_to_add(log, 'scans')}")  # fmt: skip
    plain = with_odometry(log, config.model_copy(update={"scan_odometry": None}))
    messages = _core.MessageLog()
    wheels = plain.tables.get("odometry")
    if wheels is not None and "odometry" in config.use:
        if wheels is log.tables.get("odometry"):
            wheels = as_measured("odometry", wheels, config, config.latency_s["odometry"])
        add_odometry(messages, {"arrival_ns": wheels["stamp_ns"], **wheels})
    messages.add_scans(scans, log["scans"].get("arrival_ns"))
    messages.sort()
    start = _start(config, log, min(scan.stamp for scan in scans), onto is not None)
    try:
        made = _core.map_scans(
            scan_odometry_of(config), build_estimator_config(config.estimator).odometry, messages,
            start, resolution_m, None if onto is None else onto.occupancy_grid(), progress,
        )  # fmt: skip
    except ValueError as problem:
        raise LogError(f"map of scans: {problem}") from problem
    return _result(made, onto)


def check_resolution(resolution_m: float) -> None:
    """Raise ConfigError where a map cannot be drawn with such cells."""
    if not 0.001 <= resolution_m <= 10.0:
        raise ConfigError(f"the resolution is {resolution_m:g}, expected 0.001 to 10 m")


def _start(config: RunConfig, log: Log, stamp: int, is_continued: bool) -> _core.PoseEstimate:
    """Return the pose of the first scan in the frame of the map."""
    truth = truth_of(log)
    if config.start == "truth" and truth is not None and truth.heading is not None:
        at, inside = interpolate(truth, np.array([stamp], dtype=np.int64))
        if not inside[0] or at.heading is None:
            raise ConfigError("start is 'truth', but truth.csv has no pose at the first scan; set "
                              "start: [x, y, heading_deg]")  # fmt: skip
        x, y = at.position[0, :2].tolist()
        return given_start((x, y, float(np.rad2deg(at.heading[0]))), config.start_sigma, stamp)
    if isinstance(config.start, tuple):
        return given_start(config.start, config.start_sigma, stamp)
    if is_continued:
        raise ConfigError("a map is continued from where the drive starts on it; set start: "
                          "[x, y, heading_deg] and start_sigma")  # fmt: skip
    return given_start((0.0, 0.0, 0.0), config.start_sigma, stamp)


def _result(made: _core.ScanMapping, onto: GridMap | None) -> MapResult:
    origin = made.grid.origin
    grid = GridMap(np.array(made.grid.cells), made.grid.resolution,
                   (origin.x, origin.y, origin.heading))  # fmt: skip
    poses = np.asarray(made.poses)
    estimate = Trajectory(np.asarray(made.stamp_ns), poses[:, :2], poses[:, 2], made.covariances)
    loops = tuple(MapLoop(None if one.is_on_map else one.from_ns, one.to_ns, one.kept,
                          one.explained, one.agreement) for one in made.loops)  # fmt: skip
    appeared, vanished = (None, None) if onto is None else _changes(grid, onto)
    findings = tuple(_findings(made, estimate, onto is not None))
    return MapResult(grid, estimate, loops, made.keys, made.scans, findings, appeared, vanished)


def _findings(made: _core.ScanMapping, estimate: Trajectory, is_continued: bool) -> list[str]:
    """Return what makes a map doubtful, a sentence each."""
    found = []
    kept = sum(loop.kept for loop in made.loops)
    if made.keys < 2 and 2 * made.weak <= made.scans:
        found.append("the robot stood: the map is what one place shows; drive")
    elif is_continued and not any(loop.kept and loop.is_on_map for loop in made.loops):
        found.append("no scan fits the old map near the start; is `start` right, and the map of "
                     "this building?")  # fmt: skip
    elif kept == 0:
        found.append("no place was seen again, so nothing checks the map: its far end may be off "
                     f"by {3.0 * _last_sigma(estimate):.1f} m (three sigma); end the drive where "
                     "it began")  # fmt: skip
    if kept < len(made.loops):
        found.append(f"{len(made.loops) - kept} of {len(made.loops)} places seen again contradict "
                     "the others and were left out")  # fmt: skip
    if made.unmatched > 0:
        found.append(f"{made.unmatched} of {made.keys} scans fitted nothing before them: there "
                     "only wheels, if there are any, say how the robot went; drive and turn slower"
                     )  # fmt: skip
    if made.weak > 0:
        found.append(f"{made.weak} of {made.scans} scans show nothing of how far the robot went, "
                     "as along a corridor, and there are no wheels: lengths there are guesses"
                     )  # fmt: skip
    return found


def _last_sigma(estimate: Trajectory) -> float:
    P = estimate.covariance
    assert P is not None
    return float(np.sqrt(np.linalg.eigvalsh(P[-1][:2, :2])[-1]))


def _changes(grid: GridMap, old: GridMap) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return cells of walls that the old map has not, though it is known there, and of its gone."""
    height, width = grid.cells.shape
    c, s = np.cos(old.origin[2]), np.sin(old.origin[2])
    dx, dy = old.origin[0] - grid.origin[0], old.origin[1] - grid.origin[1]
    left = round((c * dx + s * dy) / grid.resolution_m)  # both have the same axes
    below = round((c * dy - s * dx) / grid.resolution_m)
    before = np.full((height, width), -1, np.int8)
    before[below : below + old.cells.shape[0], left : left + old.cells.shape[1]] = old.cells
    walls, old_walls = grid.cells == OCCUPIED, before == OCCUPIED
    appeared = walls & (before == FREE) & ~_near(old_walls)
    vanished = old_walls & (grid.cells == FREE) & ~_near(walls)
    return appeared, vanished


def _near(walls: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells that have a wall within `_NEIGHBOURS` cells along both axes."""
    near = walls.copy()
    for axis in (0, 1):
        spread = near.copy()
        for step in range(1, _NEIGHBOURS + 1):
            ahead = [slice(None), slice(None)]
            behind = [slice(None), slice(None)]
            ahead[axis], behind[axis] = slice(step, None), slice(None, -step)
            spread[tuple(ahead)] |= near[tuple(behind)]
            spread[tuple(behind)] |= near[tuple(ahead)]
        near = spread
    return near


def write_map_result(result: MapResult, folder: Path) -> list[Path]:
    """Write ``map.yaml`` and ``map.pgm``, ``drive.tum`` and ``loops.csv``."""
    folder.mkdir(parents=True, exist_ok=True)
    write_map(result.grid, folder / "map.yaml")
    write_tum(folder / "drive.tum", result.estimate)
    loops = result.loops
    columns = [
        ["" if one.from_ns is None else repr(one.from_ns / NANOSECONDS) for one in loops],
        number_texts(np.array([one.to_ns for one in loops], dtype=np.float64) / NANOSECONDS),
        ["yes" if one.kept else "no" for one in loops],
        number_texts(np.array([one.explained for one in loops])),
        number_texts(np.array([one.agreement for one in loops])),
    ]
    write_table(folder / "loops.csv", ("from_s", "to_s", "kept", "explained", "agreement"), columns)
    return [folder / name for name in ("map.yaml", "map.pgm", "drive.tum", "loops.csv")]
