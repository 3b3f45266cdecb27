# SPDX-License-Identifier: Apache-2.0
"""A TurtleBot 4 in a college building: RPLIDAR scans all around, odometry, ROS map."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.io.maps import read_map
from locfuse.types import Log
from papers.datasets.source import FREE_THRESH, increments, read_source, truth

LASER = {
    "pose_in_body": [0.0039, 0.0, float(np.pi / 2.0)],
    "angle_min_rad": -3.1241393,
    "angle_increment_rad": 0.0087145,
    "range_min_m": 0.15,
    "range_max_m": 12.0,
}


def convert(source: Path, out: Path) -> list[Path]:
    """Write the run (46 s, 8.3 m) as a log folder.

    Source: Olin College's robotics course, GitHub ackurtzy/robot_localization, bag
    ``macfirst_floor_take_2`` (23 September 2022) as CSV: ``scans.csv.gz`` (t_s, r000...),
    ``odometry.csv.gz`` (t_s, x_m, y_m, theta_rad, v_mps, omega_radps), ``reference.csv.gz`` (t_s,
    x_m, y_m, theta_rad); ``mac_1st_floor_final.pgm`` and ``.yaml`` as published.

    Licence: none stated, openly published course data; for tests, not to be passed on.

    Quirks: the truth is a reference that was computed, not measured: a fit of all poses to the map
    and the odometry. World is the frame of the map, whose corner is at (-1.12, -39.4). The odometry
    has a frame of its own that lies near the map's by chance; its poses become motions, its speeds
    are left out. It begins 0.2 s after the first scan. Infinite ranges mean no return; 1 percent
    are longer than the sensor's 12 m and kept. The laser is turned by 90 degrees. The map's
    free_thresh of 0.25 would make its unknown cells free and is read as 0.196.
    """
    grid = read_map(source / "mac_1st_floor_final.yaml", free_thresh=FREE_THRESH)
    pose = dict(t_s="s", x_m="f", y_m="f", theta_rad="f")
    driven = read_source(source / "odometry.csv.gz", {**pose, "v_mps": "f", "omega_radps": "f"})
    scans = read_source(source / "scans.csv.gz", dict(t_s="s"), beams="r", no_return=b"inf")
    reference = read_source(source / "reference.csv.gz", pose)
    log = Log(
        tables={
            "odometry": increments(
                driven["t_s"], driven["x_m"], driven["y_m"], driven["theta_rad"]
            ),
            "scans": {"stamp_ns": scans["t_s"], "ranges_m": scans["beams"]},
            "truth": truth(reference["t_s"], reference),
        },
        laser=LASER,
        grid=grid,
        description="TurtleBot 4 in a college: laser scans, odometry, map; truth fitted to the map",
        licence="None stated, openly published course data (Olin College); not to be passed on",
    )
    write_log(log, out)
    return [out]
