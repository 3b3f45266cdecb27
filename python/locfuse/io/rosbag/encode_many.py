# SPDX-License-Identifier: Apache-2.0
"""What many messages say, as the values that `locfuse.io.rosbag.pack` makes bytes of.

The same as `locfuse.io.rosbag.encode` says of one message; each function takes columns of a table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.rosbag.decode import PLANAR
from locfuse.io.rosbag.encode import KNOWN, RINGS
from locfuse.io.rosbag.increments import wrapped
from locfuse.io.rosbag.unpack import Places, Texts
from locfuse.types import NANOSECONDS, Columns, FloatArray

Values = dict[str, Any]


def header(path: str, stamp_ns: NDArray[np.int64], frame: str | Texts) -> Values:
    """Return headers."""
    return {f"{path}.stamp.sec": stamp_ns // NANOSECONDS, f"{path}.frame_id": frame,
            f"{path}.stamp.nanosec": stamp_ns % NANOSECONDS}  # fmt: skip


def odometry(table: Columns, frame: str, child_frame: str) -> Values:
    """Return nav_msgs/Odometry of x, y, heading, v and omega; without the latter two they are 0."""
    values = {
        **header("header", table["stamp_ns"], frame),
        "child_frame_id": child_frame,
        **_point("pose.pose.position", table["x"], table["y"], table.get("z")),
        **_turned("pose.pose.orientation", table["heading"]),
    }
    if "v" in table:
        values |= {"twist.twist.linear.x": table["v"], "twist.twist.angular.z": table["omega"]}
    return values


def transforms(table: Columns, frame: str, child_frame: str) -> Values:
    """Return tf2_msgs/TFMessage of one transform each, of x, y and heading."""
    return {
        "transforms": np.ones(len(table["stamp_ns"]), np.int64),
        **header("transforms[].header", table["stamp_ns"], frame),
        "transforms[].child_frame_id": child_frame,
        **_point("transforms[].transform.translation", table["x"], table["y"]),
        **_turned("transforms[].transform.rotation", table["heading"]),
    }


def points(table: Columns, frame: str) -> Values:
    """Return geometry_msgs/PointStamped."""
    return {**header("header", table["stamp_ns"], frame),
            **_point("point", table["x"], table["y"], table["z"])}  # fmt: skip


def poses(table: Columns, frame: str) -> Values:
    """Return geometry_msgs/PoseWithCovarianceStamped; `covariance` is (n, 3, 3)."""
    return {
        **header("header", table["stamp_ns"], frame),
        **_point("pose.pose.position", table["x"], table["y"]),
        **_turned("pose.pose.orientation", table["heading"]),
        "pose.covariance": planar_covariances(table["covariance"]),
    }


def planar_covariances(covariance: FloatArray) -> FloatArray:
    """Return the covariances (n, 36) of ROS poses of those of (x, y, heading), shape (n, 3, 3)."""
    full = np.zeros((len(covariance), 6, 6))
    full[:, [2, 3, 4], [2, 3, 4]] = KNOWN
    full[:, PLANAR[0], PLANAR[1]] = covariance
    return full.reshape(-1, 36)


def positions(table: Columns, frame: str) -> Values:
    """Return locfuse_msgs/TagPosition."""
    return {
        **header("header", table["stamp_ns"], frame),
        "tag": texts(table["tag"]) if "tag" in table else "",
        **_point("position", table["x_m"], table["y_m"]),
        "sigma": table["sigma_m"],
    }


def ranges(table: Columns, counts: Places, frames: dict[str, str]) -> Values:
    """Return locfuse_msgs/UwbRanges of so many rows each, stamped as their last."""
    tags, last = texts(table["tag"]), np.cumsum(counts) - 1
    inner = tags.renamed(lambda tag: frames.get(tag, ""))
    return {
        **header("header", table["stamp_ns"][last], inner._replace(codes=inner.codes[last])),
        "ranges": counts,
        **header("ranges[].header", table["stamp_ns"], inner),
        "ranges[].tag": tags,
        "ranges[].anchor": texts(table["anchor"]),
        "ranges[].range": table["range_m"],
        "ranges[].sigma": table.get("sigma_m"),
    }


def sightings(table: Columns, counts: Places, frame: str) -> Values:
    """Return locfuse_msgs/LandmarkSightings of so many rows each, stamped as their last."""
    return {
        **header("header", table["stamp_ns"][np.cumsum(counts) - 1], frame),
        "sightings": counts,
        **header("sightings[].header", table["stamp_ns"], frame),
        "sightings[].landmark": texts(table["landmark"]),
        "sightings[].range": table["range_m"],
        "sightings[].bearing": table["bearing_rad"],
        "sightings[].sigma_range": table.get("sigma_range_m"),
        "sightings[].sigma_bearing": table.get("sigma_bearing_rad"),
    }


def scans(table: Columns, geometry: Sequence[float], frame: str) -> Values:
    """Return sensor_msgs/LaserScan; no return is infinity, an unknown intensity NaN."""
    start, step, nearest, farthest = geometry
    told = table["ranges_m"].astype(np.float32)
    told[np.isnan(told)] = np.inf
    return {
        **header("header", table["stamp_ns"], frame),
        "angle_min": start,
        "angle_max": start + step * (told.shape[1] - 1),
        "angle_increment": step,
        "range_min": nearest,
        "range_max": farthest,
        "ranges": told,
        "intensities": table.get("intensities"),
    }


def texts(column: NDArray[np.str_]) -> Texts:
    """Return a column of texts, each name of them once."""
    known: dict[str, int] = {}
    codes = [known.setdefault(text, len(known)) for text in column.tolist()]
    return Texts(list(known), np.array(codes, np.int64))


def _point(path: str, x: FloatArray, y: FloatArray, z: FloatArray | None = None) -> Values:
    return {f"{path}.x": x, f"{path}.y": y, f"{path}.z": z}


def _turned(path: str, heading: FloatArray) -> Values:
    z, w = quaternions(heading)
    return {f"{path}.z": z, f"{path}.w": w}


def quaternions(heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return z and w (n,) of turns in the plane, bit for bit as `encode.quaternion` does."""
    half = (0.5 * heading).tolist()
    z, w = np.array(list(map(math.sin, half))), np.array(list(map(math.cos, half)))
    target = wrapped(heading)
    left = np.flatnonzero(_heading(z, w) != target)
    same_z, up_z, down_z = z.copy(), z.copy(), z.copy()
    same_w, up_w, down_w = w.copy(), w.copy(), w.copy()
    for _ in range(RINGS if len(left) else 0):
        for values, towards in ((up_z, 2.0), (up_w, 2.0), (down_z, -2.0), (down_w, -2.0)):
            values[left] = np.nextafter(values[left], towards)
        for z_again, w_again in (
            (up_z, same_w), (down_z, same_w), (same_z, up_w), (same_z, down_w), (up_z, up_w),
            (up_z, down_w), (down_z, up_w), (down_z, down_w),
        ):  # fmt: skip
            found = _heading(z_again[left], w_again[left]) == target[left]
            z[left[found]], w[left[found]] = z_again[left[found]], w_again[left[found]]
            left = left[~found]
    return z, w


def _heading(z: FloatArray, w: FloatArray) -> FloatArray:
    """Return the headings of quaternions."""
    return wrapped(2.0 * np.array(list(map(math.atan2, z.tolist(), w.tolist())), np.float64))
