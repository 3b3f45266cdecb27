# SPDX-License-Identifier: Apache-2.0
"""How well measurements are predicted that were not used, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.tune.drive import Compared, compared, robust
from locfuse.tune.problem import Problem
from locfuse.tune.quantity import Quantity

_TOLERANCE = 1.05


@dataclass(frozen=True)
class Fit:
    """How one source fits: mean NIS per row of what fits, share of outliers, `nats` a measurement.

    The last is the mean log-likelihood of measurements that fit in both cases.
    """

    nis: float
    outliers: float
    nats: float


@dataclass(frozen=True)
class HeldOut:
    """Measurements of a source, each predicted with what the other half of its recording says."""

    source: str
    count: int
    before: Fit
    after: Fit


@dataclass(frozen=True)
class Outliers:
    """Share of the measurements of a source that do not fit, and of those that are too long."""

    source: str
    count: int
    share: float
    too_long: float


def outliers(problem: Problem, values: Mapping[str, float]) -> tuple[Outliers, ...]:
    """Return the outliers of each source, with what was found."""
    tried = problem.compared(robust(problem.with_values(values)))
    found = []
    for source in _sources(tried):
        there = [one[source] for one in tried if source in one]
        compared = np.concatenate([one.is_compared for one in there])
        out = np.concatenate([one.is_compared & ~one.fits for one in there])
        residual = np.concatenate([one.residual for one in there])[out]
        longer = float(np.mean(residual > 0.0)) if len(residual) else 0.5
        found.append(Outliers(source, int(compared.sum()), float(out.sum() / compared.sum()),
                              longer))  # fmt: skip
    return tuple(found)


def held_out(
    problem: Problem,
    quantities: Sequence[Quantity],
    values: Mapping[str, float],
    others: Mapping[str, float | str],
) -> tuple[HeldOut, ...]:
    """Predict each half of the recordings with what the other half says, and `others` as given."""
    drives = problem.spaced()
    before = [compared(problem.config, drive) for drive in drives]
    halves = []
    for part in (0, 1):
        problem.part = part
        found = problem.find(quantities, values)
        config = problem.with_values({**found.values, **others})
        halves.append([compared(config, drive) for drive in drives])
    problem.part = None
    results = []
    for source in _sources(before):
        pairs = []
        for drive, old in enumerate(before):
            if source not in old:
                continue
            second = problem.is_second_half(drive, old[source].stamp_ns)
            for part in (0, 1):
                new, rows = halves[part][drive][source], second != bool(part)
                pairs.append((_rows(old[source], rows), _rows(new, rows)))
        olds, news = ([pair[k] for pair in pairs] for k in (0, 1))
        both = [old.fits & new.fits for old, new in pairs]
        count = sum(int(old.is_compared.sum()) for old in olds)
        results.append(HeldOut(source, count, _fit(olds, both), _fit(news, both)))
    return tuple(results)


def margin_of(held: Sequence[HeldOut]) -> float:
    """Return the factor of all sigmas that makes up for a mean NIS beyond 1; 1 if it is not."""
    count = sum(one.count for one in held)
    nis = sum(one.count * one.after.nis for one in held) / max(count, 1)
    return float(np.sqrt(nis)) if nis > _TOLERANCE else 1.0


def _sources(compared: Sequence[Mapping[str, Compared]]) -> list[str]:
    return sorted({source for each in compared for source, one in each.items()
                   if one.is_compared.any()})  # fmt: skip


def _rows(compared: Compared, rows: NDArray[np.bool_]) -> Compared:
    return Compared(*(getattr(compared, name)[rows] for name in compared.__dataclass_fields__))


def _fit(parts: Sequence[Compared], both: Sequence[NDArray[np.bool_]]) -> Fit:
    fits = np.concatenate([one.fits for one in parts])
    nis = np.concatenate([one.nis / np.maximum(one.dof, 1) for one in parts])
    there = sum(int(one.is_compared.sum()) for one in parts)
    nats = np.concatenate([one.log_likelihood for one in parts])[np.concatenate(list(both))]
    return Fit(float(nis[fits].mean()) if fits.any() else np.nan,
               float(1.0 - fits.sum() / max(there, 1)),
               float(nats.mean()) if len(nats) else np.nan)  # fmt: skip
