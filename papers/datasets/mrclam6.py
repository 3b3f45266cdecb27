# SPDX-License-Identifier: Apache-2.0
"""UTIAS MRCLAM data set 6: robots that see barcodes on tubes, odometry, true poses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import write_log
from locfuse.types import Columns, Log, LogError, StampArray
from papers.datasets.source import landmarks, later_than_before, read_words, runs_of, truth


def convert(source: Path, out: Path) -> list[Path]:
    """Write each robot, such as robot1, robot3 and robot5, as a log folder below `out`.

    Source: Multi-Robot Cooperative Localization and Mapping, data set 6 (K. Leung, Y. Halpern, T.
    Barfoot, H. Liu, International Journal of Robotics Research 30(8), 2011), GitHub
    ericguerrero/MUSI-lab-session-1: for each robot N ``RobotN_Odometry.dat.gz`` (time, speed, turn
    rate), ``RobotN_Measurement.dat.gz`` (time, barcode, range, bearing) and
    ``RobotN_Groundtruth.dat.gz`` (time, x, y, heading); ``Barcodes.dat`` (subject, barcode) and
    ``Landmark_Groundtruth.dat`` (subject, x, y and their deviations).

    Licence: openly published research data, to be cited, the copy for educational use; for tests,
    not to be passed on.

    Quirks: stamps count from the first that both odometry and truth reach, and end with the first
    of them that ends; what is outside of that is left out, but for one row of the truth at each end
    that covers it. Landmarks are called by their subject, "6" to "20". Sightings of other robots,
    and barcodes that are in no table (misread), are left out. Ranges and bearings count from the
    robot's own point, without an offset: the camera looks forward, 30 degrees to either side.
    Ranges are biased by distance and have heavy tails, bearings are good, the turn rate is poor: on
    odometry alone the heading is anywhere at the end. Some landmarks are only 15 to 25 cm apart.
    Where stamps of odometry or truth repeat, the first row is kept.
    """
    subject, barcode = read_words(source / "Barcodes.dat", "tt")
    subject_of = dict(zip(barcode.tolist(), subject.tolist(), strict=True))
    name, x, y, _, _ = read_words(source / "Landmark_Groundtruth.dat", "tffff")
    runs = runs_of(source, "_Odometry.dat.gz")
    logs = [_read(source, run, subject_of, landmarks(name, x, y)) for run in runs]
    folders = [out / run.lower() for run in runs]
    for log, folder in zip(logs, folders, strict=True):
        write_log(log, folder)
    return folders


def _read(source: Path, run: str, subject_of: Mapping[str, str], places: Columns) -> Log:
    driven = _table(source / f"{run}_Odometry.dat.gz", ("v_mps", "omega_radps"))
    true = _table(source / f"{run}_Groundtruth.dat.gz", ("x_m", "y_m", "theta_rad"))
    stamp, barcode, range_m, bearing = read_words(source / f"{run}_Measurement.dat.gz", "stff")
    subject = np.array([subject_of.get(code, "") for code in barcode.tolist()])
    every = {"stamp_ns": stamp, "landmark": subject, "range_m": range_m, "bearing_rad": bearing}
    seen = _rows(every, np.isin(subject, places["landmark"]))
    begin = max(int(table["stamp_ns"][0]) for table in (driven, true))
    end = min(int(table["stamp_ns"][-1]) for table in (driven, true))
    if begin >= end:
        raise LogError(f"{source / run}_Odometry.dat.gz: no stamp within the time of the truth")
    driven, seen = _between(driven, begin, end), _between(seen, begin, end)
    true = _between(true, *_around(true["stamp_ns"], begin, end), origin=begin)
    return Log(
        tables={
            "odometry": driven,
            "landmark_sightings": seen,
            "truth": truth(true["stamp_ns"], true),
            "landmarks": places,
        },
        description=f"MRCLAM data set 6, {run}: range and bearing to 15 landmarks, odometry, "
        "motion capture",
        licence="Openly published research data (University of Toronto ASRL); not to be passed on",
    )


def _table(path: Path, names: tuple[str, ...]) -> Columns:
    """Return a file of stamps and numbers, without rows whose stamp does not come after."""
    stamp, *values = read_words(path, "s" + "f" * len(names))
    table = {"stamp_ns": stamp, **dict(zip(names, values, strict=True))}
    return _rows(table, later_than_before(stamp))


def _rows(table: Columns, kept: NDArray[np.bool_]) -> Columns:
    return {name: values[kept] for name, values in table.items()}


def _around(stamp: StampArray, begin: int, end: int) -> tuple[int, int]:
    """Return the nearest stamps between which a time lies, so that it is covered to its ends."""
    first, last = np.searchsorted(stamp, begin, "right") - 1, np.searchsorted(stamp, end)
    return int(stamp[first]), int(stamp[last])


def _between(table: Columns, begin: int, end: int, origin: int | None = None) -> Columns:
    """Return the rows within a time, counted from its beginning or another origin."""
    stamp = table["stamp_ns"]
    rows = _rows(table, (stamp >= begin) & (stamp <= end))
    return {**rows, "stamp_ns": rows["stamp_ns"] - (begin if origin is None else origin)}
