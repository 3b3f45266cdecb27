# SPDX-License-Identifier: Apache-2.0
"""The paper's two simulators, with our filter in them, and with its mistakes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from locfuse import _core
from locfuse.eval.consistency import PROBABILITY, band
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle
from papers.gadau2022.world import (
    DISC_M,
    DISCS,
    DURATION_S,
    LASER,
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
    Gps,
    Sensors,
    detector,
    filter_config,
    known,
    map_of,
    scan_of,
    seen_by,
    sightings_of,
    told,
    way_among,
)

NEES_ROWS = 42  # of which a NEES is required
Mistake = Literal["derivatives", "range_row", "bearing_row", "surface"]
Correct = Callable[[_core.PoseEkf, int, FloatArray], None]


@dataclass(frozen=True)
class Run:
    """One drive.

    Attributes
    ----------
    truth, found : float64 array, shape (n, 3)
        Pose after each step.
    nees : float
        Of the last.
    fixes : float64 array, shape (m, 2)
        What GPS told.
    """

    truth: FloatArray
    found: FloatArray
    nees: float
    fixes: FloatArray

    @cached_property
    def off_m(self) -> FloatArray:
        """Error of the position after each step."""
        off: FloatArray = np.hypot(*(self.found - self.truth)[:, :2].T)
        return off

    @cached_property
    def off_rad(self) -> FloatArray:
        """Error of the heading after each step, not negative."""
        return np.abs(wrap_angle(self.found[:, 2] - self.truth[:, 2]))

    def converged_s(self) -> float:
        """Return when it came near the truth to stay, infinity if never."""
        far = (self.off_m > NEAR_M) | (self.off_rad > NEAR_RAD)
        last = int(np.flatnonzero(far)[-1]) if far.any() else -1
        return (last + 1) * STEP_NS / NANOSECONDS if last + 1 < len(far) else np.inf


def microsimulation(
    layout: str, path: str, seed: int, *, wrong: bool = True, mistake: Mistake | None = None,
    sensors: Sensors = LASER,
) -> Run:  # fmt: skip
    """Drive a minute among landmarks that are always all in view.

    Parameters
    ----------
    layout, path : str
        Keys of `LAYOUTS` and `PATHS`.
    seed : int
    wrong : bool
        Whether the filter starts 2 m and 60 degrees off.
    mistake : str, optional
        ``derivatives`` of the paper's Fig. 2 instead of the right ones, or one row of them only:
        ``range_row``, ``bearing_row``; ranges to the ``surface`` of discs of 30 cm taken for those
        to their centres.
    sensors : Sensors
        The start, the drive and what odometry tells are the same with all of them.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(LAYOUTS[layout], dtype=np.float64)
    fuse: Correct = _by_name
    if mistake is not None and mistake != "surface":
        fuse = _by_derivatives(marks, (mistake,))
    short = DISC_M if mistake == "surface" else 0.0
    drive = plan(PATHS[path], ROOM_M, DURATION_S, rng)
    pose = drive.pose_at(np.arange(0, round(DURATION_S * 10) + 1) / 10.0)
    start = pose[0].copy()
    if wrong:
        side = rng.uniform(-np.pi, np.pi)
        start += [WRONG_M * np.cos(side), WRONG_M * np.sin(side), rng.choice([-1, 1]) * WRONG_RAD]
    ekf = _ekf(start, marks, wrong)
    for_gps = rng.spawn(1)[0]
    fixes: list[FloatArray] = []

    def see_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        seen = seen_by(at, marks, rng, short)  # even if unused: it takes from the odometry's rng
        if sensors.laser:
            fuse(ekf, stamp, seen)
        if sensors.gps is not None and stamp % sensors.gps.every_ns == 0:
            fixes.append(_located(ekf, stamp, at, sensors.gps, for_gps))

    run = _drive(ekf, pose, rng, see_and_fuse)
    return replace(run, fixes=np.array(fixes).reshape(-1, 2))


def _located(
    ekf: _core.PoseEkf, stamp: int, at: FloatArray, gps: Gps, rng: np.random.Generator
) -> FloatArray:
    fix: FloatArray = at[:2] + gps.sigma_m * rng.standard_normal(2)
    ekf.on(_core.PositionFix(stamp, fix, gps.sigma_m**2 * np.eye(2)))
    return fix


def ray_simulation(
    discs: str, speed_mps: float, seed: int, path: str = "circle", *,
    by_rule: Collection[Mistake] | None = None,
) -> Run:  # fmt: skip
    """Drive, or stand, in a room where 151 rays end on discs and walls.

    Parameters
    ----------
    discs : str
        A key of `DISCS`.
    speed_mps : float
    seed : int
    path : str
        Of `RAY_PATHS`.
    by_rule : collection of str, optional
        Discs are recognized by the paper's Fig. 3 instead of fitted, and fused with these mistakes,
        maybe none: the ray of a disc and its radius make a range and a bearing.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(DISCS[discs])
    pose = way_among(marks, path, speed_mps, rng)
    fuse = _fitted(marks, rng) if by_rule is None else _recognized(marks, rng, by_rule)
    return _drive(_ekf(pose[0], marks), pose, rng, fuse)


def nees_of(estimate: _core.PoseEstimate, truth: FloatArray) -> float:
    """Return how large an error is by what the estimate says of itself; 3 on average."""
    error = _core.local(estimate.pose, _core.Pose2(*truth))
    return float(error @ np.linalg.solve(estimate.covariance, error))


def nees_band(runs: int) -> tuple[float, float]:
    """Return the band of a mean NEES over runs, such that all `NEES_ROWS` hold with 95 %.

    Bonferroni's: what is outside is shared out evenly, whatever depends on what.
    """
    return band(3, runs, 1.0 - (1.0 - PROBABILITY) / NEES_ROWS)


def _ekf(start: FloatArray, marks: FloatArray, wrong: bool = False) -> _core.PoseEkf:
    config = filter_config()
    if wrong:
        config.gate_landmark = config.gate_position = 1.0
    sigma = [WRONG_M, WRONG_M, WRONG_RAD] if wrong else [0.05, 0.05, 0.02]
    return _core.PoseEkf(config, _core.AnchorMap([]), [],
                         _core.PoseEstimate(0, _core.Pose2(*start), np.diag(sigma) ** 2),
                         known(marks))  # fmt: skip


def _drive(ekf: _core.PoseEkf, pose: FloatArray, rng: np.random.Generator, fuse: Correct) -> Run:
    """Feed odometry with the noise of Fig. 1 and what is seen, step by step."""
    found = []
    for k, (before, after) in enumerate(pairwise(pose)):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        ekf.on(_core.Increment(begin, end, told(before, after, rng)))
        ekf.advance_to(end)
        fuse(ekf, end, after)
        at = ekf.estimate(end).pose
        found.append([at.x, at.y, at.heading])
    return Run(pose[1:], np.array(found), nees_of(ekf.estimate(), pose[-1]), np.empty((0, 2)))


def _by_name(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
    for landmark, (distance, bearing) in enumerate(seen.tolist()):
        ekf.on(_core.RangeBearing(stamp, landmark, distance, bearing))


def _fitted(marks: FloatArray, rng: np.random.Generator) -> Correct:
    """Fuse the discs that are fitted to the rays."""
    finder = detector()

    def fit_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        found = finder.detect(scan_of(stamp, at, marks, rng))
        if found:
            ekf.on_joint(sightings_of(found, stamp))

    return fit_and_fuse


def _recognized(
    marks: FloatArray, rng: np.random.Generator, mistakes: Collection[Mistake]
) -> Correct:
    """Fuse the ray that the paper's rule has for each disc; none where it recognizes none."""
    discs = map_of(marks)
    fuse = _by_derivatives(marks, mistakes)
    to_centre = 0.0 if "surface" in mistakes else DISC_M

    def recognize_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        scan = scan_of(stamp, at, marks, rng)
        rays = _core.recognize_landmarks(scan, ekf.estimate(stamp).pose, discs)
        fuse(ekf, stamp, np.array([[ray.range + to_centre, ray.bearing] if ray.beam >= 0
                                   else [np.nan, np.nan] for ray in rays]))  # fmt: skip

    return recognize_and_fuse


def _by_derivatives(marks: FloatArray, mistakes: Collection[Mistake]) -> Correct:
    """Fuse with H as Fig. 2 prints it, where a mistake asks for that.

    Its range's row has the signs of its negative; its bearing's has dx and dy exchanged, (dx, -dy)
    for (dy, -dx).
    """
    noise = np.diag([SIGMA_RANGE_M, SIGMA_BEARING_RAD]) ** 2
    gate = _core.Gate(1.0)
    both = "derivatives" in mistakes

    def fuse(ekf: _core.PoseEkf, stamp: int, seen: FloatArray) -> None:
        for at, z in zip(marks, seen, strict=True):
            if np.isnan(z[0]):
                continue
            pose = ekf.estimate(stamp).pose
            dx, dy = at - [pose.x, pose.y]
            d = float(np.hypot(dx, dy))
            off = [z[0] - d, _core.wrap_angle(float(z[1] - np.arctan2(dy, dx) + pose.heading))]
            sign = 1.0 if both or "range_row" in mistakes else -1.0
            turned = [dx, -dy] if both or "bearing_row" in mistakes else [dy, -dx]
            H = [[sign * dx / d, sign * dy / d, 0.0], [turned[0] / d**2, turned[1] / d**2, -1.0]]
            ekf.fuse(stamp, _core.Linearization(off, H, noise), gate)

    return fuse
