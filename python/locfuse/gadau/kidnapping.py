# SPDX-License-Identifier: Apache-2.0
"""A robot that is picked up and put down elsewhere: noticed when, found again when."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from locfuse import _core
from locfuse.claims import Claim, claim_of, share
from locfuse.gadau.world import (
    DISC_M,
    DISCS,
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
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

BEFORE_S, AFTER_S = 300.0, 30.0  # it is carried off
LEAST_M = 2.0  # that it is carried
WORLDS = {"triangle": "three landmarks", "discs": "5 discs, 151 rays"}
NOTICED_S, FOUND_S = 2.0, 5.0  # required


@dataclass(frozen=True)
class Kidnapping:
    """How one went, in seconds; infinity for never.

    Attributes
    ----------
    noticed_s : float
        After it was put down.
    found_s : float
        Tracking within 20 cm and 5 degrees, to stay, after three landmarks were seen at once;
        NaN if they never were.
    false_alarms : int
    hours : float
        In which they might have been.
    """

    noticed_s: float
    found_s: float
    false_alarms: int
    hours: float


def kidnapping_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: landmarks have no names."""
    for world, what in WORLDS.items():
        runs = [kidnap(world, seed) for seed in range(seeds)]
        key = f"gadau_kidnapped_{world}"
        noticed = np.array([run.noticed_s for run in runs])
        found = np.array([run.found_s for run in runs if not np.isnan(run.found_s)])
        yield share(key, f"kidnapped, {what}: noticed within {NOTICED_S:g} s",
                    int(np.sum(noticed <= NOTICED_S)), seeds, 0.99)  # fmt: skip
        yield claim_of(f"{key}_noticed", f"kidnapped, {what}: noticed after", "s", None,
                       np.minimum(noticed, AFTER_S), "-", lambda v: True)  # fmt: skip
        yield share(f"{key}_found", f"kidnapped, {what}: found within {FOUND_S:g} s of seeing 3",
                    int(np.sum(found <= FOUND_S)), len(found), 0.97)  # fmt: skip
        yield claim_of(f"{key}_found_after", f"kidnapped, {what}: found after", "s", None,
                       np.minimum(found, AFTER_S), "-", lambda v: True)  # fmt: skip
        hours = sum(run.hours for run in runs)
        rate = sum(run.false_alarms for run in runs) / hours
        yield Claim(f"{key}_false", f"{what}: false alarms in {hours:.1f} h", "1/h", None, rate,
                    rate, rate, "<= 1", rate <= 1.0)  # fmt: skip


def kidnap(world: str, seed: int, measurements_per_false_alarm: float = 1e6) -> Kidnapping:
    """Drive five minutes, be carried off to a pose anywhere in the room, drive on.

    Parameters
    ----------
    world : str
        A key of `WORLDS`.
    seed : int
    measurements_per_false_alarm : float
        Of the `RecoveringEkfConfig`.
    """
    rng = np.random.default_rng(seed)
    marks = np.array(DISCS["5"] if world == "discs" else LAYOUTS["triangle"], dtype=np.float64)
    look = _looking(world, marks, rng)
    config = _core.RecoveringEkfConfig()
    config.measurements_per_false_alarm = measurements_per_false_alarm
    config.estimator = filter_config()
    ekf = _core.RecoveringEkf(config, landmarks=known(marks))
    before, after = _way(world, marks, BEFORE_S, rng), _way(world, marks, AFTER_S, rng)
    while np.hypot(*(after[0] - before[-1])[:2]) < LEAST_M:
        after = _way(world, marks, AFTER_S, rng)
    ekf.start_at(_core.PoseEstimate(0, _core.Pose2(*before[0]), np.diag([0.05, 0.05, 0.02]) ** 2))
    stamp = 0
    for here, there in pairwise(before):
        ekf.on(_core.Increment(stamp, stamp + STEP_NS, told(here, there, rng)))
        stamp += STEP_NS
        ekf.on_joint(look(stamp, there))
    false_alarms = ekf.alarms
    off, saw_three, alarms = [], [], []
    for here, there in pairwise(after):
        ekf.on(_core.Increment(stamp, stamp + STEP_NS, told(here, there, rng)))
        stamp += STEP_NS
        seen = look(stamp, there)
        ekf.on_joint(seen)
        saw_three.append(len(seen) >= 3)
        alarms.append(ekf.alarms)
        off.append(_is_off(ekf, there))
    times = (1.0 + np.arange(len(off))) * STEP_NS / NANOSECONDS
    noticed = np.array(alarms) > false_alarms
    wrong = np.flatnonzero(off)
    right_from = int(wrong[-1]) + 1 if len(wrong) else 0
    first = float(times[np.argmax(saw_three)]) if any(saw_three) else np.nan
    found = float(times[right_from]) if right_from < len(times) else np.inf
    return Kidnapping(
        noticed_s=float(times[np.argmax(noticed)]) if noticed.any() else np.inf,
        found_s=max(found - first, 0.0) if any(saw_three) else np.nan,
        false_alarms=false_alarms + max(alarms[-1] - false_alarms - 1, 0),
        hours=(BEFORE_S + AFTER_S) / 3600.0,
    )


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


def _is_off(ekf: _core.RecoveringEkf, truth: FloatArray) -> bool:
    if ekf.is_lost:
        return True
    off = _core.local(ekf.state().hypotheses[0].estimate.pose, _core.Pose2(*truth))
    return bool(np.hypot(off[0], off[1]) > NEAR_M or abs(off[2]) > NEAR_RAD)
