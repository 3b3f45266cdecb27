# SPDX-License-Identifier: Apache-2.0
"""Gazebo runs of the UWB/LiDAR packages of the Izmir University of Economics AGV project."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from locfuse.io.log_folder import write_log
from locfuse.types import Log, LogError, wrap_angle
from papers.datasets.source import check_map, copy_map, read_source, runs_of

WITHOUT_MAP = ("home",)  # driven in another world
TAG = "tag"
LASER = {
    "pose_in_body": [-0.064, 0.0, 0.0],
    "angle_min_rad": 0.0,
    "angle_increment_rad": 0.0175019,
    "range_min_m": 0.12,
    "range_max_m": 3.5,
}


def convert(source: Path, out: Path) -> list[Path]:
    """Write each run, such as home, run3, straight and static, as a log folder below `out`.

    Source: CSV exports of ROS bags by Bekir Bostanci, GitHub bekirbostanci/ros_uwb_slam, and the
    map of bekirbostanci/ros_pozyx_simulation: for each run ``RUN_odom.csv`` (t, x, y, yaw, v, w),
    ``RUN_ranges.csv`` (t, r0...), ``RUN_scans.csv.gz`` (t, s0...), ``RUN_anchors.csv`` (index, id,
    x, y, z); ``map.pgm`` and ``map.yaml``.

    Licence: none stated for the samples, openly published research data; the simulation package
    declares BSD.

    Quirks: simulated (TurtleBot3 waffle). The pose columns are the simulator's own pose and become
    the truth; v and w, nearly free of noise, become the odometry. The noise of a range grows with
    the distance: 0.75 percent of it. Tag and anchors are at height 0. Beams go once around from
    straight ahead. The map fits every run but home.
    """
    check_map(source)
    logs = {run: _read(source, run) for run in runs_of(source, "_odom.csv")}
    for run, log in logs.items():
        write_log(log, out / run)
        if log.map is not None:
            copy_map(source, out / run)
    return [out / run for run in logs]


def _read(source: Path, run: str) -> Log:
    drive = read_source(
        source / f"{run}_odom.csv", dict(t="s", x="f", y="f", yaw="f", v="f", w="f")
    )
    anchors = read_source(
        source / f"{run}_anchors.csv", dict(index="f", id="t", x="f", y="f", z="f")
    )
    measured = read_source(source / f"{run}_ranges.csv", dict(t="s"), beams="r")
    scans = read_source(source / f"{run}_scans.csv.gz", dict(t="s"), beams="s")
    names = anchors["id"][np.argsort(anchors["index"])]
    there = ~np.isnan(measured["beams"])
    if there.shape[1] != len(names):
        raise LogError(f"{source / run}_anchors.csv: {len(names)} anchors, expected as many as "
                       f"{run}_ranges.csv has columns of ranges, {there.shape[1]}")  # fmt: skip
    row, column = np.nonzero(there)
    return Log(
        tables={
            "odometry": {"stamp_ns": drive["t"], "v_mps": drive["v"], "omega_radps": drive["w"]},
            "ranges": {
                "stamp_ns": measured["t"][row],
                "tag": np.full(len(row), TAG),
                "anchor": names[column],
                "range_m": measured["beams"][there],
            },
            "scans": {"stamp_ns": scans["t"], "ranges_m": scans["beams"]},
            "truth": {
                "stamp_ns": drive["t"],
                "x_m": drive["x"],
                "y_m": drive["y"],
                "heading_rad": wrap_angle(drive["yaw"]),
            },
            "anchors": {
                "anchor": anchors["id"],
                "x_m": anchors["x"],
                "y_m": anchors["y"],
                "z_m": anchors["z"],
            },
        },
        tags={TAG: (0.0, 0.0, 0.0)},
        laser=LASER,
        map=None if run in WITHOUT_MAP else "map.yaml",
        description=f"IEU Gazebo run {run}: simulated UWB ranges, laser scans and odometry",
        licence="None stated, openly published research data; the simulation declares BSD",
    )
