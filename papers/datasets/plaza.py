# SPDX-License-Identifier: Apache-2.0
"""CMU Plaza: a robot lawn-mower with ranging radios."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log, LogError, wrap_angle
from papers.datasets.source import arc, read_source, runs_of, with_start


def convert(source: Path, out: Path) -> list[Path]:
    """Write each run as a log folder: `out` itself if there is one run, else below it.

    Source: J. Djugash, B. Hamner, S. Roth, "Navigating with Ranging Radios: Five Data Sets with
    Ground Truth", J. Field Robotics 2009; as CSV files of the matrices in GTSAM's
    ``examples/Data/Plaza1_.mat``: ``RUN_odometry.csv`` (t, dist, dheading), ``RUN_ranges.csv`` (t,
    antenna, beacon, range), ``RUN_groundtruth.csv`` (t, x, y, heading) and ``RUN_beacons.csv``
    (beacon, x, y). Run plaza1 takes 1933 s and 1.86 km.

    Licence: openly published research data; the GTSAM repository is under BSD-2-Clause.

    Quirks: planar, heights are unknown and taken as 0. The lever arm of the vehicle's radio is not
    given and taken as zero. In plaza1 ranges read 2 to 4 m long, about 0.03 m + 0.069 per metre,
    and pause for up to 97 s. Odometry row k moves truth row k to row k + 1; it becomes the chord of
    an arc of length dist and turn dheading, after a row of zeros at the first truth stamp. Its
    turns are the differences of the reference headings, so dead reckoning is only 4.4 m off at the
    end.
    """
    runs = runs_of(source, "_groundtruth.csv")
    folders = [out / run for run in runs] if len(runs) > 1 else [out]
    logs = [_read(source, run) for run in runs]
    for log, folder in zip(logs, folders, strict=True):
        write_log(log, folder)
    return folders


def _read(source: Path, run: str) -> Log:
    truth = read_source(source / f"{run}_groundtruth.csv", dict(t="s", x="f", y="f", heading="f"))
    driven = read_source(source / f"{run}_odometry.csv", dict(t="s", dist="f", dheading="f"))
    ranges = read_source(
        source / f"{run}_ranges.csv", dict(t="s", antenna="t", beacon="t", range="f")
    )
    beacons = read_source(source / f"{run}_beacons.csv", dict(beacon="t", x="f", y="f"))
    if not np.array_equal(driven["t"], truth["t"][1:]):
        path = source / f"{run}_odometry.csv"
        raise LogError(f"{path}: stamps differ from those of the ground truth after its first row")
    return Log(
        tables={
            "odometry": with_start(
                truth["t"][0], {"stamp_ns": driven["t"], **arc(driven["dist"], driven["dheading"])}
            ),
            "ranges": {
                "stamp_ns": ranges["t"],
                "tag": ranges["antenna"],
                "anchor": ranges["beacon"],
                "range_m": ranges["range"],
            },
            "truth": {
                "stamp_ns": truth["t"],
                "x_m": truth["x"],
                "y_m": truth["y"],
                "heading_rad": wrap_angle(truth["heading"]),
            },
            "anchors": {
                "anchor": beacons["beacon"],
                "x_m": beacons["x"],
                "y_m": beacons["y"],
                "z_m": np.zeros(len(beacons["x"])),
            },
        },
        tags={str(radio): (0.0, 0.0, 0.0) for radio in np.unique(ranges["antenna"])},
        description=f"CMU {run}: robot lawn-mower, ranging radios, odometry, GPS/inertial truth",
        licence="Openly published research data; GTSAM's copy is under BSD-2-Clause",
    )
