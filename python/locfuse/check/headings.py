# SPDX-License-Identifier: Apache-2.0
"""Reported headings against those in which a robot drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse.eval.dead_reckoning import Track, align, at_times, legs, levered, windows
from locfuse.types import NANOSECONDS, FloatArray, Trajectory

_CORRELATED_S = 1.0  # errors of positions that are nearer in time count as one
_LEAST = np.radians(4.5)  # a declination counts from 5 degrees on
_DECLINATION = np.radians(20.0)  # at most, where people live


@dataclass(frozen=True)
class HeadingError:
    """How reported headings differ from driven ones.

    Reported is driven plus `offset`, or `offset` minus driven if `is_clockwise`. Radians.
    """

    offset: float
    is_clockwise: bool

    @property
    def is_gross(self) -> bool:
        """Whether it is more than a declination."""
        return self.is_clockwise or abs(self.offset) > _DECLINATION


def heading_error(odometry: Trajectory | None, track: Track) -> HeadingError | None:
    """Return how the headings of a track are wrong, None if they are right or nothing shows them.

    The driven heading is that of odometry, laid on the track stretch by stretch. Without odometry
    it is the course: the robot may drive backwards, but hardly so that this looks like a compass.
    """
    if track.path.heading is None:
        return None
    if odometry is None:
        reported, driven, weight, sigma = _by_course(track.path)
    else:
        reported, driven, weight, sigma = _by_odometry(odometry, track)
    if not weight.any():
        return None
    plus, minus = (np.average(np.exp(1j * (reported + sign * driven)), weights=weight)
                   for sign in (1.0, -1.0))  # fmt: skip
    if abs(plus) > 0.8 and abs(plus) > abs(minus) + 0.2:
        return HeadingError(float(np.angle(plus)), is_clockwise=True)
    offset = float(np.angle(minus))
    if abs(minus) > 0.8 and abs(offset) > max(_LEAST, 3.0 * sigma):
        return HeadingError(offset, is_clockwise=False)
    return None


def _by_odometry(
    odometry: Trajectory, track: Track
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return reported and driven headings, the distance driven with each, and a common sigma."""
    rows, variances = [np.empty((0, 3))], []
    for stamp in windows(track, odometry):
        driven, reported = at_times(odometry, stamp), at_times(track.path, stamp)
        fit = align(levered(driven, track.lever), reported[:, :2])
        if fit.rms < 0.25 * fit.spread:
            step = np.linalg.norm(np.diff(driven[:, :2], axis=0, prepend=driven[:1, :2]), axis=1)
            rows.append(np.column_stack([reported[:, 2], driven[:, 2] + fit.angle, step]))
            seconds = float(stamp[-1] - stamp[0]) / NANOSECONDS
            independent = max(min(seconds / _CORRELATED_S, len(stamp)), 1.0)
            variances.append((fit.rms / fit.spread) ** 2 / independent)
    sigma = float(np.sqrt(np.sum(variances)) / max(len(variances), 1))
    found = np.vstack(rows)
    return found[:, 0], found[:, 1], found[:, 2], sigma


def _by_course(path: Trajectory) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return the same from the course, which shows no offset: its sigma is infinite."""
    assert path.heading is not None
    begin, end = legs(path.position).T
    move = path.position[end] - path.position[begin]
    course: FloatArray = np.arctan2(move[:, 1], move[:, 0])
    enough = np.full(len(course), float(len(course) >= 5))
    return path.heading[begin], course, enough, np.inf
