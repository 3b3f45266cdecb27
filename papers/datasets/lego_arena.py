# SPDX-License-Identifier: Apache-2.0
"""A Lego robot among six cylinders: raw laser scans, wheel ticks, overhead camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import write_log
from locfuse.types import Columns, FloatArray, Log, LogError, StampArray
from papers.datasets.source import arc, landmarks, later_than_before, read_words, with_start

BEAMS = 660
STEP_RAD = 0.006135923151543
NEAREST_M = 0.02
M_PER_TICK = 0.349e-3
TRACK_WIDTH_M = 0.173
LASER = {
    "pose_in_body": [0.03, 0.0, -0.06981317007977318],
    "angle_min_rad": -(BEAMS // 2) * STEP_RAD,
    "angle_increment_rad": STEP_RAD,
    "range_min_m": NEAREST_M,
    "range_max_m": 4.0,
}


def convert(source: Path, out: Path) -> list[Path]:
    """Write the first 167 scans (33 s, 5.1 m) as a log folder.

    Source: C. Brenner's lectures on SLAM, Leibniz University Hannover, GitHub
    nishadelias/Robot_SLAM_Simulation, ``Unit_A``: ``robot4_motors.txt`` (lines M t ...),
    ``robot4_scan.txt.gz`` (S t 660 r1...r660), ``robot4_reference.txt`` (P t x y) in milliseconds,
    millimetres and ticks; ``robot_arena_landmarks.txt`` (L C x y d).

    Licence: none stated, openly published course data; for tests, not to be passed on.

    Quirks: motors, scans and camera have stamps of their own. Motor lines that repeat the stamp and
    ticks of the line before, 37 of 167, are left out. Odometry are arcs of two wheels 173 mm apart,
    0.349 mm a tick, from the third and seventh word of a motor line; the width of 155 mm that goes
    with the recording elsewhere is far off. Ranges below 20 mm are no returns. The scanner is 30 mm
    ahead of the axle and turned by -4 degrees. The truth is the overhead position, without heading;
    whether of axle or scanner is not stated, and taken for the axle. Dead reckoning fits it best
    from (1.850, 1.897) at 213.5 degrees. The field d of a cylinder, 55 mm, is taken for its radius,
    though it is elsewhere called the diameter: from 0.3 m to 2.3 m the beams on a cylinder span
    0.10 m. Ranges read short, by 0.03 m at 0.5 m and 0.12 m at 2 m, for which the lectures add 90
    mm to the mean range of a cylinder to come to its centre. Scans come 0.4 s late against the
    wheels, and the camera sees ways 3 % longer than they go. Walls are seen behind the cylinders.
    """
    motors = _lines(source / "robot4_motors.txt", "M", "ts" + 12 * "f")
    scans = _lines(source / "robot4_scan.txt.gz", "S", "tst" + BEAMS * "f")
    seen = _lines(source / "robot4_reference.txt", "P", "tsff")
    _, _, x_mm, y_mm, d_mm = _lines(source / "robot_arena_landmarks.txt", "L", "ttfff")
    ranges = np.stack(scans[3:], axis=1) / 1000.0
    log = Log(
        tables={
            "odometry": _driven(_stamps(motors[1]), motors[2], motors[6]),
            "scans": {
                "stamp_ns": _stamps(scans[1]),
                "ranges_m": np.where(ranges < NEAREST_M, np.nan, ranges),
            },
            "truth": {
                "stamp_ns": _stamps(seen[1]),
                "x_m": seen[2] / 1000.0,
                "y_m": seen[3] / 1000.0,
            },
            "landmarks": landmarks(
                np.array([str(number) for number in range(1, len(x_mm) + 1)]),
                x_mm / 1000.0,
                y_mm / 1000.0,
                float(d_mm[0]) / 1000.0,
            ),
        },
        laser=LASER,
        description="Lego robot in a cylinder arena: raw scans, wheel ticks, overhead position",
        licence="None stated, openly published course data (Hannover); not to be passed on",
    )
    write_log(log, out)
    return [out]


def _lines(path: Path, letter: str, kinds: str) -> list[NDArray[Any]]:
    columns = read_words(path, kinds)
    odd = np.flatnonzero(columns[0] != letter)
    if len(odd) > 0:
        found = str(columns[0][odd[0]])
        raise LogError(f"{path}, row {odd[0] + 1}: begins with {found!r}, expected {letter}")
    return columns


def _stamps(milliseconds: StampArray) -> StampArray:
    """Return nanoseconds of what was read as seconds but counts milliseconds."""
    return milliseconds // 1000


def _driven(stamp_ns: StampArray, left: FloatArray, right: FloatArray) -> Columns:
    """Return motions of ticks that each wheel has counted; a line said twice counts once."""
    kept = later_than_before(stamp_ns)
    stamp_ns, left, right = stamp_ns[kept], left[kept], right[kept]
    left_m, right_m = (M_PER_TICK * np.diff(ticks) for ticks in (left, right))
    moved = arc((left_m + right_m) / 2.0, (right_m - left_m) / TRACK_WIDTH_M)
    return with_start(int(stamp_ns[0]), {"stamp_ns": stamp_ns[1:], **moved})
