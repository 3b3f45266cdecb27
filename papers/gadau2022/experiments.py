# SPDX-License-Identifier: Apache-2.0
"""Runs of gadau2022: its two simulators, kidnapping, and the recognition of discs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.eval.consistency import PROBABILITY, band
from locfuse.sim.obstacles import hidden_by
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle
from papers.gadau2022.methods import (
    Correct,
    Mistake,
    by_derivatives,
    by_recognition,
    filter_config,
    fitted,
    fuse_fix,
    fuse_named,
    known,
    map_of,
    nees_of,
    pose_ekf,
    sightings_in,
    ungated_ekf,
)
from papers.gadau2022.world import (
    DISC_M,
    DISCS,
    DURATION_S,
    FIELD_RAD,
    LASER,
    LAYOUTS,
    NEAR_M,
    NEAR_RAD,
    PATHS,
    RAYS,
    REACH_M,
    ROOM_M,
    STEP_NS,
    WRONG_M,
    WRONG_RAD,
    Sensors,
    measured_motion,
    scan_of,
    seen_by,
    way_among,
)

NEES_ROWS = 42  # of which a NEES is required


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
        Of the GPS.
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
        The start, the drive and the odometry are the same with all of them.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(LAYOUTS[layout], dtype=np.float64)
    fuse: Correct = fuse_named
    if mistake is not None and mistake != "surface":
        fuse = by_derivatives(marks, (mistake,))
    short = DISC_M if mistake == "surface" else 0.0
    drive = plan(PATHS[path], ROOM_M, DURATION_S, rng)
    pose = drive.pose_at(np.arange(0, round(DURATION_S * 10) + 1) / 10.0)
    start = pose[0].copy()
    if wrong:
        side = rng.uniform(-np.pi, np.pi)
        start += [WRONG_M * np.cos(side), WRONG_M * np.sin(side), rng.choice([-1, 1]) * WRONG_RAD]
    ekf = pose_ekf(start, marks, wrong)
    for_gps = rng.spawn(1)[0]
    fixes: list[FloatArray] = []

    def see_and_fuse(ekf: _core.PoseEkf, stamp: int, at: FloatArray) -> None:
        seen = seen_by(at, marks, rng, short)  # even if unused: it takes from the odometry's rng
        if sensors.laser:
            fuse(ekf, stamp, seen)
        if sensors.gps is not None and stamp % sensors.gps.every_ns == 0:
            fixes.append(fuse_fix(ekf, stamp, at, sensors.gps, for_gps))

    run = _drive(ekf, pose, rng, see_and_fuse)
    return replace(run, fixes=np.array(fixes).reshape(-1, 2))


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
    fuse = fitted(marks, rng) if by_rule is None else by_recognition(marks, rng, by_rule)
    return _drive(pose_ekf(pose[0], marks), pose, rng, fuse)


def nees_band(runs: int) -> tuple[float, float]:
    """Return the band of a mean NEES over runs, such that all `NEES_ROWS` hold with 95 %.

    Bonferroni's: what is outside is shared out evenly, whatever depends on what.
    """
    return band(3, runs, 1.0 - (1.0 - PROBABILITY) / NEES_ROWS)


def _drive(ekf: _core.PoseEkf, pose: FloatArray, rng: np.random.Generator, fuse: Correct) -> Run:
    """Feed odometry with the noise of Fig. 1 and what is seen, step by step."""
    found = []
    for k, (before, after) in enumerate(pairwise(pose)):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        ekf.on(_core.Increment(begin, end, measured_motion(before, after, rng)))
        ekf.advance_to(end)
        fuse(ekf, end, after)
        at = ekf.estimate(end).pose
        found.append([at.x, at.y, at.heading])
    return Run(pose[1:], np.array(found), nees_of(ekf.estimate(), pose[-1]), np.empty((0, 2)))


BEFORE_S, AFTER_S = 300.0, 30.0  # it is carried off
MIN_CARRIED_M = 2.0  # that it is carried
WORLDS = {"triangle": "three landmarks", "discs": "5 discs, 151 rays"}
NOTICED_S, FOUND_S = 2.0, 5.0  # required


@dataclass(frozen=True)
class Kidnapping:
    """One drive in which a robot is carried off.

    Attributes
    ----------
    truth : float64 array, shape (n, 3)
        Pose after each step.
    found : float64 array, shape (n, 3)
        Where it believes to be; NaN while it is lost.
    seen, alarms : int arrays, shape (n,)
        Landmarks seen at once; alarms so far.
    put_down : int
        The first step after it was carried off.
    nees : float
        Of the last; NaN while it is lost.
    alone, named : float64 arrays, shape (n, 3), or None
        Poses of a PoseEkf with the same messages, and of one that knows which landmark is which
        and gates nothing, as the paper's.
    """

    truth: FloatArray
    found: FloatArray
    seen: NDArray[np.intp]
    alarms: NDArray[np.intp]
    put_down: int
    nees: float
    alone: FloatArray | None = None
    named: FloatArray | None = None

    def noticed_s(self) -> float:
        """Return when it noticed, after it was put down; infinity for never."""
        later = self.alarms[self.put_down :]
        return _seconds_to(later > self.alarms[self.put_down - 1])

    def found_s(self, by: FloatArray | None = None) -> float:
        """Return when it was within 20 cm and 5 degrees, to stay, after it saw three landmarks.

        Infinity for never; NaN if it never saw three at once. `by` are poses of another filter.
        """
        found = self.found if by is None else by
        three = self.seen[self.put_down :] >= 3
        if not three.any():
            return float("nan")
        off = np.abs(found - self.truth)[self.put_down :]
        far = ~((np.hypot(off[:, 0], off[:, 1]) <= NEAR_M)
                & (np.abs(wrap_angle(off[:, 2])) <= NEAR_RAD))  # fmt: skip
        stays = ~np.logical_or.accumulate(far[::-1])[::-1]
        return max(_seconds_to(stays) - _seconds_to(three), 0.0)

    def false_alarms(self) -> int:
        """Return how many alarms had no reason."""
        before, all_ = self.alarms[self.put_down - 1], self.alarms[-1]
        return int(before + max(all_ - before - 1, 0))


def kidnap(
    world: str, seed: int, probability_lost: float = 0.5, *, beside: bool = False
) -> Kidnapping:
    """Drive five minutes, be carried off to a pose anywhere in the room, drive on.

    Parameters
    ----------
    world : str
        A key of `WORLDS`.
    seed : int
    probability_lost : float
        Of the `HealthConfig`.
    beside : bool
        Whether a PoseEkf gets the same messages, and another which landmark is which. All are in
        view in the world "triangle" alone.
    """
    rng = np.random.default_rng(seed)
    marks = marks_of(world)
    look = sightings_in(world, marks, rng)
    config = _core.RecoveringEkfConfig()
    config.health.probability_lost = probability_lost
    config.start.estimator = filter_config()
    ekf = _core.RecoveringEkf(config, _core.World(landmarks=known(marks)))
    before, after = _path(world, marks, BEFORE_S, rng), _path(world, marks, AFTER_S, rng)
    while np.hypot(*(after[0] - before[-1])[:2]) < MIN_CARRIED_M:
        after = _path(world, marks, AFTER_S, rng)
    start = _core.PoseEstimate(0, _core.Pose2(*before[0]), np.diag([0.05, 0.05, 0.02]) ** 2)
    ekf.start_at(start)
    alone = ekf.estimator() if beside else None
    named = ungated_ekf(start, marks) if beside and world == "triangle" else None
    rows, poses, trusted = [], [], []
    for k, (here, there) in enumerate([*pairwise(before), *pairwise(after)]):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        motion, sightings = (
            _core.Increment(begin, end, measured_motion(here, there, rng)),
            look(end, there),
        )
        ekf.on(motion)
        ekf.on_joint(sightings)
        rows.append((there, _pose_of(ekf), len(sightings), ekf.alarms))
        if alone is not None:
            alone.on(motion)
            alone.on_joint(sightings)
            poses.append(_row(alone.estimate().pose))
        if named is not None:
            named.on(motion)
            for landmark, one in enumerate(sightings):
                named.on(_core.RangeBearing(end, landmark, one.range, one.bearing))
            trusted.append(_row(named.estimate().pose))
    truth, found, seen, alarms = (np.array(column) for column in zip(*rows, strict=True))
    return Kidnapping(truth, found, seen, alarms, len(before) - 1, _nees_of(ekf, truth[-1]),
                      np.array(poses) if poses else None,
                      np.array(trusted) if trusted else None)  # fmt: skip


def marks_of(world: str) -> FloatArray:
    """Return where the landmarks are, shape (n, 2)."""
    return np.array(DISCS["5"] if world == "discs" else LAYOUTS["triangle"], dtype=np.float64)


def _seconds_to(happened: NDArray[np.bool_]) -> float:
    when = np.flatnonzero(happened)
    return float(when[0] + 1) * STEP_NS / NANOSECONDS if len(when) else float("inf")


def _pose_of(ekf: _core.RecoveringEkf) -> tuple[float, float, float]:
    if ekf.is_lost:
        return (np.nan, np.nan, np.nan)
    return _row(ekf.state().hypotheses[0].estimate.pose)


def _nees_of(ekf: _core.RecoveringEkf, truth: FloatArray) -> float:
    if ekf.is_lost:
        return float("nan")
    return nees_of(ekf.state().hypotheses[0].estimate, truth)


def _row(pose: _core.Pose2) -> tuple[float, float, float]:
    return (pose.x, pose.y, pose.heading)


def _path(world: str, marks: FloatArray, seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return poses of a random walk between places; among discs, of one that touches none."""
    time = np.arange(0, round(seconds * 10) + 1) / 10.0
    if world == "triangle":
        return plan(PATHS["random"], ROOM_M, seconds, rng).pose_at(time)
    while True:  # a circle somewhere in the room
        radius, middle = rng.uniform(0.5, 2.5), rng.uniform(1.0, 9.0, 2)
        angle = rng.uniform(-np.pi, np.pi) + rng.choice([-0.5, 0.5]) / radius * time
        way = middle + radius * np.column_stack([np.cos(angle), np.sin(angle)])
        apart = np.hypot(*(way[:, None] - marks).transpose(2, 0, 1)).min()
        if apart > DISC_M + 0.2 and way.min() > 0.3 and way.max() < ROOM_M[0] - 0.3:
            heading = angle + np.sign(angle[-1] - angle[0]) * np.pi / 2.0
            return np.column_stack([way, wrap_angle(heading)])


APART_M = DISC_M + 0.2  # from the middle of any disc, where a robot is
OFF_M = 0.3  # of the pose that is predicted
PLACES = 10  # for each seed


@dataclass(frozen=True)
class Recognized:
    """How many discs a ray met, how many were named, and how many of them by such a ray."""

    in_view: int
    found: int
    right: int


def recognized(discs: str, seed: int, off_m: float = 0.0) -> Recognized:
    """Stand in several places, turned anyhow, and recognize.

    Parameters
    ----------
    discs : str
        A key of `DISCS`.
    seed : int
    off_m : float
        How far from there the robot is taken to be.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(DISCS[discs])
    in_view = found = right = 0
    for _ in range(PLACES):
        at = _place(marks, rng)
        side = rng.uniform(-np.pi, np.pi)
        taken = at + [off_m * np.cos(side), off_m * np.sin(side), 0.0]
        scan = scan_of(0, at, marks, rng)
        ended = _ended_on(at, marks)
        rays = _core.recognize_landmarks(scan, _core.Pose2(*taken), map_of(marks))
        for disc, ray in enumerate(rays):
            in_view += bool(np.any(ended == disc))
            found += ray.beam >= 0
            right += ray.beam >= 0 and ended[ray.beam] == disc
    return Recognized(in_view, found, right)


def _place(marks: FloatArray, rng: np.random.Generator) -> FloatArray:
    while True:
        at = rng.uniform([0.3, 0.3, -np.pi], [ROOM_M[0] - 0.3, ROOM_M[1] - 0.3, np.pi])
        if np.hypot(*(marks - at[:2]).T).min() > APART_M:
            return at


def _ended_on(at: FloatArray, marks: FloatArray) -> FloatArray:
    """Return the disc on which each ray ends, -1 for none within reach, shape (RAYS,)."""
    angle = (at[2] + np.linspace(-FIELD_RAD, FIELD_RAD, RAYS))[None]
    far = np.array([hidden_by(mark[None, None], DISC_M, at[None, :2], angle)[0] for mark in marks])
    nearest: FloatArray = np.where(far.min(axis=0) < REACH_M, far.argmin(axis=0), -1)
    return nearest
