# SPDX-License-Identifier: Apache-2.0
"""ACFR's car park: a truck with a laser among surveyed poles with reflective tape, good GPS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log, LogError
from papers.datasets.source import (
    TRUCK_LASER,
    landmarks,
    positions,
    read_source,
    truck_odometry,
    truck_scans,
)

POLE_RADIUS_M = 0.03
SIGMA_GPS_M = 0.03


def convert(source: Path, out: Path) -> list[Path]:
    """Write the first part of the drive (60 s, 281 scans) as a log folder.

    Source: E. Nebot, Australian Centre for Field Robotics, University of Sydney, about 2000, GitHub
    yuzehai1995/hwork_SLAM, as CSV: ``laser_ranges.csv.gz`` (t_s, r000...r360),
    ``laser_intensity.csv.gz`` (t_s, i000...i360), ``drive.csv.gz`` (t_s, speed_encoder_mps,
    steering_rad), ``gps.csv.gz`` (t_s, x_m, y_m), ``beacons.csv`` (id, x_m, y_m).

    Licence: none stated, openly published research data; for tests, not to be passed on.

    Quirks: the body's origin is the middle of the rear axle, the laser 3.78 m ahead of it and 0.5 m
    to its left. GPS gives where the laser is, to 3 cm: it becomes ``positions`` of an antenna at
    (3.78, 0.5) in the body. There is no truth, since without a true heading that is none of the
    body: compare an estimate's antenna with the positions, and leave them out of use. The laser was
    at (4.688, 0.836), heading 4.382 rad, at 46.598 s, fitted to three poles in one scan; on
    odometry alone the steering is biased: from there the antenna ends 0.96 m off. Ranges above 81.8
    m mean no return. Intensity is 0 to 4, and not 0 on reflective tape. The poles are thin; 6 cm is
    believed to be their diameter, not measured, and most are seen by one beam to four. Yet ranges
    fit best as they are, 1.4 cm off the surveyed places; with the radius added 1.9 cm. Between
    poles there are seconds without any; cars and walls are seen, too.
    """
    scans = truck_scans(source / "laser_ranges.csv.gz")
    brightness = read_source(source / "laser_intensity.csv.gz", dict(t_s="s"), beams="i")
    odometry = truck_odometry(source / "drive.csv.gz")
    gps = read_source(source / "gps.csv.gz", dict(t_s="s", x_m="f", y_m="f"))
    poles = read_source(source / "beacons.csv", dict(id="t", x_m="f", y_m="f"))
    same = np.array_equal(brightness["t_s"], scans["stamp_ns"])
    if not same or brightness["beams"].shape != scans["ranges_m"].shape:
        path = source / "laser_intensity.csv.gz"
        raise LogError(f"{path}: stamps or beams differ from those of laser_ranges.csv.gz")
    log = Log(
        tables={
            "odometry": odometry,
            "positions": positions(gps["t_s"], gps["x_m"], gps["y_m"], SIGMA_GPS_M),
            "scans": {**scans, "intensities": brightness["beams"]},
            "landmarks": landmarks(poles["id"], poles["x_m"], poles["y_m"], POLE_RADIUS_M),
        },
        laser=TRUCK_LASER,
        description="ACFR car park, first part: laser with intensity, 15 surveyed poles, truck "
        "odometry, GPS of an antenna at the laser",
        licence="None stated, openly published research data (ACFR); not to be passed on",
    )
    write_log(log, out)
    return [out]
