# SPDX-License-Identifier: Apache-2.0
"""Distributes the trials of a sweep in batches and collects their rows."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent import futures
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from locfuse.config.schema import RunConfig
from locfuse.io.whole import alone_in
from locfuse.sweep.table import Folder, Trials, trials_of
from locfuse.sweep.trial import Row, Trial, Work, empty_row, run_batch
from locfuse.sweep.vary import Axis, Values, as_written, axes_of, with_values
from locfuse.sweep.workers import ProcessPool, one_thread_each, processors
from locfuse.types import ConfigError, words

BATCH_S = 1.0  # duration of a batch; large against the milliseconds of a scheduler
MAX_IN_BATCH = 64
AHEAD = 2  # batches per worker: one running, one waiting
TRIES = 2  # runs of a trial alone before it is blamed for the end of its workers

Progress = Callable[[int, int], None]


def run_trials(
    config: RunConfig,
    trials: int,
    vary: Mapping[str, Values] | None = None,
    *,
    executor: futures.Executor | None = None,
    workers: int | None = None,
    base: Path | None = None,
    out: Path | None = None,
    recovered_m: float | None = None,
    progress: Progress | None = None,
) -> Trials:
    """Run a configuration many times, each time with another seed and other values.

    Trial k has the seed of the configuration plus k, and draws its values by k: the table does not
    depend on the executor, the number of workers or the order in which they finish. Every value
    is checked before the first trial starts.

    Parameters
    ----------
    config : RunConfig
    trials : int
        Number of trials. Lists and grids of several keys are combined and taken in turn.
    vary : mapping of dotted path to values, optional
        As `locfuse.sweep.vary.axes_of` takes them: ``{"simulation.ranges.sigma_m": "0.05..0.5"}``.
    executor : concurrent.futures.Executor, optional
        Runs the trials, e.g. of `dask_cluster`. By default a pool of new processes with one
        thread each; a script that uses it needs ``if __name__ == "__main__":``.
    workers : int, optional
        Processes of that pool, or of the executor; by default one for each processor.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    out : Path, optional
        Folder for the table, written batch by batch; trials already in it are not run again.
        Needs pyarrow.
    recovered_m : float, optional
        Position error [m] below which a trial has recovered from a fault; by default inside the
        ellipse that should hold 99 % of the errors.
    progress : callable, optional
        Called with (trials done, all trials).

    Returns
    -------
    Trials
        A failed trial is a row with its error.

    Raises
    ------
    ConfigError
        If a key or a value is not allowed, or `out` holds another sweep, or is being written.
    OSError
        If the executor stops. Finished trials are in `out`.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> from locfuse.config.load import parse_config
    >>> room = parse_config({"simulation": {"duration_s": 5}})
    >>> with ThreadPoolExecutor(1) as pool:
    ...     found = run_trials(room, 4, {"simulation.ranges.rate_hz": [2, 10]}, executor=pool)
    >>> found["simulation.ranges.rate_hz"].tolist()
    [2, 10, 2, 10]
    >>> bool((found["position_rmse_m"] < 0.1).all())
    True
    """
    for name, value in (("trials", trials), ("workers", 1 if workers is None else workers)):
        if value < 1:
            raise ConfigError(f"{name} is {value}, expected at least 1")
    if recovered_m is not None and not recovered_m > 0.0:
        raise ConfigError(f"recovered_m is {recovered_m}, expected > 0")
    axes = axes_of(config, vary or {})
    work = _work(config, axes, base, recovered_m)
    planned = plan(config, axes, trials)
    _check(config, work.data, axes, planned)
    if out is None:
        return trials_of(_rows(work, planned, None, executor, workers, progress), axes)
    with alone_in(out):
        folder = Folder(out, _about(config, work, trials), axes)
        rows = _rows(work, planned, folder, executor, workers, progress)
        folder.put_together()
    return trials_of(rows, axes)


def _rows(
    work: Work,
    planned: Sequence[Trial],
    folder: Folder | None,
    executor: futures.Executor | None,
    workers: int | None,
    progress: Progress | None,
) -> list[Row]:
    """Return the rows of all trials, of which those of the folder are there already."""
    rows = [] if folder is None else folder.rows
    done = {row["trial"] for row in rows}
    count = len(done)

    def keep(found: Sequence[Row]) -> None:
        nonlocal count
        rows.extend(found)
        count += len(found)
        if folder is not None:
            folder.add(found)
        if progress is not None:
            progress(count, len(planned))

    keep([])
    pending = deque(trial for trial in planned if trial.index not in done)
    if executor is not None:
        size = workers or getattr(executor, "_max_workers", None) or processors()
        _Submission(work, executor, size, pending, keep).run()
    elif pending:
        size = min(workers or processors(), len(pending))
        with one_thread_each():
            _OnProcesses(work, size, pending, keep).run()
    return rows


def plan(config: RunConfig, axes: Sequence[Axis], trials: int) -> list[Trial]:
    """Return seed and values of each trial.

    Raises ConfigError if there are more combinations of lists and grids than trials.
    """
    listed = [axis for axis in axes if axis.values]
    combinations = math.prod(len(axis.values) for axis in listed)
    if combinations > trials:
        raise ConfigError(
            f"the values make {combinations} combinations, which is more than {trials} trials; ask "
            "for at least one each"
        )
    of_grid = list(product(*(axis.values for axis in listed)))
    found = []
    for k in range(trials):
        taken = iter(of_grid[k % combinations])
        values = tuple(
            next(taken) if axis.values else axis.draw(config.seed, k, place)
            for place, axis in enumerate(axes)
        )
        found.append(Trial(k, config.seed + k, values))
    return found


def _work(
    config: RunConfig, axes: tuple[Axis, ...], base: Path | None, recovered_m: float | None
) -> Work:
    from locfuse import __version__

    where = (Path() if base is None else base).resolve()
    return Work(as_written(config), axes, str(where), recovered_m, __version__)


def _check(
    config: RunConfig, data: dict[str, Any], axes: Sequence[Axis], trials: Iterable[Trial]
) -> None:
    """Raise ConfigError if values of a trial, or the limits of drawn values, are not allowed."""
    if config.simulation is None and config.log is None:
        raise ConfigError("the config names no 'log' and no 'simulation'; give one")
    for axis in axes:
        if not axis.values:
            for end in axis.ends:
                with_values(config, data, [axis], [end])
    for values in {repr(trial.values): trial.values for trial in trials}.values():
        with_values(config, data, axes, values)


def _about(config: RunConfig, work: Work, trials: int) -> dict[str, Any]:
    """Return what identifies a sweep."""
    reads = config.simulation is None or (
        config.simulation.map is not None and config.simulation.map.file is not None
    )
    return {
        "format": 1,
        "version": work.version,
        "trials": trials,
        "vary": {
            axis.key: list(axis.values)
            or {"low": axis.low, "high": axis.high, "log": axis.log, "whole": axis.whole}
            for axis in work.axes
        },
        "recovered_m": work.recovered_m,
        "base": work.base if reads else None,
        "config": config.model_dump(mode="json"),
    }


@dataclass
class _Submission:
    """Submits trials to an executor until all are done."""

    work: Work
    executor: futures.Executor
    size: int
    pending: deque[Trial]
    keep: Callable[[Sequence[Row]], None]
    flying: dict[futures.Future[list[Row]], list[Trial]] = field(default_factory=dict)
    suspects: deque[Trial] = field(default_factory=deque)
    tries: dict[int, int] = field(default_factory=dict)

    def run(self) -> None:
        """Return when no trial is left."""
        try:
            while self.pending or self.suspects or self.flying:
                self._hand_out()
                done, _ = futures.wait(self.flying, return_when=futures.FIRST_COMPLETED)
                for future in done:
                    batch = self.flying.pop(future, None)
                    if batch is not None:  # else a new pool runs its trials as suspects
                        self._take(future, batch)
        finally:
            for future in self.flying:
                future.cancel()

    def _hand_out(self) -> None:
        # After a worker has ended, the suspects run one at a time to find the one that ended it.
        most = 1 if self.suspects else AHEAD * self.size
        while (self.pending or self.suspects) and len(self.flying) < most:
            queue = self.suspects or self.pending
            batch = [queue.popleft() for _ in range(self._batch_size())]
            try:
                future = self.executor.submit(run_batch, self.work, batch, BATCH_S)
            except futures.BrokenExecutor:
                queue.extendleft(reversed(batch))
                self._renew()
                continue
            self.flying[future] = batch

    def _batch_size(self) -> int:
        """Return the batch size: smaller towards the end, so that all workers finish together."""
        if self.suspects:
            return 1
        return max(1, min(MAX_IN_BATCH, len(self.pending) // (2 * AHEAD * self.size)))

    def _take(self, future: futures.Future[list[Row]], batch: list[Trial]) -> None:
        try:
            rows = future.result()
        except ConfigError:
            raise
        except futures.CancelledError:
            raise OSError("the executor cancelled its work; run the same again to resume") from None
        except Exception as error:
            self._suspect(batch, error)
            if isinstance(error, futures.BrokenExecutor):
                self._renew()
            return
        self.pending.extendleft(reversed(batch[len(rows) :]))  # not run in the time of the batch
        self.keep(rows)

    def _suspect(self, batch: list[Trial], error: Exception) -> None:
        """Try again what may have ended a worker; a trial that ends one alone gets an error."""
        if len(batch) > 1:
            self.suspects.extend(batch)
            return
        for trial in batch:
            self.tries[trial.index] = self.tries.get(trial.index, 0) + 1
            if self.tries[trial.index] < TRIES:
                self.suspects.append(trial)
                continue
            said = words(error)
            row = empty_row(self.work.axes, trial)
            self.keep([{**row, "error": f"its worker ended: {type(error).__name__}: {said}"}])

    def _renew(self) -> None:
        raise OSError("the executor is broken: a worker ended; run the same again to resume")


class _OnProcesses(_Submission):
    """The same with its own pool, which is replaced when one of its processes has ended."""

    def __init__(
        self, work: Work, size: int, pending: deque[Trial], keep: Callable[[Sequence[Row]], None]
    ) -> None:
        self._pool = ProcessPool(size)
        super().__init__(work, self._pool, size, pending, keep)

    def run(self) -> None:
        """Return when no trial is left."""
        try:
            super().run()
        except BaseException:  # an interrupt must not wait for running trials either
            self._pool.end()
            raise
        self._pool.shutdown()

    def _renew(self) -> None:
        self.suspects.extend(trial for batch in self.flying.values() for trial in batch)
        self.flying.clear()
        self._pool.end()
        self._pool = ProcessPool(self.size)
        self.executor = self._pool
