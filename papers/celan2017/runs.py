# SPDX-License-Identifier: Apache-2.0
"""What the scrubber believes along a lap, by each set-up of Table II and some of ours."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.scenario import Covered, WheelSlip
from locfuse.run.start import scans_of
from locfuse.sim import laser
from locfuse.sim.faults import World, with_faults
from locfuse.sim.sensors import seconds
from locfuse.types import Columns, FloatArray, Log, StampArray, wrap_angle
from papers.celan2017.world import LASER, SIZE_M, TAGS, Lap

Message: TypeAlias = _core.Increment | _core.LaserScan | _core.PositionFix | _core.Range
Uwb: TypeAlias = Literal["none", "fixes", "ranges"]

SIGMA_START = (0.02, 0.02, np.deg2rad(1.0))  # of the mark on the floor on which it is parked
PARTICLES = 2000
# Of the wheels as a user may know them: wide enough for what they get wrong all the time.
SIGMAS = {
    "sigma_longitudinal_per_sqrt_m": 0.05,
    "sigma_lateral_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_m": 0.03,
    "sigma_heading_per_sqrt_rad": 0.05,
}
# The same for the filter of UWB, which is asked where they may spin: as on a floor that is wet.
# Particles told that spread without need, and the switch acts in clean laps (docs/accuracy.md).
SIGMAS_WET = SIGMAS | {
    "sigma_longitudinal_per_sqrt_m": 0.2,
    "sigma_heading_per_sqrt_m": 0.06,
    "sigma_heading_per_sqrt_rad": 0.1,
}
SIGMA_UWB_M = 0.25  # of a range: its noise and what its calibration leaves
# Of the switch, chosen on seeds 100 to 111: half a metre is not to be passed, and a pose through
# walls, half a metre off, is better than none. Particles that are sure are never overruled, as in
# the paper: UWB that comes back after minutes may be sure of a place across the floor.
SWITCH = {
    "elsewhere_m": float(np.hypot(*SIZE_M)),
    "elsewhere_rad": np.pi,
    "sigma_unsure_m": 0.18,
    "sigma_sure_m": 0.18,
    "uwb_sigma_m": 0.18,
    "doubt_s": 1.0,
    "uwb_nis": 3.0,
}
BLIND_S, SEEN_S = 180.0, 20.0  # with nothing in sight, and thereafter until the end of the lap
SPIN_WAY, SPIN_TURN = 1.25, 1.1  # what wheels tell there over what is driven


class Estimator(Protocol):
    """What takes messages in order of time and says where the body is."""

    def on(self, message: Message, /) -> object: ...
    def estimate(self) -> _core.PoseEstimate: ...


@dataclass(frozen=True)
class Setup:
    """How a lap is localized.

    Attributes
    ----------
    text : str
    make : callable
        Takes the lap, the pose it is told at the start, and a seed; returns an `Estimator`.
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


class Wheels:
    """Odometry alone."""

    def __init__(self, start: _core.PoseEstimate) -> None:
        self._motion = _core.OdometryMotion(sigmas())
        self._start = start
        self._pose, self._stamp = start.pose, start.stamp

    def on(self, message: Message, /) -> None:
        if isinstance(message, _core.Increment):
            self._pose = self._pose * message.motion
            self._stamp = message.stamp

    def estimate(self) -> _core.PoseEstimate:
        return _core.PoseEstimate(self._stamp, self._pose, self._start.covariance)


def sigmas(told: Mapping[str, float] = SIGMAS) -> _core.OdometryConfig:
    """Return the noise of the wheels as estimators know it."""
    config = _core.OdometryConfig()
    for name, value in told.items():
        setattr(config, name, value)
    return config


def mcl(lap: Lap, start: _core.PoseEstimate, seed: int) -> _core.Mcl:
    """Return `Mcl` on the robot's map, at the pose that it is told."""
    config = _core.MclConfig()
    config.min_particles = config.max_particles = PARTICLES
    config.seed = seed
    config.odometry = sigmas()
    config.range.sigma_m = SIGMA_UWB_M
    grid = lap.floor.map.occupancy_grid()
    made = _core.Mcl(config, grid, start.stamp, *radios_known(lap))
    made.start_at([_core.PoseHypothesis(start)])
    return made


def switching(lap: Lap, start: _core.PoseEstimate, seed: int) -> _core.SwitchingMcl:
    """Return `mcl` that UWB rescues: ranges and wheels in a filter of their own."""
    config = _core.RecoveringEkfConfig()
    config.estimator.odometry = sigmas(SIGMAS_WET)
    config.estimator.range.sigma_m = SIGMA_UWB_M
    uwb = _core.RecoveringEkf(config, *radios_known(lap))
    uwb.start_at(start)
    thresholds = _core.SwitchingMclConfig()
    for name, value in SWITCH.items():
        setattr(thresholds, name, value)
    return _core.SwitchingMcl(thresholds, mcl(lap, start, seed), uwb)


def radios_known(lap: Lap) -> tuple[_core.AnchorMap, list[_core.Tag]]:
    """Return anchors and tags with the ids of the messages."""
    places = lap.floor.anchors.values()
    anchors = _core.AnchorMap([_core.Anchor(k, list(at)) for k, at in enumerate(places)])
    return anchors, tags_known()


def half(lap: Lap) -> tuple[Covered, ...]:
    """Return the cardboard of Fig. 12, over the right half."""
    return (Covered(from_deg=-180.0, to_deg=0.0),)


def hall(lap: Lap) -> tuple[Covered, ...]:
    """Return the cardboard, and a time with nothing in sight, as in a hall wider than the reach."""
    end_s = lap.duration_s - SEEN_S
    return (*half(lap), Covered(from_deg=-180.0, to_deg=180.0, from_s=end_s - BLIND_S,
                                to_s=end_s))  # fmt: skip


def spinning(lap: Lap) -> Columns:
    """Return what the wheels tell where they spin in that hall, as on a floor that is wet."""
    end_s = lap.duration_s - SEEN_S
    slip = WheelSlip(from_s=end_s - BLIND_S, to_s=end_s, translation_factor=SPIN_WAY,
                     rotation_factor=SPIN_TURN)  # fmt: skip
    odometry = {"odometry": lap.log["odometry"]}
    world = World(lap.drive, {}, {}, lap.log["odometry"]["stamp_ns"])
    return with_faults(odometry, [(slip, np.random.default_rng(0))], world)["odometry"]


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
    told = reported_start(lap, seed)
    given = list(messages(lap, setup))
    stamps, found = [], []
    begin = time.perf_counter()
    estimator = setup.make(lap, told, seed)
    for is_scan, message in given:
        if not is_scan or setup.scans:
            estimator.on(message)
        if is_scan:
            stamps.append(message.stamp)
            found.append(estimator.estimate())
    wall_s = time.perf_counter() - begin
    stamp_ns = np.array(stamps, np.int64)
    truth = lap.drive.pose_at(seconds(stamp_ns))
    estimate = np.array([[e.pose.x, e.pose.y, e.pose.heading] for e in found])
    drawn = truth[:, :2] + lap.floor.shift(truth[:, :2])
    return Run(
        stamp_ns,
        truth,
        estimate,
        np.array([e.covariance for e in found]),
        np.asarray(np.hypot(*(estimate[:, :2] - drawn).T)),
        lap.floor.in_open_room(truth[:, :2]),
        lap.duration_s,
        wall_s,
        tuple(estimator.injections) if isinstance(estimator, _core.SwitchingMcl) else (),
    )


def reported_start(lap: Lap, seed: int) -> _core.PoseEstimate:
    """Return the pose of the mark on the floor, off by as much as its covariance says."""
    off = SIGMA_START * np.random.default_rng([seed, 2]).standard_normal(3)
    x, y, heading = (lap.drive.pose_at(0.0)[0] + off).tolist()
    return _core.PoseEstimate(0, _core.Pose2(x, y, _core.wrap_angle(heading)),
                              np.diag(np.square(SIGMA_START)))  # fmt: skip


def messages(lap: Lap, setup: Setup) -> Iterator[tuple[bool, Message]]:
    """Yield whether it is a scan, and each message, in order of the stamps where they take effect.

    An increment takes effect where it begins; at equal stamps scans come last.
    """
    scans = scans_of(lap.log if setup.cover is None else _covered(lap, setup.cover(lap)))
    rows: list[tuple[int, bool, Message]] = [(z.stamp, True, z) for z in scans]
    wheels = spinning(lap) if setup.wet else lap.log["odometry"]
    rows += [(u.begin, False, u) for u in increments(wheels)]
    if setup.uwb == "fixes":
        rows += [(z.stamp, False, z) for z in tag_fixes(lap.fixes)]
    elif setup.uwb == "ranges":
        rows += [(z.stamp, False, z) for z in _ranges(lap)]
    rows.sort(key=lambda row: row[:2])
    yield from (row[1:] for row in rows)


def _covered(lap: Lap, covers: tuple[Covered, ...]) -> Log:
    scans = lap.log["scans"]
    hidden = [laser.covered(scans["stamp_ns"], LASER, cover) for cover in covers]
    table = {**scans, "ranges_m": np.where(np.any(hidden, axis=0), np.nan, scans["ranges_m"])}
    return replace(lap.log, tables={**lap.log.tables, "scans": table})


def increments(odometry: Columns) -> Iterator[_core.Increment]:
    """Yield the motions of a table of odometry."""
    stamps = odometry["stamp_ns"].tolist()
    motions = zip(
        *(odometry[key].tolist() for key in ("dx_m", "dy_m", "dheading_rad")), strict=True
    )
    for begin, end, motion in zip(stamps[:-1], stamps[1:], list(motions)[1:], strict=True):
        yield _core.Increment(begin, end, _core.Pose2(*motion))


def _ranges(lap: Lap) -> Iterator[_core.Range]:
    table = lap.log["ranges"]
    tags, anchors = list(TAGS), list(lap.floor.anchors)
    columns = (table[key].tolist() for key in ("stamp_ns", "tag", "anchor", "range_m"))
    for stamp, tag, anchor, distance in zip(*columns, strict=True):
        yield _core.Range(stamp, tags.index(tag), anchors.index(anchor), distance)


def tags_known() -> list[_core.Tag]:
    """Return the tags with the ids of the messages."""
    return [_core.Tag(k, list(at)) for k, at in enumerate(TAGS.values())]


def tag_fixes(fixes: Columns) -> Iterator[_core.PositionFix]:
    """Yield the positions that an RTLS gives, one tag after the other."""
    ids = {name: k for k, name in enumerate(TAGS)}
    rows = zip(*(fixes[key].tolist() for key in ("stamp_ns", "tag", "x_m", "y_m")),
               fixes["covariance"], strict=True)  # fmt: skip
    for stamp, tag, x, y, covariance in rows:
        yield _core.PositionFix(stamp, [x, y], covariance, ids[tag])


def tag_poses(fixes: Columns) -> Iterator[_core.PoseObservation]:
    """Yield the pose that fits the positions of all three tags best, wherever all are heard."""
    stamps, count = np.unique(fixes["stamp_ns"], return_counts=True)
    heard = set(stamps[count == len(TAGS)].tolist())
    arms = {k: at[:2] for k, at in enumerate(TAGS.values())}
    every = (z for z in tag_fixes(fixes) if z.stamp in heard)
    for stamp, together in groupby(every, key=lambda z: z.stamp):
        epoch = list(together)
        fit = _core.rigid_fit(np.array([arms[z.tag] for z in epoch if z.tag is not None]),
                              np.array([z.position for z in epoch]),
                              np.array([z.covariance for z in epoch]))  # fmt: skip
        if fit.status == _core.RigidFitStatus.FITTED:
            yield _core.PoseObservation(stamp, fit.pose, fit.covariance)
