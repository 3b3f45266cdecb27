# SPDX-License-Identifier: Apache-2.0
"""Odometry from a laser without a map: each scan is fitted to those before it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.schema import RunConfig
from locfuse.eval.dead_reckoning import dead_reckon
from locfuse.eval.errors import interpolate
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import scans_of
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, LogError, Trajectory

LONGEST_S = 1e9  # any gap of the odometry is driven through
MEASURED_S = 0.1  # a velocity by scans is measured over so long at least
HOLD_NS = NANOSECONDS  # wheels that are silent for longer say nothing
# How much a body may change its velocity between two scans, where no wheels measure it.
SIGMA_MPS, SIGMA_RADPS = 0.5, 0.5

Wheels = _core.Velocity | _core.Increment
Item = tuple[int, int, Wheels | _core.LaserScan]  # time, rank, and what comes then


class ScanDrive:
    """Makes increments of scans; the motion by wheels, where they come, is where a fit begins.

    Feed wheels and scans in order of arrival. Without wheels the body is expected to go on as it
    did in the last scans, give or take 0.5 m/s and 0.5 rad/s. `noise` is that of the
    wheels.
    """

    def __init__(
        self,
        noise: _core.OdometryConfig | None = None,
        config: _core.ScanOdometryConfig | None = None,
    ) -> None:
        self._model = _core.OdometryMotion(noise or _core.OdometryConfig())
        self._odometry = _core.ScanOdometry(config or _core.ScanOdometryConfig())
        self._at: int | None = None  # stamp of the last scan
        self._twist = np.zeros(3)  # by the last scans, per second
        self._since, self._seconds = _core.Pose2(), 0.0  # motion by scans, not yet in it
        self._wheels_ns: int | None = None  # end of what wheels say
        self._rate = np.zeros(3)  # of the wheels, per second
        self._moved = _core.Pose2()  # by wheels, from the last scan to their end

    def on_wheels(self, message: Wheels) -> None:
        """Take the motion of the wheels."""
        begin = message.begin if isinstance(message, _core.Increment) else message.stamp
        if self._wheels_ns is not None and begin < self._wheels_ns:
            return  # late
        self._drive_to(begin)
        self._wheels_ns = message.stamp
        if isinstance(message, _core.Velocity):
            self._rate = np.array([message.forward, message.left, message.turn_rate])
        else:
            self._rate = _twist(message.motion, (message.stamp - begin) / NANOSECONDS)
            self._moved = self._moved * message.motion

    def on_scan(self, scan: _core.LaserScan) -> _core.Increment | None:
        """Return the motion since the last scan; None for the first one, and one that is late.

        Raises ValueError if the scan is not valid.
        """
        before = self._at
        if before is not None and scan.stamp <= before:
            return None
        seconds = 0.0 if before is None else (scan.stamp - before) / NANOSECONDS
        has_wheels = self._wheels_ns is not None and scan.stamp <= self._wheels_ns + HOLD_NS
        guess, covariance = self._by_wheels(scan.stamp, seconds) if has_wheels else (
            _arc(self._twist, seconds),
            np.diag(np.square([SIGMA_MPS, SIGMA_MPS, SIGMA_RADPS])) * seconds**2,
        )  # fmt: skip
        if before is None:
            guess, covariance = _core.Pose2(), np.zeros((3, 3))
        fitted = self._odometry.on(scan, guess, covariance)
        motion = fitted.increment.motion
        self._at = scan.stamp
        if before is None:
            self._moved = _core.Pose2()
            return None
        if fitted.match.converged:
            self._follow(motion, seconds)
        return _core.Increment(before, scan.stamp, motion)

    def _follow(self, motion: _core.Pose2, seconds: float) -> None:
        """Measure the velocity over a while: scans may come at once, and each is off a little."""
        self._since, self._seconds = self._since * motion, self._seconds + seconds
        if self._seconds >= MEASURED_S:
            self._twist = _twist(self._since, self._seconds)
            self._since, self._seconds = _core.Pose2(), 0.0

    def _by_wheels(self, stamp: int, seconds: float) -> tuple[_core.Pose2, FloatArray]:
        """Return the motion since the last scan and its covariance; what is beyond it is kept."""
        assert self._wheels_ns is not None
        beyond = _arc(self._rate, (self._wheels_ns - stamp) / NANOSECONDS)
        motion = self._moved * beyond.inverse()
        self._moved = beyond
        return motion, self._model.propagate(_core.Pose2(), motion, seconds).noise

    def _drive_to(self, stamp: int) -> None:
        """Go on by the rate of the wheels."""
        if self._wheels_ns is not None and stamp > self._wheels_ns:
            held = min(stamp - self._wheels_ns, HOLD_NS)
            self._moved = self._moved * _arc(self._rate, held / NANOSECONDS)


def _twist(motion: _core.Pose2, seconds: float) -> FloatArray:
    """Return the velocities that make a motion, in the body frame: an arc."""
    if seconds <= 0.0:
        return np.zeros(3)
    half = 0.5 * motion.heading
    stretch = half / np.sin(half) if abs(half) > 1e-9 else 1.0
    c, s = np.cos(half), np.sin(half)
    x, y = motion.x, motion.y
    return (
        np.array([stretch * (c * x + s * y), stretch * (c * y - s * x), motion.heading]) / seconds
    )


def _arc(twist: FloatArray, seconds: float) -> _core.Pose2:
    """Return the motion that velocities in the body frame make; the inverse of `_twist`."""
    vx, vy, turn = (twist * seconds).tolist()
    half = 0.5 * turn
    shrink = np.sin(half) / half if abs(half) > 1e-9 else 1.0
    c, s = np.cos(half), np.sin(half)
    return _core.Pose2(float(shrink * (c * vx - s * vy)), float(shrink * (s * vx + c * vy)), turn)


def with_scan_odometry(log: Log, config: RunConfig) -> Log:
    """Return the log with odometry of its scans, if the configuration asks for it.

    It replaces that of wheels, which only shows where each fit begins. Raises LogError where the
    log has no scans.
    """
    if config.scan_odometry is None:
        return log
    return replace(log, tables={**log.tables, "odometry": _odometry_of(log, scan_drive(config))})


def scan_drive(config: RunConfig) -> ScanDrive:
    """Return what makes odometry of scans for a run."""
    assert config.scan_odometry is not None
    noise = build_estimator_config(config.estimator).odometry
    local = _core.LocalMapConfig(sigma_range_m=config.scan_odometry.sigma_range_m)
    return ScanDrive(noise, _core.ScanOdometryConfig(map=local))


def wheels_of(log: Log) -> Iterator[tuple[int, Wheels]]:
    """Yield the odometry of a log with its times of arrival."""
    table: Columns = log.tables.get("odometry", {})
    if not table:
        return
    stamps = table["stamp_ns"].tolist()
    if "v_mps" in table:
        arrived = table.get("arrival_ns", table["stamp_ns"]).tolist()
        left = table.get("v_left_mps", np.zeros(len(stamps)))
        velocities = (column.tolist() for column in (table["v_mps"], table["omega_radps"], left))
        for stamp, arrival, *velocity in zip(stamps, arrived, *velocities, strict=True):
            yield arrival, _core.Velocity(stamp, *velocity)
        return
    begins = [*stamps[:1], *stamps[:-1]]
    arrived = table["arrival_ns"].tolist() if "arrival_ns" in table else begins
    columns = (table[name].tolist() for name in ("dx_m", "dy_m", "dheading_rad"))
    for row, (begin, stamp, arrival, *motion) in enumerate(
        zip(begins, stamps, arrived, *columns, strict=True)
    ):
        moved = _core.Pose2(*motion) if row > 0 else _core.Pose2()
        yield arrival, _core.Increment(begin, stamp, moved)


def _odometry_of(log: Log, drive: ScanDrive) -> Columns:
    """Return the table of odometry that the scans of a log make, in order of arrival."""
    scans = scans_of(log)
    if not scans:
        raise LogError("odometry of scans needs scans and a laser, but the log has none; "
                       f"{how_to_add(log, 'scans')}, or leave 'scan_odometry' out")  # fmt: skip
    arrived = log["scans"].get("arrival_ns", log["scans"]["stamp_ns"]).tolist()
    items: list[Item] = [(arrival, 0, wheels) for arrival, wheels in wheels_of(log)]
    items += [(arrival, 1, scan) for arrival, scan in zip(arrived, scans, strict=True)]
    rows: list[tuple[int, int, float, float, float]] = []
    for arrival, _, item in sorted(items, key=lambda entry: entry[:2]):
        if not isinstance(item, _core.LaserScan):
            drive.on_wheels(item)
            continue
        try:
            u = drive.on_scan(item)
        except ValueError as problem:
            raise LogError(f"scan_odometry: {problem}") from problem
        if u is not None:
            rows.append((u.stamp, arrival, u.motion.x, u.motion.y, u.motion.heading))
        elif not rows:
            rows.append((item.stamp, arrival, 0.0, 0.0, 0.0))
    stamp, arrival_ns, dx, dy, turn = (np.array(column) for column in zip(*rows, strict=True))
    odometry = {"stamp_ns": stamp, "dx_m": dx, "dy_m": dy, "dheading_rad": turn}
    return odometry | ({"arrival_ns": arrival_ns} if "arrival_ns" in log["scans"] else {})


def scan_odometry(
    log: Log,
    config: _core.ScanOdometryConfig | None = None,
    noise: _core.OdometryConfig | None = None,
) -> Trajectory:
    """Feed the scans of a log to a `ScanOdometry`; between scans the wheels lead on.

    For a whole log: where a scan lies between two rows of the wheels both count.

    Parameters
    ----------
    log : Log
        With odometry, scans and a laser. Scans before or after the odometry are left out.
    config : ScanOdometryConfig, optional
    noise : OdometryConfig, optional
        Of the wheels.

    Returns
    -------
    Trajectory
        Of the body, from (0, 0, 0) on, at each stamp of the odometry and each scan; every pose from
        what was known by then.

    Raises
    ------
    LogError
        If the log has no odometry or no scans.
    """
    scans = {scan.stamp: scan for scan in scans_of(log)}
    if "odometry" not in log or not scans:
        raise LogError("a drive by scans needs odometry, scans and a laser; the log lacks one")
    wheels = dead_reckon(log["odometry"])
    stamps = np.array(sorted(scans), np.int64)
    inside = (stamps >= wheels.stamp_ns[0]) & (stamps <= wheels.stamp_ns[-1])
    stamps = np.union1d(wheels.stamp_ns, stamps[inside])
    at, _ = interpolate(wheels, stamps, longest_gap_s=LONGEST_S)
    assert at.heading is not None
    rows = np.column_stack([at.position, at.heading]).tolist()

    model = _core.OdometryMotion(noise or _core.OdometryConfig())
    odometry = _core.ScanOdometry(config or _core.ScanOdometryConfig())
    moved, covariance = _core.Pose2(), np.zeros((3, 3))  # since the last scan
    fitted = _core.Pose2()  # there
    last, reported_ns = _core.Pose2(*rows[0]), int(stamps[0])
    poses = []
    for stamp, row in zip(stamps.tolist(), rows, strict=True):
        wheel = _core.Pose2(*row)
        step = model.propagate(moved, last.inverse() * wheel, (stamp - reported_ns) / NANOSECONDS)
        covariance = step.jacobian @ covariance @ step.jacobian.T + step.noise
        moved, last, reported_ns = step.moved, wheel, stamp
        if stamp in scans:
            fitted = odometry.on(scans[stamp], moved, covariance).pose
            moved, covariance = _core.Pose2(), np.zeros((3, 3))
        pose = fitted * moved
        poses.append((pose.x, pose.y, pose.heading))
    path = np.array(poses)
    return Trajectory(stamps, path[:, :2], path[:, 2])
