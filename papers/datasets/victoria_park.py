# SPDX-License-Identifier: Apache-2.0
"""Victoria Park, Sydney: a truck among trees, raw laser, odometry, poor GPS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log
from papers.datasets.source import TRUCK_LASER, positions, read_source, truck_odometry, truck_scans

SIGMA_GPS_M = 2.0


def convert(source: Path, out: Path) -> list[Path]:
    """Write the first 800 s (2.2 km) twice: folders ``laser`` and ``trees`` below `out`.

    Source: J. Guivant and E. Nebot, Australian Centre for Field Robotics, GitHub
    OpenSLAM-org/openslam_ufastslam, trees from ezamorag/EKFSLAM_for_Victoria_Park_Benchmark, as
    CSV: ``laser.csv.gz`` (t_s, r000...r360), ``drive.csv.gz`` (t_s, speed_encoder_mps,
    steering_rad), ``gps.csv.gz`` (t_s, x_m, y_m), ``trees_reference_detector.csv.gz`` (scan_t_s,
    range_m, bearing_rad, diameter_m).

    Licence: none stated for the recording, openly published research data; MIT for the trees. For
    tests, not to be passed on.

    Quirks: ``laser`` has the raw scans, ``trees`` what the detector that comes with the recording
    found in them, as sightings without a name; both have odometry and GPS. The body's origin is the
    middle of the rear axle, the laser 3.78 m ahead of it and 0.5 m to its left. Ranges above 81.8 m
    mean no return: four beams of five. Trees are sighted at their centre, and their bearing is
    turned to count from straight ahead; their diameters have no place in a log. There is no truth
    and no map: the GPS wanders by metres under trees, jumps and pauses for up to 51 s, so it is
    written as ``positions`` of 2 m, a rough guess, and shows how good an estimate is only to a few
    metres. Steering is that of the recalibrated copy. GPS counts from its first fix, where the
    truck heads for 38 degrees. Nineteen scans are missing; people and cars move about.
    """
    seen = read_source(
        source / "trees_reference_detector.csv.gz",
        dict(scan_t_s="s", range_m="f", bearing_rad="f", diameter_m="f"),
    )
    gps = read_source(source / "gps.csv.gz", dict(t_s="s", x_m="f", y_m="f"))
    shared = {
        "odometry": truck_odometry(source / "drive.csv.gz"),
        "positions": positions(gps["t_s"], gps["x_m"], gps["y_m"], SIGMA_GPS_M),
    }
    trees = {
        "stamp_ns": seen["scan_t_s"],
        "landmark": np.full(len(seen["scan_t_s"]), ""),
        "range_m": seen["range_m"],
        "bearing_rad": seen["bearing_rad"] - np.pi / 2.0,
    }
    about = "Victoria Park, 0 to 800 s: {}, truck odometry, poor GPS"
    licence = "None stated, openly published research data (ACFR); not to be passed on"
    logs = {
        "laser": Log(
            tables={**shared, "scans": truck_scans(source / "laser.csv.gz")},
            laser=TRUCK_LASER,
            description=about.format("raw laser scans"),
            licence=licence,
        ),
        "trees": Log(
            tables={**shared, "landmark_sightings": trees},
            landmark_sensor={"pose_in_body": TRUCK_LASER["pose_in_body"]},
            description=about.format("trees of the reference detector"),
            licence=f"{licence}; trees: MIT (ezamorag)",
        ),
    }
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]
