# SPDX-License-Identifier: Apache-2.0
"""The simulated world of Zhang and its messages, iteration by iteration; results/zhang.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse import _core
from locfuse.config.scenario import Scenario
from locfuse.run.start import scans_of
from locfuse.sim.scenario import simulate
from locfuse.types import FloatArray, GridMap, StampArray

ITERATIONS = 30
PERIOD_S = 0.5  # from scan to scan: 0.2 m, or a turn of 17 degrees
ODOMETRY_HZ = 10.0
RANGE_MAX_M = 30.0  # of the paper's UTM-30LX
BEAM_RAD = np.deg2rad(np.arange(-90.0, 91.0))  # its 181 beams, in body
SIGMA_DISTANCE_PER_SQRT_M = 0.03
SIGMA_ODOMETER_PER_SQRT_M = 0.02  # of its turn, rad
SIGMA_ODOMETER_PER_SQRT_RAD = 0.03
SIGMA_GYRO_PER_SQRT_S = np.deg2rad(0.1)
PEOPLE = 2


@dataclass(frozen=True)
class Step:
    """What one iteration brings: the drive since the last one, then a scan.

    Attributes
    ----------
    stamp_ns : int64 array, shape (m + 1,)
        Between which the controls hold.
    control : float64 array, shape (m, 2)
        Distance [m] and turn [rad], the mean of odometer and gyro: results/zhang.md eq. (5).
    ranges : float64 array, shape (181,)
        Metres; NaN where there was no return.
    scan : LaserScan
        The same as a message.
    truth : float64 array, shape (3,)
        x, y [m] and heading [rad] at the scan.
    """

    stamp_ns: StampArray
    control: FloatArray
    ranges: FloatArray
    scan: _core.LaserScan
    truth: FloatArray


@dataclass(frozen=True)
class World:
    """A map, where the robot starts on it (x [m], y [m], heading [rad]), and its iterations."""

    grid: GridMap
    start: FloatArray
    steps: list[Step]


def scenario(seed: int, people: int = PEOPLE) -> Scenario:
    """Return floor plan, drive and sensors; the seed also makes the floor plan."""
    walkers = [{"kind": "people", "count": people}] if people else []
    return Scenario.model_validate(
        {
            "path": {"shape": "roam", "speed_mps": 0.4, "turn_rate_radps": 0.6},
            "duration_s": ITERATIONS * PERIOD_S,
            "odometry": {
                "rate_hz": ODOMETRY_HZ,
                "sigma_longitudinal_per_sqrt_m": SIGMA_DISTANCE_PER_SQRT_M,
                "sigma_heading_per_sqrt_m": SIGMA_ODOMETER_PER_SQRT_M,
                "sigma_heading_per_sqrt_rad": SIGMA_ODOMETER_PER_SQRT_RAD,
            },
            "ranges": None,
            "poses": None,
            "laser": {
                "rate_hz": 1.0 / PERIOD_S,
                "beams": len(BEAM_RAD),
                "field_of_view_deg": 180.0,
                "range_min_m": 0.1,
                "range_max_m": RANGE_MAX_M,
                "sigma_m": 0.02,
                "dropout": 0.01,
            },
            "map": {"generate": "zhang", "seed": seed},
            "faults": walkers,
        }
    )


def world(seed: int, people: int = PEOPLE) -> World:
    """Return a floor plan, a drive over it and the robot's messages, all from one seed."""
    rng = np.random.default_rng(seed)
    log = simulate(scenario(seed, people), rng)
    assert log.grid is not None
    table, odometry = log["truth"], log["odometry"]
    truth = np.column_stack([table["x_m"], table["y_m"], np.unwrap(table["heading_rad"])])
    at = np.searchsorted(table["stamp_ns"], odometry["stamp_ns"])
    sigma_gyro = SIGMA_GYRO_PER_SQRT_S / np.sqrt(ODOMETRY_HZ)
    gyro = np.diff(truth[at, 2]) + sigma_gyro * rng.standard_normal(len(at) - 1)
    turn = 0.5 * (odometry["dheading_rad"][1:] + gyro)  # (5)
    control = np.column_stack([odometry["dx_m"][1:], turn])
    per = round(PERIOD_S * ODOMETRY_HZ)
    scans = scans_of(log)
    steps = [
        Step(
            odometry["stamp_ns"][k * per : (k + 1) * per + 1],
            control[k * per : (k + 1) * per],
            log["scans"]["ranges_m"][k + 1],
            scans[k + 1],
            truth[at[(k + 1) * per]],
        )
        for k in range(ITERATIONS)
    ]
    return World(log.grid, truth[0], steps)


def control_variance(control: FloatArray) -> FloatArray:
    """Return the variances of distance [m^2] and turn [rad^2] of controls, shapes (..., 2).

    The turn is the mean of two readings, so it has a quarter of the sum of their variances.
    """
    distance, turn = np.abs(control[..., 0]), np.abs(control[..., 1])
    odometer = SIGMA_ODOMETER_PER_SQRT_M**2 * distance + SIGMA_ODOMETER_PER_SQRT_RAD**2 * turn
    gyro = SIGMA_GYRO_PER_SQRT_S**2 / ODOMETRY_HZ
    return np.stack([SIGMA_DISTANCE_PER_SQRT_M**2 * distance, 0.25 * (odometer + gyro)], axis=-1)
