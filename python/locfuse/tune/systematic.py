# SPDX-License-Identifier: Apache-2.0
"""What no number of measurements shows, as odometry comes in steps and has noise."""

from __future__ import annotations

import math

import numpy as np

from locfuse.tune.problem import Found, Problem
from locfuse.tune.quantity import with_values
from locfuse.types import NANOSECONDS


def least_sigmas(problem: Problem, found: Found) -> dict[str, float]:
    """Return the sigma that some quantities have at least, beyond the likelihood's.

    Between two messages odometry is a straight line, so a latency is known to a part of their
    distance in time. A scale is found by motions with noise: it comes out too small by the share
    that the noise has in their squares over a second (errors in variables).
    """
    tables = [drive.log["odometry"] for drive in problem.drives if "odometry" in drive.log]
    if not tables:
        return {}
    period = float(np.median(np.concatenate([np.diff(t["stamp_ns"]) for t in tables])))
    late = period / NANOSECONDS / math.sqrt(12.0)
    least = {q.key: late for q in found.quantities if q.key.endswith(".latency_s")}
    wheels = with_values(problem.config, {**problem.fixed, **found.values}).estimator.odometry
    noise, squares = np.zeros(3), np.full(3, 1e-12)
    for drive in problem.drives:
        if drive.steps is not None:
            noise += drive.steps.table(wheels)["variance"].sum(axis=0)
            squares += np.sum(drive.steps.mean**2 * drive.steps.windows[:, None], axis=0)
    for key, axis in (("distance_scale", 0), ("turn_scale", 2)):
        least[f"estimator.odometry.{key}"] = float(noise[axis] / squares[axis])
    return least
