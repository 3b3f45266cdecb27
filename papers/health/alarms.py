# SPDX-License-Identifier: Apache-2.0
"""Alarms that are missed, false or late, and errors beyond their protection level."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.verdicts import series_of
from locfuse.types import NANOSECONDS, FloatArray
from papers.health.scenarios import LIMIT_M, Drive

MIN_LOSS_S = 0.5  # shorter is none
PATIENCE_S = 10.0  # an alarm later than this is missed
NEAR_S = 5.0  # an alarm this close to a loss is not false


@dataclass(frozen=True)
class Alarms:
    """What became of alarms on some drives.

    Attributes
    ----------
    losses, missed : int
        How often a robot was lost, and how often nothing said so.
    delays_s : float64 array, shape (losses - missed,)
    false : int
        Alarms without a reason.
    hours : float
    """

    losses: int
    missed: int
    delays_s: FloatArray
    false: int
    hours: float

    @property
    def false_per_hour(self) -> float:
        """Return the rate of false alarms."""
        return self.false / self.hours


def alarms_of(drives: Iterable[Drive]) -> Alarms:
    """Compare alarms with errors beyond `LIMIT_M`."""
    losses = missed = false = 0
    delays: list[float] = []
    hours = 0.0
    for drive in drives:
        time = drive.health.stamp_ns / NANOSECONDS
        hours += float(time[-1] - time[0]) / 3600.0
        far = stretches(time, drive.distance > LIMIT_M, MIN_LOSS_S)
        lost = drive.health.state == "lost"
        for begin, end in far:
            losses += 1
            said = time[lost & (time >= begin) & (time <= max(end, begin + PATIENCE_S))]
            if len(said) and said[0] - begin <= PATIENCE_S:
                delays.append(float(said[0] - begin))
            else:
                missed += 1
        for begin, _ in stretches(time, lost, 0.0):
            if not any(first - NEAR_S <= begin <= last + NEAR_S for first, last in far):
                false += 1
    return Alarms(losses, missed, np.array(delays), false, hours)


def joined(sets: Sequence[Alarms]) -> Alarms:
    """Return what became of the alarms of all."""
    return Alarms(
        sum(one.losses for one in sets),
        sum(one.missed for one in sets),
        np.concatenate([one.delays_s for one in sets]),
        sum(one.false for one in sets),
        sum(one.hours for one in sets),
    )


def stretches(
    time: FloatArray, happens: NDArray[np.bool_], least_s: float
) -> list[tuple[float, float]]:
    """Return begin and end of all stretches of at least some length."""
    return [(float(time[a]), float(time[b - 1])) for a, b in series_of(happens)
            if time[b - 1] - time[a] >= least_s]  # fmt: skip


def beyond(drives: Iterable[Drive]) -> tuple[FloatArray, float]:
    """Return how often errors lie beyond their protection levels.

    Returns
    -------
    float64 array, shape (3,)
        Share of all points at which x, y and heading lie beyond their level.
    float
        Share of points that have levels.
    """
    broken, available, points = np.zeros(3), 0, 0
    for drive in drives:
        level = drive.health.protection
        broken += np.sum(np.abs(drive.error) > level, axis=0)
        available += int(np.isfinite(level[:, 0]).sum())
        points += len(level)
    return broken / points, available / points


def roc(drives: Sequence[Drive]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how an alarm at every threshold of `within` would do.

    Returns
    -------
    float64 arrays, shape (k,)
        Share of points within `LIMIT_M` that it calls lost; of points beyond that it calls lost;
        thresholds.
    """
    score = np.concatenate([1.0 - drive.health.within for drive in drives])
    far = np.concatenate([drive.distance > LIMIT_M for drive in drives])
    order = np.argsort(-score, kind="stable")
    hit = np.cumsum(far[order]) / max(int(far.sum()), 1)
    wrong = np.cumsum(~far[order]) / max(int((~far).sum()), 1)
    return wrong, hit, score[order]
