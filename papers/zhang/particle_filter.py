# SPDX-License-Identifier: Apache-2.0
"""Particles, beam model, similar energy region; results/zhang.md eq. (7), (8), (14)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.sim.beams import cast
from locfuse.sim.space import cell_of, middle_of
from locfuse.types import FREE, FloatArray, GridMap, wrap_angle
from papers.zhang.world import BEAM_RAD, RANGE_MAX_M, Step

COUNT = 150


class Localizer(Protocol):
    """What is compared: particles, shape (n, 3), moved and weighed once per iteration."""

    @property
    def particles(self) -> FloatArray: ...

    def estimate(self) -> FloatArray:
        """Return x, y [m] and heading [rad]."""
        ...

    def on(self, step: Step) -> None: ...


def anywhere(grid: GridMap, count: int, rng: np.random.Generator) -> FloatArray:
    """Draw poses evenly from the free space, shape (count, 3)."""
    cells = np.argwhere(grid.cells == FREE)
    middle = middle_of(grid, cells[rng.integers(len(cells), size=count)])
    offset = grid.resolution_m * (rng.random((count, 2)) - 0.5)
    return np.column_stack([middle + offset, rng.uniform(-np.pi, np.pi, count)])


def around(
    pose: FloatArray, sigma_m: float, sigma_rad: float, rng: np.random.Generator
) -> FloatArray:
    """Draw `COUNT` poses about one, shape (COUNT, 3)."""
    off: FloatArray = rng.standard_normal((COUNT, 3)) * [sigma_m, sigma_m, sigma_rad]
    return pose + off


def is_free(grid: GridMap, pose: FloatArray) -> NDArray[np.bool_]:
    """Return which poses, shape (n, 3), stand on a free cell of the map."""
    cell = cell_of(grid, pose[:, :2])
    inside = np.all((cell >= 0) & (cell < grid.cells.shape), axis=1)
    row, column = np.where(inside[:, None], cell, 0).T
    return np.asarray(inside & (grid.cells[row, column] == FREE))


def drawn_again(weight: FloatArray, count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return which particles are drawn, lines 9 to 12 of Table 1, evenly spread over the weights.

    Parameters
    ----------
    weight : float64 array, shape (n,)
        Not negative, not all zero; need not sum to 1.
    count : int
    rng : numpy Generator

    Returns
    -------
    int array, shape (count,)
        Each index as often as its weight says, rounded up or down.
    """
    passed = np.cumsum(weight)
    at = (np.arange(count) + rng.random()) * (passed[-1] / count)
    drawn: NDArray[np.intp] = np.searchsorted(passed, at, side="right")
    return np.minimum(drawn, len(weight) - 1)


def relative(log_weight: FloatArray) -> FloatArray:
    """Return weights relative to the largest; all 1 where no particle has any."""
    most = log_weight.max()
    return np.exp(log_weight - most) if np.isfinite(most) else np.ones(len(log_weight))


def mean_pose(pose: FloatArray, weight: FloatArray | None = None) -> FloatArray:
    """Return the mean of poses; of headings that of their directions.

    Parameters
    ----------
    pose : float64 array, shape (n, 3)
    weight : float64 array, shape (n,), optional
        By default equal.
    """
    x, y, c, s = np.average(
        [pose[:, 0], pose[:, 1], np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1, weights=weight
    )
    return np.array([x, y, np.arctan2(s, c)])


def errors_of(pose: FloatArray, truth: FloatArray) -> FloatArray:
    """Return distance [m] and turn [rad, not negative] from a pose to the truth, shape (2,)."""
    return np.array([np.hypot(*(pose - truth)[:2]), abs(wrap_angle(pose[2] - truth[2]))])


SIGMA_M = 0.2  # of a reading about its expectation: laser, map and a particle's share of the space
SHARE_GAUSSIAN = 0.95  # lambda_g
SHARE_MAXIMUM = 1.0 - SHARE_GAUSSIAN  # lambda_d
PEAK = float(np.log(SHARE_GAUSSIAN / (SIGMA_M * np.sqrt(2.0 * np.pi))))  # of a reading as expected


class RangeMap:
    """What each beam would read from each pose, to half a cell.

    Beams go as far at once as the distance to the nearest wall lets them, which is several times as
    fast as from cell to cell; eq. (8) is wider than a cell.

    Parameters
    ----------
    grid : GridMap
    """

    def __init__(self, grid: GridMap) -> None:
        self._field = _core.DistanceField(grid.occupancy_grid(), 0.0)
        self._resolution_m = grid.resolution_m

    def expected(self, pose: FloatArray) -> FloatArray:
        """Return the expectation of each beam from poses, shape (n, 3).

        Returns
        -------
        float64 array, shape (n, 181)
            Metres, at most `RANGE_MAX_M`.
        """
        direction = (pose[:, 2:] + BEAM_RAD).ravel()
        along = np.column_stack([np.cos(direction), np.sin(direction)])
        start = np.repeat(pose[:, :2], len(BEAM_RAD), axis=0)
        travelled = np.zeros(len(direction))
        left = np.arange(len(direction))
        while len(left) > 0:
            at = start[left] + travelled[left, None] * along[left]
            free = self._field.distance(at)
            # The look-up goes from middle to middle of cells: either may be half a diagonal off.
            step = np.maximum(free - np.sqrt(2.0) * self._resolution_m, 0.5 * self._resolution_m)
            goes = (free > 0.0) & (travelled[left] < RANGE_MAX_M)
            left = left[goes]
            travelled[left] += step[goes]
        overshoot = 0.25 * self._resolution_m  # on average
        travelled = np.clip(travelled - overshoot, 0.0, RANGE_MAX_M)
        return travelled.reshape(len(pose), len(BEAM_RAD))


def log_likelihoods(ranges: FloatArray, expected: FloatArray) -> FloatArray:
    """Return the logarithm of eq. (8) for each beam; their sum over beams is that of eq. (7).

    The delta of a reading without return has the same value from every pose, which is taken as 1.

    Parameters
    ----------
    ranges : float64 array, shape (181,)
        NaN where there was no return.
    expected : float64 array, shape (n, 181)

    Returns
    -------
    float64 array, shape (n, 181)
    """
    gaussian = PEAK - 0.5 * ((ranges - expected) / SIGMA_M) ** 2
    return np.where(np.isnan(ranges), np.log(SHARE_MAXIMUM), gaussian)


SPACING_M = 0.25
HEADINGS = 72
SIMILAR_SHARE = 0.1  # of all poses that are taken for similar


class EnergyMap:
    """Energies of poses on a lattice over the free space, computed once per map.

    Parameters
    ----------
    grid : GridMap
    """

    def __init__(self, grid: GridMap) -> None:
        every = max(1, round(SPACING_M / grid.resolution_m))
        cells = np.argwhere(grid.cells[::every, ::every] == FREE) * every
        self._spacing_m = every * grid.resolution_m
        heading = 2.0 * np.pi / HEADINGS * np.arange(HEADINGS)
        at = middle_of(grid, cells)
        distance = cast(grid, np.repeat(at, HEADINGS, axis=0), np.tile(heading, len(at)),
                        RANGE_MAX_M).reshape(len(at), HEADINGS)  # fmt: skip
        energy = 1.0 - np.minimum(distance, RANGE_MAX_M) / RANGE_MAX_M
        quarter = HEADINGS // 4
        ahead = [np.roll(energy, turn, axis=1) for turn in range(-quarter, quarter + 1)]
        self._energy: FloatArray = np.mean(ahead, axis=0).ravel()
        self._pose = np.column_stack([np.repeat(at, HEADINGS, axis=0), np.tile(heading, len(at))])

    def draw(self, ranges: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw poses whose energy is near that of a scan.

        Parameters
        ----------
        ranges : float64 array, shape (181,)
            Metres; NaN where there was no return.
        count : int
        rng : numpy Generator

        Returns
        -------
        float64 array, shape (count, 3)
            Spread over the shares of their lattice points.
        """
        energy = 1.0 - np.nanmean(ranges) / RANGE_MAX_M
        similar = max(1, round(SIMILAR_SHARE * len(self._energy)))
        nearest = np.argpartition(np.abs(self._energy - energy), similar - 1)[:similar]
        share = [self._spacing_m, self._spacing_m, 2.0 * np.pi / HEADINGS]
        offset = share * (rng.random((count, 3)) - 0.5)
        return np.asarray(self._pose[rng.choice(nearest, count)] + offset)
