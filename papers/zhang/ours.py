# SPDX-License-Identifier: Apache-2.0
"""locfuse's own Monte Carlo localization, with as many particles as the paper's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from locfuse import _core
from locfuse.types import FloatArray, GridMap
from papers.zhang.particles import COUNT
from papers.zhang.world import (
    BEAM_RAD,
    SIGMA_DISTANCE_PER_SQRT_M,
    SIGMA_GYRO_PER_SQRT_S,
    SIGMA_ODOMETER_PER_SQRT_M,
    SIGMA_ODOMETER_PER_SQRT_RAD,
    Step,
)


def settings(seed: int) -> _core.MclConfig:
    """Return the defaults with `COUNT` particles and scouts, every beam, the noise of the controls.

    So few particles leave most places uncovered, wherever the robot is: that a scout is right
    against all of them is as likely as not, until the belief is ready. And the map is the one that
    the world was made of, so scans fit it within 20 cm, and more beams count as independent than on
    a map that was drawn in a building.
    """
    config = _core.MclConfig()
    config.min_particles = config.max_particles = COUNT
    config.scouts = COUNT
    config.beams = len(BEAM_RAD)
    config.independent_beams = config.independent_beams_searching = 20.0
    config.sigma_widest_m = 0.2
    config.kidnapping_probability = 0.5
    config.odometry.sigma_longitudinal_per_sqrt_m = SIGMA_DISTANCE_PER_SQRT_M
    config.odometry.sigma_lateral_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_m = 0.5 * SIGMA_ODOMETER_PER_SQRT_M
    config.odometry.sigma_heading_per_sqrt_rad = 0.5 * SIGMA_ODOMETER_PER_SQRT_RAD
    config.odometry.sigma_heading_per_sqrt_s = 0.5 * SIGMA_GYRO_PER_SQRT_S
    config.seed = seed
    return config


class OurMcl:
    """`Mcl` of the library, fed like the others.

    Parameters
    ----------
    grid : GridMap
    config : MclConfig
    start : PoseEstimate, optional
        By default anywhere in free space.
    """

    def __init__(
        self,
        grid: GridMap,
        config: _core.MclConfig,
        start: _core.PoseEstimate | None = None,
    ) -> None:
        self._mcl = _core.Mcl(config, grid.occupancy_grid())
        if start is not None:
            self._mcl.start_at([_core.PoseHypothesis(start)])

    @property
    def particles(self) -> FloatArray:
        return self._mcl.particles[:, :3]

    def estimate(self) -> FloatArray:
        pose = self._mcl.estimate().pose
        return np.array([pose.x, pose.y, pose.heading])

    def on(self, step: Step) -> None:
        for (begin, end), (way, turn) in zip(
            pairwise(step.stamp_ns.tolist()), step.control.tolist(), strict=True
        ):
            motion = _core.Pose2(way * np.cos(turn), way * np.sin(turn), turn)
            self._mcl.on(_core.Increment(begin, end, motion))
        self._mcl.on(step.scan)
