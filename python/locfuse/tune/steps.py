# SPDX-License-Identifier: Apache-2.0
"""Steps of odometry whose noise counts by what the robot did, not by what each step reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from locfuse.config.schema import Odometry, RunConfig
from locfuse.run.messages import MOTION
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray

# Over so long a noise is small against a turn, and a robot does one thing.
_WINDOW_S = 1.0
_CLEAR = 4.0  # a turn of two sigmas of its noise may be none
_STEADY = 0.25  # share by which a steady pace varies at most
_SLOW = 0.05  # [m/s] and [rad/s]


@dataclass(frozen=True)
class Steps:
    """Motions between stamps, (n, 3): what is reported, and its mean over a second.

    A step of 30 ms is as much noise as motion: by its own size its variance would grow with its
    noise, and a scale would shrink the noise rather than correct the motion.
    """

    begin_ns: StampArray
    stamp_ns: StampArray
    arrival_ns: StampArray
    motion: FloatArray
    mean: FloatArray

    @property
    def windows(self) -> FloatArray:
        """How many such steps the window around each has, (n,)."""
        return np.maximum(_WINDOW_S * NANOSECONDS / (self.stamp_ns - self.begin_ns), 1.0)

    @property
    def change_pace(self) -> bool:
        """Whether speed or turn rate vary: at one pace a latency is another place on the way."""
        seconds = (self.stamp_ns - self.begin_ns) / NANOSECONDS
        pace = self.mean[:, [0, 2]] / seconds[:, None]
        size = np.sqrt(np.mean(pace**2, axis=0))
        return bool(np.any(pace.std(axis=0) > _STEADY * np.maximum(size, _SLOW)))

    def table(self, wheels: Odometry) -> Columns:
        """Return odometry, corrected, with variances: docs/models/motion.md eq. (1.3)."""
        seconds = (self.stamp_ns - self.begin_ns) / NANOSECONDS
        distance, turn = np.hypot(self.mean[:, 0], self.mean[:, 1]), np.abs(self.mean[:, 2])
        noise = (wheels.sigma_heading_per_sqrt_m**2 * distance
                 + wheels.sigma_heading_per_sqrt_rad**2 * turn)  # fmt: skip
        # Of a turn that is but noise nothing is left.
        clear = np.maximum(1.0 - _CLEAR * noise / np.maximum(turn**2 * self.windows, 1e-12), 0.0)
        turn = clear * turn
        scale = np.array([wheels.distance_scale, wheels.distance_scale, wheels.turn_scale])
        sure = np.column_stack([np.ones_like(clear), np.ones_like(clear), clear])
        motion = self.motion + (scale - 1.0) * sure * self.mean
        angle = wheels.direction_rad + 0.5 * (motion[:, 2] - self.motion[:, 2])
        c, s = np.cos(angle), np.sin(angle)
        columns = dict(zip(MOTION, (c * motion[:, 0] - s * motion[:, 1],
                                    s * motion[:, 0] + c * motion[:, 1], motion[:, 2]),
                           strict=True))  # fmt: skip
        variance = np.column_stack([
            wheels.sigma_longitudinal_per_sqrt_m**2 * distance
            + wheels.sigma_longitudinal_per_sqrt_s**2 * seconds
            + wheels.sigma_xy_per_sqrt_s**2 * seconds,
            wheels.sigma_lateral_per_sqrt_m**2 * distance + wheels.sigma_xy_per_sqrt_s**2 * seconds,
            wheels.sigma_heading_per_sqrt_m**2 * distance
            + wheels.sigma_heading_per_sqrt_rad**2 * turn
            + wheels.sigma_heading_per_sqrt_s**2 * seconds,
        ])  # fmt: skip
        return {"begin_ns": self.begin_ns, "stamp_ns": self.stamp_ns, **columns,
                "arrival_ns": self.arrival_ns, "variance": variance}  # fmt: skip


def steps_of(odometry: Columns, config: RunConfig) -> Steps | None:
    """Return the steps of a table of wheels; None where it has gaps, or its clock goes back."""
    stamp = odometry["stamp_ns"]
    if "begin_ns" in odometry or len(stamp) < 3 or np.any(np.diff(stamp) <= 0):
        return None
    if "dx_m" in odometry:
        motion = np.column_stack([odometry[name] for name in MOTION])[1:]
    else:
        seconds = np.diff(stamp) / NANOSECONDS
        if seconds.max() > config.estimator.hold_s:
            return None
        motion = _chords(odometry, seconds)
    begin, stamp = stamp[:-1], stamp[1:]
    arrival = odometry.get("arrival_ns")
    arrival = begin if arrival is None else arrival[1:] if "dx_m" in odometry else arrival[:-1]
    return Steps(begin, stamp, arrival, motion, _means(begin, stamp, motion))


def _chords(odometry: Columns, seconds: FloatArray) -> FloatArray:
    """Return the motions of velocities that hold until the next."""
    turn = odometry["omega_radps"][:-1] * seconds
    forward = odometry["v_mps"][:-1] * seconds
    left = odometry.get("v_left_mps", np.zeros(len(seconds) + 1))[:-1] * seconds
    along = np.sinc(turn / np.pi)
    across = np.sin(0.5 * turn) * np.sinc(0.5 * turn / np.pi)
    return np.column_stack([along * forward - across * left, across * forward + along * left, turn])


def _means(begin: StampArray, stamp: StampArray, motion: FloatArray) -> FloatArray:
    """Return the part of each step in the motion of the second around it."""
    ends = np.concatenate([begin[:1], stamp])
    total = np.vstack([np.zeros(3), np.cumsum(motion, axis=0)])
    middle, length = 0.5 * (begin + stamp), (stamp - begin).astype(float)
    half = 0.5 * np.maximum(_WINDOW_S * NANOSECONDS, length)
    low = np.clip(middle - half, ends[0], ends[-1])
    high = np.clip(middle + half, ends[0], ends[-1])
    share = length / (high - low)
    return np.column_stack([share * (np.interp(high, ends, of) - np.interp(low, ends, of))
                            for of in total.T])  # fmt: skip
