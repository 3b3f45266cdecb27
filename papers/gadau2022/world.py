# SPDX-License-Identifier: Apache-2.0
"""The worlds of gadau2022: landmarks, paths, noise and rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse import _core
from locfuse.config.scenario import Circle, Path, Points, Polygon, Square, Star, Waypoints
from locfuse.sim.obstacles import hidden_by
from locfuse.sim.trajectory import plan
from locfuse.types import NANOSECONDS, FloatArray, wrap_angle

STEP_NS = NANOSECONDS // 10
DURATION_S = 60.0
SETTLED_S = 30.0  # after a wrong start
ROOM_M = (10.0, 10.0)
# Fig. 1: what is added to the pose in every step, and to speed and turn rate.
SIGMA_POSE_M, SIGMA_POSE_RAD = 0.002, 0.002
SIGMA_SPEED_MPS, SIGMA_TURN_RADPS = 0.05, 0.05
SIGMA_RANGE_M, SIGMA_BEARING_RAD = 0.05, 0.02
SPEED_MPS = 0.5  # in the microsimulator
ENDLESS = 1e6  # whatever is more is written so
WRONG_M, WRONG_RAD = 2.0, np.deg2rad(60.0)  # of the start
NEAR_M, NEAR_RAD = 0.2, np.deg2rad(5.0)  # of the truth: converged
LAYOUTS = {
    "one": [[2, 5]],
    "two": [[2, 5], [8, 5]],
    "line": [[1, 4], [5, 4], [9, 4]],  # a circle starts 2 m from its mirror image
    "triangle": [[1, 1], [9, 1], [5, 9]],
    "square, near": [[1, 1], [9, 1], [9, 9], [1, 9]],
    "five, far": [[-20, -20], [30, -20], [30, 30], [-20, 30], [5, 40]],
}
PATHS: dict[str, Path] = {
    "circle": Circle(speed_mps=SPEED_MPS),
    "star": Star(speed_mps=SPEED_MPS, radius_m=3.5),  # not over the landmark in the north
    "square": Square(speed_mps=SPEED_MPS),
    "pentagon": Polygon(speed_mps=SPEED_MPS, radius_m=3.5, corners=5),
    "random": Waypoints(speed_mps=SPEED_MPS),
}


@dataclass(frozen=True)
class Gps:
    """Fixes of the position: a sigma per axis, and the time between two."""

    sigma_m: float
    every_ns: int


@dataclass(frozen=True)
class Sensors:
    """What corrects the odometry: landmarks by laser, GPS, or both."""

    laser: bool = True
    gps: Gps | None = None


_RECEIVER = Gps(0.5, NANOSECONDS)
LASER = Sensors()
SENSORS = {  # with the landmarks there are
    "GPS": ("triangle", Sensors(laser=False, gps=_RECEIVER)),
    "laser": ("triangle", LASER),
    "GPS and laser": ("triangle", Sensors(gps=_RECEIVER)),
    "laser, one landmark": ("one", LASER),
    "GPS and laser, one landmark": ("one", Sensors(gps=_RECEIVER)),
    "GPS as good as the laser": ("triangle", Sensors(False, Gps(SIGMA_RANGE_M, STEP_NS))),
}
RAYS, FIELD_RAD, REACH_M, SIGMA_RAY_M = 151, 2.0, 6.0, 0.01
DISC_M = 0.3
DISCS = {
    "5": [[2.0, 2.0], [8.0, 2.5], [8.2, 8.0], [2.2, 7.8], [5.0, 5.2]],
    "8": [[2.0, 2.0], [8.0, 2.5], [8.2, 8.0], [2.2, 7.8], [5.0, 5.2], [5.1, 1.2], [8.8, 5.3],
          [1.1, 5.0]],
}  # fmt: skip
SPEEDS = (0.0, 0.3, 1.0)
_MIDDLE = (5.0, 5.2)  # of a disc
AMONG_DISCS: dict[str, Path] = {  # clear of all discs; random ways are drawn so
    "circle": Circle(center_m=_MIDDLE, radius_m=1.8),
    "star": Star(center_m=_MIDDLE, radius_m=2.5),
    "square": Square(center_m=_MIDDLE, side_m=4.0),
    "pentagon": Polygon(center_m=_MIDDLE, radius_m=2.5, corners=5),
}
RAY_PATHS = (*AMONG_DISCS, "random")
CLEAR_M = 0.2  # between a way and a disc, and more


def way_among(
    marks: FloatArray, path: str, speed_mps: float, rng: np.random.Generator
) -> FloatArray:
    """Return the poses of a minute, step by step, that touch no disc, shape (n, 3).

    They begin anywhere along the path: what rays make of discs depends on the place, so errors are
    to be looked at in many.

    Parameters
    ----------
    marks : float64 array, shape (m, 2)
        The middles of the discs.
    path : str
        Of `RAY_PATHS`.
    speed_mps : float
        0 stands.
    rng : numpy Generator
    """
    way: Path = _between(marks, rng) if path == "random" else AMONG_DISCS[path]
    time = np.arange(0, round(DURATION_S * 10) + 1) / 10.0
    driven = way.model_copy(update={"speed_mps": speed_mps or SPEED_MPS})
    drive = plan(driven, ROOM_M, 2.0 * DURATION_S, rng)
    begin = rng.uniform(0.0, DURATION_S)
    return drive.pose_at(begin + time if speed_mps > 0.0 else np.full_like(time, begin))


def _between(marks: FloatArray, rng: np.random.Generator) -> Points:
    """Return random places, each reached from the one before on a straight line that is clear."""
    places: list[FloatArray] = []
    while len(places) < 60:  # more than two minutes
        place = rng.uniform(1.0, np.array(ROOM_M) - 1.0)
        leg = np.linspace(places[-1] if places else place, place, 200)
        apart = np.hypot(*(leg[:, None] - marks).transpose(2, 0, 1)).min()
        if apart > DISC_M + CLEAR_M:
            places.append(place)
    return Points(points_m=[(float(x), float(y)) for x, y in places])


def scan_of(
    stamp: int, at: FloatArray, marks: FloatArray, rng: np.random.Generator
) -> _core.LaserScan:
    """Return what the rays measure to discs and walls, NaN beyond their reach."""
    angle = at[2] + np.linspace(-FIELD_RAD, FIELD_RAD, RAYS)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    discs = hidden_by(marks[None], DISC_M, at[None, :2], angle[None])[0]
    wall = np.where(along > 0.0, np.array(ROOM_M), 0.0) - at[:2]
    walls = np.divide(wall, along, out=np.full_like(along, np.inf), where=along != 0.0)
    ranges = np.minimum(discs, walls.min(axis=1))
    ranges = ranges + SIGMA_RAY_M * rng.standard_normal(RAYS)
    geometry = _core.LaserGeometry(_core.Pose2(), -FIELD_RAD, 2.0 * FIELD_RAD / (RAYS - 1), 0.05,
                                   REACH_M)  # fmt: skip
    return _core.LaserScan(stamp, geometry, np.where(ranges < REACH_M, ranges, np.nan))


def seen_by(
    at: FloatArray, marks: FloatArray, rng: np.random.Generator, short_m: float = 0.0
) -> FloatArray:
    """Return range and bearing of every landmark, shape (n, 2), ranges `short_m` too short."""
    off = marks - at[:2]
    bearing = np.arctan2(off[:, 1], off[:, 0]) - at[2]
    seen = np.column_stack([np.hypot(*off.T) - short_m, bearing])
    noisy = seen + [SIGMA_RANGE_M, SIGMA_BEARING_RAD] * rng.standard_normal(seen.shape)
    return np.column_stack([np.maximum(noisy[:, 0], 0.0), wrap_angle(noisy[:, 1])])


def measured_motion(before: FloatArray, after: FloatArray, rng: np.random.Generator) -> _core.Pose2:
    """Return the motion of a step with the noise of Fig. 1."""
    step = _core.Pose2(*before).inverse() * _core.Pose2(*after)
    seconds = STEP_NS / NANOSECONDS
    noise = rng.standard_normal(5) * [SIGMA_POSE_M, SIGMA_POSE_M, SIGMA_POSE_RAD,
                                      SIGMA_SPEED_MPS * seconds,
                                      SIGMA_TURN_RADPS * seconds]  # fmt: skip
    return _core.Pose2(step.x + noise[0] + noise[3], step.y + noise[1],
                       step.heading + noise[2] + noise[4])  # fmt: skip
