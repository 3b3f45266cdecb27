# SPDX-License-Identifier: Apache-2.0
"""Bags as robots record them, written message by message, and logs to compare."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_files import bag_sink
from locfuse.io.rosbag.decode import RangeRow, ScanRow
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.wire import long, serializer, store
from locfuse.types import GridMap, Log

T0 = 1_700_000_000_000_000_000
MS = 1_000_000
KINDS = ("bag", "mcap", "db3")

Recorded = tuple[int, Publication]


def write_messages(path: Path, messages: Iterable[Recorded]) -> Path:
    """Write a bag of the kind that its name says; a .db3 becomes the folder of that name."""
    if path.suffix == ".db3":
        return write_sqlite(path, messages)
    with bag_sink(path) as sink:
        for time_ns, publication in messages:
            sink.write(time_ns, publication)
    return path


def write_sqlite(path: Path, messages: Iterable[Recorded], **packing: Any) -> Path:
    """Write a folder of ROS 2 with a database; `packing` is how rosbags packs it."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    known: dict[str, Any] = {}
    writer = Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3)
    if packing:
        writer.set_compression(**packing)
    with writer:
        for time_ns, p in messages:
            if p.topic not in known:
                known[p.topic] = writer.add_connection(f"/{p.topic}", long(p.type),
                                                       typestore=store("cdr"))  # fmt: skip
            writer.write(known[p.topic], time_ns, serializer("cdr", p.type)(p.fields))
    return path


def drive(steps: int = 20, late_ns: int = 5 * MS) -> list[Recorded]:
    """Return a robot that drives 0.1 m a step on a circle of 2 m, received by two anchors.

    It publishes odometry, a scan, ranges and its mounts, all recorded `late_ns` after their stamps.
    """
    mounts = [encode.transform(T0, "base_link", "laser", (0.2, 0.0, 0.0), 0.3),
              encode.transform(T0, "base_link", "radio", (0.1, 0.05, 0.0), 0.8)]  # fmt: skip
    messages: list[Recorded] = [(T0, encode.transforms(mounts, static=True))]
    for k in range(steps):
        stamp, angle = T0 + 100 * MS * k, 0.05 * k
        pose = (2.0 * math.sin(angle), 2.0 - 2.0 * math.cos(angle), angle)
        ranges = [RangeRow(stamp, "tag", name, math.hypot(x - pose[0], y - pose[1]), None, "radio")
                  for name, x, y in (("A", 5.0, 0.0), ("B", 0.0, 6.0))]  # fmt: skip
        scan = ScanRow(stamp, "laser", -1.0, 0.5, 0.1, 10.0, np.full(5, 1.0 + 0.001 * k), None)
        moving = (1.0, 0.5)
        messages += [
            (stamp + late_ns, publication)
            for publication in (
                encode.odometry("odom", stamp, pose, moving, "odom", "base_link"),
                encode.uwb_ranges("uwb", ranges),
                encode.laser_scan("scan", scan),
            )
        ]
    return messages


def world() -> Log:
    """Return the two anchors of `drive`."""
    anchors = {"anchor": np.array(["A", "B"]), "x_m": np.array([5.0, 0.0]),
               "y_m": np.array([0.0, 6.0]), "z_m": np.array([0.8, 0.8])}  # fmt: skip
    return Log(tables={"anchors": anchors})


def full_log(arrival: bool = True) -> Log:
    """Return a log of every table and setting there is, on stamps from 0, with awkward numbers."""
    rng = np.random.default_rng(11)
    n = 40
    stamp = np.arange(n, dtype=np.int64) * 100 * MS
    some = stamp[1::4]
    m = len(some)
    tables: dict[str, dict[str, Any]] = {
        "odometry": {"stamp_ns": stamp, "dx_m": rng.normal(0.05, 0.01, n),
                     "dy_m": rng.normal(0.0, 0.001, n), "dheading_rad": rng.normal(0.2, 0.1, n)},
        "ranges": {"stamp_ns": np.repeat(some, 2), "tag": np.array(["front", "laser"] * m),
                   "anchor": np.array(["A 1", "Bäume"] * m), "range_m": rng.uniform(1, 20, 2 * m),
                   "sigma_m": rng.uniform(0.01, 0.3, 2 * m)},
        "positions": {"stamp_ns": some, "tag": np.array(["", "front"] * (m // 2)),
                      "x_m": rng.normal(0, 99, m), "y_m": rng.normal(0, 99, m),
                      "sigma_m": np.array([-1.0, 0.0, *rng.uniform(0.1, 2000, m - 2)])},
        "poses": {"stamp_ns": some, "x_m": rng.normal(0, 9, m), "y_m": rng.normal(0, 9, m),
                  "heading_rad": rng.uniform(-math.pi, math.pi, m),
                  "sigma_xy_m": np.array([-1.0, 0.0, *rng.uniform(0.1, 2000, m - 2)]),
                  "sigma_heading_rad": np.array([-1.0, 0.0, *rng.uniform(0.01, 2, m - 2)])},
        "landmark_sightings": {
            "stamp_ns": np.repeat(some, 2), "landmark": np.array(["", "oak"] * m),
            "range_m": rng.uniform(1, 9, 2 * m), "bearing_rad": rng.normal(0, 1, 2 * m),
            "sigma_range_m": rng.uniform(0.1, 1, 2 * m),
            "sigma_bearing_rad": rng.uniform(0.01, 0.1, 2 * m)},
        "altitudes": {"stamp_ns": some, "height_m": np.linspace(-3.0, 17 / 3, m),
                      "sigma_m": np.linspace(0.01, 2 / 3, m)},
        "scans": {"stamp_ns": some, "ranges_m": _beams(rng, m, 0.2, 8.0, 3),
                  "intensities": _beams(rng, m, 0.0, 4000.0, 0)},
        "truth": {"stamp_ns": stamp, "x_m": rng.normal(0, 9, n), "y_m": rng.normal(0, 9, n),
                  "z_m": np.zeros(n), "heading_rad": rng.uniform(-math.pi, math.pi, n)},
        "relations": {"begin_ns": stamp[:2], "end_ns": stamp[5:7], "dx_m": rng.normal(0, 1, 2),
                      "dy_m": rng.normal(0, 1, 2), "dheading_rad": rng.normal(0, 1, 2)},
        "anchors": {"anchor": np.array(["A 1", "Bäume"]), "x_m": rng.normal(0, 9, 2),
                    "y_m": rng.normal(0, 9, 2), "z_m": rng.normal(0, 9, 2)},
        "landmarks": {"landmark": np.array(["oak", "elm"]), "x_m": rng.normal(0, 9, 2),
                      "y_m": rng.normal(0, 9, 2), "z_m": np.zeros(2),
                      "radius_m": rng.uniform(0.1, 1, 2)},
    }  # fmt: skip
    if arrival:
        for stem in ("odometry", "ranges", "scans"):
            late = rng.integers(0, 150 * MS, len(tables[stem]["stamp_ns"]))
            tables[stem]["arrival_ns"] = np.sort(tables[stem]["stamp_ns"] + late)
    cells = rng.choice(np.array([0, 100, -1], np.int8), (7, 5))
    return Log(
        tables=tables,
        tags={"front": (0.25, 0.1, 1.1), "laser": (0.1 + 0.2, -0.3, 0.5), "silent": (0, 0, 0.25)},
        laser={"pose_in_body": [0.1, -0.2, 2.0 / 3.0], "angle_min_rad": -math.pi / 2,
               "angle_increment_rad": math.pi / 6, "range_min_m": 0.12, "range_max_m": 8.1},
        landmark_sensor={"pose_in_body": [0.3, 0.1, -0.7]},
        map="floor.yaml",
        grid=GridMap(cells, 0.05, (1.1, -2.2, 0.3)),
        description="Every table: with a colon, and\na second line",
        licence="CC0-1.0",
    )  # fmt: skip


def _beams(rng: np.random.Generator, rows: int, low: float, high: float, digits: int) -> Any:
    beams = np.round(rng.uniform(low, high, (rows, 6)), digits)
    beams[rng.random((rows, 6)) < 0.2] = np.nan
    return beams


def differences(one: Log, other: Log) -> list[str]:
    """Return where two logs are not the same bit for bit."""
    found = [f"tables {list(one.tables)} and {list(other.tables)}"] * (
        list(one.tables) != list(other.tables)
    )
    for stem in one.tables.keys() & other.tables.keys():
        a, b = one[stem], other[stem]
        if list(a) != list(b):
            found.append(f"{stem}: columns {list(a)} and {list(b)}")
        for name in a.keys() & b.keys():
            kind = a[name].dtype.kind
            same = np.array_equal(a[name], b[name], equal_nan=kind == "f")
            if not same or kind != b[name].dtype.kind:
                found.append(f"{stem}.{name}")
    for key in ("tags", "laser", "landmark_sensor", "map", "description", "licence"):
        if getattr(one, key) != getattr(other, key):
            found.append(f"{key}: {getattr(one, key)} and {getattr(other, key)}")
    if cells_of(one) != cells_of(other):
        found.append("grid")
    return found


def cells_of(log: Log) -> Any:
    """Return what can be compared of a map."""
    grid = log.grid
    return None if grid is None else (grid.cells.tolist(), grid.resolution_m, grid.origin)


def sentences(caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return what was said, each in one line, and forget it."""
    said = [record.getMessage() for record in caplog.records if record.name.startswith("locfuse")]
    caplog.clear()
    assert not any("\n" in sentence for sentence in said)
    return said
