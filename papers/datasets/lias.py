# SPDX-License-Identifier: Apache-2.0
"""LIAS planar data set: a trolley with three UWB tags among eight anchors, at rest and moving."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import write_log
from locfuse.types import Columns, Log, LogError, wrap_angle
from papers.datasets.source import read_source

ANCHORS, TAGS = range(8), range(3)
MOVING = "fast"
MOVING_SESSION = "8.14"
BODY_HEIGHT_M = 0.97  # by motion capture, above the floor on which the anchors' z counts

Table = Mapping[str, NDArray[Any]]


def convert(source: Path, out: Path) -> list[Path]:
    """Write each pose at rest as a log folder below `out`, named as published, and the run `fast`.

    Source: the folder Planar_Dataset, GitHub
    LIAS-CUHKSZ/Efficient-Pose-Estimation-via-UWB-measurements (H. Jiang et al., "Efficient Planar
    Pose Estimation via UWB Measurements", ICRA 2023), of its static part every 20th row, as CSV:
    ``static_ranges.csv.gz`` (pose, t, a0_t0...a7_t2), ``static_poses.csv`` (pose, session, site,
    nominal_deg, x, y, yaw_deg), ``anchors.csv`` (session, anchor, x, y, z), ``tags.csv`` (session,
    tag, x, y, z), ``dynamic_fast_ranges.csv.gz`` (t, a0_t0...a7_t2),
    ``dynamic_fast_groundtruth.csv.gz`` (t, x, y, z, yaw, q1...q4).

    Licence: MIT.

    Quirks: two sessions (8.14 and 8.20) with anchors and tags of their own. Stamps count from the
    begin of each pose, truth is the pose at every stamp. The plane of the tags is 0.97 m high,
    which the tags' z holds here. Ranges read long, by 0.03 m to 0.3 m, each link by its own, stable
    amount, and are smoothed: successive rows are not independent. The run is of session 8.14, 100
    rows a second of all 24 ranges; where its truth repeats a stamp the first row counts.
    """
    poses = read_source(
        source / "static_poses.csv",
        dict(pose="t", session="t", site="t", nominal_deg="f", x="f", y="f", yaw_deg="f"),
    )
    links = {f"a{anchor}_t{tag}": "g" for anchor in ANCHORS for tag in TAGS}
    measured = read_source(source / "static_ranges.csv.gz", dict(pose="t", t="s") | links)
    anchors = read_source(
        source / "anchors.csv", dict(session="t", anchor="t", x="f", y="f", z="f")
    )
    tags = read_source(source / "tags.csv", dict(session="t", tag="t", x="f", y="f", z="f"))
    logs: dict[str, Log] = {}
    for row, pose in enumerate(poses["pose"].tolist()):
        rows = measured["pose"] == pose
        if not rows.any():
            raise LogError(f"{source / 'static_ranges.csv.gz'}: no row of pose {pose}")
        here = {key: values[rows] for key, values in measured.items()}
        session = poses["session"][row]
        logs[pose] = _log(
            _at_rest({key: values[row] for key, values in poses.items()}, here),
            here,
            _of_session(anchors, session, source / "anchors.csv"),
            _of_session(tags, session, source / "tags.csv"),
            f"LIAS planar, session {session}, pose {pose}: ranges of three tags at rest",
        )
    logs[MOVING] = _moving(source, links, anchors, tags)
    for folder, log in logs.items():
        write_log(log, out / folder)
    return [out / folder for folder in logs]


def _of_session(table: Table, session: str, path: Path) -> Table:
    rows = table["session"] == session
    if not rows.any():
        raise LogError(f"{path}: no row of session {session}")
    return {key: values[rows] for key, values in table.items()}


def _moving(source: Path, links: dict[str, str], anchors: Table, tags: Table) -> Log:
    measured = read_source(source / f"dynamic_{MOVING}_ranges.csv.gz", dict(t="s") | links)
    truth = read_source(
        source / f"dynamic_{MOVING}_groundtruth.csv.gz",
        dict(t="s", x="f", y="f", z="f", yaw="f", q1="f", q2="f", q3="f", q4="f"),
    )
    stamp_ns, first = np.unique(truth["t"], return_index=True)
    return _log(
        {
            "stamp_ns": stamp_ns,
            "x_m": truth["x"][first],
            "y_m": truth["y"][first],
            "heading_rad": wrap_angle(truth["yaw"][first]),
        },
        measured,
        _of_session(anchors, MOVING_SESSION, source / "anchors.csv"),
        _of_session(tags, MOVING_SESSION, source / "tags.csv"),
        f"LIAS planar, session {MOVING_SESSION}, run {MOVING}: ranges of three tags on the move",
    )


def _at_rest(pose: Mapping[str, Any], measured: Table) -> Columns:
    """Return the pose at every stamp of its ranges."""
    stamp_ns = np.unique(measured["t"])
    yaw = float(wrap_angle(np.deg2rad(pose["yaw_deg"])))
    return {
        "stamp_ns": stamp_ns,
        "x_m": np.full(len(stamp_ns), pose["x"]),
        "y_m": np.full(len(stamp_ns), pose["y"]),
        "heading_rad": np.full(len(stamp_ns), yaw),
    }


def _log(truth: Columns, measured: Table, anchors: Table, tags: Table, description: str) -> Log:
    links = np.stack([measured[f"a{a}_t{t}"] for t in TAGS for a in ANCHORS], axis=1)
    row, link = np.nonzero(~np.isnan(links))
    names = np.array([[str(t), str(a)] for t in TAGS for a in ANCHORS])
    return Log(
        tables={
            "ranges": {
                "stamp_ns": measured["t"][row],
                "tag": names[link, 0],
                "anchor": names[link, 1],
                "range_m": links[row, link],
            },
            "truth": truth,
            "anchors": {
                "anchor": anchors["anchor"],
                "x_m": anchors["x"],
                "y_m": anchors["y"],
                "z_m": anchors["z"],
            },
        },
        tags={
            str(tag): (float(x), float(y), round(BODY_HEIGHT_M + float(z), 4))
            for tag, x, y, z in zip(*(tags[key] for key in ("tag", "x", "y", "z")), strict=True)
        },
        description=description,
        licence="MIT",
    )
