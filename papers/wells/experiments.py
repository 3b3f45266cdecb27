# SPDX-License-Identifier: Apache-2.0
"""Drives localized by both methods, and by the laser alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import NANOSECONDS, FloatArray
from papers.wells.methods import OurEkf, PaperEkf
from papers.wells.world import (
    BEAMS,
    CYLINDERS,
    RADIUS_M,
    SCAN_NS,
    detector,
    measured_motion,
    random_drive,
    scan_of,
)


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


def drive_both(seed: int, *, slip: bool) -> Paths:
    """Drive among the cylinders and localize by both methods.

    Odometry errs by 5 mm and 0.3 degrees per root of a metre and of a radian, which is little;
    with `slip`, wheels slip for two of every twelve seconds, 30 % too far, and the gyro drifts
    by half a degree a second.
    """
    rng = np.random.default_rng(seed)
    drive = random_drive(rng)
    scan_ns = np.arange(0, int(drive.start[-1] * NANOSECONDS), SCAN_NS)
    truth = drive.pose_at(scan_ns / NANOSECONDS)
    ours, paper = OurEkf(truth[0]), PaperEkf(truth[0])
    odometry = [truth[0]]
    rows = []
    for k, (begin, end) in enumerate(pairwise(scan_ns.tolist()), start=1):
        measured = measured_motion(drive, begin, end, rng, slip)
        here = _core.Pose2(*odometry[-1]) * _core.Pose2(*measured)
        odometry.append(np.array([here.x, here.y, here.heading]))
        scan = scan_of(truth[k], end, rng)
        ours.on(begin, end, measured, scan)
        seen = paper.on(measured, here.heading, scan)
        rows.append((ours.pose(), ours.covariance(), ours.cylinders, paper.pose, seen))
    pose, covariance, count, of_paper, laser = (np.array(part) for part in zip(*rows, strict=True))
    return Paths(truth[1:], pose, covariance, count, of_paper, laser, np.array(odometry[1:]))


EVERY_NS = NANOSECONDS  # between two scans that are looked at
FINER = 10  # times as many beams
Centre = tuple[float, float]  # range and bearing


def by_beam(seed: int, times: int = 1, *, noisy: bool = True) -> float:
    """Return the RMSE [m] by the closest beam and the radius, with so many times 360 beams."""

    def centre(pose: FloatArray, rng: np.random.Generator) -> Centre | None:
        scan = scan_of(pose, 0, rng if noisy else None, times)
        if not np.isfinite(np.asarray(scan.ranges)).any():
            return None
        seen = _core.closest_beam(scan, 0, BEAMS * times - 1, RADIUS_M)
        return seen.range, seen.bearing

    return _laser_rmse(seed, centre)


def by_arc(seed: int) -> float:
    """Return the RMSE [m] by the closest of the cylinders that are fitted to all their beams."""
    finder = detector()

    def centre(pose: FloatArray, rng: np.random.Generator) -> Centre | None:
        found = finder.detect(scan_of(pose, 0, rng))
        if not found:
            return None
        closest = min(found, key=lambda one: one.range)
        return closest.range, closest.bearing

    return _laser_rmse(seed, centre)


def _laser_rmse(
    seed: int, centre: Callable[[FloatArray, np.random.Generator], Centre | None]
) -> float:
    """Drive as `drive_both` of that seed does; the cylinder seen is the one nearest to there."""
    rng = np.random.default_rng(seed)
    drive = random_drive(rng)
    off = []
    for pose in drive.pose_at(np.arange(0.0, drive.start[-1], EVERY_NS / NANOSECONDS)):
        seen = centre(pose, rng)
        if seen is None:
            continue
        angle = pose[2] + seen[1]
        at = pose[:2] + seen[0] * np.array([np.cos(angle), np.sin(angle)])
        off.append(np.hypot(*(CYLINDERS - at).T).min())
    return float(np.sqrt(np.mean(np.square(off))))
