# SPDX-License-Identifier: Apache-2.0
"""wells: an EKF on cylinders that a laser sees; the paper's method beside ours.

The paper trusts the heading of the odometry and takes one beam a scan: the closest, plus the radius
of the cylinder (its eq. 8 to 14). Ours fits every arc, puts the cylinders of a scan together with
the map jointly, and estimates the heading.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.claims import Claim, Progress, claim_of, consistent
from locfuse.eval.consistency import band
from locfuse.plot.style import save
from locfuse.plot.wells import plot_paths
from locfuse.sim.obstacles import hidden_by
from locfuse.sim.trajectory import Drive, drive_of
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

RADIUS_M = 1.0
CYLINDERS = np.array([[2.0, 2.0], [-2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]])
BEAMS = 360
BEAM_RAD = np.deg2rad(np.arange(BEAMS) - 180.0)
RANGE_MAX_M = 3.5  # of the TurtleBot3's LDS-01
SIGMA_BEAM_M = 0.01
SCAN_NS = NANOSECONDS // 5
SPEED_MPS, TURN_RADPS = 0.22, 0.6
LEGS = 24  # of a drive
STEPS = 12  # of odometry per scan
GYRO_BIAS_RADPS = np.deg2rad(0.5)
SLIP = 0.3  # of the way that slipping wheels report too much
SLIPPING_S, EVERY_S = 2.0, 12.0
# Where a driver goes: around the cylinders and between them, and which ways are free.
PLACES = np.array([[0, 0], [4, 0], [0, 4], [-4, 0], [0, -4], [4, 4], [-4, 4], [-4, -4], [4, -4]])
WAYS = {0: (1, 2, 3, 4), 1: (0, 5, 8), 2: (0, 5, 6), 3: (0, 6, 7), 4: (0, 7, 8), 5: (1, 2),
        6: (2, 3), 7: (3, 4), 8: (4, 1)}  # fmt: skip


@dataclass(frozen=True)
class Paths:
    """One drive: poses at each scan, shape (n, 3).

    Attributes
    ----------
    truth, ours, paper, odometry : float64 arrays, shape (n, 3)
    laser : float64 array, shape (n, 2)
        Where the paper's closest beam puts the robot; NaN where it saw none.
    covariance : float64 array, shape (n, 3, 3)
        Of ours.
    cylinders : int array, shape (n,)
        How many ours found.
    """

    truth: FloatArray
    ours: FloatArray
    covariance: FloatArray
    cylinders: NDArray[np.intp]
    paper: FloatArray
    laser: FloatArray
    odometry: FloatArray


def wells_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows: clean odometry, then slipping wheels and a biased gyro."""
    claims: list[Claim] = []
    for done, spoilt in enumerate((False, True)):
        progress(done * seeds, 2 * seeds)
        drives = []
        for seed in range(seeds):
            drives.append(drive_both(seed, spoilt=spoilt))
            progress(done * seeds + seed + 1, 2 * seeds)
        claims += _rows(drives, spoilt)
    return claims


def draw_pictures(folder: Path, seeds: int) -> list[Path]:
    """Draw the paths of the first drives, as Fig. 3 and 4 of the paper, and worse odometry."""
    del seeds  # two drives tell
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, spoilt in (("wells_clean", False), ("wells_spoilt", True)):
        paths.append(folder / f"{name}.png")
        drive = drive_both(0, spoilt=spoilt)
        save(plot_paths(CYLINDERS, RADIUS_M, drive.truth, {"laser alone": drive.laser,
             "the paper's": drive.paper[:, :2], "ours": drive.ours[:, :2]}), paths[-1])  # fmt: skip
    return paths


def drive_both(seed: int, *, spoilt: bool) -> Paths:
    """Drive among the cylinders and localize by both methods.

    Odometry errs by 5 mm and 0.3 degrees per root of a metre and of a radian, which is little;
    spoilt, wheels slip for two of every twelve seconds, telling 30 % too much, and the gyro drifts
    by half a degree a second.
    """
    rng = np.random.default_rng(seed)
    drive = _drive(rng)
    scan_ns = np.arange(0, int(drive.start[-1] * NANOSECONDS), SCAN_NS)
    truth = drive.pose_at(scan_ns / NANOSECONDS)
    ours, paper = _Ours(truth[0]), _Paper(truth[0])
    odometry = [truth[0]]
    rows = []
    for k, (begin, end) in enumerate(pairwise(scan_ns.tolist()), start=1):
        told = _odometry(drive, begin, end, rng, spoilt)
        here = _core.Pose2(*odometry[-1]) * _core.Pose2(*told)
        odometry.append(np.array([here.x, here.y, here.heading]))
        scan = _scan(truth[k], end, rng)
        ours.on(begin, end, told, scan)
        seen = paper.on(told, here.heading, scan)
        rows.append((ours.pose(), ours.covariance(), ours.cylinders, paper.pose, seen))
    pose, covariance, count, of_paper, laser = (np.array(part) for part in zip(*rows, strict=True))
    return Paths(truth[1:], pose, covariance, count, of_paper, laser, np.array(odometry[1:]))


def _drive(rng: np.random.Generator) -> Drive:
    """Return a drive from place to place: turns on the spot, straight ways."""
    at, pose, motions = 0, np.array([0.0, 0.0, 0.0]), []
    for _ in range(LEGS):
        at = int(rng.choice(WAYS[at]))
        off = PLACES[at] + rng.uniform(-0.15, 0.15, 2) - pose[:2]
        heading = np.arctan2(off[1], off[0])
        turn = float(wrap_angle(heading - pose[2]))
        if turn != 0.0:
            motions.append((abs(turn) / TURN_RADPS, 0.0, np.copysign(TURN_RADPS, turn)))
        motions.append((float(np.hypot(*off)) / SPEED_MPS, SPEED_MPS, 0.0))
        pose = np.array([*(pose[:2] + off), heading])
    return drive_of((0.0, 0.0, 0.0), motions)


def _odometry(
    drive: Drive, begin: int, end: int, rng: np.random.Generator, spoilt: bool
) -> FloatArray:
    """Return the motion that wheels and gyro tell between two scans."""
    time = np.linspace(begin, end, STEPS + 1) / NANOSECONDS
    pose = [_core.Pose2(*row) for row in drive.pose_at(time)]
    total = _core.Pose2()
    for k, (before, after) in enumerate(pairwise(pose)):
        step = before.inverse() * after
        way, turn = np.hypot(step.x, step.y), abs(step.heading)
        along = step.x + 0.005 * np.sqrt(way) * rng.standard_normal()
        heading = step.heading + 0.005 * np.sqrt(way + turn) * rng.standard_normal()
        if spoilt:
            along *= 1.0 + SLIP * (time[k] % EVERY_S < SLIPPING_S)
            heading += GYRO_BIAS_RADPS * (time[k + 1] - time[k])
        total = total * _core.Pose2(along, step.y, heading)
    return np.array([total.x, total.y, total.heading])


def _scan(pose: FloatArray, stamp: int, rng: np.random.Generator) -> _core.LaserScan:
    """Return what 360 beams see of the cylinders, NaN without return."""
    beams = (pose[2] + BEAM_RAD)[None]
    ranges = hidden_by(CYLINDERS[None], RADIUS_M, pose[None, :2], beams)[0]
    ranges = ranges + SIGMA_BEAM_M * rng.standard_normal(BEAMS)
    laser = _core.LaserGeometry(_core.Pose2(), float(BEAM_RAD[0]), float(np.deg2rad(1.0)), 0.12,
                                RANGE_MAX_M)  # fmt: skip
    return _core.LaserScan(stamp, laser, np.where(ranges < RANGE_MAX_M, ranges, np.nan))


class _Ours:
    """Cylinders fitted, associated jointly, fused in a `PoseEkf` that learns how its gyro drifts.

    It is not told when wheels slip, and its noise does not follow: 5 cm per root of a metre, clean
    or spoilt. That is ten times the noise of clean wheels, and a quarter of what a slip tells too
    much: 13 cm over 44 cm.
    """

    def __init__(self, start: FloatArray) -> None:
        self.cylinders = 0  # found in the last scan
        config = _core.PoseEkfConfig()
        config.odometry.sigma_longitudinal_per_sqrt_m = 0.05
        config.odometry.sigma_lateral_per_sqrt_m = 0.01
        config.odometry.sigma_heading_per_sqrt_m = 0.01
        config.odometry.sigma_heading_per_sqrt_rad = 0.01
        config.calibration.sigma_turn_bias_radps = 0.02
        landmarks = [_core.Landmark(i, at, RADIUS_M) for i, at in enumerate(CYLINDERS)]
        self._detector = _core.CylinderDetector(
            _core.CylinderDetectorConfig(radius_m=RADIUS_M, sigma_range_m=SIGMA_BEAM_M)
        )
        self._ekf = _core.PoseEkf(
            config, _core.AnchorMap([]), [],
            _core.PoseEstimate(0, _core.Pose2(*start), np.diag([0.05, 0.05, 0.05]) ** 2),
            _core.LandmarkSight(_core.LandmarkMap(landmarks)),
        )  # fmt: skip

    def on(self, begin: int, end: int, told: FloatArray, scan: _core.LaserScan) -> None:
        self._ekf.on(_core.Increment(begin, end, _core.Pose2(*told)))
        found = self._detector.detect(scan)
        self.cylinders = len(found)
        self._ekf.on_joint(
            [_core.RangeBearing(end, None, one.range, one.bearing, one.covariance[:2, :2])
             for one in found]
        )  # fmt: skip

    def pose(self) -> FloatArray:
        pose = self._ekf.estimate().pose
        return np.array([pose.x, pose.y, pose.heading])

    def covariance(self) -> FloatArray:
        return self._ekf.estimate().covariance


class _Paper:
    """wells eq. 2 to 14: the position by a Kalman filter, the heading of the odometry."""

    def __init__(self, start: FloatArray) -> None:
        self.pose = start.copy()
        self._P = np.diag([0.05, 0.05]) ** 2

    def on(self, told: FloatArray, heading: float, scan: _core.LaserScan) -> FloatArray:
        """Predict, correct by the closest beam; return where that puts the robot, or NaN."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        moved = self.pose[:2] + [c * told[0] - s * told[1], s * told[0] + c * told[1]]
        self.pose = np.array([*moved, heading])
        self._P = self._P + 0.005**2 * float(np.hypot(*told[:2])) * np.eye(2)
        ranges = np.asarray(scan.ranges)
        if not np.isfinite(ranges).any():
            return np.full(2, np.nan)
        beam = int(np.nanargmin(ranges))
        angle, distance = heading + BEAM_RAD[beam], ranges[beam] + RADIUS_M
        off = distance * np.array([np.cos(angle), np.sin(angle)])
        nearest = CYLINDERS[np.argmin(np.hypot(*(CYLINDERS - (self.pose[:2] + off)).T))]
        seen: FloatArray = nearest - off
        gain = self._P @ np.linalg.inv(self._P + SIGMA_BEAM_M**2 * np.eye(2))
        self.pose[:2] += gain @ (seen - self.pose[:2])
        self._P = (np.eye(2) - gain) @ self._P
        return seen


def _rows(drives: list[Paths], spoilt: bool) -> Iterator[Claim]:
    key = "wells_spoilt" if spoilt else "wells"
    what = "slip and gyro bias: " if spoilt else "clean odometry: "
    limit_cm, limit_deg = (2.0, 0.5) if spoilt else (1.0, 0.3)
    for row, when, least in (("", "", 0), ("_two", " with two cylinders in view", 2)):
        parts = [(d.ours[d.cylinders >= least], d.truth[d.cylinders >= least]) for d in drives]
        yield claim_of(f"{key}{row}", f"{what}position RMSE{when}", "cm", None,
                       [100.0 * _rmse(pose[:, :2], truth) for pose, truth in parts],
                       f"<= {limit_cm:g}", lambda v: v <= limit_cm)  # fmt: skip
        yield claim_of(f"{key}{row}_heading", f"{what}heading RMSE{when}", "deg", None,
                       [_heading_rmse(pose, truth) for pose, truth in parts],
                       f"<= {limit_deg:g}", lambda v: v <= limit_deg)  # fmt: skip
    yield claim_of(f"{key}_share", f"{what}scans with two cylinders in view", "%", None,
                   [100.0 * float(np.mean(d.cylinders >= 2)) for d in drives], "-",
                   lambda v: True)  # fmt: skip
    off = np.array([_off(d.ours[-1:], d.truth[-1:])[0] for d in drives])
    nees = [float(e @ np.linalg.solve(d.covariance[-1], e))
            for e, d in zip(off, drives, strict=True)]  # fmt: skip
    yield consistent(key, what, nees, band(3, len(drives)))
    for part, shown in (("laser alone", [d.laser for d in drives]),
                        ("EKF", [d.paper[:, :2] for d in drives])):  # fmt: skip
        rmse_cm = [100.0 * _rmse(p, d.truth) for p, d in zip(shown, drives, strict=True)]
        yield claim_of(f"{key}_paper_{part[:3].lower()}", f"{what}the paper's {part}, RMSE",
                       "cm", None, rmse_cm, "-", lambda v: True)  # fmt: skip
    yield claim_of(f"{key}_odometry", f"{what}heading of the odometry, at the end", "deg", None,
                   [float(np.abs(np.rad2deg(_off(d.odometry[-1:], d.truth[-1:])[0, 2])))
                    for d in drives], "-", lambda v: True)  # fmt: skip


def _off(pose: FloatArray, truth: FloatArray) -> FloatArray:
    off = pose - truth
    off[:, 2] = wrap_angle(off[:, 2])
    return off


def _rmse(position: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(np.sum((position - truth[:, :2]) ** 2, axis=1))))


def _heading_rmse(pose: FloatArray, truth: FloatArray) -> float:
    return float(np.rad2deg(np.sqrt(np.mean(_off(pose, truth)[:, 2] ** 2))))
