# SPDX-License-Identifier: Apache-2.0
"""The tables of a log from the contents of a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import GEOMETRY, INCREASING, MAY_BE_EMPTY, MESSAGES, NAMES, SCHEMA
from locfuse.io.rosbag import restarts
from locfuse.io.rosbag.bag_contents import BagContents
from locfuse.io.rosbag.columns import length
from locfuse.io.rosbag.decode import saturated_readings
from locfuse.io.rosbag.fixes import is_beside, overridden, unplaced
from locfuse.io.rosbag.increments import increments_of
from locfuse.types import NANOSECONDS, FloatArray

Columns = dict[str, NDArray[Any]]

OTHER_CLOCK_NS = 3600 * NANOSECONDS  # record times this far from stamps are of another clock
AHEAD_NS = NANOSECONDS  # stamps this far after the recording are said


def tables_of(contents: BagContents) -> dict[str, Columns]:
    """Return the tables of a log, with a warning for rows that are left out."""
    own_clock = _own_clock(contents)
    tables: dict[str, Columns] = {}
    for stem in [stem for stem in SCHEMA if stem in contents.tables]:
        raw = contents.tables.pop(stem).columns()
        if "record_ns" in raw:
            raw = _timed(contents, stem, raw, own_clock)
        tables[stem] = FINISHED[stem](contents, raw) if stem in FINISHED else raw
    described = contents.settings.columns if contents.settings else {}
    for stem, names in described.items():
        if stem in tables:
            tables[stem] = {name: tables[stem][name] for name in names if name in tables[stem]}
        elif stem in MAY_BE_EMPTY:
            tables[stem] = _empty(names)
    filled = [stem for stem in tables if stem in MAY_BE_EMPTY or length(tables[stem])]
    return {stem: tables[stem] for stem in [*described, *filled] if stem in filled}


def _own_clock(contents: BagContents) -> bool:
    """Return whether record times count from the origin of the stamps."""
    if contents.settings is not None:
        return True
    lags = {
        stem: rows.lag_ns()
        for stem, rows in contents.tables.items()
        if stem in MESSAGES and len(rows)
    }
    if not lags or any(abs(lag) <= OTHER_CLOCK_NS for lag in lags.values()):
        for stem, lag in lags.items():
            if lag > AHEAD_NS:
                contents.warn(f"{stem} are stamped {lag / NANOSECONDS:.6g} s before they were "
                              "recorded, and come too late to be used where that is more than "
                              "history_s; do the clocks agree?")  # fmt: skip
        return True
    lag = float(np.median(list(lags.values())))
    contents.warn(f"was recorded {lag / NANOSECONDS:.6g} s after the stamps of its messages, by "
               "another clock; so messages arrive at their stamps")  # fmt: skip
    return False


def _timed(contents: BagContents, stem: str, raw: Columns, own_clock: bool) -> Columns:
    """Return a table with stamps and arrivals of the log, in order; `record_ns` is gone."""
    record = raw.pop("record_ns")
    if own_clock:
        raw, record = _without_future(contents, stem, raw, record)
    shift = contents.settings.shift_ns if contents.settings else 0
    raw["stamp_ns"] = stamp = raw["stamp_ns"] - shift
    arrival = np.maximum(record - shift, stamp) if own_clock else stamp
    keeps = bool((arrival != stamp).any())
    if contents.settings is not None and stem in contents.settings.columns:
        keeps = "arrival_ns" in contents.settings.columns[stem]
    if stem in MESSAGES and keeps:
        raw["arrival_ns"] = arrival
    by = stamp if stem in INCREASING or not keeps else arrival
    if (np.diff(by) < 0).any():
        order = np.argsort(by, kind="stable")
        raw = {name: values[order] for name, values in raw.items()}
    return _increasing(contents, stem, raw) if stem in INCREASING else raw


def _without_future(
    contents: BagContents, stem: str, raw: Columns, record: NDArray[Any]
) -> tuple[Columns, NDArray[Any]]:
    ahead = raw["stamp_ns"] - record
    if not (ahead > AHEAD_NS).any():
        return raw, record
    far = ahead > OTHER_CLOCK_NS
    near = int((ahead > AHEAD_NS).sum() - far.sum())
    if near:
        most = ahead[~far].max() / NANOSECONDS
        contents.warn(f"{near} of the {stem} are stamped up to {most:.3g} s after they were "
                   "recorded; they arrive when stamped. Do the clocks agree?")  # fmt: skip
    if far.any():
        contents.warn(f"{int(far.sum())} of the {stem} are stamped more than an hour after they "
                   "were recorded and are left out")  # fmt: skip
    return {name: values[~far] for name, values in raw.items()}, record[~far]


def _increasing(contents: BagContents, stem: str, raw: Columns) -> Columns:
    repeats = np.concatenate([[False], np.diff(raw["stamp_ns"]) == 0])
    if not repeats.any():
        return raw
    contents.warn(f"{int(repeats.sum())} messages of {stem} have the stamp of "
                   "another and are left out")  # fmt: skip
    return {name: values[~repeats] for name, values in raw.items()}


def _table_odometry(contents: BagContents, raw: Columns) -> Columns:
    stamp = raw["stamp_ns"]
    times = {"arrival_ns": raw["arrival_ns"]} if "arrival_ns" in raw else {}
    velocity = np.column_stack([raw["v_mps"], raw["v_left_mps"], raw["omega_radps"]])
    velocity[~np.isfinite(velocity)] = 0.0
    if contents.odometry_from() == "twist":
        table = {"stamp_ns": stamp, "v_mps": velocity[:, 0].copy()}
        if velocity[:, 1].any() or contents.had_column("odometry", "v_left_mps"):
            table["v_left_mps"] = velocity[:, 1].copy()
        return {**table, "omega_radps": velocity[:, 2].copy(), **times}
    poses = np.column_stack([raw["x"], raw["y"], raw["heading"]])
    motion = _without_jumps(contents, stamp, poses, velocity)
    return {"stamp_ns": stamp, "dx_m": motion[:, 0].copy(), "dy_m": motion[:, 1].copy(),
            "dheading_rad": motion[:, 2].copy(), **times}  # fmt: skip


def _without_jumps(
    contents: BagContents, stamp: NDArray[Any], poses: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return increments; where odometry was set anew, those of its velocities."""
    motion = increments_of(poses)
    found = restarts.rows_of_leaps(stamp, poses, velocity, motion)
    if found:
        first = found[0]
        contents.warn(restarts.sentence(int(stamp[first]), motion[first], len(found)))
    for row in found:
        seconds = int(stamp[row] - stamp[row - 1]) / NANOSECONDS
        by = restarts.motion_by_velocity(seconds, velocity[row - 1 : row + 1].tolist())
        motion[row] = by.x, by.y, by.heading
    return motion


def _known(
    stem: str, names: tuple[str, ...], contents: BagContents, raw: Columns, what: str = "sigma"
) -> Columns:
    """Return a table with some columns where all rows have them, else without."""
    unknown = np.isnan(raw[names[0]])
    if not unknown.any():
        return raw
    if not unknown.all():
        contents.warn(f"{int(unknown.sum())} of {len(unknown)} {stem} bring no "
                       f"{what}; those of the others are left out, too")  # fmt: skip
    return {name: values for name, values in raw.items() if name not in names}


def _table_sightings(contents: BagContents, raw: Columns) -> Columns:
    stem, elevation = "landmark_sightings", ("elevation_rad", "sigma_elevation_rad")
    raw = _known(stem, elevation, contents, raw, "elevation")
    return _known(stem, ("sigma_range_m", "sigma_bearing_rad", elevation[1]), contents, raw)


def _table_positions(contents: BagContents, raw: Columns) -> Columns:
    frames = raw.pop("frame")
    for frame in sorted(contents.antennas):
        if is_beside(frame, contents.tree) and not contents.places_antennas:
            contents.warn(overridden(frame, contents.tree))
        elif is_beside(frame, contents.tree):
            raw["tag"] = np.where((raw["tag"] == "") & (frames == frame), frame, raw["tag"])
            contents.tag_frames[frame] = frame
        elif frame and frame not in contents.tree:
            contents.warn(unplaced(frame, contents.tree.base))
    if (raw["tag"] == "").all() and not contents.had_column("positions", "tag"):
        raw.pop("tag")
    return raw


def _table_scans(contents: BagContents, raw: Columns) -> Columns:
    """Return scans, each with its own geometry where that is not the same for all."""
    if contents.saturated:
        contents.warn(saturated_readings(contents.saturated))
    names = raw.pop("laser") if len(contents.lasers) == 1 else raw["laser"]
    _, first, of = np.unique(names, return_index=True, return_inverse=True)
    beams, *angles = (raw[name] for name in GEOMETRY)
    if (beams == beams[0]).all() and all((own == own[first][of]).all() for own in angles):
        return {name: values for name, values in raw.items() if name not in GEOMETRY}
    return raw


def _table_headings(contents: BagContents, raw: Columns) -> Columns:
    if not raw["is_course"].any():
        raw.pop("is_course")
    return _known("headings", ("sigma_rad",), contents, raw)


def _table_truth(contents: BagContents, raw: Columns) -> Columns:
    if np.isnan(raw["heading_rad"]).any():
        raw.pop("heading_rad")
    if not raw["z_m"].any() and not contents.had_column("truth", "z_m"):
        raw.pop("z_m")
    return raw


def _table_anchors(contents: BagContents, raw: Columns) -> Columns:
    return {"anchor": raw["name"], **{key: raw[key] for key in ("x_m", "y_m", "z_m")}}


def _table_landmarks(contents: BagContents, raw: Columns) -> Columns:
    table = {"landmark": raw["name"], "x_m": raw["x_m"], "y_m": raw["y_m"]}
    if raw["z_m"].any() or contents.had_column("landmarks", "z_m"):
        table["z_m"] = raw["z_m"]
    if not np.isnan(raw["radius_m"]).any():
        table["radius_m"] = raw["radius_m"]
    return table


def _table_relations(contents: BagContents, raw: Columns) -> Columns:
    shift = contents.settings.shift_ns if contents.settings else 0
    return {**raw, "begin_ns": raw["begin_ns"] - shift, "end_ns": raw["end_ns"] - shift}


FINISHED: dict[str, Callable[[BagContents, Columns], Columns]] = {
    "odometry": _table_odometry,
    "ranges": partial(_known, "ranges", ("sigma_m",)),
    "landmark_sightings": _table_sightings,
    "altitudes": partial(_known, "altitudes", ("sigma_m",)),
    "headings": _table_headings,
    "positions": _table_positions,
    "scans": _table_scans,
    "truth": _table_truth,
    "anchors": _table_anchors,
    "landmarks": _table_landmarks,
    "relations": _table_relations,
}


def _empty(names: Iterable[str]) -> Columns:
    """Return the columns of a message table without rows."""
    return {
        name: np.zeros((0, 1) if name in ("ranges_m", "intensities") else 0,
                       np.int64 if name.endswith("_ns") else np.str_ if name in NAMES else float)
        for name in names
    }  # fmt: skip
