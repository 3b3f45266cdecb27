# SPDX-License-Identifier: Apache-2.0
"""How far apart in time measurements of one source are independent."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from operator import attrgetter

import numpy as np

from locfuse.tune.problem import Found, Problem

# Seconds between measurements of one anchor, landmark or tag that are compared; 0: all.
SPACINGS_S = (0.0, 1.0, 3.0, 10.0, 30.0)
_LEAST = 100  # measurements that must be left
_LARGER = 1.2  # a sigma that is larger by less is the same
_SIGMAS = 4.0
_SMALLER = 1.3
_SIGMAS_OF_WHEELS = 2.5
_KNOWN = 0.4  # sigma of the logarithm of a sigma that is known at all

# Source, column of its distance, keys of the absolute and of the relative part of a sigma.
_PARTS = (
    ("ranges", "range_m", "estimator.range.sigma_m", "estimator.range.sigma_relative"),
    ("landmark_sightings", "range_m", "estimator.landmark.sigma_range_m",
     "estimator.landmark.sigma_range_relative"),
    ("landmark_sightings", None, "estimator.landmark.sigma_bearing_rad", None),
    ("positions", None, "estimator.position.sigma_m", None),
    ("positions", None, "estimator.position.least_sigma_m", None),
    ("headings", None, "estimator.heading.sigma_rad", None),
    ("headings", None, "estimator.heading.least_sigma_rad", None),
    ("altitudes", None, "estimator.air.altitude.sigma_m", None),
)  # fmt: skip


def enough(problem: Problem) -> bool:
    """Return whether enough measurements are so far apart."""
    return problem.spaced_count >= _LEAST


def chosen(problem: Problem, found: Mapping[float, Found], counts: Mapping[float, int]) -> float:
    """Return the least spacing beyond which no sigma of a sensor grows and none of wheels shrinks.

    Errors that are correlated over seconds look small to measurements that follow closely: an
    estimator that believes in them takes the error for motion.
    """
    sizes = {spacing: dict(_sizes(problem, one)) for spacing, one in found.items()}
    for spacing in sorted(sizes):
        if all(later <= spacing or not (_grows(sizes[spacing], sizes[later], counts[later])
                                        or _shrinks(found[spacing], found[later]))
               for later in sizes):  # fmt: skip
            return spacing
    raise AssertionError("the largest spacing has no larger one")


def _grows(now: Mapping[str, float], later: Mapping[str, float], count: int) -> bool:
    least = max(math.log(_LARGER), _SIGMAS / math.sqrt(2.0 * count))
    return any(later[key] - now[key] > least for key in now)


def _shrinks(now: Found, later: Found) -> bool:
    sigmas = later.sigmas
    for i, q in enumerate(later.quantities):
        if q.key.startswith("estimator.odometry.sigma_") and sigmas[i] < _KNOWN:
            change = math.log(now.values[q.key] / later.values[q.key])
            if change > max(math.log(_SMALLER), _SIGMAS_OF_WHEELS * sigmas[i]):
                return True
    return False


def _sizes(problem: Problem, found: Found) -> Iterator[tuple[str, float]]:
    """Yield the logarithm of each sigma, at the median distance."""
    for source, column, key, relative in _PARTS:
        if key not in found.values:
            continue
        sigma = found.values[key]
        if column is not None and relative is not None:
            share = found.values.get(relative, float(attrgetter(relative)(problem.config)))
            tables = [drive.log.tables.get(source, {}).get(column, ()) for drive in problem.drives]
            distances = np.concatenate([np.asarray(t, float) for t in tables])
            sigma = math.hypot(sigma, share * float(np.nanmedian(distances)))
        yield key, math.log(sigma)
