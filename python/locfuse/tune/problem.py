# SPDX-License-Identifier: Apache-2.0
"""The likelihood of recordings as a function of some keys of a configuration."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from locfuse import NumericalError
from locfuse.config.schema import RunConfig
from locfuse.tune.drive import (
    Compared,
    Drive,
    Ready,
    compared,
    key_of_messages,
    ready,
    robust,
    without_gates,
)
from locfuse.tune.maximize import Maximum, Variable, covariance, maximize, positive
from locfuse.tune.quantity import Quantity, with_values
from locfuse.types import NANOSECONDS, Columns, FloatArray, LogError, StampArray

_LEAST_MEASUREMENTS = 50
_BLOCK_S = 20.0  # errors of stretches so far apart are independent
_BLOCKS = (10, 100)
_KEPT = 4  # sets of messages that are kept for the next steps
_LOST = -20.0  # log-likelihood of a measurement that cannot be compared, as after a failure


@dataclass(frozen=True)
class Found:
    """The values at which the likelihood is largest, and how it bends there."""

    quantities: tuple[Quantity, ...]
    maximum: Maximum

    @property
    def value(self) -> float:
        """Log-likelihood of all measurements."""
        return self.maximum.value

    @property
    def information(self) -> FloatArray:
        """Minus the second derivatives, (k, k)."""
        return self.maximum.information

    @property
    def sigmas(self) -> FloatArray:
        """Sigma of each coordinate by those, (k,)."""
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(positive(self.information)))))

    @property
    def values(self) -> dict[str, float]:
        """Value of each key."""
        return {q.key: q.value(x) for q, x in zip(self.quantities, self.maximum.at.tolist(),
                                                  strict=True)}  # fmt: skip


class Problem:
    """Recordings, which of their measurements count, and what is held fixed.

    `part` 0 or 1 counts one half of each recording, None all.
    """

    def __init__(
        self,
        config: RunConfig,
        drives: Sequence[Drive],
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self.config = config
        self.drives = list(drives)
        self.fixed: dict[str, float] = {}
        self.part: int | None = None
        self.spacing_s = 0.0
        self._progress = progress
        self._runs = 0
        self._expected = 0
        first = self.compared(robust(config))
        self._kept = [{source: one.is_compared for source, one in each.items()} for each in first]
        self._early = self._of_the_first_second(first)
        self._of_outlier = [{source: one.at_limit for source, one in each.items()}
                            for each in first]  # fmt: skip
        self._arrange()

    @property
    def count(self) -> int:
        """Number of measurements that count."""
        return sum(int(rows.sum()) for each in self._kept for rows in each.values())

    def check(self) -> None:
        """Raise LogError where a recording has next to nothing to compare."""
        for index, kept in enumerate(self._kept):
            count = sum(int(rows.sum()) for rows in kept.values())
            if count < _LEAST_MEASUREMENTS:
                several = len(self.drives) > 1
                which = f"log {index + 1} of {len(self.drives)}" if several else "the log"
                raise LogError(f"{which} has {count} measurements that the estimator can compare "
                               f"with what it expects; tune needs {_LEAST_MEASUREMENTS}"
                               )  # fmt: skip

    def compared(self, config: RunConfig) -> list[dict[str, Compared]]:
        """Fuse all recordings with a configuration."""
        return [compared(config, drive) for drive in self.drives]

    def leave_outliers_out(self, values: Mapping[str, float]) -> tuple[int, float]:
        """Count what fits with these values, and nothing else.

        Returns how many have changed, and the score of these values with robust noise.
        """
        found = self.compared(robust(self.with_values(values)))
        kept = [{source: one.fits for source, one in each.items()} for each in found]
        self._early = self._of_the_first_second(found)
        changed = sum(int(np.sum(rows != before[source])) for each, before
                      in zip(kept, self._kept, strict=True)
                      for source, rows in each.items())  # fmt: skip
        self._kept = kept
        self._arrange()
        return changed, self._score(found)

    @staticmethod
    def _of_the_first_second(
        found: Sequence[Mapping[str, Compared]],
    ) -> list[dict[str, NDArray[np.bool_]]]:
        """Return which rows are fused before those that are compared."""
        return [{source: one.is_usable & ~one.is_late for source, one in each.items()}
                for each in found]  # fmt: skip

    def score(self, config: RunConfig) -> float:
        """Return the log-likelihood of all measurements with a configuration.

        One that does not fit counts as one at the limit did with the configuration as it was.
        """
        return self._score(self.compared(config))

    def _score(self, found: Sequence[Mapping[str, Compared]]) -> float:
        total = 0.0
        for each, least in zip(found, self._of_outlier, strict=True):
            for source, one in each.items():
                known = one.is_compared & np.isfinite(least[source])
                likelihood = np.where(one.fits, one.log_likelihood, least[source])
                total += float(likelihood[known].sum())
        return total

    def find(
        self,
        quantities: Sequence[Quantity],
        begin: Mapping[str, float] | None = None,
        information: FloatArray | None = None,
    ) -> Found:
        """Return where the likelihood is largest; `begin` has values to begin with."""
        begin = begin or {}
        variables = [_begun(q, begin) for q in quantities]
        count = len(quantities)
        self._expected = self._runs + 6 * count + count * count
        maximum = maximize(lambda points: self._likelihoods(quantities, points), variables,
                           information)  # fmt: skip
        return Found(tuple(quantities), maximum)

    def covariance(self, found: Found, *, anew: bool = False) -> FloatArray:
        """Return the covariance of the coordinates of what was found, see `maximize.covariance`."""
        variables = [_begun(q, found.values) for q in found.quantities]
        return covariance(lambda points: self._likelihoods(found.quantities, points), variables,
                          found.maximum, self._block, anew=anew)  # fmt: skip

    @property
    def spaced_count(self) -> int:
        """Number of those that are far enough apart."""
        return len(self._block)

    def space(self, spacing_s: float) -> None:
        """Compare measurements of one anchor, landmark or tag so far apart only."""
        self.spacing_s = spacing_s
        self._arrange()

    def spaced(self) -> list[Drive]:
        """Return the recordings with measurements so far apart only, outliers with them."""
        return [drive.rows({source: spaced(drive.log[source], np.full(len(rows), True),
                                           self.spacing_s) for source, rows in kept.items()})
                for drive, kept in zip(self.drives, self._kept, strict=True)]  # fmt: skip

    def may_vanish(self, found: Found, which: int, drop: float) -> bool:
        """Return whether a quantity at its lower end costs less than so much likelihood."""
        at = found.maximum.at.copy()
        at[which] = found.quantities[which].variable.low
        return found.value - float(self._likelihoods(found.quantities, [at])[0].sum()) < drop

    @property
    def student(self) -> float:
        """Half the width of a 95 % interval over its sigma, by Student's t of the stretches."""
        return 1.96 + 2.4 / max(int(self._block.max()), 1)

    def with_values(self, values: Mapping[str, float | str]) -> RunConfig:
        """Return the configuration with values, and those that are held fixed."""
        return with_values(self.config, {**self.fixed, **values})

    def is_second_half(self, drive: int, stamp_ns: StampArray) -> NDArray[np.bool_]:
        """Return which stamps are in the second half of a recording."""
        return np.asarray(stamp_ns > self._middle_ns[drive])

    def _arrange(self) -> None:
        """Cut the recordings down to what counts."""
        blocks, halves, done = [], [], 0
        self._trimmed: list[Drive] = []
        self._counts: list[int] = []
        self._made: dict[object, Ready] = {}
        self._middle_ns: list[int] = []
        for drive, fitting, early in zip(self.drives, self._kept, self._early, strict=True):
            kept = {source: rows & spaced(drive.log[source], rows, self.spacing_s)
                    for source, rows in fitting.items()}  # fmt: skip
            # The first second is fused, and not compared.
            begin = drive.start.stamp + NANOSECONDS
            rows = {source: one | early[source] for source, one in kept.items()}
            self._trimmed.append(drive.rows(rows))
            stamps = [drive.log[source]["stamp_ns"][kept[source]] for source in sorted(kept)]
            stamp = np.concatenate([np.zeros(0, np.int64), *stamps])
            since = (stamp - begin) / NANOSECONDS
            length = max(float(since.max(initial=0.0)), 1e-3) * (1.0 + 1e-9)
            count = int(np.clip(length / _BLOCK_S, *_BLOCKS))
            blocks.append(done + np.floor(since / length * count).astype(np.intp))
            halves.append((since > 0.5 * length).astype(np.intp))
            done += count
            self._counts.append(len(stamp))
            self._middle_ns.append(begin + round(0.5 * length * NANOSECONDS))
        self._block: NDArray[np.intp] = np.concatenate(blocks)
        self._half: NDArray[np.intp] = np.concatenate(halves)

    def _ready(self, config: RunConfig, index: int) -> Ready:
        """Return the messages of a drive, which most steps of a search have in common."""
        drive = self._trimmed[index]
        key = index, key_of_messages(config)
        made = self._made.get(key)
        if made is None:
            made = ready(config, drive, by_steps=True)
            self._made[key] = made
            for old in list(self._made)[: -_KEPT * len(self._trimmed)]:
                self._made.pop(old, None)
        return made

    def _likelihoods(
        self, quantities: Sequence[Quantity], points: Sequence[FloatArray]
    ) -> list[FloatArray]:
        def at(point: FloatArray) -> FloatArray:
            values = {q.key: q.value(float(x)) for q, x in zip(quantities, point, strict=True)}
            config = without_gates(self.with_values(values))
            parts = []
            for index, drive in enumerate(self._trimmed):
                try:
                    found = compared(config, drive, self._ready(config, index))
                except NumericalError:  # sigmas that no filter can do with
                    parts.append(np.full(self._counts[index], _LOST))
                    continue
                parts += [found[source].log_likelihood[found[source].is_late]
                          for source in sorted(found)]  # fmt: skip
            likelihood = np.concatenate(parts)
            likelihood = np.where(np.isfinite(likelihood), likelihood, _LOST)
            return likelihood if self.part is None else likelihood * (self._half == self.part)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = list(pool.map(at, points))
        self._runs += len(points)
        if self._progress is not None:
            self._progress(self._runs, max(self._expected, self._runs))
        return found


def spaced(table: Columns, rows: NDArray[np.bool_], spacing_s: float) -> NDArray[np.bool_]:
    """Return which rows are so far apart in time, of those of one anchor, landmark or tag each.

    Rows of one stamp stay together; rows that do not count have no say.
    """
    if spacing_s == 0.0:
        return np.full(len(rows), True)
    stamp, spacing = table["stamp_ns"], round(spacing_s * NANOSECONDS)
    of = [np.unique(table[name], return_inverse=True)[1] for name in ("tag", "anchor", "landmark")
          if name in table]  # fmt: skip
    whose = np.unique(np.column_stack([np.zeros(len(stamp), np.intp), *of]), axis=0,
                      return_inverse=True)[1].ravel()  # fmt: skip
    found = np.full(len(stamp), False)
    last: dict[int, int] = {}
    for row in np.flatnonzero(rows)[np.argsort(stamp[rows], kind="stable")].tolist():
        at, name = int(stamp[row]), int(whose[row])
        if at - last.get(name, at - spacing) in range(1, spacing):
            continue
        last[name] = at
        found[row] = True
    return found


def _begun(quantity: Quantity, begin: Mapping[str, float]) -> Variable:
    variable = quantity.variable
    if quantity.key not in begin:
        return variable
    return replace(variable, value=quantity.coordinate(begin[quantity.key]))
