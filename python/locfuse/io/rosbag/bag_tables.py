# SPDX-License-Identifier: Apache-2.0
"""The tables of a log from the contents of a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import (
    INCREASING,
    MAX_SPEED_MPS,
    MAX_TURN_RATE_RADPS,
    MAY_BE_EMPTY,
    MESSAGES,
    NAMES,
)
from locfuse.io.rosbag.bag_contents import BagContents
from locfuse.io.rosbag.columns import length
from locfuse.io.rosbag.increments import increments_of
from locfuse.types import NANOSECONDS, FloatArray

Columns = dict[str, NDArray[Any]]

OTHER_CLOCK_NS = 3600 * NANOSECONDS  # record times this far from stamps are of another clock
AHEAD_NS = NANOSECONDS  # stamps this far after the recording are said
ORDER = ("odometry", "ranges", "positions", "poses", "landmark_sightings", "scans", "truth",
         "relations", "anchors", "landmarks")  # fmt: skip


def tables_of(contents: BagContents) -> dict[str, Columns]:
    """Return the tables of a log, with a warning for rows that are left out."""
    own_clock = _own_clock(contents)
    tables: dict[str, Columns] = {}
    for stem in [stem for stem in ORDER if stem in contents.tables]:
        raw = contents.tables.pop(stem).columns()
        if "record_ns" in raw:
            raw = _timed(contents, stem, raw, own_clock)
        tables[stem] = FINISHED.get(stem, _as_it_is)(contents, raw)
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
    lags = [
        rows.lag_ns() for stem, rows in contents.tables.items() if stem in MESSAGES and len(rows)
    ]
    lag = float(np.median(lags)) if lags else 0.0
    if abs(lag) <= OTHER_CLOCK_NS:
        return True
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
    if contents.odometry_from() == "twist":
        return {"stamp_ns": stamp, "v_mps": raw["v_mps"], "omega_radps": raw["omega_radps"],
                **times}  # fmt: skip
    motion = _without_jumps(contents, stamp, np.column_stack([raw["x"], raw["y"], raw["heading"]]))
    return {"stamp_ns": stamp, "dx_m": motion[:, 0].copy(), "dy_m": motion[:, 1].copy(),
            "dheading_rad": motion[:, 2].copy(), **times}  # fmt: skip


def _without_jumps(contents: BagContents, stamp: NDArray[Any], poses: FloatArray) -> FloatArray:
    """Return increments; where odometry was set anew the body did not move."""
    motion = increments_of(poses)
    seconds = np.maximum(np.diff(stamp, prepend=stamp[:1] - NANOSECONDS) / NANOSECONDS, 1e-9)
    fast = np.hypot(motion[:, 0], motion[:, 1]) / seconds > MAX_SPEED_MPS
    fast |= np.abs(motion[:, 2]) / seconds > MAX_TURN_RATE_RADPS
    fast[:1] = False
    if fast.any():
        first = int(np.argmax(fast))
        contents.warn(f"odometry jumps {int(fast.sum())} times, first by "
                   f"{np.hypot(*motion[first, :2]):.3g} m at "
                   f"{stamp[first] / NANOSECONDS:.3f} s; it was set anew, so no motion is "
                   "taken there")  # fmt: skip
        motion[fast] = 0.0
    return motion


def _table_ranges(contents: BagContents, raw: Columns) -> Columns:
    return _known_sigmas(contents, "ranges", raw, ("sigma_m",))


def _table_landmark_sightings(contents: BagContents, raw: Columns) -> Columns:
    names = ("sigma_range_m", "sigma_bearing_rad")
    return _known_sigmas(contents, "landmark_sightings", raw, names)


def _known_sigmas(
    contents: BagContents, stem: str, raw: Columns, names: tuple[str, ...]
) -> Columns:
    """Return a table with sigmas where all rows have them, else without."""
    unknown = np.isnan(raw[names[0]])
    if not unknown.any():
        return raw
    if not unknown.all():
        contents.warn(f"{int(unknown.sum())} of {len(unknown)} {stem} bring no "
                       "sigma; those of the others are left out, too")  # fmt: skip
    return {name: values for name, values in raw.items() if name not in names}


def _table_positions(contents: BagContents, raw: Columns) -> Columns:
    if (raw["tag"] == "").all() and not contents.had_column("positions", "tag"):
        raw.pop("tag")
    return raw


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


def _as_it_is(_: BagContents, raw: Columns) -> Columns:
    return raw


FINISHED: dict[str, Callable[[BagContents, Columns], Columns]] = {
    "odometry": _table_odometry,
    "ranges": _table_ranges,
    "landmark_sightings": _table_landmark_sightings,
    "positions": _table_positions,
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
