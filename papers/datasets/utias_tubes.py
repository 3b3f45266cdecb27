# SPDX-License-Identifier: Apache-2.0
"""The plastic tubes of Barfoot's course: range and bearing by laser, wheel speeds, true poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log
from papers.datasets.source import landmarks, read_source, truth

TUBES = range(1, 18)


def convert(source: Path, out: Path) -> list[Path]:
    """Write the first half of the drive (630 s, 181 m) as a log folder.

    Source: "dataset2" of T. Barfoot's course AER1513, University of Toronto, GitHub
    samberg96/2D-ekf-example, as CSV: ``log.csv.gz`` (t_s, v_mps, omega_radps, x_true_m, y_true_m,
    theta_true_rad, true_valid, r01_m...r17_m, b01_rad...b17_rad), ``landmarks.csv`` (id, x_m, y_m),
    ``parameters.csv`` (laser_offset_d_m and four variances).

    Licence: none stated, openly published course data; for tests, not to be passed on.

    Quirks: tubes were found in the scans by the publishers; ranges are to their centres, so that no
    radius is given, and a range of 0 means not seen. The laser is 0.219 m ahead of the body's
    origin, looking forward. Sigmas are the publishers': 0.030 m and 0.026 rad. A row's speeds hold
    until the next row, as in a log: so dead reckoning ends 2.5 m and 14.5 degrees off. The robot
    travels 4.6 degrees to the right of its heading, always: the frame of the wheels is turned
    against that of laser and truth. The log is as recorded; a filter that takes the two frames for
    one is 5 cm off to the side and overconfident. Errors of one tube stay similar from row to
    row. Rows whose motion capture is marked invalid, 172 of 6304, are left out of the truth.
    """
    ranges = {f"r{tube:02d}_m": "f" for tube in TUBES}
    bearings = {f"b{tube:02d}_rad": "f" for tube in TUBES}
    pose = dict(x_true_m="f", y_true_m="f", theta_true_rad="f", true_valid="t")
    rows = read_source(
        source / "log.csv.gz", dict(t_s="s", v_mps="f", omega_radps="f") | pose | ranges | bearings
    )
    places = read_source(source / "landmarks.csv", dict(id="t", x_m="f", y_m="f"))
    stated = read_source(
        source / "parameters.csv",
        dict(laser_offset_d_m="f", range_var_m2="f", bearing_var_rad2="f", v_var_m2ps2="f",
             omega_var_rad2ps2="f"),
    )  # fmt: skip
    range_m = np.stack([rows[name] for name in ranges], axis=1)
    row, tube = np.nonzero(range_m > 0.0)
    bearing = np.stack([rows[name] for name in bearings], axis=1)[row, tube]
    sigma_range, sigma_bearing = (
        float(np.sqrt(stated[key][0])) for key in ("range_var_m2", "bearing_var_rad2")
    )
    valid = rows["true_valid"] == "1"
    named = ("x_true_m", "y_true_m", "theta_true_rad")
    true = dict(zip(("x_m", "y_m", "theta_rad"), (rows[key][valid] for key in named), strict=True))
    log = Log(
        tables={
            "odometry": {
                "stamp_ns": rows["t_s"],
                "v_mps": rows["v_mps"],
                "omega_radps": rows["omega_radps"],
            },
            "landmark_sightings": {
                "stamp_ns": rows["t_s"][row],
                "landmark": np.array([str(number) for number in TUBES])[tube],
                "range_m": range_m[row, tube],
                "bearing_rad": bearing,
                "sigma_range_m": np.full(len(row), sigma_range),
                "sigma_bearing_rad": np.full(len(row), sigma_bearing),
            },
            "truth": truth(rows["t_s"][valid], true),
            "landmarks": landmarks(places["id"], places["x_m"], places["y_m"]),
        },
        landmark_sensor={"pose_in_body": [float(stated["laser_offset_d_m"][0]), 0.0, 0.0]},
        description="UTIAS tubes, first half: range and bearing to 17 tubes, wheel speeds, "
        "motion capture",
        licence="None stated, openly published course data (AER1513); not to be passed on",
    )
    write_log(log, out)
    return [out]
