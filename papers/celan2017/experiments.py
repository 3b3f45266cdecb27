# SPDX-License-Identifier: Apache-2.0
"""Laps of the scrubber by each set-up of Table II and some of ours."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.scenario import Covered
from locfuse.run.start import scans_of
from locfuse.sim.sensors import seconds
from locfuse.types import FloatArray, StampArray, wrap_angle
from papers.celan2017.methods import Estimator, Message, Wheels, mcl, switching
from papers.celan2017.world import (
    Lap,
    covered,
    half,
    hall,
    increments,
    lap,
    ranges_of,
    spinning,
    tag_fixes,
)
from papers.claims import Progress

Uwb: TypeAlias = Literal["none", "fixes", "ranges"]

SIGMA_START = (0.02, 0.02, np.deg2rad(1.0))  # of the mark on the floor on which it is parked


@dataclass(frozen=True)
class Setup:
    """How a lap is localized.

    Attributes
    ----------
    text : str
    make : callable
        Takes the lap, the pose at the start, and a seed; returns an `Estimator`.
    cover : callable, optional
        Takes the lap and returns the covers of the laser.
    uwb : str
        What it is given of the radios.
    scans : bool
        Whether it is given scans.
    wet : bool
        Whether wheels spin where nothing is in sight.
    """

    text: str
    make: Callable[[Lap, _core.PoseEstimate, int], Estimator]
    cover: Callable[[Lap], tuple[Covered, ...]] | None = None
    uwb: Uwb = "none"
    scans: bool = True
    wet: bool = False


@dataclass(frozen=True)
class Run:
    """What was believed at each scan of a lap.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
    truth, estimate : float64 arrays, shape (n, 3)
        x, y [m] and heading [rad] in world.
    covariance : float64 array, shape (n, 3, 3)
        Of (x, y, heading), as the estimator states it.
    off_map_m : float64 array, shape (n,)
        Distance to where the robot is on its bent map.
    in_room : bool array, shape (n,)
        Whether the robot is in the room with the anchors.
    duration_s, wall_s : float
        Of the lap, and that its replay took.
    injections : tuple of Injection
        When UWB took over, by a switch.
    """

    stamp_ns: StampArray
    truth: FloatArray
    estimate: FloatArray
    covariance: FloatArray
    off_map_m: FloatArray
    in_room: NDArray[np.bool_]
    duration_s: float
    wall_s: float
    injections: tuple[_core.Injection, ...] = ()

    @property
    def off_m(self) -> FloatArray:
        """Error of position, shape (n,)."""
        return np.asarray(np.hypot(*(self.estimate - self.truth)[:, :2].T))

    @property
    def end(self) -> FloatArray:
        """Estimate minus truth at the end: x, y [m], heading [rad]."""
        off = self.estimate[-1] - self.truth[-1]
        return np.array([off[0], off[1], wrap_angle(off[2])])

    @property
    def sigma_in_body(self) -> FloatArray:
        """Standard deviations ahead and to the side, shape (n, 2), as Fig. 14 has their squares."""
        c, s = np.cos(self.estimate[:, 2]), np.sin(self.estimate[:, 2])
        turn = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], axis=1)
        turned = turn @ self.covariance[:, :2, :2] @ turn.swapaxes(1, 2)
        return np.asarray(np.sqrt(np.diagonal(turned, axis1=1, axis2=2)))


SETUPS: Mapping[str, Setup] = {
    "odometry": Setup("odometry", lambda lap, start, seed: Wheels(start), scans=False),
    "lidar": Setup("LiDAR", mcl),
    "covered": Setup("half of the LiDAR covered", mcl, half),
    "covered_ranges": Setup("half covered, UWB ranges always", mcl, half, "ranges"),
    "covered_switch": Setup("half covered, UWB by a switch", switching, half, "ranges"),
    "lidar_switch": Setup("LiDAR, UWB by a switch", switching, None, "ranges"),
    "hall": Setup("half covered, a wet hall", mcl, hall, wet=True),
    "hall_ranges": Setup(
        "half covered, a wet hall, UWB ranges always", mcl, hall, "ranges", wet=True
    ),
    "hall_switch": Setup(
        "half covered, a wet hall, UWB by a switch", switching, hall, "ranges", wet=True
    ),
}


def follow(lap: Lap, setup: Setup, seed: int) -> Run:
    """Replay a lap by a set-up."""
    start = marked_start(lap, seed)
    given = list(messages(lap, setup))
    stamps, found, spread = [], [], []
    begin = time.perf_counter()
    estimator = setup.make(lap, start, seed)
    for is_scan, message in given:
        if not is_scan or setup.scans:
            estimator.on(message)
        if is_scan:
            stamps.append(message.stamp)
            found.append(estimator.estimate())
            spread.append(_spread(estimator, found[-1]))
    wall_s = time.perf_counter() - begin
    stamp_ns = np.array(stamps, np.int64)
    truth = lap.drive.pose_at(seconds(stamp_ns))
    estimate = np.array([[e.pose.x, e.pose.y, e.pose.heading] for e in found])
    drawn = truth[:, :2] + lap.floor.shift(truth[:, :2])
    return Run(
        stamp_ns,
        truth,
        estimate,
        np.array(spread),
        np.asarray(np.hypot(*(estimate[:, :2] - drawn).T)),
        lap.floor.in_open_room(truth[:, :2]),
        lap.duration_s,
        wall_s,
        tuple(estimator.injections) if isinstance(estimator, _core.SwitchingMcl) else (),
    )


def _spread(estimator: Estimator, estimate: _core.PoseEstimate) -> FloatArray:
    """Return the covariance of particles, without what being lost adds: docs/health.md (14)."""
    if isinstance(estimator, _core.Mcl | _core.SwitchingMcl):
        health, span = estimator.health(), _core.HealthConfig().wrong_span_m
        if health.state == _core.HealthState.LOST:
            anywhere = np.array([span**2 / 3.0, span**2 / 3.0, np.pi**2 / 3.0])
            return np.asarray(estimate.covariance - health.wrong * np.diag(anywhere))
    return np.asarray(estimate.covariance)


def marked_start(lap: Lap, seed: int) -> _core.PoseEstimate:
    """Return the pose of the mark on the floor, off by as much as its covariance says."""
    off = SIGMA_START * np.random.default_rng([seed, 2]).standard_normal(3)
    x, y, heading = (lap.drive.pose_at(0.0)[0] + off).tolist()
    return _core.PoseEstimate(0, _core.Pose2(x, y, _core.wrap_angle(heading)),
                              np.diag(np.square(SIGMA_START)))  # fmt: skip


def messages(lap: Lap, setup: Setup) -> Iterator[tuple[bool, Message]]:
    """Yield whether it is a scan, and each message, in order of the stamps where they take effect.

    An increment takes effect where it begins; at equal stamps scans come last.
    """
    scans = scans_of(lap.log if setup.cover is None else covered(lap, setup.cover(lap)))
    rows: list[tuple[int, bool, Message]] = [(z.stamp, True, z) for z in scans]
    wheels = spinning(lap) if setup.wet else lap.log["odometry"]
    rows += [(u.begin, False, u) for u in increments(wheels)]
    if setup.uwb == "fixes":
        rows += [(z.stamp, False, z) for z in tag_fixes(lap.fixes)]
    elif setup.uwb == "ranges":
        rows += [(z.stamp, False, z) for z in ranges_of(lap)]
    rows.sort(key=lambda row: row[:2])
    yield from (row[1:] for row in rows)


NEAR_M, LOST_M = 0.5, 1.0


@cache  # rows and pictures show the same runs
def runs_of(seed: int) -> dict[str, Run]:
    """Return the runs of all set-ups on the lap of a seed."""
    of = lap(seed)
    return {name: follow(of, setup, seed) for name, setup in SETUPS.items()}


def laps(seeds: int, progress: Progress = lambda done, total: None) -> dict[str, list[Run]]:
    """Return the runs of each set-up on the laps of seeds 0 to seeds - 1."""
    every = []
    for seed in range(seeds):
        every.append(runs_of(seed))
        progress(seed + 1, seeds)
    return {name: [runs[name] for runs in every] for name in SETUPS}


def end_m(run: Run) -> float:
    """Return the error of position at the end."""
    return float(np.hypot(*run.end[:2]))


def longest_lost_s(run: Run) -> float:
    """Return the longest time without a pose within `LOST_M` that begins after an injection."""
    if not run.injections:
        return 0.0
    after = run.stamp_ns >= run.injections[0].stamp
    time_s = seconds(run.stamp_ns[after])
    found = np.flatnonzero(run.off_m[after] <= LOST_M)
    edges = np.concatenate([[time_s[0]], time_s[found], [time_s[-1]]])
    return float(np.diff(edges).max())
