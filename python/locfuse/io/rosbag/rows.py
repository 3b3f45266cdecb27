# SPDX-License-Identifier: Apache-2.0
"""Decoded messages as rows of the tables of a log: columns by name, in the units of the format."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.io.log_folder import FORCES, RATES
from locfuse.io.rosbag import restarts
from locfuse.io.rosbag.decode import (
    NOT_MEASURED_M,
    AltitudeRow,
    FixRow,
    HeadingRow,
    ImuRow,
    MessageError,
    Mount,
    OdometryRow,
    PoseRow,
    RangeRow,
    ScanRow,
    SightingRow,
)
from locfuse.types import NANOSECONDS, FloatArray

Row = dict[str, Any]
SIGHTED = ("sigma_range_m", "sigma_bearing_rad", "elevation_rad", "sigma_elevation_rad")


class Wheels:
    """Makes increments of the poses of odometry, or takes its velocities.

    `use` is ``pose`` or ``twist``, as `ros.odometry_from`; `on_leap` is called with a sentence
    where odometry was set anew.
    """

    def __init__(self, use: str, on_leap: Callable[[str], None] = lambda _: None) -> None:
        self._use = use
        self._on_leap = on_leap
        self._before: OdometryRow | None = None
        self._leaps = restarts.Leaps()

    def row(self, now: OdometryRow) -> Row:
        """Return the row of a message; of the first one only the stamp says something."""
        if self._use == "twist":
            found = {"stamp_ns": now.stamp_ns, "v_mps": now.v, "omega_radps": now.omega}
            return found if now.left == 0.0 else {**found, "v_left_mps": now.left}
        before = self._before
        if before is None or now.stamp_ns > before.stamp_ns:
            self._before = now
        moved = _core.Pose2()
        if before is not None and now.stamp_ns > before.stamp_ns:
            was = _core.Pose2(before.x, before.y, before.heading)
            moved = self._without_leap(
                before, now, was.inverse() * _core.Pose2(now.x, now.y, now.heading)
            )
        return {
            "stamp_ns": now.stamp_ns,
            "dx_m": moved.x,
            "dy_m": moved.y,
            "dheading_rad": moved.heading,
        }

    def _without_leap(
        self, before: OdometryRow, now: OdometryRow, moved: _core.Pose2
    ) -> _core.Pose2:
        seconds = (now.stamp_ns - before.stamp_ns) / NANOSECONDS
        velocity = [[part if math.isfinite(part) else 0.0 for part in (row.v, row.left, row.omega)]
                    for row in (before, now)]  # fmt: skip
        motion, pose = (moved.x, moved.y, moved.heading), (now.x, now.y, now.heading)
        if not self._leaps.is_leap(seconds, motion, pose, velocity):
            return moved
        self._on_leap(restarts.sentence(now.stamp_ns, motion))
        return restarts.motion_by_velocity(seconds, velocity)


def laser_of(row: ScanRow, mount: Mount, upside_down: bool = False) -> dict[str, Any]:
    """Return the geometry of a scan as `Log.laser` has it; head down, angles count clockwise."""
    sign = -1.0 if upside_down else 1.0
    timed = {"time_increment_s": row.time_increment} if row.time_increment else {}
    return {
        "pose_in_body": [mount.x, mount.y, mount.heading],
        "angle_min_rad": sign * row.angle_min,
        "angle_increment_rad": sign * row.angle_increment,
        "range_min_m": row.range_min,
        "range_max_m": row.range_max,
        **timed,
    }


def scan_row(row: ScanRow, laser: Mapping[str, Any]) -> Row:
    """Return a scan with the geometry of its laser."""
    found = {"stamp_ns": row.stamp_ns, "ranges_m": row.ranges, "laser": laser}
    return found if row.intensities is None else {**found, "intensities": row.intensities}


def imu_row(row: ImuRow, turn: FloatArray | None = None) -> Row:
    """Return a sample of an IMU; without an accelerometer forces of 0, which show no vertical.

    `turn` are its axes in the body, shape (3, 3), where they are not those of the body.
    """
    rate, force = row.rate, row.force or (0.0, 0.0, 0.0)
    if turn is not None:
        rate, force = (tuple((turn @ np.array(vector)).tolist()) for vector in (rate, force))
    return {"stamp_ns": row.stamp_ns, **dict(zip(RATES, rate, strict=True)),
            **dict(zip(FORCES, force, strict=True))}  # fmt: skip


def range_row(row: RangeRow) -> Row:
    """Return a range; without ``sigma_m`` where that is not known."""
    found: Row = {"stamp_ns": row.stamp_ns, "tag": row.tag, "anchor": row.anchor,
                 "range_m": row.range_m}  # fmt: skip
    return found if row.sigma_m is None else {**found, "sigma_m": row.sigma_m}


def position_row(row: FixRow) -> Row:
    """Return a position of a tag, or of the antenna."""
    return {"stamp_ns": row.stamp_ns, "tag": row.tag, "x_m": row.x, "y_m": row.y,
            "sigma_m": row.sigma_m}  # fmt: skip


def pose_row(row: PoseRow) -> Row:
    """Return a pose with its sigmas; MessageError as of `sigmas_of`."""
    xy, heading = sigmas_of(row.covariance)
    return {
        "stamp_ns": row.stamp_ns,
        "x_m": row.x,
        "y_m": row.y,
        "heading_rad": row.heading,
        "sigma_xy_m": xy,
        "sigma_heading_rad": heading,
    }


def sigmas_of(covariance: FloatArray) -> tuple[float, float]:
    """Return sigmas of position and heading: 0 of a covariance of 0, -1 of one marked as unknown.

    Raises MessageError if variances are neither positive nor marked as unknown.
    """
    xy, heading = 0.5 * (covariance[0, 0] + covariance[1, 1]), covariance[2, 2]
    if covariance[0, 0] == -1.0:
        return -1.0, -1.0
    if covariance.any() and not (xy > 0.0 and heading > 0.0):
        raise MessageError(f"the variances of x, y and heading are {covariance[0, 0]:g}, "
                           f"{covariance[1, 1]:g} and {heading:g}; expected > 0, or all 0 or -1 "
                           "first where they are not known")  # fmt: skip
    return (min(math.sqrt(xy), NOT_MEASURED_M), min(math.sqrt(heading), NOT_MEASURED_M))


def sighting_row(row: SightingRow) -> Row:
    """Return a landmark seen; without sigmas where they are not known."""
    found: Row = {"stamp_ns": row.stamp_ns, "landmark": row.landmark, "range_m": row.range_m,
                 "bearing_rad": row.bearing_rad}  # fmt: skip
    found |= {name: value for name in SIGHTED if (value := getattr(row, name)) is not None}
    return found


def altitude_row(row: AltitudeRow) -> Row:
    """Return an altitude; without ``sigma_m`` where that is not known."""
    found: Row = {"stamp_ns": row.stamp_ns, "height_m": row.height_m}
    return found if row.sigma_m is None else {**found, "sigma_m": row.sigma_m}


def heading_row(row: HeadingRow) -> Row:
    """Return a heading or a course; ``sigma_rad`` is NaN where that is not known."""
    return {"stamp_ns": row.stamp_ns, "heading_rad": row.heading_rad,
            "sigma_rad": math.nan if row.sigma_rad is None else row.sigma_rad,
            "is_course": float(row.is_course)}  # fmt: skip
