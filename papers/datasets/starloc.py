# SPDX-License-Identifier: Apache-2.0
"""STAR-loc: a rig with UWB tags in a motion-capture room: no odometry, truth in 3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.csv_table import read_table
from locfuse.io.log_folder import write_log
from locfuse.types import Columns, FloatArray, Log
from papers.datasets.source import heading_of, read_source, runs_of

CALIBRATED = dict(range_calib="f", std="f", fpp1="f", fpp2="f")
POSE = dict.fromkeys(("x", "y", "z", "w", "rot_x", "rot_y", "rot_z"), "f")
TRUE = dict.fromkeys(("tag_pos_x", "tag_pos_y", "tag_pos_z", "gt_range"), "f")
LICENCE = "None stated, openly published research data (UTIAS ASRL); not to be passed on"


def convert(source: Path, out: Path) -> list[Path]:
    """Write each sequence as a log folder below `out`, such as loop-2d_s5; calibrated ones twice.

    Source: F. Duembgen, M. A. Shalaby, C. Holmes, C. C. Cossette, J. R. Forbes, J. Le Ny, T. D.
    Barfoot, "STAR-loc: Dataset for STereo And Range-based localization", arXiv 2309.05518, GitHub
    utiasASRL/starloc, selected columns: for each sequence ``SEQ_uwb.csv.gz`` (time_s, from_id,
    to_id, range, perhaps range_calib, std, fpp1, fpp2, then the true poses of rig and tag) and
    ``SEQ_anchors.csv`` (anchor, x, y, z).

    Licence: none stated, openly published research data, to be cited; for tests, not to be passed
    on.

    Quirks: a folder SEQ has the ranges as measured. Where the publishers calibrated them (delays
    and power), a folder SEQ_calibrated has those, with the sigmas they predict. The body is the
    rig, its heading where the rig's forward axis points in the plane. The rig is tilted, by 29
    degrees in loop-2d-fast_s1 and 11 in loop-2d_s5, and sways by several degrees, which a body in
    the plane cannot: so each tag is where it was on average over, beside and before the rig's
    origin, 1 cm from there half of the time and 5 cm at most. In the rig's own frame tags 1 and 2
    of s1 are at (-0.085, -0.207, 0.069) m and (-0.085, 0, 0.069) m, tag 1 of s5 at (-0.186, -0.113,
    0.098) m. Ranges of s1 read 0.1 to 0.35 m long, with bursts up to 2.2 m, those of s5 0.1 m
    short; its anchors are almost of one height, so height may be mirrored. Ranges of one stamp in
    s5 share one true pose. Inertial data, powers and true ranges are not used; the truth is that of
    the rig beside each range.
    """
    runs = runs_of(source, "_uwb.csv.gz")
    logs: dict[str, Log] = {}
    for run in runs:
        path = source / f"{run}_uwb.csv.gz"
        calibrated = "range_calib" in read_table(path).header
        columns = CALIBRATED if calibrated else {}
        received = read_source(
            path, dict(time_s="s", from_id="t", to_id="t", range="f") | columns | POSE | TRUE
        )
        anchors = read_source(source / f"{run}_anchors.csv", dict(anchor="t", x="f", y="f", z="f"))
        logs[run] = _log(run, received, received["range"], {}, anchors)
        if calibrated:
            sigma = {"sigma_m": received["std"]}
            logs[f"{run}_calibrated"] = _log(run, received, received["range_calib"], sigma, anchors)
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def _log(run: str, received: Columns, ranges: FloatArray, sigma: Columns, anchors: Columns) -> Log:
    heading = heading_of(*(received[key] for key in ("w", "rot_x", "rot_y", "rot_z")))
    stamp_ns, first = np.unique(received["time_s"], return_index=True)
    return Log(
        tables={
            "ranges": {
                "stamp_ns": received["time_s"],
                "tag": received["from_id"],
                "anchor": received["to_id"],
                "range_m": ranges,
                **sigma,
            },
            "truth": {
                "stamp_ns": stamp_ns,
                "x_m": received["x"][first],
                "y_m": received["y"][first],
                "z_m": received["z"][first],
                "heading_rad": heading[first],
            },
            "anchors": {
                "anchor": anchors["anchor"],
                "x_m": anchors["x"],
                "y_m": anchors["y"],
                "z_m": anchors["z"],
            },
        },
        tags=_tags(received, heading),
        description=f"STAR-loc {run}: UWB ranges of a rig{', calibrated' if sigma else ''}, motion "
        "capture in 3D",
        licence=LICENCE,
    )


def _tags(received: Columns, heading: FloatArray) -> dict[str, tuple[float, float, float]]:
    """Return where each tag is on average, in a body that turns with the rig but never tilts."""
    away = [received[f"tag_pos_{axis}"] - received[axis] for axis in "xyz"]
    c, s = np.cos(heading), np.sin(heading)
    levelled = np.stack([c * away[0] + s * away[1], c * away[1] - s * away[0], away[2]], axis=1)
    means = {
        str(tag): levelled[received["from_id"] == tag].mean(axis=0)
        for tag in np.unique(received["from_id"])
    }
    return {
        tag: (round(float(x), 4), round(float(y), 4), round(float(z), 4))
        for tag, (x, y, z) in means.items()
    }
