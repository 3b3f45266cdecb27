# SPDX-License-Identifier: Apache-2.0
"""What no number of measurements shows, as odometry comes in steps whose noise is not small."""

from __future__ import annotations

import math

import numpy as np

from locfuse.tune.problem import Found, Problem
from locfuse.types import NANOSECONDS, Columns


def least_sigmas(problem: Problem, found: Found) -> dict[str, float]:
    """Return the sigma that each quantity has at least, beyond the likelihood's.

    Between two messages odometry is a straight line, so a latency is known to a part of their
    distance in time. Where the noise of a step is as large as the step, a scale comes out too
    small, as any factor of what is known badly (docs/tune.md).
    """
    tables = [drive.log["odometry"] for drive in problem.drives if "odometry" in drive.log]
    if not tables:
        return {}
    least: dict[str, float] = {}
    period = float(np.median(np.concatenate([np.diff(t["stamp_ns"]) for t in tables])))
    late = period / NANOSECONDS / math.sqrt(12.0)
    for q in found.quantities:
        if q.key.endswith(".latency_s"):
            least[q.key] = late
    wheels = problem.config.estimator.odometry

    def value(name: str) -> float:
        key = f"estimator.odometry.{name}"
        return float(found.values.get(key, problem.fixed.get(key, getattr(wheels, name))))

    for table in tables:
        distance, turn = _steps(table)
        along = value("sigma_longitudinal_per_sqrt_m") ** 2 * distance.sum()
        about = (value("sigma_heading_per_sqrt_m") ** 2 * distance.sum()
                 + value("sigma_heading_per_sqrt_rad") ** 2 * turn.sum())  # fmt: skip
        for key, noise, steps in (("distance_scale", along, distance), ("turn_scale", about, turn)):
            share = noise / max(float(np.sum(steps**2)), 1e-12)
            ratio = 1.0 / math.sqrt(max(share, 1e-12))
            least[f"estimator.odometry.{key}"] = _folded(ratio)
    return least


def _folded(ratio: float) -> float:
    """Return by what share the mean of |x| is beyond that of a Gaussian x.

    `ratio` is its mean over its sigma.
    """
    tail = 0.5 * math.erfc(ratio / math.sqrt(2.0))
    density = math.exp(-0.5 * ratio**2) / math.sqrt(2.0 * math.pi)
    return 2.0 * (density / ratio - tail)


def _steps(table: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Return distance and turn of each row of odometry."""
    if "dx_m" in table:
        return np.hypot(table["dx_m"], table["dy_m"]), np.abs(table["dheading_rad"])
    seconds = np.diff(table["stamp_ns"], append=table["stamp_ns"][-1:]) / NANOSECONDS
    left = table.get("v_left_mps", 0.0)
    return np.hypot(table["v_mps"], left) * seconds, np.abs(table["omega_radps"]) * seconds
