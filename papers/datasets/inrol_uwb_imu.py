# SPDX-License-Identifier: Apache-2.0
"""A sensor head carried in space among eight UWB anchors: no odometry, truth in 3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import QUATERNION, Columns, Log
from papers.datasets.source import heading_of, read_source, runs_of

TAG = "tag"
TAG_OVER_IMU_M = 0.01
POSE = dict.fromkeys(("tx", "ty", "tz", "qx", "qy", "qz", "qw"), "f")


def convert(source: Path, out: Path) -> list[Path]:
    """Write each sequence, such as filtering_state_estimation1, as a log folder below `out`.

    Source: T. Kim, B. Yoon, D. J. Lee, Seoul National University, "UWB-Based Localization System
    Considering Antenna Anisotropy and NLOS/Multipath Conditions", 2024, GitHub
    INRoL/inrol_uwb_localization, as CSV: for each sequence ``SEQ_uwb.csv.gz`` (index, timestamp,
    anchor_id, r), ``SEQ_imu_pose.csv.gz`` (timestamp, tx, ty, tz, qx, qy, qz, qw) and
    ``SEQ_anchors.csv`` (anchor, tx, ty, tz, qx, qy, qz, qw); some with ``SEQ_imu.csv.gz`` (index,
    timestamp, wx, wy, wz, ax, ay, az).

    Licence: GPL-3.0, the files as well as the publishers' code; this reader is our own.

    Quirks: the body is the IMU, its heading where its forward axis points in the plane; the tag
    sits 1 cm above it. Each anchor replies 21 times a second, several of them at one stamp; rows
    not in order of time are sorted. Ranges err by some centimetres by direction, and read up to 3 m
    long where something is in the way. The attitude of the anchors is not used.
    """
    runs = runs_of(source, "_uwb.csv.gz")
    logs = {run: _read(source, run) for run in runs}
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def _read(source: Path, run: str) -> Log:
    measured = read_source(
        source / f"{run}_uwb.csv.gz", dict(index="t", timestamp="s", anchor_id="t", r="f")
    )
    true = read_source(source / f"{run}_imu_pose.csv.gz", dict(timestamp="s") | POSE)
    anchors = read_source(source / f"{run}_anchors.csv", dict(anchor="t") | POSE)
    return Log(
        tables={
            "ranges": {
                "stamp_ns": measured["timestamp"],
                "tag": np.full(len(measured["r"]), TAG),
                "anchor": measured["anchor_id"],
                "range_m": measured["r"],
            },
            "truth": {
                "stamp_ns": true["timestamp"],
                "x_m": true["tx"],
                "y_m": true["ty"],
                "z_m": true["tz"],
                "heading_rad": heading_of(*(true[key] for key in QUATERNION)),
                **{key: true[key] for key in QUATERNION},
            },
            **_imu(source / f"{run}_imu.csv.gz"),
            "anchors": {
                "anchor": anchors["anchor"],
                "x_m": anchors["tx"],
                "y_m": anchors["ty"],
                "z_m": anchors["tz"],
            },
        },
        tags={TAG: (0.0, 0.0, TAG_OVER_IMU_M)},
        description=f"INRoL {run}: UWB ranges of one tag to eight anchors, motion capture in 3D",
        licence="GPL-3.0",
    )


def _imu(file: Path) -> dict[str, Columns]:
    if not file.is_file():
        return {}
    read = read_source(
        file,
        dict(index="t", timestamp="s") | dict.fromkeys(("wx", "wy", "wz", "ax", "ay", "az"), "f"),
    )
    samples = {"stamp_ns": read["timestamp"]}
    for axis in "xyz":
        samples[f"w{axis}_radps"] = read[f"w{axis}"]
    for axis in "xyz":
        samples[f"a{axis}_mps2"] = read[f"a{axis}"]
    return {"imu": samples}
