# SPDX-License-Identifier: Apache-2.0
"""A drone that ranges to four UWB anchors in a motion-capture room: no odometry, truth in 3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log
from papers.datasets.source import heading_of, read_source, runs_of

TAG = "tag"


def convert(source: Path, out: Path) -> list[Path]:
    """Write each sequence, such as seq1, seq3 and seq5, as a log folder below `out`.

    Source: J. H. Choe and I. Shim, Inha University, "Addressing Relative Pose Impact on UWB
    Localization: Dataset Introduction and Analysis", arXiv 2407.03890, GitHub
    cjhhalla/RCV_uwb_dataset, as CSV: for each sequence ``SEQ_ranges.csv.gz`` (t, anchor, range,
    rx_power, then the tag's true pose), ``SEQ_groundtruth.csv.gz`` (t, x, y, z, qx, qy, qz, qw),
    ``SEQ_anchors.csv`` (anchor, x, y, z, qx, qy, qz, qw).

    Licence: none stated, openly published research data, to be cited; for tests, not to be passed
    on.

    Quirks: the truth is the tag's own pose, so the body is the tag; heading is where its forward
    axis points in the plane. There is no odometry. Each anchor is received 5 times a second, not in
    step, after a silence of some seconds at the beginning. Ranges read 0.16 m to 0.35 m long, by
    direction and distance. Up to 3 percent are gross errors. A negative range cannot be in a log
    and is left out: 27 of 3366 in seq1, 12 of 3841 in seq3, 1 of 5630 in seq5; with them go the
    largest errors, what stays is 1.7 m off at most. The attitude of the anchors, the received
    powers and the true poses beside the ranges are not used. The anchors of seq5 stand close
    together.
    """
    runs = runs_of(source, "_ranges.csv.gz")
    logs = {run: _read(source, run) for run in runs}
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def _read(source: Path, run: str) -> Log:
    pose = dict.fromkeys(("x", "y", "z", "qx", "qy", "qz", "qw"), "f")
    measured = read_source(
        source / f"{run}_ranges.csv.gz", dict(t="s", anchor="t", range="f", rx_power="f") | pose
    )
    true = read_source(source / f"{run}_groundtruth.csv.gz", dict(t="s") | pose)
    anchors = read_source(source / f"{run}_anchors.csv", dict(anchor="t") | pose)
    kept = measured["range"] >= 0.0
    return Log(
        tables={
            "ranges": {
                "stamp_ns": measured["t"][kept],
                "tag": np.full(kept.sum(), TAG),
                "anchor": measured["anchor"][kept],
                "range_m": measured["range"][kept],
            },
            "truth": {
                "stamp_ns": true["t"],
                "x_m": true["x"],
                "y_m": true["y"],
                "z_m": true["z"],
                "heading_rad": heading_of(*(true[key] for key in ("qw", "qx", "qy", "qz"))),
            },
            "anchors": {
                "anchor": anchors["anchor"],
                "x_m": anchors["x"],
                "y_m": anchors["y"],
                "z_m": anchors["z"],
            },
        },
        tags={TAG: (0.0, 0.0, 0.0)},
        description=f"RCV drone {run}: UWB ranges of one tag to four anchors, motion capture in 3D",
        licence="None stated, openly published research data (Inha); not to be passed on",
    )
