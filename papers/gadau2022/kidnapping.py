# SPDX-License-Identifier: Apache-2.0
"""A robot that is picked up and put down elsewhere: noticed when, found again when."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle
from papers.claims import Claim, claim_of, consistent, share
from papers.gadau2022.runs import nees_band, nees_of
from papers.gadau2022.world import (
    DISC_M,
    DISCS,
    ENDLESS,
    LAYOUTS,
    NEAR_M,
    NEAR_RAD,
    PATHS,
    ROOM_M,
    STEP_NS,
    detector,
    filter_config,
    known,
    scan_of,
    seen_by,
    sightings_of,
    told,
)

BEFORE_S, AFTER_S = 300.0, 30.0  # it is carried off
LEAST_M = 2.0  # that it is carried
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
        Where a PoseEkf believes to be that got the same messages, and one that is told which
        landmark is which and believes each sighting, as the paper's.
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


def kidnapping_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: landmarks have no names."""
    for world, what in WORLDS.items():
        runs = [kidnap(world, seed, beside=world == "triangle") for seed in range(seeds)]
        key = f"gadau_kidnapped_{world}"
        noticed = np.array([run.noticed_s() for run in runs])
        found = np.array([run.found_s() for run in runs])
        found = found[~np.isnan(found)]
        yield share(key, f"kidnapped, {what}: noticed within {NOTICED_S:g} s",
                    int(np.sum(noticed <= NOTICED_S)), seeds, 0.99)  # fmt: skip
        yield claim_of(f"{key}_noticed", f"kidnapped, {what}: noticed after", "s", None,
                       np.minimum(noticed, AFTER_S), "-", lambda v: True)  # fmt: skip
        yield share(f"{key}_found", f"kidnapped, {what}: found within {FOUND_S:g} s of seeing 3",
                    int(np.sum(found <= FOUND_S)), len(found), 0.97)  # fmt: skip
        yield claim_of(f"{key}_found_after", f"kidnapped, {what}: found after", "s", None,
                       np.minimum(found, AFTER_S), "-", lambda v: True)  # fmt: skip
        hours = seeds * (BEFORE_S + AFTER_S) / 3600.0
        rate = sum(run.false_alarms() for run in runs) / hours
        yield Claim(f"{key}_false", f"{what}: false alarms in {hours:.1f} h", "1/h", None, rate,
                    rate, rate, "<= 1", rate <= 1.0)  # fmt: skip
        nees = [min(run.nees, ENDLESS) for run in runs if not np.isnan(run.nees)]
        yield consistent(key, f"kidnapped, {what}, found again: ", nees, nees_band(len(nees)))
        if world == "triangle":
            yield from _beside_claims(key, f"kidnapped, {what}", runs)


def _beside_claims(key: str, what: str, runs: list[Kidnapping]) -> Iterator[Claim]:
    """Yield whether a Kalman filter finds itself again that does not ask whether it is lost."""
    filters = {
        "alone": ("PoseEkf alone", [run.found_s(run.alone) for run in runs]),
        "named": ("PoseEkf alone, told which is which, no gate",
                  [run.found_s(run.named) for run in runs]),
    }  # fmt: skip
    for name, (text, found) in filters.items():
        yield share(f"{key}_{name}", f"{what}, {text}: found within {FOUND_S:g} s",
                    int(np.sum(np.array(found) <= FOUND_S)), len(runs), None)  # fmt: skip
        yield claim_of(f"{key}_{name}_after", f"{what}, {text}: found after", "s", None,
                       np.minimum(found, AFTER_S), "-", lambda v: True,
                       f"never counts as {AFTER_S:g}")  # fmt: skip


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
    look = _looking(world, marks, rng)
    config = _core.RecoveringEkfConfig()
    config.health.probability_lost = probability_lost
    config.estimator = filter_config()
    ekf = _core.RecoveringEkf(config, landmarks=known(marks))
    before, after = _way(world, marks, BEFORE_S, rng), _way(world, marks, AFTER_S, rng)
    while np.hypot(*(after[0] - before[-1])[:2]) < LEAST_M:
        after = _way(world, marks, AFTER_S, rng)
    start = _core.PoseEstimate(0, _core.Pose2(*before[0]), np.diag([0.05, 0.05, 0.02]) ** 2)
    ekf.start_at(start)
    alone = ekf.estimator() if beside else None
    named = _trusting(start, marks) if beside and world == "triangle" else None
    rows, poses, trusted = [], [], []
    for k, (here, there) in enumerate([*pairwise(before), *pairwise(after)]):
        begin, end = k * STEP_NS, (k + 1) * STEP_NS
        motion, sightings = _core.Increment(begin, end, told(here, there, rng)), look(end, there)
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


def _trusting(start: _core.PoseEstimate, marks: FloatArray) -> _core.PoseEkf:
    """Return a filter that believes each sighting."""
    config = filter_config()
    config.gate_landmark = 1.0
    return _core.PoseEkf(config, _core.AnchorMap([]), [], start, known(marks))


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


def _looking(
    world: str, marks: FloatArray, rng: np.random.Generator
) -> Callable[[int, FloatArray], list[_core.RangeBearing]]:
    if world == "discs":
        finder = detector()
        return lambda stamp, at: sightings_of(finder.detect(scan_of(stamp, at, marks, rng)), stamp)
    return lambda stamp, at: [
        _core.RangeBearing(stamp, None, distance, bearing)
        for distance, bearing in seen_by(at, marks, rng).tolist()
    ]


def _way(world: str, marks: FloatArray, seconds: float, rng: np.random.Generator) -> FloatArray:
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
