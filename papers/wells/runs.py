# SPDX-License-Identifier: Apache-2.0
"""One drive, localized by both methods."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import NANOSECONDS, FloatArray
from papers.wells.methods import Ours, Paper
from papers.wells.world import SCAN_NS, random_drive, scan_of, told_motion


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


def drive_both(seed: int, *, spoilt: bool) -> Paths:
    """Drive among the cylinders and localize by both methods.

    Odometry errs by 5 mm and 0.3 degrees per root of a metre and of a radian, which is little;
    spoilt, wheels slip for two of every twelve seconds, telling 30 % too much, and the gyro drifts
    by half a degree a second.
    """
    rng = np.random.default_rng(seed)
    drive = random_drive(rng)
    scan_ns = np.arange(0, int(drive.start[-1] * NANOSECONDS), SCAN_NS)
    truth = drive.pose_at(scan_ns / NANOSECONDS)
    ours, paper = Ours(truth[0]), Paper(truth[0])
    odometry = [truth[0]]
    rows = []
    for k, (begin, end) in enumerate(pairwise(scan_ns.tolist()), start=1):
        told = told_motion(drive, begin, end, rng, spoilt)
        here = _core.Pose2(*odometry[-1]) * _core.Pose2(*told)
        odometry.append(np.array([here.x, here.y, here.heading]))
        scan = scan_of(truth[k], end, rng)
        ours.on(begin, end, told, scan)
        seen = paper.on(told, here.heading, scan)
        rows.append((ours.pose(), ours.covariance(), ours.cylinders, paper.pose, seen))
    pose, covariance, count, of_paper, laser = (np.array(part) for part in zip(*rows, strict=True))
    return Paths(truth[1:], pose, covariance, count, of_paper, laser, np.array(odometry[1:]))
