# SPDX-License-Identifier: Apache-2.0
"""How well the paper's rule (its Fig. 3) tells which landmark a ray ended on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from locfuse import _core
from locfuse.sim.obstacles import hidden_by
from locfuse.types import FloatArray
from papers.claims import Claim, share
from papers.gadau2022.world import (
    DISC_M,
    DISCS,
    FIELD_RAD,
    RAYS,
    REACH_M,
    ROOM_M,
    map_of,
    scan_of,
)

APART_M = DISC_M + 0.2  # from the middle of any disc, where a robot is
OFF_M = 0.3  # of the pose that is predicted
PLACES = 10  # for each seed


@dataclass(frozen=True)
class Recognized:
    """How many discs a ray met, how many were named, and how many of them by such a ray."""

    in_view: int
    found: int
    right: int


def recognition_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: from the true pose, and from one that is predicted wrong."""
    for key, off_m, what in (("", 0.0, ""), ("_off", OFF_M, f", pose {OFF_M:g} m off")):
        seen = [recognized(discs, seed, off_m) for discs in DISCS for seed in range(seeds)]
        found, right = sum(one.found for one in seen), sum(one.right for one in seen)
        yield share(f"gadau_rule_found{key}", f"rule of Fig. 3{what}: of discs in view, recognized",
                    right, sum(one.in_view for one in seen), None)  # fmt: skip
        yield share(f"gadau_rule_right{key}", f"rule of Fig. 3{what}: of what it names, right",
                    right, found, None)  # fmt: skip


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
