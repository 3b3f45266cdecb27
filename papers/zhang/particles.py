# SPDX-License-Identifier: Apache-2.0
"""Sets of particles: drawn from free space, drawn again by weight, summarized."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from locfuse.sim.space import cell_of, middle_of
from locfuse.types import FREE, FloatArray, GridMap, wrap_angle
from papers.zhang.world import Step

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
