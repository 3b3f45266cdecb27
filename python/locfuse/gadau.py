# SPDX-License-Identifier: Apache-2.0
"""gadau2022: an EKF on landmarks by range and bearing; where the authors' filter failed, and why.

Their microsimulator sees every landmark exactly where it is; their second one has 151 rays that end
on discs and walls. Kidnapping, the third part of the paper, is not repeated yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from locfuse import _core
from locfuse.claims import Claim, Progress, claim_of, consistent, share
from locfuse.config.scenario import Circle, Path, Square, Star, Waypoints
from locfuse.eval.consistency import band
from locfuse.sim.obstacles import hidden_by
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

STEP_NS = NANOSECONDS // 10
DURATION_S = 60.0
ROOM_M = (10.0, 10.0)
# Fig. 1: what is added to the pose in every step, and to speed and turn rate.
SIGMA_POSE_M, SIGMA_POSE_RAD = 0.002, 0.002
SIGMA_SPEED_MPS, SIGMA_TURN_RADPS = 0.05, 0.05
SIGMA_RANGE_M, SIGMA_BEARING_RAD = 0.05, 0.02
ENDLESS = 1e6  # whatever is more is written so
WRONG_M, WRONG_RAD = 2.0, np.deg2rad(60.0)  # of the start
NEAR_M, NEAR_RAD = 0.2, np.deg2rad(5.0)  # of the truth: converged
LAYOUTS = {
    "one": [[2, 5]],
    "two": [[2, 5], [8, 5]],
    "triangle": [[1, 1], [9, 1], [5, 9]],
    "square, near": [[1, 1], [9, 1], [9, 9], [1, 9]],
    "five, far": [[-20, -20], [30, -20], [30, 30], [-20, 30], [5, 40]],
}
PATHS: dict[str, Path] = {
    "circle": Circle(speed_mps=0.5),
    "star": Star(speed_mps=0.5),
    "square": Square(speed_mps=0.5),
    "random": Waypoints(speed_mps=0.5),
}
RAYS, FIELD_RAD, REACH_M, SIGMA_RAY_M = 151, 2.0, 6.0, 0.01
DISC_M = 0.3
DISCS = {
    "5": [[2.0, 2.0], [8.0, 2.5], [8.2, 8.0], [2.2, 7.8], [5.0, 5.2]],
    "8": [[2.0, 2.0], [8.0, 2.5], [8.2, 8.0], [2.2, 7.8], [5.0, 5.2], [5.1, 1.2], [8.8, 5.3],
          [1.1, 5.0]],
}  # fmt: skip
SPEEDS = (0.0, 0.3, 1.0)

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


def gadau_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return all rows."""
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(lambda name=name: _layout(name, seeds) for name in LAYOUTS),
        *(lambda name=name: _path(name, seeds) for name in PATHS),
        lambda: _theirs(seeds),
        *(lambda name=name: _discs(name, max(seeds // 10, 2)) for name in DISCS),
    ]  # fmt: skip
    claims: list[Claim] = []
    for done, part in enumerate(parts):
        progress(done, len(parts))
        claims += part()
    progress(len(parts), len(parts))
    return claims


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

    def see(at: FloatArray) -> FloatArray:
        off = marks - at[:2]
        bearing = np.arctan2(off[:, 1], off[:, 0]) - at[2]
        seen = np.column_stack([np.hypot(*off.T) - short, bearing])
        noisy = seen + [SIGMA_RANGE_M, SIGMA_BEARING_RAD] * rng.standard_normal(seen.shape)
        return np.column_stack([np.maximum(noisy[:, 0], 0.0), wrap_angle(noisy[:, 1])])

    return _drive(ekf, pose, rng, lambda ekf, stamp, at: fuse(ekf, stamp, see(at)))


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
    detector = _core.CylinderDetector(
        _core.CylinderDetectorConfig(radius_m=DISC_M, sigma_range_m=SIGMA_RAY_M, least_beams=4)
    )
    geometry = _core.LaserGeometry(_core.Pose2(), -FIELD_RAD, 2.0 * FIELD_RAD / (RAYS - 1), 0.05,
                                   REACH_M)  # fmt: skip

    def fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        scan = _core.LaserScan(stamp, geometry, _rays(at, marks, rng))
        found = detector.detect(scan)
        ekf.on_joint([_core.RangeBearing(stamp, None, one.range, one.bearing,
                                         one.covariance[:2, :2]) for one in found])  # fmt: skip

    return _drive(_ekf(pose[0], marks, False), pose, rng, fuse)


def _ekf(start: FloatArray, marks: FloatArray, wrong: bool) -> _core.PoseEkf:
    config = _core.PoseEkfConfig()
    rate = NANOSECONDS / STEP_NS
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.0
    config.odometry.sigma_lateral_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_rad = 0.0
    # In every step, so many a second: noise of the pose, and of the speeds over a step.
    xy = np.hypot(SIGMA_POSE_M, SIGMA_SPEED_MPS / rate)
    turn = np.hypot(SIGMA_POSE_RAD, SIGMA_TURN_RADPS / rate)
    config.odometry.sigma_xy_per_sqrt_s = float(xy * np.sqrt(rate))
    config.odometry.sigma_heading_per_sqrt_s = float(turn * np.sqrt(rate))
    config.landmark.sigma_range_m = SIGMA_RANGE_M
    config.landmark.sigma_bearing_rad = SIGMA_BEARING_RAD
    config.gate_landmark = 1.0 if wrong else 0.9999
    sigma = [WRONG_M, WRONG_M, WRONG_RAD] if wrong else [0.05, 0.05, 0.02]
    known = _core.LandmarkMap([_core.Landmark(i, at, DISC_M) for i, at in enumerate(marks)])
    return _core.PoseEkf(config, _core.AnchorMap([]), [],
                         _core.PoseEstimate(0, _core.Pose2(*start), np.diag(sigma) ** 2),
                         _core.LandmarkSight(known))  # fmt: skip


def _drive(ekf: _core.PoseEkf, pose: FloatArray, rng: np.random.Generator, fuse: Correct) -> Run:
    """Feed odometry with the noise of Fig. 1 and what is seen, step by step."""
    off = []
    for k, (before, after) in enumerate(pairwise(pose)):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        step = _core.Pose2(*before).inverse() * _core.Pose2(*after)
        seconds = STEP_NS / NANOSECONDS
        noise = rng.standard_normal(5) * [SIGMA_POSE_M, SIGMA_POSE_M, SIGMA_POSE_RAD,
                                          SIGMA_SPEED_MPS * seconds,
                                          SIGMA_TURN_RADPS * seconds]  # fmt: skip
        told = _core.Pose2(step.x + noise[0] + noise[3], step.y + noise[1],
                           step.heading + noise[2] + noise[4])  # fmt: skip
        ekf.on(_core.Increment(begin, end, told))
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


def _rays(at: FloatArray, marks: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return what the rays measure to discs and walls, NaN beyond their reach."""
    angle = at[2] + np.linspace(-FIELD_RAD, FIELD_RAD, RAYS)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    discs = hidden_by(marks[None], DISC_M, at[None, :2], angle[None])[0]
    wall = np.where(along > 0.0, np.array(ROOM_M), 0.0) - at[:2]
    walls = np.divide(wall, along, out=np.full_like(along, np.inf), where=along != 0.0)
    ranges = np.minimum(discs, walls.min(axis=1))
    ranges = ranges + SIGMA_RAY_M * rng.standard_normal(RAYS)
    return np.where(ranges < REACH_M, ranges, np.nan)


def _layout(name: str, seeds: int) -> Iterator[Claim]:
    runs = [microsimulation(name, "circle", seed) for seed in range(seeds)]
    key = f"gadau_{name.replace(', ', '_')}"
    what = f"{name}, start 2 m and 60 degrees wrong: "
    yield from _convergence(key, what, runs, seeds, name not in ("one", "two"))


def _path(name: str, seeds: int) -> Iterator[Claim]:
    runs = [microsimulation("triangle", name, seed) for seed in range(seeds)]
    yield from _convergence(f"gadau_path_{name}", f"triangle, path {name}: ", runs, seeds, True)


def _convergence(
    key: str, what: str, runs: list[Run], seeds: int, required: bool
) -> Iterator[Claim]:
    when = [run.converged_s() for run in runs]
    yield share(key, f"{what}converges", int(np.isfinite(when).sum()), seeds,
                0.99 if required else 0.0)  # fmt: skip
    yield claim_of(f"{key}_time", f"{what}after", "s", None,
                   np.minimum(when, DURATION_S), "-", lambda v: True)  # fmt: skip
    yield claim_of(f"{key}_error", f"{what}error at the end", "cm", None,
                   [100.0 * float(run.off_m[-1]) for run in runs], "-", lambda v: True)  # fmt: skip
    yield _nees(key, what, runs, required)


def _theirs(seeds: int) -> Iterator[Claim]:
    """Show what the paper's mistakes do, from the right start."""
    told = {
        None: "ours",
        "derivatives": "with the derivatives of Fig. 2",
        "surface": "with ranges to the surface of discs",
    }
    for mistake in (None, *get_args(Mistake)):
        runs = [microsimulation("square, near", "circle", seed, wrong=False, mistake=mistake)
                for seed in range(seeds)]  # fmt: skip
        key, what = f"gadau_{mistake or 'right'}", f"right start, {told[mistake]}: "
        yield claim_of(key, f"{what}worst error", "m", None,
                       [float(min(run.off_m.max(), ENDLESS)) for run in runs], "-",
                       lambda v: True)  # fmt: skip
        yield _nees(key, what, runs, mistake is None)


def _nees(key: str, what: str, runs: list[Run], required: bool) -> Claim:
    return consistent(key, what, [min(run.nees, ENDLESS) for run in runs], band(3, len(runs)),
                      required)  # fmt: skip


def _discs(name: str, seeds: int) -> Iterator[Claim]:
    for speed in SPEEDS:
        runs = [ray_simulation(name, speed, seed) for seed in range(seeds)]
        how = "standing" if speed == 0.0 else f"{speed:g} m/s"
        yield claim_of(f"gadau_rays_{name}_{speed:g}", f"{name} discs, 151 rays, {how}: RMSE", "cm",
                       None, [100.0 * float(np.sqrt(np.mean(run.off_m**2))) for run in runs],
                       "<= 5", lambda v: v <= 5.0)  # fmt: skip
        yield claim_of(f"gadau_rays_{name}_{speed:g}_worst", f"{name} discs, {how}: worst error",
                       "cm", None, [100.0 * float(run.off_m.max()) for run in runs], "-",
                       lambda v: True)  # fmt: skip
        yield _nees(f"gadau_rays_{name}_{speed:g}", f"{name} discs, {how}: ", runs, True)
