# SPDX-License-Identifier: Apache-2.0
"""Rows of the tables of a log as messages, one by one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from locfuse import _core
from locfuse.config.schema import USABLE, RunConfig
from locfuse.io.log_folder import FORCES, MAX_LASERS, RATES
from locfuse.run.messages import MOTION, NOT_IN_PLANE, corrected
from locfuse.run.start import laser_geometry
from locfuse.types import NANOSECONDS, FloatArray, Log

Row = Mapping[str, Any]
Message = (
    _core.Velocity
    | _core.Increment
    | _core.Range
    | _core.PositionFix
    | _core.PoseObservation
    | _core.RangeBearing
    | _core.Altitude
    | _core.Heading
    | _core.Imu
)


def effective_ns(message: Message) -> int:
    """Return when a message takes effect: its stamp, but the beginning of an increment."""
    return message.begin if isinstance(message, _core.Increment) else message.stamp


class Rows:
    """Makes messages of rows; knows the names and their ids, and where odometry has come to.

    Names are in order of id; those of the world first, then others as they are received.
    """

    def __init__(self, config: RunConfig, world: Log) -> None:
        self.anchor_names = _names(world, "anchors", "anchor")
        self.landmark_names = _names(world, "landmarks", "landmark")
        self.tag_names = list(world.tags)
        self._laser, self._lasers = world.laser, world.lasers
        self._geometries: list[tuple[Any, _core.LaserGeometry]] = []  # of the last lasers
        self._ids = [
            {name: i for i, name in enumerate(names)}
            for names in (self.anchor_names, self.tag_names, self.landmark_names)
        ]
        self._delay_ns: dict[str, int] = {
            s: round(config.latency_s[s] * NANOSECONDS) for s in USABLE
        }
        self._wheels = config.estimator.odometry
        self._flies = config.estimator.kind == "air"
        self._odometry_ns: int | None = None
        self._of: dict[str, Callable[[int, Row], Message]] = {
            "odometry": self._odometry,
            "ranges": self._range,
            "positions": self._position,
            "poses": self._pose,
            "landmark_sightings": self._sighting,
            "altitudes": self._altitude,
            "headings": self._heading,
        }

    def message(self, source: str, row: Row) -> Message:
        """Return a row of the table `source` as a message; ValueError if a value is not valid."""
        return self._of[source](int(row["stamp_ns"]) - self._delay_ns[source], row)

    def go_on_from(self, before: Rows) -> None:
        """Take the next increment for the one that follows the last one of before."""
        self._odometry_ns = before._odometry_ns

    def forget_odometry(self) -> None:
        """Begin motion anew: the next increment covers a motion from before."""
        self._odometry_ns = None

    def imu(self, row: Row) -> _core.Imu:
        """Return a sample of an inertial sensor."""
        rate = [float(row[name]) for name in RATES]
        force = [float(row[name]) for name in FORCES] if FORCES[0] in row else None
        return _core.Imu(int(row["stamp_ns"]) - self._delay_ns["imu"], rate, force)

    def scan(self, row: Row) -> _core.LaserScan:
        """Return a row of scans.

        Its ``laser`` is the name of one of several in the world, or a geometry of its own.
        """
        laser = row.get("laser", self._laser)
        if isinstance(laser, str):
            laser = self._lasers.get(laser)
        if laser is None:
            name = f" {row['laser']!r}" if "laser" in row else ""
            key = "lasers" if name or self._lasers else "laser"
            raise ValueError(f"a scan came, but nothing is known of the laser{name}; add {key!r} "
                             "to the log.yaml of the world")  # fmt: skip
        if "beams" in row:  # of a log in which scans differ
            laser = {**laser, **{key: row[key] for key in ("angle_min_rad", "angle_increment_rad")}}
        geometry = next((known for given, known in self._geometries if given == laser), None)
        if geometry is None:
            geometry = laser_geometry(laser)
            self._geometries = [(laser, geometry), *self._geometries[: MAX_LASERS - 1]]
        beams = int(row["beams"]) if "beams" in row else None
        bright = row["intensities"][:beams] if row.get("intensities") is not None else None
        known = bright is not None and bool(np.all(np.isfinite(bright)))
        return _core.LaserScan(int(row["stamp_ns"]), geometry, row["ranges_m"][:beams],
                               bright if known else None)  # fmt: skip

    def _odometry(self, stamp: int, row: Row) -> Message:
        right = {name: float(value) for name, value in corrected(row, self._wheels).items()}
        if "v_mps" in row:
            return _core.Velocity(stamp, right["v_mps"], right["omega_radps"],
                                  right.get("v_left_mps", 0.0))  # fmt: skip
        before, motion = self._odometry_ns, _core.Pose2()
        if before is not None and before < stamp:
            motion = _core.Pose2(*(right[name] for name in MOTION))
        if before is None or before < stamp:
            self._odometry_ns = stamp
        begin = stamp if before is None else min(before, stamp)
        return _core.Increment(begin, stamp, motion)

    def _range(self, stamp: int, row: Row) -> Message:
        sigma = row.get("sigma_m")
        tag = _id(self._ids[1], self.tag_names, row["tag"])
        anchor = _id(self._ids[0], self.anchor_names, row["anchor"])
        return _core.Range(stamp, tag, anchor, float(row["range_m"]),
                           None if sigma is None else float(sigma))  # fmt: skip

    def _position(self, stamp: int, row: Row) -> Message:
        tag = row.get("tag") or None
        return _core.PositionFix(
            stamp,
            [float(row["x_m"]), float(row["y_m"])],
            reported_covariance([row["sigma_m"]] * 2),
            None if tag is None else _id(self._ids[1], self.tag_names, tag),
        )

    def _pose(self, stamp: int, row: Row) -> Message:
        pose = _core.Pose2(*(float(row[key]) for key in ("x_m", "y_m", "heading_rad")))
        sigmas = [row["sigma_xy_m"], row["sigma_xy_m"], row["sigma_heading_rad"]]
        return _core.PoseObservation(stamp, pose, reported_covariance(sigmas))

    def _sighting(self, stamp: int, row: Row) -> Message:
        name = row.get("landmark") or None
        landmark = None if name is None else _id(self._ids[2], self.landmark_names, name)
        range_m, bearing = (
            None if np.isnan(row[key]) else float(row[key]) for key in ("range_m", "bearing_rad")
        )
        covariance = None
        if "sigma_range_m" in row:
            covariance = reported_covariance([row["sigma_range_m"], row["sigma_bearing_rad"]])
        elevation = float(row.get("elevation_rad", np.nan))
        if np.isnan(elevation):
            return _core.RangeBearing(stamp, landmark, range_m, bearing, covariance)
        if not self._flies:
            raise ValueError(NOT_IN_PLANE)
        return _core.RangeBearing(stamp, landmark, range_m, bearing, covariance, elevation,
                                  row.get("sigma_elevation_rad"))  # fmt: skip

    def _altitude(self, stamp: int, row: Row) -> Message:
        return _core.Altitude(stamp, float(row["height_m"]), row.get("sigma_m"))

    def _heading(self, stamp: int, row: Row) -> Message:
        sigma = float(row.get("sigma_rad", np.nan))
        return _core.Heading(stamp, float(row["heading_rad"]), None if np.isnan(sigma) else sigma,
                             bool(row.get("is_course", 0)))  # fmt: skip


def _names(world: Log, table: str, column: str) -> list[str]:
    return [str(name) for name in world[table][column]] if table in world else []


def _id(ids: dict[str, int], names: list[str], name: str) -> int:
    if name not in ids:
        ids[name] = len(names)
        names.append(name)
    return ids[name]


def reported_covariance(sigmas: ArrayLike) -> FloatArray:
    """Return the covariance of sigmas; -1 and 0, which say that none is known, stay."""
    values = np.array(sigmas, dtype=np.float64)
    return np.diag(values * np.abs(values))
