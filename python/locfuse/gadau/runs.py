# SPDX-License-Identifier: Apache-2.0
"""The paper's two simulators, with our filter in them, and with its mistakes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from locfuse import _core
from locfuse.gadau.world import (
    DISC_M,
    DISCS,
    DURATION_S,
    LAYOUTS,
    NEAR_M,
    NEAR_RAD,
    PATHS,
    ROOM_M,
    SIGMA_BEARING_RAD,
    SIGMA_RANGE_M,
    STEP_NS,
    WRONG_M,
    WRONG_RAD,
    detector,
    filter_config,
    known,
    scan_of,
    seen_by,
    sightings_of,
    told,
)
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

Mistake = Literal["derivatives", "surface"]
Correct = Callable[[_core.PoseEkf, int, FloatArray], None]


@dataclass(frozen=True)
class Run:
    """How far off one run was, at each step: metres and radians; NEES of the last."""

    off_m: FloatArray
    off_rad: FloatArray
    nees: float

    def converged_s(self) -> float:
        """Return when it came near the truth to stay, infinity if never."""
        far = (self.off_m > NEAR_M) | (self.off_rad > NEAR_RAD)
        last = int(np.flatnonzero(far)[-1]) if far.any() else -1
        return (last + 1) * STEP_NS / NANOSECONDS if last + 1 < len(far) else np.inf


def microsimulation(
    layout: str, path: str, seed: int, *, wrong: bool = True, mistake: Mistake | None = None
) -> Run:
    """Drive a minute among landmarks that are always all in view.

    Parameters
    ----------
    layout, path : str
        Keys of `LAYOUTS` and `PATHS`.
    seed : int
    wrong : bool
        Whether the filter starts 2 m and 60 degrees off.
    mistake : str, optional
        ``derivatives`` of the paper's Fig. 2 instead of the right ones; ranges to the ``surface``
        of discs of 30 cm taken for those to their centres.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(LAYOUTS[layout], dtype=np.float64)
    fuse = _with_their_derivatives(marks) if mistake == "derivatives" else _by_name
    short = DISC_M if mistake == "surface" else 0.0
    drive = plan(PATHS[path], ROOM_M, DURATION_S, rng)
    pose = drive.pose_at(np.arange(0, round(DURATION_S * 10) + 1) / 10.0)
    start = pose[0].copy()
    if wrong:
        side = rng.uniform(-np.pi, np.pi)
        start += [WRONG_M * np.cos(side), WRONG_M * np.sin(side), rng.choice([-1, 1]) * WRONG_RAD]
    ekf = _ekf(start, marks, wrong)

    def see_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        fuse(ekf, stamp, seen_by(at, marks, rng, short))

    return _drive(ekf, pose, rng, see_and_fuse)


def ray_simulation(discs: str, speed_mps: float, seed: int) -> Run:
    """Drive, or stand, in a room where 151 rays end on discs and walls."""
    rng = np.random.default_rng(seed)
    marks = np.array(DISCS[discs])
    place = np.array([5.0, 3.0, 0.5])
    if speed_mps > 0.0:
        turn = speed_mps / 1.8  # a circle between the discs
        time = np.arange(0, round(DURATION_S * 10) + 1) / 10.0
        angle = turn * time - np.pi / 2.0
        pose = np.column_stack([5.0 + 1.8 * np.cos(angle), 5.2 + 1.8 * np.sin(angle),
                                wrap_angle(angle + np.pi / 2.0)])  # fmt: skip
    else:
        pose = np.tile(place, (round(DURATION_S * 10) + 1, 1))
    finder = detector()

    def fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        ekf.on_joint(sightings_of(finder.detect(scan_of(stamp, at, marks, rng)), stamp))

    return _drive(_ekf(pose[0], marks, False), pose, rng, fuse)


def _ekf(start: FloatArray, marks: FloatArray, wrong: bool) -> _core.PoseEkf:
    config = filter_config()
    if wrong:
        config.gate_landmark = 1.0
    sigma = [WRONG_M, WRONG_M, WRONG_RAD] if wrong else [0.05, 0.05, 0.02]
    return _core.PoseEkf(config, _core.AnchorMap([]), [],
                         _core.PoseEstimate(0, _core.Pose2(*start), np.diag(sigma) ** 2),
                         known(marks))  # fmt: skip


def _drive(ekf: _core.PoseEkf, pose: FloatArray, rng: np.random.Generator, fuse: Correct) -> Run:
    """Feed odometry with the noise of Fig. 1 and what is seen, step by step."""
    off = []
    for k, (before, after) in enumerate(pairwise(pose)):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        ekf.on(_core.Increment(begin, end, told(before, after, rng)))
        ekf.advance_to(end)
        fuse(ekf, end, after)
        found = ekf.estimate(end).pose
        off.append([np.hypot(found.x - after[0], found.y - after[1]),
                    abs(_core.wrap_angle(found.heading - float(after[2])))])  # fmt: skip
    off_m, off_rad = np.array(off).T
    last = ekf.estimate()
    error = _core.local(last.pose, _core.Pose2(*pose[-1]))
    nees = float(error @ np.linalg.solve(last.covariance, error))
    return Run(off_m, off_rad, nees)


def _by_name(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
    for landmark, (distance, bearing) in enumerate(seen.tolist()):
        ekf.on(_core.RangeBearing(stamp, landmark, distance, bearing))


def _with_their_derivatives(marks: FloatArray) -> Correct:
    """Fuse with H as Fig. 2 prints it: the range's row has the signs of its negative."""
    noise = np.diag([SIGMA_RANGE_M, SIGMA_BEARING_RAD]) ** 2
    gate = _core.Gate(1.0)

    def fuse(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
        for at, z in zip(marks, seen, strict=True):
            pose = ekf.estimate(stamp).pose
            dx, dy = at - [pose.x, pose.y]
            d = float(np.hypot(dx, dy))
            off = [z[0] - d, _core.wrap_angle(float(z[1] - np.arctan2(dy, dx) + pose.heading))]
            H = [[dx / d, dy / d, 0.0], [dx / d**2, -dy / d**2, -1.0]]
            ekf.fuse(stamp, _core.Linearization(off, H, noise), gate)

    return fuse
