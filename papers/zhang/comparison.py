# SPDX-License-Identifier: Apache-2.0
"""Standard MCL, the paper's and ours side by side, over seeds; docs/models/zhang.md."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray
from papers.claims import Claim, Progress, claim_of, share
from papers.zhang.ours import OurMcl, settings
from papers.zhang.paper import FusionMcl
from papers.zhang.particles import Localizer, around, errors_of
from papers.zhang.standard import StandardMcl
from papers.zhang.world import ITERATIONS, World, world

METHODS = {"standard": "standard MCL", "paper": "the paper's", "ours": "ours"}
NEAR_M = 0.5
NEAR_RAD = np.deg2rad(20.0)
PAPER_ITERATIONS = 19  # in which the paper's method found the robot
OUR_ITERATIONS = 10
SIGMA_START = (0.2, np.deg2rad(5.0))  # m, rad: of a robot that is told where it is


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


def localizer(method: str, of: World, seed: int, told: bool = False) -> Localizer:
    """Return a method of `METHODS`, which knows nothing or is told where the robot starts."""
    rng = np.random.default_rng([seed, 1])
    start = around(of.start, *SIGMA_START, rng) if told else None
    if method == "standard":
        return StandardMcl(of.grid, rng, start)
    sigma_m, sigma_rad = SIGMA_START
    P = np.diag(np.square([sigma_m, sigma_m, sigma_rad]))
    if method == "paper":
        return FusionMcl(of.grid, rng, start, P if told else None)
    known = _core.PoseEstimate(0, _core.Pose2(*of.start), P) if told else None
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
            method = localizer(name, of, seed, told=True)
            for step in of.steps:
                method.on(step)
            off = method.particles[:, :2] - of.steps[-1].truth[:2]
            values.append(float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))
    return {name: np.array(values) for name, values in found.items()}


def claims_of(runs: Mapping[str, Runs], told: Mapping[str, FloatArray]) -> Iterator[Claim]:
    """Return the rows of the comparison."""
    yield from _found_claims(runs)
    for name, text in METHODS.items():
        yield _iterations_claim(name, text, runs[name].converged())
    for name, text in METHODS.items():
        for iteration in (5, 10, 15, ITERATIONS):
            yield claim_of(f"zhang_{name}_error_{iteration}", f"{text}: error, iteration "
                           f"{iteration}", "m", None, runs[name].errors[:, iteration - 1, 0], "-",
                           lambda v: True)  # fmt: skip
    for name, text in METHODS.items():
        yield claim_of(f"zhang_{name}_spread", f"{text}: particles about a robot that is tracked",
                       "cm", None, 100.0 * told[name], "-", lambda v: True)  # fmt: skip
    for name, text in METHODS.items():
        yield claim_of(f"zhang_{name}_cost", f"{text}: processor time per iteration", "ms", None,
                       1e3 * np.median(runs[name].seconds, axis=1), "-", lambda v: True,
                       "C++" if name == "ours" else "numpy")  # fmt: skip


def _found_claims(runs: Mapping[str, Runs]) -> Iterator[Claim]:
    """Say how often each method finds the robot: the paper's more often than not, ours always."""
    required = {
        ("standard", PAPER_ITERATIONS): (0.5, True),
        ("paper", PAPER_ITERATIONS): (0.5, False),
        ("ours", OUR_ITERATIONS): (0.95, False),
    }
    for within in (PAPER_ITERATIONS, OUR_ITERATIONS):
        for name, text in METHODS.items():
            converged = runs[name].converged()
            limit, at_most = required.get((name, within), (None, False))
            yield share(f"zhang_{name}_found_{within}",
                        f"{text}: found within {within} iterations",
                        int((converged <= within).sum()), len(converged), limit,
                        at_most)  # fmt: skip


def _iterations_claim(name: str, text: str, converged: FloatArray) -> Claim:
    limit = {"paper": PAPER_ITERATIONS, "ours": OUR_ITERATIONS}.get(name, ITERATIONS + 1)
    required = f"<= {limit}" if limit <= ITERATIONS else "-"
    paper = float(PAPER_ITERATIONS) if name == "paper" else None
    return claim_of(f"zhang_{name}_iterations", f"{text}: iterations to converge", "1", paper,
                    converged, required, lambda v: v <= limit,
                    f"never counts as {ITERATIONS + 1}")  # fmt: skip
