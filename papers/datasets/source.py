# SPDX-License-Identifier: Apache-2.0
"""What the converters share: reading published CSV files, wrapping, joining columns."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.io.csv_table import parse, read_bytes, read_table
from locfuse.types import Columns, FloatArray, LogError, StampArray, wrap_angle

# Of acfr_carpark and victoria_park; its encoder is at the left rear wheel.
TRUCK = _core.AckermannVehicle(_core.AckermannConfig(wheel_base_m=2.83, encoder_left_m=0.76))
TRUCK_LONGEST_M = 81.8  # 81.83 to 81.91 are no distances but what the sensor says of a beam
TRUCK_LASER: dict[str, Any] = {
    "pose_in_body": [3.78, 0.5, 0.0],  # from the middle of the rear axle
    "angle_min_rad": -float(np.pi / 2.0),
    "angle_increment_rad": float(np.pi / 360.0),
    "range_min_m": 0.0,
    "range_max_m": TRUCK_LONGEST_M,
}

MAP_FILES = ("map.pgm", "map.yaml")
FREE_THRESH = 0.196  # where a map says 0.25, its unexplored cells (shade 205) would be free


def read_source(
    path: Path, kinds: Mapping[str, str], beams: str | None = None, no_return: bytes | None = None
) -> dict[str, NDArray[Any]]:
    """Read a CSV file whose header must be exactly the keys of `kinds`, in order.

    Parameters
    ----------
    path : Path
    kinds : mapping of column name to letter of `parse_table`
    beams : str, optional
        Letter in front of the numbers of further columns, returned as ``beams``. The numbers may
        all have as many digits: r000, r001, ...
    no_return : bytes, optional
        What stands for an empty field.

    Returns
    -------
    dict of arrays, shape (rows,)
        And ``beams``, shape (rows, beams), NaN where a field is empty.

    Raises
    ------
    LogError
        If the file is missing or is not such a table.
    """
    file = read_table(path)
    named, rest = file.header[: len(kinds)], file.header[len(kinds) :]
    digits = len(rest[0]) - 1 if rest else 0
    numbered = tuple(f"{beams}{number:0{digits}d}" for number in range(len(rest)))
    if named != tuple(kinds) or rest != numbered or (beams is not None and not rest):
        expected = ",".join(kinds) + (f",{beams}0,{beams}1,..." if beams else "")
        raise LogError(f"{path}, line {file.first_line - 1}: expected the header {expected}")
    if no_return is not None:
        file = replace(file, data=file.data.replace(no_return, b""))
    columns = file.columns("".join(kinds.values()) + "g" * len(rest))
    if len(columns[0]) == 0:
        raise LogError(f"{path}: no row after the header")
    table = dict(zip(kinds, columns, strict=False))
    if beams is not None:
        table["beams"] = np.stack(columns[len(kinds) :], axis=1)
    return table


def read_words(path: Path, kinds: str) -> list[NDArray[Any]]:
    """Read a text file without header, its fields separated by spaces or tabs.

    Parameters
    ----------
    path : Path
    kinds : str
        One letter of `parse_table` for each column.

    Returns
    -------
    list of arrays, shape (rows,)

    Raises
    ------
    LogError
        If the file is missing, has no row, or is not such a table.
    """
    columns = parse(read_bytes(path), kinds, " ", 1, path)
    if len(columns[0]) == 0:
        raise LogError(f"{path}: no row")
    return columns


def runs_of(source: Path, ending: str) -> list[str]:
    """Return the names of the runs in a folder: what stands before `ending` in its files' names.

    Raises
    ------
    LogError
        If there is none.
    """
    names = sorted(path.name.removesuffix(ending) for path in source.glob(f"?*{ending}"))
    if not names:
        raise LogError(f"{source}: no file that ends in {ending}")
    return names


def later_than_before(stamp_ns: StampArray) -> NDArray[np.bool_]:
    """Return which stamps come after all before them."""
    latest = np.maximum.accumulate(stamp_ns)
    return np.concatenate([[True], stamp_ns[1:] > latest[:-1]])


def with_start(stamp_ns: int, increments: Columns) -> Columns:
    """Return increments with a row of zeros in front: where the first motion begins."""
    return {
        name: np.concatenate([[stamp_ns if name == "stamp_ns" else 0], values]).astype(values.dtype)
        for name, values in increments.items()
    }


def increments(stamp_ns: StampArray, x: FloatArray, y: FloatArray, heading: FloatArray) -> Columns:
    """Return cumulative odometry as motions, each in the body frame where it begins.

    Parameters
    ----------
    stamp_ns : int64 array, shape (n,)
    x, y, heading : float64 arrays, shape (n,)
        Metres and radians, in a frame of the odometry's own.

    Returns
    -------
    columns, shape (n,)
        ``stamp_ns``, ``dx_m``, ``dy_m``, ``dheading_rad``; the first motion is zero.
    """
    cos, sin, dx, dy = np.cos(heading[:-1]), np.sin(heading[:-1]), np.diff(x), np.diff(y)
    motions = {
        "stamp_ns": stamp_ns[1:],
        "dx_m": cos * dx + sin * dy,
        "dy_m": cos * dy - sin * dx,
        "dheading_rad": wrap_angle(np.diff(heading)),
    }
    return with_start(int(stamp_ns[0]), motions)


def arc(length: FloatArray, turn: FloatArray) -> Columns:
    """Return motions along circular arcs in the body frame at their beginning.

    Parameters
    ----------
    length : float64 array, shape (n,)
        Metres, negative backwards.
    turn : float64 array, shape (n,)
        Radians.

    Returns
    -------
    columns
        ``dx_m``, ``dy_m``, ``dheading_rad``.
    """
    chord = length * np.sinc(turn / (2.0 * np.pi))  # numpy's sinc(x) is sin(pi x) / (pi x)
    return {
        "dx_m": chord * np.cos(turn / 2.0),
        "dy_m": chord * np.sin(turn / 2.0),
        "dheading_rad": turn,
    }


def truck_odometry(path: Path) -> Columns:
    """Return the odometry of the truck of a file t_s, speed_encoder_mps, steering_rad.

    Raises
    ------
    LogError
        If the file is missing, is not such a table, or steers as no truck does.
    """
    driven = read_source(path, dict(t_s="s", speed_encoder_mps="f", steering_rad="f"))
    try:
        moved = TRUCK.velocities(driven["speed_encoder_mps"], driven["steering_rad"])
    except ValueError as error:
        raise LogError(f"{path}: {error}") from error
    return {"stamp_ns": driven["t_s"], "v_mps": moved[:, 0], "omega_radps": moved[:, 1]}


def truck_scans(path: Path) -> Columns:
    """Return the scans of the truck of a file t_s, r000 to r360, NaN for no return."""
    scans = read_source(path, dict(t_s="s"), beams="r")
    ranges = scans["beams"]
    return {
        "stamp_ns": scans["t_s"],
        "ranges_m": np.where(ranges > TRUCK_LONGEST_M, np.nan, ranges),
    }


def positions(stamp_ns: StampArray, x: FloatArray, y: FloatArray, sigma_m: float) -> Columns:
    """Return fixes of one sigma as the positions of a log."""
    return {"stamp_ns": stamp_ns, "x_m": x, "y_m": y, "sigma_m": np.full(len(x), sigma_m)}


def landmarks(name: NDArray[Any], x: FloatArray, y: FloatArray, radius_m: float = 0.0) -> Columns:
    """Return the landmarks of a log, all of one radius [m], or points."""
    table = {"landmark": name, "x_m": x, "y_m": y}
    return table | ({"radius_m": np.full(len(x), radius_m)} if radius_m > 0.0 else {})


def heading_of(w: FloatArray, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return where the forward axis of unit quaternions points in the plane, in [-pi, pi)."""
    return wrap_angle(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def truth(stamp_ns: StampArray, pose: Columns) -> Columns:
    """Return poses ``x_m``, ``y_m``, ``theta_rad`` as the truth of a log."""
    return {
        "stamp_ns": stamp_ns,
        "x_m": pose["x_m"],
        "y_m": pose["y_m"],
        "heading_rad": wrap_angle(pose["theta_rad"]),
    }


def row_error(path: Path, row: int, text: str) -> LogError:
    """Return the error that names a file and the line of a row, counting rows from 0."""
    return read_table(path).error(row, text)


def copy_map(source: Path, out: Path) -> None:
    """Copy a ROS map into a log folder."""
    for name in MAP_FILES:
        shutil.copyfile(source / name, out / name)


def check_map(source: Path) -> None:
    """Refuse a source without its map before anything is written."""
    for name in MAP_FILES:
        if not (source / name).is_file():
            raise LogError(f"{source / name}: no such file")
