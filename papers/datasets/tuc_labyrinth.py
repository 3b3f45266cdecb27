# SPDX-License-Identifier: Apache-2.0
"""TU Chemnitz labyrinth: a small robot between four UWB modules, indoors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log
from papers.datasets.source import read_source

TAG = "tag"


def convert(source: Path, out: Path) -> list[Path]:
    """Write the one sequence (29.8 s, 9.2 m) as a log folder.

    Source: Tim Pfeifer, TU Chemnitz, "The Labyrinth Dataset", GitHub TUC-ProAut/libRSF,
    ``datasets/Indoor_UWB``, as CSV: ``ranges.csv`` (t, anchor, range, anchor_x, anchor_y),
    ``wheel_odometry.csv`` (t, v_first, v_second, half_track), ``groundtruth.csv`` (t, x, y).

    Licence: CC-BY-SA-4.0; keep the attribution and share derived work under it.

    Quirks: planar, all heights 0; the tag is taken to be at the robot's origin. The origin's readme
    names the wheels the other way round and calls half the wheel distance the whole: dead reckoning
    fits the truth only with v_first left, v_second right and omega = (right - left) / (2 *
    half_track). A row's speeds describe the interval after its stamp: so used, dead reckoning from
    a fitted start pose is 0.055 m (RMS) off; taken for the interval before it is 0.061 m. So stamps
    are kept as they are. The fitted start pose is x 1.677 m, y 2.208 m, heading 170.5 deg; the
    truth begins at (1.652, 2.219) and has no heading. Ranges read 0.07 to 0.15 m long, with
    multipath up to 0.66 m.
    """
    wheels = read_source(
        source / "wheel_odometry.csv", dict(t="s", v_first="f", v_second="f", half_track="f")
    )
    measured = read_source(
        source / "ranges.csv", dict(t="s", anchor="t", range="f", anchor_x="f", anchor_y="f")
    )
    truth = read_source(source / "groundtruth.csv", dict(t="s", x="f", y="f"))
    left, right = wheels["v_first"], wheels["v_second"]
    names, first = np.unique(measured["anchor"], return_index=True)
    log = Log(
        tables={
            "odometry": {
                "stamp_ns": wheels["t"],
                "v_mps": (left + right) / 2.0,
                "omega_radps": (right - left) / (2.0 * wheels["half_track"]),
            },
            "ranges": {
                "stamp_ns": measured["t"],
                "tag": np.full(len(measured["t"]), TAG),
                "anchor": measured["anchor"],
                "range_m": measured["range"],
            },
            "truth": {"stamp_ns": truth["t"], "x_m": truth["x"], "y_m": truth["y"]},
            "anchors": {
                "anchor": names,
                "x_m": measured["anchor_x"][first],
                "y_m": measured["anchor_y"][first],
                "z_m": np.zeros(len(names)),
            },
        },
        tags={TAG: (0.0, 0.0, 0.0)},
        description="TU Chemnitz labyrinth: indoor UWB ranges, wheel speeds, overhead truth",
        licence="CC-BY-SA-4.0, Tim Pfeifer, TU Chemnitz (libRSF, Indoor_UWB)",
    )
    write_log(log, out)
    return [out]
