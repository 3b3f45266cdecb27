# SPDX-License-Identifier: Apache-2.0
"""Standard MCL, the paper's and ours side by side, over seeds; results/zhang.md."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray
from papers.claims import Progress
from papers.scores import rms
from papers.zhang.methods import FusionMcl, OurMcl, StandardMcl, settings, tracking_settings
from papers.zhang.particle_filter import Localizer, around, errors_of
from papers.zhang.world import ITERATIONS, World, world

METHODS = {"standard": "standard MCL", "paper": "the paper's", "ours": "ours"}
NEAR_M = 0.5
NEAR_RAD = np.deg2rad(20.0)
PAPER_ITERATIONS = 19  # in which the paper's method found the robot
OUR_ITERATIONS = 10
SIGMA_START = (0.2, np.deg2rad(5.0))  # m, rad: of a known start


@dataclass(frozen=True)
class Runs:
    """What became of one method.

    Attributes
    ----------
    errors : float64 array, shape (seeds, ITERATIONS, 2)
        Of the estimate, metres and radians.
    seconds : float64 array, shape (seeds, ITERATIONS)
        Of processor time.
    """

    errors: FloatArray
    seconds: FloatArray

    def converged(self) -> FloatArray:
        """Return from which iteration on the estimate stays right; ITERATIONS + 1 if it does not.

        Right is within `NEAR_M` and `NEAR_RAD`.
        """
        wrong = np.any(self.errors > [NEAR_M, NEAR_RAD], axis=2)
        last = ITERATIONS - np.argmax(wrong[:, ::-1], axis=1)
        return np.where(wrong.any(axis=1), last + 1.0, 1.0)


def localizer(method: str, of: World, seed: int, known_start: bool = False) -> Localizer:
    """Return a method of `METHODS`, started from nothing or near the true start."""
    rng = np.random.default_rng([seed, 1])
    start = around(of.start, *SIGMA_START, rng) if known_start else None
    if method == "standard":
        return StandardMcl(of.grid, rng, start)
    sigma_m, sigma_rad = SIGMA_START
    P = np.diag(np.square([sigma_m, sigma_m, sigma_rad]))
    if method == "paper":
        return FusionMcl(of.grid, rng, start, P if known_start else None)
    known = _core.PoseEstimate(0, _core.Pose2(*of.start), P) if known_start else None
    return OurMcl(of.grid, settings(seed), known)


def compare(seeds: int, progress: Progress = lambda done, total: None) -> dict[str, Runs]:
    """Start every method from nothing in the worlds of seeds 0 to seeds - 1."""
    found: dict[str, list[tuple[FloatArray, FloatArray]]] = {method: [] for method in METHODS}
    for seed in range(seeds):
        for method, run in _runs_in(seed).items():
            found[method].append(run)
        progress(seed + 1, seeds)
    return {method: Runs(*(np.array(part) for part in zip(*runs, strict=True)))
            for method, runs in found.items()}  # fmt: skip


@cache  # rows and pictures show the same runs
def _runs_in(seed: int) -> dict[str, tuple[FloatArray, FloatArray]]:
    of = world(seed)
    return {method: _run(localizer(method, of, seed), of) for method in METHODS}


def _run(method: Localizer, of: World) -> tuple[FloatArray, FloatArray]:
    errors, seconds = [], []
    for step in of.steps:
        begin = time.process_time()
        method.on(step)
        seconds.append(time.process_time() - begin)
        errors.append(errors_of(method.estimate(), step.truth))
    return np.array(errors), np.array(seconds)


def tracked_by_lines(seeds: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Track from a known start: the paper's refinement in numpy, and in C++ as `line_ekf`.

    Returns
    -------
    float64 arrays, shape (seeds,)
        Errors [m] of the paper's and of `line_ekf` after `ITERATIONS`, and the NEES of the latter.
    """
    rows = []
    for seed in range(seeds):
        of = world(seed)
        paper = localizer("paper", of, seed, known_start=True)
        lines = line_ekf(of, seed)
        for step in of.steps:
            paper.on(step)
            lines.on(step)
        truth = of.steps[-1].truth
        rows.append([errors_of(paper.estimate(), truth)[0], errors_of(lines.estimate(), truth)[0],
                     lines.nees(truth)])  # fmt: skip
    errors_paper, errors, nees = np.array(rows).T
    return errors_paper, errors, nees


def line_ekf(of: World, seed: int) -> OurMcl:
    """Return an `Mcl` that draws particles from lines, started near the true start."""
    sigma_m, sigma_rad = SIGMA_START
    off = np.random.default_rng([seed, 1]).normal(0.0, [sigma_m, sigma_m, sigma_rad])
    P = np.diag(np.square([sigma_m, sigma_m, sigma_rad]))
    start = _core.PoseEstimate(0, _core.Pose2(*(of.start + off)), P)
    return OurMcl(of.grid, tracking_settings(seed), start)


def spreads(seeds: int) -> dict[str, FloatArray]:
    """Return how far particles are from the robot, RMS [m], after a drive from a known start.

    Returns
    -------
    mapping of `METHODS` to float64 arrays, shape (seeds,)
    """
    found: dict[str, list[float]] = {method: [] for method in METHODS}
    for seed in range(seeds):
        of = world(seed)
        for name, values in found.items():
            method = localizer(name, of, seed, known_start=True)
            for step in of.steps:
                method.on(step)
            off = method.particles[:, :2] - of.steps[-1].truth[:2]
            values.append(rms(off))
    return {name: np.array(values) for name, values in found.items()}
