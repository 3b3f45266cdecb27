# SPDX-License-Identifier: Apache-2.0
"""What zhang reports: one figure, and pictures."""

from __future__ import annotations

from papers.page.paper import Paper, Statement

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
            "standard MCL cannot tell the position, theirs can",
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
            "told where it starts it tracks well here",
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
