# SPDX-License-Identifier: Apache-2.0
"""`AirEkf` and `TagTriangleEkf` on worlds written out apart from the models."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TypeAlias

import numpy as np

from locfuse import _core
from locfuse.sim.trajectory import drive_on
from locfuse.types import NANOSECONDS, FloatArray
from papers.consistency.sample import Sample, nees_of, pose_nees

AirMessage: TypeAlias = _core.Range | _core.Altitude | _core.RangeBearing

# A hall to fly in: anchors in its corners, two of them on the floor, a lamp and a ball.
CORNERS = ((-10.0, -10.0, 0.2), (10.0, -10.0, 8.0), (10.0, 10.0, 0.4), (-10.0, 10.0, 7.0))
BEACONS = ((14.0, 3.0, 9.0), (-5.0, -16.0, 0.5))
FLIGHT_S, STEP_S = 10.0, 0.05
SIGMA_START = np.array([0.2, 0.2, 0.05, 0.2])  # x, y [m], heading [rad], height [m]
SIGMA_SPEED, SIGMA_CLIMB = 0.4, 0.2  # at the start [m/s]
LEVER = (0.3, -0.2, -0.1)  # of the tag

# Three tags on a floor scrubber.
TRIANGLE = ((0.6, 0.0), (-0.45, 0.25), (-0.45, -0.25))
SIGMA_FIX, SIGMA_WHEELS = 0.15, 0.02
RIDE_S, FOUND_S = 60.0, 20.0  # its heading is found by then


def air_ekf(motion: _core.AirMotion, seed: int, factor: float) -> Sample:
    """Fly ten seconds by odometry, or at constant velocity without any."""
    rng = np.random.default_rng(seed)
    start = np.array([2.0, -1.0, 0.4, 3.0])
    state = start + SIGMA_START * rng.standard_normal(4)
    speed = np.array([SIGMA_SPEED, SIGMA_SPEED, SIGMA_CLIMB]) * rng.standard_normal(3)
    prior = _core.AirEstimate(0, _core.Pose2(*start[:3].tolist()), start[3],
                                   np.diag(np.square(factor * SIGMA_START)))  # fmt: skip
    anchors = _core.AnchorMap([_core.Anchor(i, list(at)) for i, at in enumerate(CORNERS)])
    sight = _core.LandmarkSensor(_core.LandmarkMap(
        [_core.Landmark(i, [x, y], height=z) for i, (x, y, z) in enumerate(BEACONS)]))  # fmt: skip
    ekf = _core.AirEkf(
        _air_config(motion, factor), _core.World(anchors, [_core.Tag(0, list(LEVER))], sight), prior
    )
    sample = Sample()
    for step in range(1, round(FLIGHT_S / STEP_S) + 1):
        begin, end = (round(n * STEP_S * NANOSECONDS) for n in (step - 1, step))
        if motion == _core.AirMotion.ODOMETRY:
            increment, climb = _carried(rng, state, end)
            ekf.on(_core.Increment(begin, end, increment), climb)
        else:
            _drifted(rng, state, speed)
        for source, message in _measured(rng, state, step, end, factor):
            sample.add(source, ekf.on(message))
    last = ekf.estimate()
    turned = _core.wrap_angle(state[2] - last.pose.heading)
    off = state - [last.pose.x, last.pose.y, last.pose.heading, last.height]
    off[2] = turned
    groups = {"position": (0, 1), "heading": (2,), "height": (3,)}
    sample.nees = nees_of(off, last.covariance, groups)
    return sample


def _air_config(motion: _core.AirMotion, factor: float) -> _core.AirEkfConfig:
    config = _core.AirEkfConfig()
    config.motion = motion
    config.correlation_s = 0.0  # simulated errors are independent
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.03 * factor
    config.odometry.sigma_lateral_per_sqrt_m = 0.01 * factor
    config.odometry.sigma_heading_per_sqrt_m = 0.02 * factor
    config.odometry.sigma_heading_per_sqrt_rad = 0.03 * factor
    config.sigma_height_per_sqrt_s = 0.1 * factor
    config.constant_velocity.sigma_velocity_per_sqrt_s = 0.5 * factor
    config.constant_velocity.sigma_climb_per_sqrt_s = 0.3 * factor
    config.constant_velocity.sigma_heading_per_sqrt_s = 0.2 * factor
    config.sigma_start_velocity_mps = SIGMA_SPEED * factor
    config.sigma_start_climb_mps = SIGMA_CLIMB * factor
    config.range.sigma_m = 0.1 * factor
    config.landmark.sigma_range_m = 0.1 * factor
    config.landmark.sigma_bearing_rad = 0.02 * factor
    config.landmark_in_space.sensor_up_m = 0.2
    config.landmark_in_space.sigma_elevation_rad = 0.03 * factor
    config.altitude.altimeter_up_m = 0.05
    config.range.gate = config.altitude.gate = config.landmark.gate = 1.0
    return config


def _carried(rng: np.random.Generator, state: FloatArray, end: int) -> tuple[_core.Pose2, float]:
    """Move the state with noise; return the noisy odometry, and the climb rate."""
    ahead, turn = 0.04, 0.03
    climb = 0.4 * math.cos(0.3 * end / NANOSECONDS)
    state[0] += ahead * math.cos(state[2])
    state[1] += ahead * math.sin(state[2])
    state[2] += turn
    state[3] += climb * STEP_S + rng.normal(0.0, 0.1 * math.sqrt(STEP_S))
    sigma = (0.03 * math.sqrt(ahead), 0.01 * math.sqrt(ahead),
             math.sqrt(0.02**2 * ahead + 0.03**2 * turn))  # fmt: skip
    dx, dy, da = np.array([ahead, 0.0, turn]) + np.array(sigma) * rng.standard_normal(3)
    return _core.Pose2(dx, dy, da), climb


def _drifted(rng: np.random.Generator, state: FloatArray, speed: FloatArray) -> None:
    """Move by white acceleration; the heading walks."""
    sigma = np.array([0.5, 0.5, 0.3])
    # Half of the kick's displacement within the step correlates with it, the rest is independent.
    kick = sigma * math.sqrt(STEP_S) * rng.standard_normal(3)
    rest = sigma * math.sqrt(STEP_S**3 / 12.0) * rng.standard_normal(3)
    state[[0, 1, 3]] += STEP_S * (speed + 0.5 * kick) + rest
    speed += kick
    state[2] += rng.normal(0.0, 0.2 * math.sqrt(STEP_S))


def _measured(
    rng: np.random.Generator, state: FloatArray, step: int, end: int, factor: float
) -> Iterator[tuple[str, AirMessage]]:
    """Yield ranges to all corners at 4 Hz, an altitude and sightings at 1 Hz."""
    x, y, heading, height = state.tolist()
    c, s = math.cos(heading), math.sin(heading)
    if step % 5 != 0:
        return
    tag = (x + LEVER[0] * c - LEVER[1] * s, y + LEVER[0] * s + LEVER[1] * c, height + LEVER[2])
    for anchor, at in enumerate(CORNERS):
        yield "ranges", _core.Range(end, 0, anchor, math.dist(tag, at) + rng.normal(0.0, 0.1))
    if step % 20 != 0:
        return
    yield "altitudes", _core.Altitude(end, height + 0.05 + rng.normal(0.0, 0.2), 0.2 * factor)
    for landmark, (lx, ly, lz) in enumerate(BEACONS):
        dx, dy, dz = lx - x, ly - y, lz - (height + 0.2)
        along = math.hypot(dx, dy)
        bearing = _core.wrap_angle(math.atan2(dy, dx) - heading + rng.normal(0.0, 0.02))
        distance = math.hypot(along, dz) + rng.normal(0.0, 0.1) if landmark == 0 else None
        yield (
            "sightings",
            _core.RangeBearing(
                end,
                landmark,
                distance,
                bearing,
                elevation=math.atan2(dz, along) + rng.normal(0.0, 0.03),
            ),
        )


def tag_triangle_ekf(seed: int, factor: float) -> Sample:
    """Drive a minute by the wheels and fixes of three tags."""
    rng = np.random.default_rng(seed)
    sigma = np.array([0.1, 0.1, 0.1])
    start = np.array([3.0, 4.0, 0.3])
    state = start + sigma * rng.standard_normal(3)
    config = _core.TagTriangleEkfConfig()
    config.correlation_s = 0.0
    config.motion.sigma_velocity_per_sqrt_s = 0.1 * factor
    for name in ("sigma_forward_mps", "sigma_lateral_mps", "sigma_turn_rate_radps",
                 "sigma_point_mps"):  # fmt: skip
        setattr(config.velocity, name, factor * getattr(config.velocity, name))
    config.position.gate = config.velocity.gate = 1.0
    tags = [_core.Tag(10 + i, [*at, 1.0]) for i, at in enumerate(TRIANGLE)]
    ekf = _core.TagTriangleEkf(config, _core.World(tags=tags), _core.PoseEstimate(
        0, _core.Pose2(*start.tolist()), np.diag(np.square(factor * sigma))))  # fmt: skip
    sample, rate, now = Sample(), 7.5, 0
    for step in range(1, round(RIDE_S * rate) + 1):
        end = round(step / rate * NANOSECONDS)
        seconds, now = (end - now) / NANOSECONDS, end
        forward = 0.33 + 0.1 * math.sin(0.3 * step / rate)
        turn_rate = 0.25 * math.sin(0.2 * step / rate)
        state = drive_on(state, seconds, forward, turn_rate)
        noise = SIGMA_WHEELS * rng.standard_normal(2)
        ekf.on(_core.Velocity(end, forward + noise[0], turn_rate + noise[1]))
        if step % 15 not in (0, 7):
            continue
        c, s = math.cos(state[2]), math.sin(state[2])
        for tag, (ahead, left) in zip(tags, TRIANGLE, strict=True):
            at = state[:2] + [c * ahead - s * left, s * ahead + c * left]
            at += SIGMA_FIX * rng.standard_normal(2)
            covariance = np.eye(2) * (factor * SIGMA_FIX) ** 2
            outcome = ekf.on(_core.PositionFix(end, at, covariance, tag=tag.id))
            if end > FOUND_S * NANOSECONDS:
                sample.add("positions", outcome)
    sample.nees = pose_nees(state, ekf.estimate())
    return sample


OTHERS: Mapping[str, Callable[[int, float], Sample]] = {
    "AirEkf: odometry, all sensors": partial(air_ekf, _core.AirMotion.ODOMETRY),
    "AirEkf: constant velocity, all sensors": partial(air_ekf, _core.AirMotion.CONSTANT_VELOCITY),
    "TagTriangleEkf: fixes of tags": tag_triangle_ekf,
}
