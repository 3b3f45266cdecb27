# SPDX-License-Identifier: Apache-2.0
"""What Zhang reports (one number, and figures), and our rows about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from locfuse.eval.consistency import band
from locfuse.types import FloatArray
from papers.claims import Claim, Paper, Progress, Statement, claim_of, consistent, share
from papers.zhang.experiments import (
    METHODS,
    OUR_ITERATIONS,
    PAPER_ITERATIONS,
    Runs,
    compare,
    spreads,
    tracked_by_lines,
)
from papers.zhang.world import ITERATIONS

PAPER = Paper(
    "zhang",
    "Zhang Hong and others: A fusion localization algorithm combining MCL with EKF",
    "Monte Carlo localization whose particles are refined by an EKF.",
    seeds=60,
    quick_seeds=12,
    statements=(
        Statement(
            "IV.A, Figs. 3a and 4a", "iteration 5",
            "standard MCL is all over the map, theirs concentrated",
            ("zhang_standard_error_5", "zhang_paper_error_5"),
            lambda standard, paper: paper < 0.5 < standard,
            "zhang_global",
            "judged by the error; standard MCL is left here with one wrong place, not with many",
        ),
        Statement(
            "IV.A, Figs. 3b and 4b", "iteration 10",
            "standard MCL has not located the robot",
            ("zhang_standard_found_10",),
            lambda standard: standard < 50.0,
            "zhang_global",
        ),
        Statement(
            "IV.A, Figs. 3c and 4c", "iteration 15",
            "standard MCL cannot determine the position, theirs can",
            ("zhang_standard_error_15", "zhang_paper_error_15"),
            lambda standard, paper: paper < 0.5 < standard,
            "zhang_global",
        ),
        Statement(
            "IV.A", "iterations until it is located",
            "19, from nothing, with 150 particles",
            ("zhang_paper_iterations", "zhang_paper_found_19", "zhang_ours_iterations"),
            lambda iterations, found, ours: iterations <= 19.0 and found >= 50.0,
            "zhang_error",
            "mostly at the first scan: walls at right angles, on a map without error",
        ),
        Statement(
            "IV.A, Fig. 5", "location error",
            "lower than that of standard MCL",
            ("zhang_standard_error_30", "zhang_paper_error_30", "zhang_ours_error_30"),
            lambda standard, paper, ours: paper < standard,
            "zhang_error",
        ),
        Statement(
            "IV.B, Fig. 8b", "tracked from a known start: theirs",
            "particles tightly around the robot",
            ("zhang_paper_spread",),
            lambda paper: paper < 10.0,
            "zhang_tracking",
        ),
        Statement(
            "IV.B, Fig. 8a", "tracked from a known start: standard MCL",
            "particles throughout the map, not around the robot",
            ("zhang_standard_spread",),
            lambda standard: standard > 100.0,
            "zhang_tracking",
            "from a known start it tracks well here",
        ),
        Statement(
            "V", "cost",
            "few hardware resources (no figure)",
            ("zhang_standard_cost", "zhang_paper_cost"),
            lambda standard, paper: paper <= standard,
            remark="taken as no more time than standard MCL, both in numpy",
        ),
    ),
    captions={
        "zhang_global": "Particles on one floor, the start unknown, after 5, 10 and 15 iterations: "
        "standard MCL, the paper's method, which most floors do not keep waiting as long, ours. "
        "The ring is the robot.",
        "zhang_error": "Error of the estimate over iterations, median and middle half of the runs, "
        "and how many have found the robot for good: standard MCL, the paper's method, ours.",
        "zhang_tracking": "Particles about a robot whose start was known, after 30 iterations.",
    },
)  # fmt: skip


def zhang_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows of the comparison; a tenth of the seeds also tracks from a known start."""
    rows = comparison_claims(compare(seeds, progress), spreads(max(2, seeds // 10)))
    return [*rows, *line_claims(*tracked_by_lines(seeds))]


def line_claims(paper: FloatArray, errors: FloatArray, nees: FloatArray) -> Iterator[Claim]:
    """Return the rows about lines in each particle in C++: precise as the paper's, and honest."""
    what = "tracked from a known start: "
    most = float(np.median(paper))
    yield claim_of("zhang_paper_tracked", f"the paper's, {what}error, iteration {ITERATIONS}", "m",
                   None, paper, "-", lambda v: True)  # fmt: skip
    yield claim_of("zhang_lines_tracked", f"`proposal: line_ekf`, {what}error, iteration "
                   f"{ITERATIONS}", "m", None, errors, f"<= {most:.4f}", lambda v: v <= most,
                   "required: the paper's median")  # fmt: skip
    yield consistent("zhang_lines", f"`proposal: line_ekf`, {what}", nees, band(3, len(nees)))


def comparison_claims(
    runs: Mapping[str, Runs], spread_m: Mapping[str, FloatArray]
) -> Iterator[Claim]:
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
                       "cm", None, 100.0 * spread_m[name], "-", lambda v: True)  # fmt: skip
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
