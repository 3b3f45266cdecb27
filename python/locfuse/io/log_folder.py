# SPDX-License-Identifier: Apache-2.0
"""Log folders: CSV files and a ``log.yaml``; docs/log_format.md is their reference."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import CsvTable, column_texts, read_table, stamp_texts, write_table
from locfuse.io.geodesy import Origin
from locfuse.io.georeference import in_plane, is_on_earth, measured, origin_of, origin_sentence
from locfuse.io.log_yaml import checked, read_log_yaml, write_log_yaml
from locfuse.io.maps import read_map, write_map
from locfuse.io.whole import INCOMPLETE, whole_folder
from locfuse.types import (
    FARTHEST_M,
    MAX_SPEED_MPS,
    NANOSECONDS,
    QUATERNION,
    Columns,
    Log,
    LogError,
    nearest,
    no_folder,
    shown,
)

GEOMETRY = ("beams", "angle_min_rad", "angle_increment_rad")  # of each scan, where they differ
RATES = ("wx_radps", "wy_radps", "wz_radps")  # of an IMU, in its axes
FORCES = ("ax_mps2", "ay_mps2", "az_mps2")
GRAVITY_MPS2 = 9.81  # which they include
_SEEN = ("stamp_s", "landmark", "range_m", "bearing_rad")
_IN_PLANE = ("x_m", "y_m")
_ON_EARTH = ("latitude_deg", "longitude_deg")  # of WGS 84, in place of these
# Which headers each file may have. ranges_m stands for the beams r0, r1, ... of a scan, intensities
# for i0, i1, ...
SCHEMA: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "odometry": (
        ("stamp_s", "dx_m", "dy_m", "dheading_rad"),
        ("stamp_s", "v_mps", "omega_radps"),
        ("stamp_s", "v_mps", "v_left_mps", "omega_radps"),
    ),
    "ranges": (
        ("stamp_s", "tag", "anchor", "range_m"),
        ("stamp_s", "tag", "anchor", "range_m", "sigma_m"),
    ),
    "positions": tuple(
        ("stamp_s", *tag, *place)
        for tag in ((), ("tag",))
        for place in (
            (*_IN_PLANE, "sigma_m"),
            *(
                (*_ON_EARTH, *altitude, *sigma)
                for altitude in ((), ("altitude_m",))
                for sigma in (("sigma_m",), ("quality",), ("sigma_m", "quality"))
            ),
        )
    ),
    "poses": (("stamp_s", "x_m", "y_m", "heading_rad", "sigma_xy_m", "sigma_heading_rad"),),
    "landmark_sightings": (
        _SEEN,
        (*_SEEN, "sigma_range_m", "sigma_bearing_rad"),
        (*_SEEN, "elevation_rad"),
        (*_SEEN, "elevation_rad", "sigma_range_m", "sigma_bearing_rad", "sigma_elevation_rad"),
    ),
    "altitudes": (("stamp_s", "height_m"), ("stamp_s", "height_m", "sigma_m")),
    "headings": tuple(
        ("stamp_s", "heading_rad", *sigma, *course)
        for sigma in ((), ("sigma_rad",))
        for course in ((), ("is_course",))
    ),
    "scans": tuple(
        ("stamp_s", *laser, *geometry, "ranges_m", *bright)
        for laser in ((), ("laser",))
        for geometry in ((), GEOMETRY)
        for bright in ((), ("intensities",))
    ),
    "imu": (("stamp_s", *RATES), ("stamp_s", *RATES, *FORCES)),
    "truth": (
        ("stamp_s", *_ON_EARTH),
        ("stamp_s", *_ON_EARTH, "altitude_m"),
        ("stamp_s", "x_m", "y_m"),
        ("stamp_s", "x_m", "y_m", "heading_rad"),
        ("stamp_s", "x_m", "y_m", "z_m"),
        ("stamp_s", "x_m", "y_m", "z_m", "heading_rad"),
        ("stamp_s", "x_m", "y_m", "z_m", "heading_rad", *QUATERNION),
    ),
    "relations": (("begin_s", "end_s", "dx_m", "dy_m", "dheading_rad"),),
    "anchors": (("anchor", "x_m", "y_m", "z_m"), ("anchor", *_ON_EARTH, "z_m")),
    "landmarks": (
        ("landmark", *_ON_EARTH),
        ("landmark", "x_m", "y_m"),
        ("landmark", "x_m", "y_m", "radius_m"),
        ("landmark", "x_m", "y_m", "z_m"),
        ("landmark", "x_m", "y_m", "z_m", "radius_m"),
        ("landmark", "x_m", "y_m", "cov_x_x", "cov_x_y", "cov_y_y"),
    ),
}
MESSAGES = ("odometry", "ranges", "positions", "poses", "landmark_sightings", "altitudes",
            "headings", "scans", "imu")  # fmt: skip
OF_THE_WORLD = ("anchors", "landmarks")
MAY_BE_EMPTY = MESSAGES[1:]
INCREASING = ("odometry", "truth")  # strictly; other messages may come in any order
NAMES = ("tag", "anchor", "landmark", "laser")
MAY_BE_NAMELESS = (("landmark_sightings", "landmark"), ("positions", "tag"))
PLACES = ("x_m", "y_m", "z_m", "height_m")
MAY_NOT_KNOW = ("positions", "poses")  # their sigmas: -1 or 0
BEAMS = {"ranges_m": "r", "intensities": "i"}  # columns of scans: one letter and the beam in a file
IN_MEMORY = {f"{key}_s": f"{key}_ns" for key in ("stamp", "arrival", "begin", "end")}

# Beyond these a file is in other units, or damaged.
MAX_TURN_RATE_RADPS = 100.0
MAX_RANGE_M = 100_000.0
MAX_FORCE_MPS2 = 10_000.0
MAX_LASERS = 16  # a frame that changes from scan to scan is no laser
MAX_STAMP_NS = 1 << 62  # the difference of two fits into 64 bits

LONGEST_NAME = 255  # bytes
Problem = tuple[int, str]

logger = logging.getLogger("locfuse")


def read_log(folder: str | Path, gps_origin: Origin | None = None) -> Log:
    """Read a log folder and check everything in it.

    Messages without ``arrival_s`` are sorted by stamp; those with it stay in the order of the file.

    Parameters
    ----------
    folder : str or Path
    gps_origin : tuple, optional
        Latitude, longitude and heading of the map's origin [deg], in place of that of log.yaml.
        Without either it is the first fix that the next confirms, which is logged.

    Returns
    -------
    Log

    Raises
    ------
    LogError
        If something is missing, unknown, not a number, out of order or out of bounds; the text
        names the file and the line or column.
    """
    folder = Path(folder)
    if not os.path.isdir(folder):
        raise LogError(no_folder(folder))
    tables = {stem: _read_table(path, stem) for stem, path in _find_tables(folder).items()}
    settings = _read_settings(folder)
    log = _log_of(folder, tables, settings, gps_origin)
    _check_set(log.tables, settings, str(folder))
    return log


def _log_of(
    folder: Path, tables: dict[str, Columns], settings: dict[str, Any], gps_origin: Origin | None
) -> Log:
    own = settings.get("gps_origin")
    if gps_origin and own and tuple(gps_origin) != own:
        raise LogError(f"{folder / 'log.yaml'}: gps_origin is {list(own)}, and that of the "
                       f"configuration or its world {list(gps_origin)}; expected the same, or one "
                       "of them")  # fmt: skip
    settings["gps_origin"] = gps_origin or own
    if any(map(is_on_earth, tables.values())):
        tables, settings["gps_origin"] = _placed(folder, tables, settings["gps_origin"])
    grid = read_map(folder / settings["map"]) if "map" in settings else None
    return Log(tables=tables, grid=grid, **settings)


def _placed(
    folder: Path, tables: dict[str, Columns], origin: Origin | None
) -> tuple[dict[str, Columns], Origin | None]:
    """Return tables with latitudes and longitudes in metres, and where the map begins."""
    on_earth = [stem for stem in tables if is_on_earth(tables[stem])]
    if "positions" in on_earth:
        tables["positions"], origin = _placed_fixes(folder, tables["positions"], origin)
        on_earth.remove("positions")
    if not on_earth:
        return tables, origin
    if origin is None:
        raise LogError(f"{folder}: {' and '.join(on_earth)} have latitudes and no fix says where "
                       "the map begins; expected gps_origin: [latitude, longitude, heading] in "
                       "log.yaml, or ros.gps_origin")  # fmt: skip
    for stem in on_earth:
        tables[stem] = in_plane(tables[stem], origin, f"{folder}: {stem}")
    return tables, origin


def _placed_fixes(
    folder: Path, received: Columns, origin: Origin | None
) -> tuple[Columns, Origin | None]:
    """Return positions in metres without those that are none, and where the map begins."""
    fixes = measured(received)
    if origin is None:
        origin = origin_of(fixes)
        if origin is not None:
            logger.warning("%s: %s", folder, origin_sentence(origin))
    at = origin or (0.0, 0.0, 0.0)  # of no fix at all
    placed = in_plane(fixes, at, f"{folder}: positions", may_leap=True)
    lost = len(received["stamp_ns"]) - len(placed["stamp_ns"])
    if lost:
        logger.warning("%s: %d of %d positions are without a fix or far away, and left out",
                       folder, lost, len(received["stamp_ns"]))  # fmt: skip
    return placed, origin


def read_world(folder: str | Path, gps_origin: Origin | None = None) -> Log:
    """Read what a log folder says of the world: no messages, and no reference.

    Parameters
    ----------
    folder : str or Path
        A log folder, which need not hold a message.
    gps_origin : tuple, optional
        As of `read_log`.

    Returns
    -------
    Log
        With anchors, landmarks, tags, laser, sensor of landmarks and map, as far as they are there.

    Raises
    ------
    LogError
        As `read_log`, or if there is nothing of that.
    """
    folder = Path(folder)
    if not os.path.isdir(folder):
        raise LogError(no_folder(folder))
    paths = {stem: path for stem, path in _find_tables(folder).items() if stem in OF_THE_WORLD}
    tables = {stem: _read_table(path, stem) for stem, path in paths.items()}
    settings = _read_settings(folder)
    if not tables and not settings:
        files = ", ".join(f"{stem}.csv" for stem in OF_THE_WORLD)
        raise LogError(f"{folder}: says nothing of the world, expected {files} or log.yaml")
    return _log_of(folder, tables, settings, gps_origin)


def with_world(log: Log, world: Log) -> Log:
    """Return a log with what `world` says in place of its own; of lasers only where they are."""
    tables = {**log.tables, **{stem: world[stem] for stem in OF_THE_WORLD if stem in world}}
    return replace(
        log,
        tables=tables,
        tags={**log.tags, **world.tags},
        laser=_placed_as(log.laser, world.laser),
        lasers={name: _placed_as(laser, world.lasers.get(name, world.laser))
                for name, laser in log.lasers.items()},
        landmark_sensor=world.landmark_sensor or log.landmark_sensor,
        map=log.map if world.grid is None else world.map,
        grid=log.grid if world.grid is None else world.grid,
        gps_origin=world.gps_origin or log.gps_origin,
    )  # fmt: skip


def _placed_as(laser: Mapping[str, Any] | None, other: Mapping[str, Any] | None) -> Any:
    if laser is None or other is None:
        return laser
    return {**laser, "pose_in_body": other["pose_in_body"]}


def write_log(log: Log, folder: str | Path) -> None:
    """Write a log as a folder that `read_log` reads back bit for bit.

    Bit for bit holds for messages sorted by stamp (or with ``arrival_ns``). A grid is written as
    ``log.map``, without one ``map.yaml``; a map without a grid is left to the caller. Files of the
    same name are replaced.

    Parameters
    ----------
    log : Log
    folder : str or Path
        Made if it is missing.

    Raises
    ------
    LogError
        If `read_log` would refuse what was to be written, or if the folder holds log files that
        this log would not replace. Nothing is written then.
    """
    columns = {stem: _checked_for_writing(stem, log[stem]) for stem in log.tables}
    _check_set(columns, _settings_of(log), "log")
    _write(log, columns, Path(folder))


def write_world(world: Log, folder: str | Path) -> None:
    """Write what a log says of the world as a folder that `read_world` reads back.

    Raises LogError as `write_log`.
    """
    stems = [stem for stem in OF_THE_WORLD if stem in world]
    columns = {stem: _checked_for_writing(stem, world[stem]) for stem in stems}
    _write(world, columns, Path(folder))


def _write(log: Log, columns: Mapping[str, Columns], folder: Path) -> None:
    settings = _settings_of(log)
    names = {f"{stem}.csv" for stem in columns} | ({"log.yaml"} if settings else set())
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if _is_log_file(path) and path.name not in names:
            raise LogError(f"{path}: not part of the log to be written; choose another folder")
    with whole_folder(folder) as stage:
        for stem, table in columns.items():
            header = [name for key in table for name in _file_names(key, table)]
            write_table(stage / f"{stem}.csv", header, _texts(table))
        if settings:
            write_log_yaml(stage / "log.yaml", settings)
        if log.grid is not None:
            write_map(log.grid, stage / settings["map"])


def _is_log_file(path: Path) -> bool:
    return path.name.endswith((".csv", ".csv.gz")) or path.name == "log.yaml"


def _find_tables(folder: Path) -> dict[str, Path]:
    """Return the files of the schema that are there, in its order; refuse other CSV files."""
    if (folder / INCOMPLETE).exists():
        raise LogError(f"{folder}: was not written to its end; write it again ({INCOMPLETE})")
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        stem = path.name.removesuffix(".gz").removesuffix(".csv")
        if path.name not in (f"{stem}.csv", f"{stem}.csv.gz"):
            continue
        if stem not in SCHEMA:
            raise LogError(f"{path}: unknown file; {nearest(stem, SCHEMA)}")
        if stem in found:
            raise LogError(f"{path}: {found[stem].name} is there too, expected one of them")
        found[stem] = path
    return {stem: found[stem] for stem in SCHEMA if stem in found}


def _read_settings(folder: Path) -> dict[str, Any]:
    path = folder / "log.yaml"
    if not path.exists():
        return {}
    settings = read_log_yaml(path)
    if "map" in settings and settings["map"] not in os.listdir(folder):
        raise LogError(f"{path}: map {shown(settings['map'])} is not in the folder")
    return settings


def _check_set(tables: Mapping[str, Columns], settings: Mapping[str, Any], where: str) -> None:
    """Check what only the files together can get wrong."""
    if not any(len(table["stamp_ns"]) for stem, table in tables.items() if stem in MESSAGES):
        names = ", ".join(f"{stem}.csv" for stem in MESSAGES)
        raise LogError(f"{where}: no message, expected rows in one of {names}")
    if "scans" not in tables:
        return
    is_named, lasers = "laser" in tables["scans"], settings.get("lasers", {})
    if not is_named and "laser" not in settings:
        key = "the column laser in scans.csv" if lasers else "the key laser in log.yaml"
        raise LogError(f"{where}: scans without geometry, expected {key}")
    for name in np.unique(tables["scans"]["laser"]).tolist() if is_named else ():
        if name not in lasers:
            known = f"it has {', '.join(lasers)}" if lasers else f"expected lasers: {{{name}: ...}}"
            raise LogError(f"{where}: scans.csv has the laser {shown(name)}, of which log.yaml "
                           f"says nothing; {known}")  # fmt: skip


def read_log_file(path: Path, stem: str) -> Columns:
    """Read one file of a log folder, whatever it is called and wherever it is.

    `stem` says which file of the format it is: a key of `SCHEMA`. Raises LogError as `read_log`,
    and for latitudes, which need the folder that says where the map begins.
    """
    table = _read_table(path, stem)
    if is_on_earth(table):
        raise LogError(f"{path}: latitudes need a log folder with gps_origin; expected x_m, y_m")
    return table


def _read_table(path: Path, stem: str) -> Columns:
    file = read_table(path)
    form = _form(stem, file.header, f"{path}, line {file.first_line - 1}")
    kinds = "".join(_kind(name) for name in file.header)
    found = dict(zip(file.header, file.columns(kinds), strict=True))
    rows = len(next(iter(found.values())))
    if rows == 0 and stem not in MAY_BE_EMPTY:
        raise LogError(f"{path}: no row after the header, expected at least one")
    table = {IN_MEMORY.get(name, name): found[name] for name in form if name in found}
    for name in [name for name in BEAMS if name in form]:
        beams = range(len(_beams(name, file.header)))
        table[name] = np.stack([found[f"{BEAMS[name]}{beam}"] for beam in beams], axis=1)
    table = {IN_MEMORY.get(name, name): table[IN_MEMORY.get(name, name)] for name in form}
    _raise_first(_problems(stem, table), file)
    return _sorted(stem, table)


def _kind(name: str) -> str:
    """Return the letter of `parse_table` for a column of a file."""
    if name in IN_MEMORY:
        return "s"
    return "t" if name in NAMES else "g" if any(_beams(key, (name,)) for key in BEAMS) else "f"


def _beams(name: str, header: Iterable[str]) -> list[str]:
    """Return the columns of a file that are beams of one column in memory."""
    return [column for column in header if re.fullmatch(rf"{BEAMS[name]}(0|[1-9]\d*)", column)]


def _form(stem: str, header: Sequence[str], where: str) -> tuple[str, ...]:
    """Return the row of the schema that a header fits in any order, with arrival_s if it has it."""
    beams = {name: _beams(name, header) if stem == "scans" else [] for name in BEAMS}
    among = {column for columns in beams.values() for column in columns}
    given = set(header) - among - set(BEAMS) | {name for name in BEAMS if beams[name]}
    extra = ("arrival_s",) if stem in MESSAGES else ()
    arrival = tuple(name for name in extra if name in given)
    forms = [form + arrival for form in SCHEMA[stem]]
    form = max(forms, key=lambda form: (len(given & set(form)), -len(set(form) - given)))
    for name in header:
        if name in BEAMS or (name not in form and name not in among):
            known = [_shown(n) for n in dict.fromkeys(sum(SCHEMA[stem], ()) + extra)]
            if name in known:
                raise LogError(f"{where}: column {name!r} does not go with {', '.join(form)}")
            raise LogError(f"{where}: unknown column {shown(name)}; {nearest(name, known)}")
    for name in form:
        if name not in given:
            raise LogError(f"{where}: column {_shown(name)!r} is missing")
    letters = [letter for name, letter in BEAMS.items() if name in form]
    for beam in range(max(map(len, beams.values()))):
        for column in (f"{letter}{beam}" for letter in letters):
            if column not in among:
                raise LogError(f"{where}: column {column!r} is missing")
    return form


def _shown(name: str) -> str:
    return f"{BEAMS[name]}0" if name in BEAMS else name


def _sorted(stem: str, table: dict[str, NDArray[Any]]) -> Columns:
    if stem not in MESSAGES or "arrival_ns" in table or np.all(np.diff(table["stamp_ns"]) >= 0):
        return table
    order = np.argsort(table["stamp_ns"], kind="stable")
    return {name: values[order] for name, values in table.items()}


def _raise_first(problems: Iterator[Problem], file: CsvTable) -> None:
    for row, text in problems:
        raise file.error(row, text)


def _problems(stem: str, table: Columns) -> Iterator[Problem]:
    """Yield what is wrong with the values of a table: the row (from 0) and the complaint."""
    for name, values in table.items():
        yield from _bad_values(stem, name, values)
    for name in NAMES:
        if stem == f"{name}s":
            yield from _first(_repeats(table[name]), f"{name} is listed twice", table[name])
    if stem in INCREASING:
        for row in np.flatnonzero(np.diff(table["stamp_ns"]) <= 0) + 1:
            before, stamp = stamp_texts(table["stamp_ns"][row - 1 : row + 1])
            yield int(row), f"stamp_s {stamp} does not come after {before} of the row before"
    if "arrival_ns" in table:
        early = table["arrival_ns"] < table["stamp_ns"]
        yield from ((int(row), "arrival_s is before stamp_s") for row in np.flatnonzero(early))
    if stem == "odometry" and "dx_m" in table:
        yield from _bad_increments(table)
    if stem in MAY_NOT_KNOW:
        yield from _bad_sigmas(table)
    if "cov_x_x" in table:
        yield from _bad_covariances(table)


def _bad_values(stem: str, name: str, values: NDArray[Any]) -> Iterator[Problem]:
    if name in IN_MEMORY.values():
        for row in np.flatnonzero((values >= MAX_STAMP_NS) | (values <= -MAX_STAMP_NS)):
            seconds, most = values[row] / NANOSECONDS, MAX_STAMP_NS / NANOSECONDS
            written = f"{name.removesuffix('_ns')}_s is {seconds:.10g}"
            yield int(row), f"{written}, expected less than {most:.4g} s from 0"
    elif name in PLACES:
        for row in np.flatnonzero(np.abs(values) > FARTHEST_M):
            yield int(row), f"{name} is {values[row]:g}; is the file in m?"
    elif name in _ON_EARTH:
        most = 90.0 if name == "latitude_deg" else 360.0
        for row in np.flatnonzero(np.abs(values) > most):
            yield int(row), (f"{name} is {values[row]:.10g}, expected at most {most:g}; NMEA's "
                             "ddmm.mm is degrees and minutes")  # fmt: skip
    elif name == "quality":
        bad = (values < 0.0) | (values != np.floor(values))
        yield from _first(bad, "a quality is none of GGA's: 0, 1, 2, ...", values)
    elif name in NAMES:
        if (stem, name) not in MAY_BE_NAMELESS:
            yield from _first(values == "", f"{name} is empty")
        quoted = np.char.find(values, '"') >= 0
        yield from _first(quoted, f"{name} has quotes, which are not part of the format", values)
    elif name.startswith("sigma_") and stem in MAY_NOT_KNOW:
        pass  # together: `_bad_sigmas`
    elif name.startswith("sigma_") or name == "radius_m":
        yield from _first(values <= 0.0, f"{name} is not positive", values)
    elif name == "elevation_rad":
        bad = np.abs(values) > 0.5 * np.pi
        yield from _first(bad, "an elevation is beyond straight up or down", values)
    elif name == "is_course":
        yield from _first((values != 0.0) & (values != 1.0), "is_course is neither 0 nor 1", values)
    elif name == "intensities":
        lowest = np.nan_to_num(values, nan=0.0).reshape(len(values), -1 if values.size else 1)
        yield from _first(lowest.min(axis=1) < 0.0, "an intensity is negative", lowest.min(axis=1))
    elif name in ("range_m", "ranges_m"):
        shape = (len(values), -1 if values.size else 1)
        lowest = np.nan_to_num(values, nan=0.0).reshape(shape).min(axis=1)
        highest = np.nan_to_num(values, nan=0.0).reshape(shape).max(axis=1)
        yield from _first(lowest < 0.0, "a range is negative", lowest)
        for row in np.flatnonzero(highest > MAX_RANGE_M):
            yield int(row), f"a range of {highest[row]:g} m; is the file in m?"
    elif name == "beams":
        bad = (values < 1.0) | (values != np.floor(values))
        yield from _first(bad, "the number of beams is not a positive integer", values)
    elif name == "angle_increment_rad":
        yield from _first(values == 0.0, "angle_increment_rad is 0")
    elif name in ("v_mps", "v_left_mps"):
        for row in np.flatnonzero(np.abs(values) > MAX_SPEED_MPS):
            yield int(row), f"{values[row]:g} m/s; is the file in m and s?"
    elif name in FORCES:
        for row in np.flatnonzero(np.abs(values) > MAX_FORCE_MPS2):
            yield int(row), f"{values[row]:g} m/s^2; is the file in m/s^2?"
    elif name in ("omega_radps", *RATES):
        for row in np.flatnonzero(np.abs(values) > MAX_TURN_RATE_RADPS):
            yield int(row), f"{values[row]:g} rad/s; is the file in rad and s?"


def _bad_sigmas(table: Columns) -> Iterator[Problem]:
    """Yield sigmas that are neither positive nor, all of a row, -1 or 0: not known."""
    sigmas = {name: values for name, values in table.items() if name.startswith("sigma_")}
    if not sigmas:  # of positions by their quality
        return
    together = np.column_stack(list(sigmas.values()))
    unknown = (together == -1.0).all(axis=1) | (together == 0.0).all(axis=1)
    for name, values in sigmas.items():
        yield from _first((values <= 0.0) & ~unknown, f"{name} is not positive", values)


def _bad_covariances(table: Columns) -> Iterator[Problem]:
    """Yield covariances that are neither positive definite nor all 0: exact."""
    xx, xy, yy = (table[name] for name in ("cov_x_x", "cov_x_y", "cov_y_y"))
    with np.errstate(over="ignore"):  # what is infinite is no covariance, too
        good = (xx > 0.0) & (yy > 0.0) & (xy * xy < xx * yy)
    exact = (xx == 0.0) & (xy == 0.0) & (yy == 0.0)
    yield from _first(~good & ~exact, "the covariance is not positive definite", xx)


def _bad_increments(table: Columns) -> Iterator[Problem]:
    seconds = np.diff(table["stamp_ns"]) / NANOSECONDS
    if len(seconds):
        seconds = np.maximum(seconds, seconds.mean())  # messages in packets are no leaps
    with np.errstate(over="ignore"):  # what is infinite is too fast, too
        speed = np.hypot(table["dx_m"], table["dy_m"])[1:] / seconds
        turn_rate = np.abs(table["dheading_rad"])[1:] / seconds
    for row in np.flatnonzero(speed > MAX_SPEED_MPS):
        yield int(row) + 1, f"{speed[row]:.4g} m/s between rows; is the file in m and s?"
    for row in np.flatnonzero(turn_rate > MAX_TURN_RATE_RADPS):
        yield int(row) + 1, f"{turn_rate[row]:.4g} rad/s between rows; is the file in rad and s?"


def _first(
    bad: NDArray[np.bool_], text: str, values: NDArray[Any] | None = None
) -> Iterator[Problem]:
    for row in np.flatnonzero(bad)[:1]:
        yield int(row), text if values is None else f"{text}: {values[row]}"


def _repeats(names: NDArray[Any]) -> NDArray[np.bool_]:
    _, first = np.unique(names, return_index=True)
    repeated = np.ones(len(names), dtype=np.bool_)
    repeated[first] = False
    return repeated


def _settings_of(log: Log) -> dict[str, Any]:
    settings: dict[str, Any] = {
        "tags": dict(log.tags),
        "laser": log.laser,
        "lasers": dict(log.lasers),
        "landmark_sensor": log.landmark_sensor,
        "map": log.map or (None if log.grid is None else "map.yaml"),
        "gps_origin": log.gps_origin,
        "description": log.description,
        "licence": log.licence,
    }
    settings = checked({key: value for key, value in settings.items() if value}, "log")
    if log.grid is not None and not re.fullmatch(r"[^/\\]+\.ya?ml", settings["map"]):
        raise LogError(f"log: map is {settings['map']!r}, expected a file name that ends in .yaml")
    if settings.get("map") == "log.yaml":
        raise LogError("log: map is 'log.yaml', which is the log's own file")
    return settings


def _checked_for_writing(stem: str, table: Columns) -> Columns:
    """Return a table in the order of its file, or raise what `read_log` would find in it."""
    where = f"log table {stem!r}"
    if stem not in SCHEMA:
        raise LogError(f"{where} is unknown; {nearest(stem, SCHEMA)}")
    header = [name for key in table for name in _file_names(key, table)]
    form = [IN_MEMORY.get(name, name) for name in _form(stem, header, where)]
    ordered = {name: _as_written(name, table[name], where) for name in form}
    lengths = {name: len(values) for name, values in ordered.items()}
    if len(set(lengths.values())) != 1:
        raise LogError(f"{where} has columns of different length: {lengths}")
    if "intensities" in ordered and ordered["intensities"].shape != ordered["ranges_m"].shape:
        shapes = f"{ordered['ranges_m'].shape} and {ordered['intensities'].shape}"
        raise LogError(f"{where}: ranges_m and intensities have shapes {shapes}, expected the same")
    if lengths[form[0]] == 0 and stem not in MAY_BE_EMPTY:
        raise LogError(f"{where} has no row, expected at least one")
    for row, text in _problems(stem, ordered):
        raise LogError(f"{where}, row {row}: {text}")
    return ordered


def _file_names(key: str, table: Columns) -> list[str]:
    """Return what a column in memory is called in a file."""
    if key in BEAMS:
        beams = np.shape(table[key])[1] if np.ndim(table[key]) == 2 else 0
        return [f"{BEAMS[key]}{beam}" for beam in range(max(1, beams))]
    return [next((name for name, other in IN_MEMORY.items() if other == key), key)]


def _as_written(name: str, values: NDArray[Any], where: str) -> NDArray[Any]:
    where = f"{where}, column {name!r}"
    values = np.asarray(values)
    kind, dtype = (
        ("U", "str")
        if name in NAMES
        else ("i", "int64")
        if name.endswith("_ns")
        else ("f", "float64")
    )
    if values.dtype.kind != kind or (kind != "U" and values.dtype.itemsize != 8):
        raise LogError(f"{where} is an array of {values.dtype}, expected {dtype}")
    if values.ndim != (2 if name in BEAMS else 1) or 0 in values.shape[1:]:
        raise LogError(f"{where} has shape {values.shape}")
    if kind == "U":
        for text in set(values.tolist()):
            _check_name(text, where)
    elif kind == "f" and values.size:  # a table without rows may be
        bad = np.isinf(values) if name in BEAMS else ~np.isfinite(values)
        for row in np.flatnonzero(bad.reshape(len(values), -1).any(axis=1))[:1]:
            raise LogError(f"{where}, row {row}: {values[row]} is not finite")
    return values


def _check_name(text: str, where: str) -> None:
    if re.search(r'[,"\x00-\x1f]', text) or text.startswith("#") or text != text.strip(" \t"):
        raise LogError(f"{where}: the name {text!r} cannot be written")
    if len(text.encode("utf-8", "replace")) > LONGEST_NAME:
        raise LogError(f"{where}: the name {shown(text)} is longer than {LONGEST_NAME} bytes")


def _texts(table: Columns) -> Iterator[list[str]]:
    """Yield the columns of a file as text."""
    for name, values in table.items():
        yield from (column_texts(name, column) for column in np.atleast_2d(values.T))
