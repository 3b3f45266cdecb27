# SPDX-License-Identifier: Apache-2.0
"""Standard MCL (Table 1), the paper's MCL with EKF, and ours; results/zhang.md."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import FREE, FloatArray, GridMap, wrap_angle
from papers.zhang import motion
from papers.zhang.line_features import correct, map_lines, scan_lines
from papers.zhang.particle_filter import (
    COUNT,
    PEAK,
    SIGMA_M,
    SIMILAR_SHARE,
    EnergyMap,
    RangeMap,
    anywhere,
    drawn_again,
    is_free,
    log_likelihoods,
    mean_pose,
    relative,
)
from papers.zhang.world import (
    BEAM_RAD,
    SIGMA_DISTANCE_PER_SQRT_M,
    SIGMA_GYRO_PER_SQRT_S,
    SIGMA_ODOMETER_PER_SQRT_M,
    SIGMA_ODOMETER_PER_SQRT_RAD,
    Step,
)


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


OBSTACLE_SHARE = 0.99  # of the particles that expect a longer reading than one of an obstacle
FITS = 0.5  # of a particle that is kept; 1 expects every reading as it is
MIN_SUM = 3.0  # eta W_th of eq. (9): one particle may fit by chance, hardly three


class FusionMcl:
    """Particles that an EKF refines by lines before they are drawn, weighed and drawn again.

    Parameters
    ----------
    grid : GridMap
    rng : numpy Generator
    particles : float64 array, shape (n, 3), optional
        Where to start; by default `COUNT` of them anywhere in free space.
    covariance : float64 array, shape (3, 3), optional
        Of each of these particles; by default that of its share of the free space.
    """

    def __init__(
        self,
        grid: GridMap,
        rng: np.random.Generator,
        particles: FloatArray | None = None,
        covariance: FloatArray | None = None,
    ) -> None:
        self._grid = grid
        self._ranges = RangeMap(grid)
        self._rng = rng
        self._walls = map_lines(grid)
        self._energy = EnergyMap(grid)
        self._particles = anywhere(grid, COUNT, rng) if particles is None else particles
        free = float((grid.cells == FREE).sum()) * grid.resolution_m**2 * 2.0 * np.pi
        P = covariance_of_share(free) if covariance is None else covariance
        self._covariance = np.tile(P, (len(self._particles), 1, 1))
        self._similar = covariance_of_share(SIMILAR_SHARE * free)
        self._mean = mean_pose(self._particles)

    @property
    def particles(self) -> FloatArray:
        return self._particles

    def estimate(self) -> FloatArray:
        return self._mean

    def on(self, step: Step) -> None:
        pose = self._refined(step)
        if np.isnan(step.ranges).all():  # somebody stands around the laser
            self._particles, self._mean = pose, mean_pose(pose)
            return
        expected = self._ranges.expected(pose)
        steady = ~np.isnan(step.ranges) & ~moving_obstacles(step.ranges, expected)
        log_weight = log_likelihoods(step.ranges, expected)[:, steady]
        free = is_free(self._grid, pose)
        fit = np.where(free, np.exp(np.mean(log_weight, axis=1) - PEAK), 0.0)
        weight = relative(np.where(free, log_weight.sum(axis=1), -np.inf))  # (7)
        self._mean = mean_pose(pose, weight)
        if fit.sum() < MIN_SUM:  # (9)
            useless = fit < FITS
            pose[useless] = self._energy.draw(step.ranges, int(useless.sum()), self._rng)
            self._particles = pose
            self._covariance = np.where(useless[:, None, None], self._similar, 0.0)
        else:
            self._particles = pose[drawn_again(weight, len(pose), self._rng)]
            self._covariance = np.zeros_like(self._covariance)

    def _refined(self, step: Step) -> FloatArray:
        """Predict and correct the Gaussian of each particle; draw the particle from it."""
        pose, P = motion.predict(self._particles, self._covariance, step.control)
        pose, P = correct(pose, P, scan_lines(step.ranges), self._walls)
        L = np.linalg.cholesky(P + 1e-12 * np.eye(3))
        off: FloatArray = L @ self._rng.standard_normal((len(pose), 3, 1))
        return pose + off[..., 0]


def covariance_of_share(volume: float) -> FloatArray:
    """Return the covariance, shape (3, 3), of the share of a region for which a particle stands.

    Parameters
    ----------
    volume : float
        Of the region over which `COUNT` particles are spread evenly, m^2 rad; a share of it is a
        cube whose side is as many metres as radians.
    """
    side = (volume / COUNT) ** (1.0 / 3.0)
    return np.asarray(side**2 / 12.0 * np.eye(3))


def moving_obstacles(ranges: FloatArray, expected: FloatArray) -> NDArray[np.bool_]:
    """Return which readings are shorter than nearly all particles expect.

    The distance filter of D. Fox, W. Burgard and S. Thrun, "Markov localization for mobile robots
    in dynamic environments", JAIR 1999: what the map does not know can only be nearer than it.
    Where that holds for most readings it is the particles that are wrong, and none is left out.

    Parameters
    ----------
    ranges : float64 array, shape (181,)
    expected : float64 array, shape (n, 181)

    Returns
    -------
    bool array, shape (181,)
    """
    nearer = np.mean(ranges < expected - 2.0 * SIGMA_M, axis=0) > OBSTACLE_SHARE
    return np.asarray(nearer & (nearer.mean() < 0.5))


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


def tracking_settings(seed: int) -> _core.MclConfig:
    """Return `settings` with the paper's refinement in C++, on a map that is known to be exact."""
    config = settings(seed)
    config.proposal = _core.ScanProposal.LINE_EKF
    config.sigma_map_m = config.sigma_map_rad = 0.0
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
        self, grid: GridMap, config: _core.MclConfig, start: _core.PoseEstimate | None = None
    ) -> None:
        self._mcl = _core.Mcl(config, _core.World(grid=grid.occupancy_grid()))
        if start is not None:
            self._mcl.start_at([_core.PoseHypothesis(start)])

    @property
    def particles(self) -> FloatArray:
        return self._mcl.particles[:, :3]

    def estimate(self) -> FloatArray:
        pose = self._mcl.estimate().pose
        return np.array([pose.x, pose.y, pose.heading])

    def nees(self, truth: FloatArray) -> float:
        """Return the squared error of x, y, heading against `truth` in sigmas of the estimate."""
        error = self.estimate() - truth
        error[2] = wrap_angle(error[2])
        return float(error @ np.linalg.solve(self._mcl.estimate().covariance, error))

    def on(self, step: Step) -> None:
        for (begin, end), (way, turn) in zip(
            pairwise(step.stamp_ns.tolist()), step.control.tolist(), strict=True
        ):
            motion = _core.Pose2(way * np.cos(turn), way * np.sin(turn), turn)
            self._mcl.on(_core.Increment(begin, end, motion))
        self._mcl.on(step.scan)
