# SPDX-License-Identifier: Apache-2.0
"""The basic MCL of the paper's Table 1; docs/models/zhang.md."""

from __future__ import annotations

import numpy as np

from locfuse.types import FloatArray, GridMap
from papers.zhang import motion
from papers.zhang.beams import RangeMap, log_likelihoods
from papers.zhang.particles import COUNT, anywhere, drawn_again, mean_pose, relative
from papers.zhang.world import Step


class StandardMcl:
    """Particles that are moved, weighed by every beam and drawn again.

    Parameters
    ----------
    grid : GridMap
    rng : numpy Generator
    particles : float64 array, shape (n, 3), optional
        Where to start; by default `COUNT` of them anywhere in free space.
    """

    def __init__(
        self, grid: GridMap, rng: np.random.Generator, particles: FloatArray | None = None
    ) -> None:
        self._ranges = RangeMap(grid)
        self._rng = rng
        self._particles = anywhere(grid, COUNT, rng) if particles is None else particles

    @property
    def particles(self) -> FloatArray:
        return self._particles

    def estimate(self) -> FloatArray:
        return mean_pose(self._particles)

    def on(self, step: Step) -> None:
        moved = motion.sample(self._particles, step.control, self._rng)
        expected = self._ranges.expected(moved)
        weight = relative(log_likelihoods(step.ranges, expected).sum(axis=1))  # (7)
        self._particles = moved[drawn_again(weight, len(moved), self._rng)]
