# SPDX-License-Identifier: Apache-2.0
"""A spinning sensor with several rings localizes a robot as well as a 2D laser in its place."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from locfuse.config.load import parse_config
from locfuse.io.rosbag import encode
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.encode import Publication
from locfuse.io.rosbag.publications import in_order_of_arrival, world_of
from locfuse.run.run import load_log, run
from locfuse.types import FloatArray, Log
from support_adapter import LATER, later
from support_bags import write_messages
from test_front_ends import FLOOR, of_topics

SEEDS = range(12)
BEAMS, REACH_M, SIGMA_M = 360, 8.0, 0.01
MOUNT, HEIGHT_M, CEILING_M = (0.2, 0.1, 0.4), 0.5, 2.5
RINGS = np.radians(np.arange(-15.0, 16.0, 2.0))  # sixteen, as of a VLP-16
FLOATS, SHORT = 7, 4  # datatypes of sensor_msgs/PointField
FIELDS = [{"name": name, "offset": 4 * k, "datatype": SHORT if name == "ring" else FLOATS,
           "count": 1} for k, name in enumerate(("x", "y", "z", "intensity", "ring"))]  # fmt: skip
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2")])


def exact(seed: int) -> Log:
    """Return a drive whose laser has no noise: where beams end."""
    laser = {"beams": BEAMS, "range_max_m": REACH_M, "sigma_m": 0.0,
             "pose_in_body": [*MOUNT[:2], math.degrees(MOUNT[2])]}  # fmt: skip
    simulation = {**FLOOR, "laser": laser, "duration_s": 20.0}
    config = parse_config({"simulation": simulation, "seed": seed})
    return later(of_topics(load_log(config, None, seed)))


def by_laser(log: Log, rng: np.random.Generator) -> list[tuple[int, Publication]]:
    """Return what a robot records whose laser has noise."""
    ranges = log["scans"]["ranges_m"]
    ranges = (ranges + SIGMA_M * rng.standard_normal(ranges.shape)).astype(np.float32)
    scans = {**log["scans"], "ranges_m": ranges.astype(np.float64)}
    noisy = replace(log, tables={**log.tables, "scans": scans})
    return recorded(noisy, encode.transform(LATER, "base_link", "laser", MOUNT, HEIGHT_M))


def by_rings(log: Log, rng: np.random.Generator) -> list[tuple[int, Publication]]:
    """Return what a robot records that has a spinning sensor in its place, as noisy."""
    assert log.laser is not None
    angle = log.laser["angle_min_rad"] + log.laser["angle_increment_rad"] * np.arange(BEAMS)
    others = replace(log, tables={k: v for k, v in log.tables.items() if k != "scans"})
    given = recorded(others, encode.transform(LATER, "base_link", "lidar", MOUNT, HEIGHT_M))
    for stamp, walls in zip(log["scans"]["stamp_ns"].tolist(), log["scans"]["ranges_m"],
                            strict=True):  # fmt: skip
        given.append((stamp, cloud(stamp, sphere(angle, walls, rng))))
    return sorted(given, key=lambda one: one[0])


def recorded(log: Log, mount: Any) -> list[tuple[int, Publication]]:
    ros = parse_config({}).ros
    head = [encode.transforms([mount], static=True)]
    head += [one for one in world_of(log, ros) if one.type == "nav_msgs/OccupancyGrid"]
    return [(LATER, one) for one in head] + [
        (one.arrival_ns, one.publication) for one in in_order_of_arrival(log, ros)
    ]


def sphere(angle: FloatArray, walls: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the points (rings, beams, 3) of one turn, from the sensor: walls, floor, ceiling.

    `walls` are the horizontal distances in each direction, NaN beyond the reach.
    """
    slope = np.tan(RINGS)[:, None]
    level = np.where(slope < 0.0, -HEIGHT_M, CEILING_M - HEIGHT_M) / slope
    flat = np.fmin(np.where(np.isnan(walls), np.inf, walls), level)
    along = flat / np.cos(RINGS)[:, None] + SIGMA_M * rng.standard_normal(flat.shape)
    along[flat > REACH_M] = np.nan
    out, up = along * np.cos(RINGS)[:, None], along * np.sin(RINGS)[:, None]
    return np.stack([out * np.cos(angle), out * np.sin(angle), up], axis=-1)


def cloud(stamp: int, points: FloatArray) -> Publication:
    """Return a sensor_msgs/PointCloud2 with a row for each ring."""
    rows = np.zeros(points.shape[:2], POINT)
    for k, axis in enumerate("xyz"):
        rows[axis] = points[..., k]
    rows["ring"] = np.arange(len(RINGS))[:, None]
    return Publication("scan", "sensor_msgs/PointCloud2", {
        "header": encode.header(stamp, "lidar"), "height": len(RINGS), "width": BEAMS,
        "fields": FIELDS, "is_bigendian": False, "point_step": POINT.itemsize,
        "row_step": POINT.itemsize * BEAMS, "data": rows.view(np.uint8).ravel(), "is_dense": False,
    })  # fmt: skip


def rmse_m(path: Path, log: Log, seed: int, **ros: Any) -> float:
    """Return the position RMSE of `mcl: {}` on a bag."""
    truth = log["truth"]
    x, y, heading = (float(truth[key][0]) for key in ("x_m", "y_m", "heading_rad"))
    config = parse_config({"mcl": {}, "start": [x, y, math.degrees(heading)], "seed": seed,
                           "ros": {"odometry_from": "twist", **ros}})  # fmt: skip
    found = read_bag(path, config.ros)
    result = run(config, replace(found, tables={**found.tables, "truth": truth}))
    return float(result.metrics["position_rmse_m"])


def compared(folder: Path, seeds: range, **ros: Any) -> tuple[float, float]:
    """Return the position RMSE over some seeds by laser and by cloud."""
    squared = []
    for seed in seeds:
        log, noise = exact(seed), np.random.default_rng(seed).spawn(2)
        squared.append([
            rmse_m(write_messages(folder / f"{name}{seed}.mcap", make(log, rng)), log, seed,
                   **(ros if name == "rings" else {})) ** 2
            for name, make, rng in (("laser", by_laser, noise[0]), ("rings", by_rings, noise[1]))
        ])  # fmt: skip
        for path in folder.glob("*.mcap"):
            path.unlink()
    laser, rings = np.sqrt(np.mean(squared, axis=0)).tolist()
    return laser, rings


def test_a_cloud_is_as_good_as_a_laser(tmp_path: Path) -> None:
    laser, rings = compared(tmp_path, SEEDS)
    print(f"laser {100.0 * laser:.2f} cm, cloud {100.0 * rings:.2f} cm")
    assert rings < 1.05 * laser


def test_a_slice_with_the_floor_is_worse(tmp_path: Path) -> None:
    laser, rings = compared(tmp_path, range(2), cloud_heights_m=[-0.1, 0.7])
    print(f"laser {100.0 * laser:.2f} cm, cloud with the floor {100.0 * rings:.2f} cm")
    assert rings > 1.05 * laser
