# SPDX-License-Identifier: Apache-2.0
"""Intel Research Lab, Seattle: 2D laser, raw wheel odometry, relative poses verified by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import write_log
from locfuse.io.maps import read_map
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, StampArray, wrap_angle
from papers.datasets.source import FREE_THRESH, increments, read_source, row_error, truth

NO_RETURN_M = 81.83
STEP_NS = 10_000_000  # the recorded times have this resolution for most of the run
POSE = dict(raw_index="f", t_s="s", x_m="f", y_m="f", theta_rad="f")
RUNS = {"test": 0, "mapping": 1}  # value of the column mapping_keyframe
LASER = {
    "pose_in_body": [0.0, 0.0, 0.0],
    "angle_min_rad": float(np.deg2rad(-90.0)),
    "angle_increment_rad": float(np.deg2rad(1.0)),
    "range_min_m": 0.0,
    "range_max_m": 50.0,
}


def convert(source: Path, out: Path) -> list[Path]:
    """Write the drive twice below `out`: test and mapping, which share all but their scans.

    mapping has the 910 scans of which the map was made, test the 2551 others: who localizes on the
    map takes test, to keep map and test apart. Both are of the same drive (2690 s, 508 m).

    Source: D. Haehnel, 2000 (Radish), with the relations of R. Kuemmerle et al., "On measuring the
    accuracy of SLAM algorithms", Autonomous Robots 27, 2009; put together of GitHub
    1988kramer/intel_dataset, acschaefer/ple and xiaofeng419/SLAM-2D-LIDAR-SCAN as CSV:
    ``odometry.csv.gz`` and ``trajectory_refined.csv.gz`` (raw_index, t_s, x_m, y_m, theta_rad),
    ``scans.csv.gz`` (raw_index, t_s, mapping_keyframe, r000...), ``relations.csv.gz`` (t1_s, t2_s,
    dx_m, dy_m, dtheta_rad); ``intel_map.pgm`` and ``intel_map.yaml``.

    Licence: none stated, openly published research data; two of the repositories are under GPL-3.0.
    For tests, not to be passed on.

    Quirks: the truth is the refined trajectory, which was computed, not measured: a fit of all
    scans to the map, which is of the same drive. The relations are what was verified. World is the
    frame of the map, whose first pose is near (0, 0, 0). The laser is taken to be at the robot's
    centre; 81.83 m means no return. The map's free_thresh of 0.25 would make its unknown cells free
    and is read as 0.196.

    Recorded times step back 629 times, by up to 0.9 s, and are rounded to 0.01 s after 1000 s.
    raw_index is the true order. Stamps are given in that order: to row k the k-th smallest time, at
    least 0.01 s after the stamp before; none moves by more than 0.9 s. So they give order and
    duration, hardly speed. Scans and truth have the stamps of their rows. The times of the
    relations are not rounded; each is that of a row, and where several rows share a rounded time
    they are taken to be spread evenly over the 0.01 s, in their order. ``relations.csv`` has the
    stamps of those rows.
    """
    grid = read_map(source / "intel_map.yaml", free_thresh=FREE_THRESH)
    odometry = _poses(source / "odometry.csv.gz")
    refined = _poses(source / "trajectory_refined.csv.gz", len(odometry["t_s"]))
    stamp_ns = stamps_of(odometry["t_s"])
    scans = _scans(source / "scans.csv.gz", len(stamp_ns))
    scan_ns = stamp_ns[scans["raw_index"].astype(np.int64)]
    tables: dict[str, Columns] = {
        "odometry": increments(stamp_ns, odometry["x_m"], odometry["y_m"], odometry["theta_rad"]),
        "truth": truth(stamp_ns, refined),
        "relations": _relations(source / "relations.csv.gz", odometry["t_s"], stamp_ns),
    }
    ranges_m = np.where(scans["beams"] >= NO_RETURN_M, np.nan, scans["beams"])
    logs = {}
    for run, keyframe in RUNS.items():
        chosen = scans["mapping_keyframe"] == keyframe
        table = {"stamp_ns": scan_ns[chosen], "ranges_m": ranges_m[chosen]}
        logs[run] = Log(
            tables={**tables, "scans": table},
            laser=LASER,
            grid=grid,
            description=f"Intel Research Lab, {run} scans: laser, wheel odometry, map, relations; "
            "truth fitted to the map",
            licence="None stated, openly published research data; not to be passed on",
        )
    for run, log in logs.items():
        write_log(log, out / run)
    return [out / run for run in logs]


def stamps_of(recorded_ns: StampArray) -> StampArray:
    """Return increasing stamps of rows in their true order, from times that step back and repeat.

    Parameters
    ----------
    recorded_ns : int64 array, shape (n,)
        With six significant digits.

    Returns
    -------
    int64 array, shape (n,)
        For row k the k-th smallest time, equal ones spread, at least `STEP_NS` after the last.
    """
    order, begin_ns, width_ns = _spread(recorded_ns)
    sorted_ns = begin_ns + np.rint(width_ns / 2.0).astype(np.int64)
    least_ns = STEP_NS * np.arange(len(order))
    stamp_ns: StampArray = least_ns + np.maximum.accumulate(sorted_ns - least_ns)
    return stamp_ns


def rows_at(recorded_ns: StampArray, time_ns: StampArray) -> NDArray[np.intp]:
    """Return the row whose time, before it was rounded, is the one asked for; -1 for none.

    Parameters
    ----------
    recorded_ns : int64 array, shape (n,)
        With six significant digits.
    time_ns : int64 array, shape (m,)
        Not rounded.
    """
    order, begin_ns, width_ns = _spread(recorded_ns)
    before = np.searchsorted(begin_ns, time_ns, side="right") - 1
    found = (before >= 0) & (time_ns - begin_ns[before] <= np.ceil(width_ns[before]))
    return np.where(found, order[before], -1)


def _spread(recorded_ns: StampArray) -> tuple[NDArray[np.intp], StampArray, FloatArray]:
    """Return the rows by time, and where the share of each in its rounded time begins and how wide.

    Rows with the same time share what was rounded to it evenly, in their order.
    """
    order = np.argsort(recorded_ns, kind="stable")
    _, first, of_row, count = np.unique(
        recorded_ns[order], return_index=True, return_inverse=True, return_counts=True
    )
    seconds = np.maximum(recorded_ns[order] / NANOSECONDS, 1.0)
    resolution_ns = 10.0 ** (np.floor(np.log10(seconds)) - 5.0) * NANOSECONDS
    width_ns = resolution_ns / count[of_row]
    rank = np.arange(len(order)) - first[of_row]
    begin_ns = recorded_ns[order] + np.rint(rank * width_ns - resolution_ns / 2.0).astype(np.int64)
    return order, begin_ns, width_ns


def _poses(path: Path, rows: int | None = None) -> Columns:
    poses = read_source(path, POSE)
    for row in np.flatnonzero(poses["raw_index"] != np.arange(len(poses["t_s"])))[:1]:
        raise row_error(path, row, f"raw_index is {poses['raw_index'][row]:g}, expected {row}")
    if rows is not None and len(poses["t_s"]) != rows:
        last = len(poses["t_s"]) - 1
        raise row_error(path, last, f"the last of {last + 1} rows, expected {rows}")
    return poses


def _scans(path: Path, rows: int) -> dict[str, NDArray[Any]]:
    kinds = dict(raw_index="f", t_s="s", mapping_keyframe="f")
    scans = read_source(path, kinds, beams="r")
    index, keyframe = scans["raw_index"], scans["mapping_keyframe"]
    for row in np.flatnonzero((index != np.floor(index)) | (index < 0) | (index >= rows))[:1]:
        raise row_error(path, row, f"raw_index is {index[row]:g}, expected one of 0 to {rows - 1}")
    for row in np.flatnonzero((keyframe != 0) & (keyframe != 1))[:1]:
        raise row_error(path, row, f"mapping_keyframe is {keyframe[row]:g}, expected 0 or 1")
    return scans


def _relations(path: Path, recorded_ns: StampArray, stamp_ns: StampArray) -> Columns:
    kinds = dict(t1_s="s", t2_s="s", dx_m="f", dy_m="f", dtheta_rad="f")
    relations = read_source(path, kinds)
    ends = {}
    for name, key in (("begin_ns", "t1_s"), ("end_ns", "t2_s")):
        rows = rows_at(recorded_ns, relations[key])
        for row in np.flatnonzero(rows < 0)[:1]:
            seconds = relations[key][row] / NANOSECONDS
            raise row_error(path, row, f"{key} is {seconds:.6f}, the time of no odometry row")
        ends[name] = stamp_ns[rows]
    return {
        **ends,
        "dx_m": relations["dx_m"],
        "dy_m": relations["dy_m"],
        "dheading_rad": wrap_angle(relations["dtheta_rad"]),
    }
