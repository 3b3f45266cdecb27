# SPDX-License-Identifier: Apache-2.0
"""Summary of a sweep: each score over all trials and by varied key, with confidence intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.consistency import PROBABILITY, band
from locfuse.eval.intervals import mean_interval, median_interval, share_interval
from locfuse.sweep.table import Trials
from locfuse.sweep.trial import COVERAGE, NIS, SCORES
from locfuse.sweep.vary import Axis
from locfuse.types import FloatArray

SLICES = 8  # of a key whose values are drawn, each with equally many trials
MIN_IN_SLICE = 6  # fewer have no interval of their median
MAX_ERRORS = 10  # distinct errors that are listed
BY_KEY = ("position_rmse_m", "position_max_m", "heading_rmse_deg", "nees_mean", *NIS, "nll",
          "recover_s")  # fmt: skip


@dataclass(frozen=True)
class Group:
    """Trials of about one value of a key.

    `low` and `high` are the smallest and largest value of a slice; both are the value where it is a
    number, else NaN. `rows` are the indices of its trials.
    """

    axis: Axis
    label: str
    low: float
    high: float
    rows: NDArray[np.intp]


@dataclass(frozen=True)
class NeesBand:
    """Mean NEES of all trials, at instants from the first to the last stamp that was compared.

    `mean` has shape (instants,); `low` and `high` are the two-sided 95 % band of each, if the
    trials are consistent.
    """

    mean: FloatArray
    low: float
    high: float
    dof: int
    trials: int

    @property
    def inside(self) -> float:
        """Return the share of instants inside the band."""
        return float(np.mean((self.mean >= self.low) & (self.mean <= self.high)))


def groups_of(trials: Trials, axis: Axis) -> list[Group]:
    """Return the trials by the values of a key; values that are drawn in slices of equal count."""
    column = trials[axis.key]
    if axis.values:
        cells = dict.fromkeys(axis.cell(value) for value in axis.values)
        return [_group(axis, cell, np.flatnonzero(column == cell)) for cell in cells]
    order = np.argsort(column, kind="stable")
    count = min(SLICES, max(len(order) // MIN_IN_SLICE, 1))
    return [
        Group(axis, f"{column[rows[0]]:.4g} to {column[rows[-1]]:.4g}", float(column[rows[0]]),
              float(column[rows[-1]]), rows)
        for rows in np.array_split(order, count)
        if len(rows)
    ]  # fmt: skip


def _group(axis: Axis, cell: int | float | str, rows: NDArray[np.intp]) -> Group:
    if isinstance(cell, str):
        return Group(axis, cell, np.nan, np.nan, rows)
    return Group(axis, f"{cell:.6g}", float(cell), float(cell), rows)


def nees_band(trials: Trials) -> NeesBand | None:
    """Return the mean NEES over trials; None where no trial has one, or their components differ."""
    known = np.isfinite(trials["nees_at"]).all(axis=1) & np.isfinite(trials["nees_dof"])
    dof = np.unique(trials["nees_dof"][known])
    if len(dof) != 1:
        return None
    n, count = int(dof[0]), int(known.sum())
    low, high = band(n, count)
    return NeesBand(trials["nees_at"][known].mean(axis=0), low, high, n, count)


def calibration(trials: Trials) -> list[dict[str, float]]:
    """Return, for each nominal level, the share of errors inside, with the interval over trials."""
    found = []
    for name, level in COVERAGE.items():
        shares = known(trials, name)
        if len(shares):
            low, high = mean_interval(shares)
            share = float(shares.mean())
            found.append({"level": level, "share": share, "low": low, "high": high})
    return found


def known(trials: Trials, name: str) -> FloatArray:
    """Return the values of a score where it is known."""
    column: FloatArray = trials[name]
    return column[np.isfinite(column)]


def score(values: FloatArray) -> dict[str, float | int | None]:
    """Return the statistics of a score over trials.

    `values` (n,) are finite, n >= 1. The keys: ``n``; ``mean`` and ``median``, each with ``_low``
    and ``_high`` of its 95 % interval (None for a median of fewer than six); ``p05``, ``p95``,
    ``min``, ``max`` of the values.
    """
    mean_low, mean_high = mean_interval(values)
    of_median = median_interval(values)
    p05, median, p95 = np.quantile(values, [0.05, 0.5, 0.95]).tolist()
    return {
        "n": len(values),
        "mean": float(values.mean()),
        "mean_low": mean_low,
        "mean_high": mean_high,
        "median": median,
        "median_low": None if of_median is None else of_median[0],
        "median_high": None if of_median is None else of_median[1],
        "p05": p05,
        "p95": p95,
        "min": float(values.min()),
        "max": float(values.max()),
    }


def summarize(trials: Trials) -> dict[str, Any]:
    """Return the summary of a sweep, ready for JSON.

    The keys: ``trials``; ``failed`` (``count``, ``share`` with its exact interval, ``errors``: the
    most frequent ones); ``scores`` by name, as `score`, those that any trial has; ``calibration``;
    ``nees``: its band and which share of instants is inside; ``by_key``: failures and the most
    important scores for each value of a varied key, or each slice of the values drawn.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> from locfuse.config.load import parse_config
    >>> from locfuse.sweep import run_trials
    >>> room = parse_config({"simulation": {"duration_s": 5}})
    >>> with ThreadPoolExecutor(1) as pool:
    ...     found = summarize(run_trials(room, 3, executor=pool))
    >>> found["trials"], found["failed"]["count"], found["scores"]["position_rmse_m"]["n"]
    (3, 0, 3)
    """
    nees = nees_band(trials)
    errors = Counter(trials["error"][trials.failed].tolist()).most_common(MAX_ERRORS)
    return {
        "trials": len(trials),
        "interval": PROBABILITY,
        "failed": {**_failed(trials), "errors": dict(errors)},
        "scores": _scores(trials, SCORES),
        "calibration": calibration(trials),
        "nees": None
        if nees is None
        else {"dof": nees.dof, "trials": nees.trials, "mean": nees.mean.tolist(),
              "low": nees.low, "high": nees.high, "inside": nees.inside},
        "by_key": {axis.key: [_of(trials, group) for group in groups_of(trials, axis)]
                   for axis in trials.axes},
    }  # fmt: skip


def _of(trials: Trials, group: Group) -> dict[str, Any]:
    some = trials.some(group.rows)
    value: dict[str, Any] = {"value": group.label}
    if np.isfinite(group.low):
        value |= {"low": group.low, "high": group.high}
    return {**value, "trials": len(some), "failed": _failed(some), "scores": _scores(some, BY_KEY)}


def _scores(trials: Trials, names: Sequence[str]) -> dict[str, Any]:
    values = {name: known(trials, name) for name in names}
    return {name: score(found) for name, found in values.items() if len(found)}


def _failed(trials: Trials) -> dict[str, Any]:
    count = int(trials.failed.sum())
    if len(trials) == 0:
        return {"count": 0, "share": None, "low": None, "high": None}
    low, high = share_interval(count, len(trials))
    return {"count": count, "share": count / len(trials), "low": low, "high": high}
