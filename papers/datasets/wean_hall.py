# SPDX-License-Identifier: Apache-2.0
"""Wean Hall, Carnegie Mellon University: 2D laser and wheel odometry on a map of corridors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import parse, read_bytes
from locfuse.io.log_folder import write_log
from locfuse.io.maps import read_map
from locfuse.types import GridMap, Log, LogError
from papers.datasets.source import FREE_THRESH, increments, read_source, runs_of, truth

BEAMS = 180
NO_RETURN_CM = 8183.0  # or 8191; no real return is longer than 54 m
KINDS = {b"O": "tfffs", b"L": "t" + "ffffff" + BEAMS * "f" + "s"}
LASER = {
    "pose_in_body": [0.25, 0.0, 0.0],
    "angle_min_rad": float(np.deg2rad(-89.5)),
    "angle_increment_rad": float(np.deg2rad(1.0)),
    "range_min_m": 0.0,
    "range_max_m": 80.0,
}


def convert(source: Path, out: Path) -> list[Path]:
    """Write each run, such as robotdata1 and robotdata3, as a log folder below `out`.

    Source: the homework on particle filters of Carnegie Mellon's course 16-831, GitHub
    tmuellersim/16-831-ParticleFilter: for each run ``RUN.log.gz`` as published (lines ``O x y theta
    t`` and ``L x y theta xl yl thetal r1...r180 t`` in centimetres, radians, seconds) and
    ``reference_RUN.csv.gz`` (t_s, x_m, y_m, theta_rad); ``wean_map.pgm`` and ``wean_map.yaml``,
    made of the published ``wean.dat.gz``.

    Licence: none stated, openly published course data; for tests, not to be passed on.

    Quirks: the truth is a reference that was computed, not measured: a fit of all poses to the map
    and the odometry. It shares the distortion of the map and its cells of 0.1 m; trust it to a cell
    and 1.5 degrees. World is the frame of the map, its corner the origin. Whether beam 1 points to
    -90 or -89.5 degrees is not stated; -89.5 is taken. Ranges of 81.83 m and more mean no return.
    The map's free_thresh of 0.25 would make its unknown cells free and is read as 0.196. Odometry
    are the O lines; scans come irregularly, and people walk in front of the robot.
    """
    grid = read_map(source / "wean_map.yaml", free_thresh=FREE_THRESH)
    logs = {run: _read(source, run, grid) for run in runs_of(source, ".log.gz")}
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def _read(source: Path, run: str, grid: GridMap) -> Log:
    path = source / f"{run}.log.gz"
    _, x_cm, y_cm, theta, stamp_ns = _lines(path, b"O")
    scans = _lines(path, b"L")
    ranges_cm = np.stack(scans[7 : 7 + BEAMS], axis=1)
    reference = read_source(
        source / f"reference_{run}.csv.gz", dict(t_s="s", x_m="f", y_m="f", theta_rad="f")
    )
    return Log(
        tables={
            "odometry": increments(stamp_ns, x_cm / 100.0, y_cm / 100.0, theta),
            "scans": {
                "stamp_ns": scans[-1],
                "ranges_m": np.where(ranges_cm >= NO_RETURN_CM, np.nan, ranges_cm / 100.0),
            },
            "truth": truth(reference["t_s"], reference),
        },
        laser=LASER,
        grid=grid,
        description=f"Wean Hall {run}: laser scans, wheel odometry, map; truth fitted to the map",
        licence="None stated, openly published course data (CMU 16-831); not to be passed on",
    )


def _lines(path: Path, kind: bytes) -> list[NDArray[Any]]:
    """Return the columns of the lines that begin with a letter; others are made blank."""
    lines = read_bytes(path).split(b"\n")
    for number, line in enumerate(lines, 1):
        if line.strip() and line[:2] not in (b"O ", b"L "):
            begin = line[:10].decode("ascii", "replace")
            raise LogError(f"{path}, line {number}: begins with {begin!r}, expected O or L")
    kept = b"\n".join(line if line[:1] == kind else b"" for line in lines)
    columns = parse(kept, KINDS[kind], " ", 1, path)
    if len(columns[0]) == 0:
        raise LogError(f"{path}: no line that begins with {kind.decode()}")
    return columns
