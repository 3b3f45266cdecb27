# SPDX-License-Identifier: Apache-2.0
"""A platform in a yard, ranging from up to 50 m to four UWB anchors side by side: no odometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Columns, Log, wrap_angle
from papers.datasets.source import read_source, row_error, runs_of

TAG = "tag"
TAG_HEIGHT_M = 1.0
PLACE = ("ax", "ay", "az")


def convert(source: Path, out: Path) -> list[Path]:
    """Write each drive, such as los_a1 and nlos_a1, as a log folder below `out`.

    Source: ADIP laboratory, Hanyang University, "Comprehensive outdoor UWB dataset: Static and
    dynamic measurements in LOS/NLOS environments", Zenodo 15226105, GitHub cucudasluv/UWB-dataset,
    the anchors of a drive merged and sorted by time, as CSV: ``CASE_ranges.csv.gz`` (t, anchor, ax,
    ay, az, range, rssi, rssi_fp) and ``CASE_groundtruth.csv`` (t, x, y, z_rel, heading_deg).

    Licence: Apache-2.0.

    Quirks: the four anchors stand within 3 m, so across the line of sight a range error of 0.2 m is
    metres. Up to 1.5 percent of an anchor's ranges are several to 20 m wrong. Where the tag is on
    the platform is not stated; 1 m above its middle fits, like the tag of the publishers' static
    part. Ranges fit where the truth was 0.2 s before, in all four drives, with robust sigmas of
    0.09 m to 0.11 m instead of 0.14 m to 0.27 m; stamps are left as published. The truth is RTK
    GNSS; its heading is the course over ground and means nothing at rest, its height is noise and
    left out, and so are signal strengths.
    """
    runs = runs_of(source, "_groundtruth.csv")
    logs = {run: _read(source, run) for run in runs}
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def _read(source: Path, run: str) -> Log:
    path = source / f"{run}_ranges.csv.gz"
    place = dict.fromkeys(PLACE, "f")
    measured = read_source(
        path, dict(t="s", anchor="t") | place | dict(range="f", rssi="f", rssi_fp="f")
    )
    true = read_source(
        source / f"{run}_groundtruth.csv", dict(t="s", x="f", y="f", z_rel="f", heading_deg="f")
    )
    return Log(
        tables={
            "ranges": {
                "stamp_ns": measured["t"],
                "tag": np.full(len(measured["t"]), TAG),
                "anchor": measured["anchor"],
                "range_m": measured["range"],
            },
            "truth": {
                "stamp_ns": true["t"],
                "x_m": true["x"],
                "y_m": true["y"],
                "heading_rad": wrap_angle(np.deg2rad(true["heading_deg"])),
            },
            "anchors": _anchors(path, measured),
        },
        tags={TAG: (0.0, 0.0, TAG_HEIGHT_M)},
        description=f"Hanyang outdoor {run}: UWB ranges of one tag to four anchors, RTK GNSS",
        licence="Apache-2.0",
    )


def _anchors(path: Path, measured: Columns) -> Columns:
    """Return where each anchor is, the same in all of its ranges."""
    names, first, which = np.unique(measured["anchor"], return_index=True, return_inverse=True)
    places = np.column_stack([measured[axis] for axis in PLACE])
    moved = np.flatnonzero((places != places[first][which]).any(axis=1))
    if len(moved):
        row = int(moved[0])
        raise row_error(path, row, f"anchor {measured['anchor'][row]} is not where it was before")
    return {"anchor": names, **{f"{axis[1:]}_m": measured[axis][first] for axis in PLACE}}
