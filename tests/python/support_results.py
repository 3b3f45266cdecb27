# SPDX-License-Identifier: Apache-2.0
"""Small runs made by hand, with every number known, for the tests of pictures and report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from locfuse.types import NANOSECONDS, Columns, Log, Outcomes, RunResult, Trajectory

# Seconds since 1970 times 1e9: what a recording has, and more than a double resolves to 1 ns.
EPOCH_NS = 1_700_000_000 * NANOSECONDS


def make_result(
    *,
    n: int = 200,
    anchors: Sequence[str] = ("A1", "A2", "A3", "A10"),
    rejected: Mapping[str, tuple[float, float]] | None = None,
    with_truth: bool = True,
    truth_heading: bool = True,
    error: tuple[float, float, float] = (0.05, -0.08, 0.02),
    sigma: tuple[float, float, float] = (0.1, 0.2, 0.05),
    config: Mapping[str, Any] | None = None,
    description: str = "",
    every_source: bool = False,
    seed: int = 7,
) -> RunResult:
    """Return a run along an ellipse, one range per anchor and 0.1 s.

    Parameters
    ----------
    n : int
        Estimates, 0.1 s apart from `EPOCH_NS`.
    anchors : sequence of str
        Names; the anchors stand on a ring around the path.
    rejected : mapping of anchor name to (begin, end)
        Seconds between which all ranges of that anchor are rejected, begin inclusive.
    with_truth, truth_heading : bool
    error : tuple of 3 floats
        Estimate minus truth, constant: metres, metres, radians.
    sigma : tuple of 3 floats
        What the estimator claims, constant and uncorrelated.
    config, description
        As in `RunResult` and `Log`.
    every_source : bool
        Also odometry, position fixes and poses.
    seed : int
        Of the NIS values, drawn from chi-square.

    Returns
    -------
    RunResult
    """
    rng = np.random.default_rng(seed)
    step = np.arange(n)
    stamp_ns = EPOCH_NS + step * (NANOSECONDS // 10)
    turn = 2.0 * np.pi * step / max(n, 1)
    true_position = np.column_stack([8.0 * np.cos(turn), 5.0 * np.sin(turn)])
    true_heading = np.mod(turn + 1.5 * np.pi, 2.0 * np.pi) - np.pi
    estimate = Trajectory(
        stamp_ns=stamp_ns,
        position=true_position + np.array(error[:2]),
        heading=np.mod(true_heading + error[2] + np.pi, 2.0 * np.pi) - np.pi,
        covariance=np.tile(np.diag(np.square(sigma)), (n, 1, 1)),
    )
    truth = None
    if with_truth:
        truth = Trajectory(stamp_ns, true_position, true_heading if truth_heading else None)

    bearing = 2.0 * np.pi * np.arange(len(anchors)) / max(len(anchors), 1)
    tables: dict[str, Columns] = {}
    if anchors:
        tables["anchors"] = {
            "anchor": np.array(anchors, dtype=np.str_),
            "x_m": 11.0 * np.cos(bearing),
            "y_m": 8.0 * np.sin(bearing),
            "z_m": np.full(len(anchors), 2.0),
        }

    sources = [("ranges", name, 1) for name in anchors]
    if every_source:
        sources += [("odometry", "", 0), ("positions", "", 2), ("poses", "", 3)]
    rows: dict[str, list[Any]] = {
        key: [] for key in ("stamp", "source", "anchor", "verdict", "nis", "dof", "reason")
    }
    bad = rejected or {}
    for k in range(n):
        for source, anchor, dof in sources:
            begin, end = bad.get(anchor or source, (0.0, 0.0))
            gated = begin <= k / 10 < end
            rows["stamp"].append(int(stamp_ns[k]))
            rows["source"].append(source)
            rows["anchor"].append(anchor)
            rows["verdict"].append("gated" if gated else "fused")
            nis = rng.chisquare(dof) if dof else np.nan
            rows["nis"].append(200.0 + nis if gated else nis)
            rows["dof"].append(dof)
            rows["reason"].append("NIS above the gate" if gated else "")
    verdict = np.array(rows["verdict"], dtype=np.str_)
    source_column = np.array(rows["source"], dtype=np.str_)
    nis_column = np.array(rows["nis"], dtype=np.float64)
    outcomes = Outcomes(
        stamp_ns=np.array(rows["stamp"], dtype=np.int64),
        source=source_column,
        tag=np.where(source_column == "ranges", "tag0", ""),
        anchor=np.array(rows["anchor"], dtype=np.str_),
        verdict=verdict,
        nis=nis_column,
        dof=np.array(rows["dof"], dtype=np.int64),
        log_likelihood=-0.5 * nis_column,
        residual=np.sqrt(nis_column),
        reason=np.array(rows["reason"], dtype=np.str_),
    )
    nees = float(np.sum(np.square(error) / np.square(sigma)))
    metrics: dict[str, Any] = {
        "position_rmse_m": float(np.hypot(*error[:2])) if with_truth else None,
        "position_p95_m": float(np.hypot(*error[:2])) if with_truth else None,
        "position_max_m": float(np.hypot(*error[:2])) if with_truth else None,
        "heading_rmse_deg": float(np.degrees(abs(error[2]))) if truth is not None else None,
        "nees_mean": nees if with_truth else None,
        "nees_dof": 3 if with_truth else None,
        "nees_in_band": 1.0 if with_truth else None,
        "nis_mean": {
            str(s): float(np.mean(nis_column[source_column == s]))
            for s in np.unique(source_column)
            if np.isfinite(nis_column[source_column == s]).any()
        },
        "counts": {
            str(s): {
                str(v): int(np.count_nonzero((source_column == s) & (verdict == v)))
                for v in np.unique(verdict[source_column == s])
            }
            for s in np.unique(source_column)
        },
        "duration_s": n / 10,
        "messages_per_second": 123456.0,
        "truth": "Compared with the true path on its own stamps; no alignment was applied.",
    }
    return RunResult(
        config=config if config is not None else {"name": "ellipse", "seed": seed},
        log=Log(tables=tables, description=description),
        estimate=estimate,
        truth=truth,
        outcomes=outcomes,
        metrics=metrics,
    )
