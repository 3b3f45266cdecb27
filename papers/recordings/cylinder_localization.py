# SPDX-License-Identifier: Apache-2.0
"""Localization on cylinders found in raw scans of recordings.

A `CylinderDetector` finds them without names, a `PoseEkf` associates those of a scan with
the map jointly and drives by the wheels in between. Noise and offsets are what the publishers of
the recordings state, for a pole of the car park what its detector counts for the laser.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.eval.errors import interpolate
from locfuse.run.start import scans_of
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, StampArray, Trajectory
from papers.claims import Claim, absent, share
from papers.datasets.source import TRUCK
from papers.recorded import load_recording
from papers.scores import rms

Seen = list[tuple[int, list[_core.RangeBearing]]]

START_SIGMAS = np.array([0.03, 0.03, np.deg2rad(1.0)])  # of fits to poles, and of a camera

# The car park: where its laser was, as its notes have it, and poles with reflective tape.
PARK_START_NS = 46_598_000_000
PARK_LASER = (4.688, 0.836, 4.382)
POLES = _core.CylinderDetectorConfig(
    sigma_range_m=0.03, sigma_bearing_rad=0.004, radius_m=0.03, least_beams=1, least_intensity=1.0
)
NEAR_M = 20.0  # within which poles are counted
AT_POLE_M = 0.3  # what ends no further from a pole is of it
PARK_REQUIRED_M = 0.12
IN_VIEW_M = (5.0, 10.0, 15.0, NEAR_M)  # rings within which poles are counted by geometry
IN_VIEW_RAD = np.deg2rad(89.0)  # a SICK sees 90 degrees to each side
FROM_POSE_M = 0.5  # a pole at 20 m, from a pose whose heading is off by a degree

# The arena: no boxes are there; beams scatter by 1.5 cm about a circle, and are 6 mrad apart.
ARENA_START = (1.850, 1.897, np.deg2rad(213.5))
TO_CENTRE_M = 0.090  # the lectures add it to the mean range of a cylinder
SIGMA_CAMERA_M = 0.001  # which resolves millimetres
ARENA_REQUIRED_M = 0.015


def cylinder_parts(configs: Path) -> list[Callable[[], Iterator[Claim]]]:
    """Return what yields the rows, in parts; the folder is that of the ready configurations."""
    return [lambda: _park_claims(configs), lambda: _arena_claims(configs)]


def load_drive(configs: Path | None, dataset: str) -> Log:
    """Return the log of a recording; `load_recording` says what is raised."""
    return load_recording(configs, dataset, dataset.replace("_", "-"))[1]


@dataclass(frozen=True)
class Drive:
    """Positions and those of a reference, which the estimator does not use.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
        Of the reference.
    position, reference : float64 arrays, shape (n, 2)
        Metres in world.
    nees : float64 array, shape (n,)
        Of two components; with the noise of the reference.
    fused : float
        Share of the sightings that fitted a cylinder; 1 where there was none.
    """

    stamp_ns: StampArray
    position: FloatArray
    reference: FloatArray
    nees: FloatArray
    fused: float

    @property
    def off(self) -> FloatArray:
        """How far apart the two are, shape (n,), metres."""
        off: FloatArray = np.hypot(*(self.position - self.reference).T)
        return off


def sightings_of(log: Log, detector: _core.CylinderDetector) -> Seen:
    """Return the stamp of each scan of a log, and the cylinders in it, without names.

    They bring no covariance: that of a fit does not know of offsets, which publishers' noise has.
    """
    return [
        (scan.stamp, [_core.RangeBearing(scan.stamp, None, cylinder.range, cylinder.bearing)
                      for cylinder in detector.detect(scan)])
        for scan in scans_of(log)
    ]  # fmt: skip


def localize(
    log: Log,
    config: _core.PoseEkfConfig,
    start: _core.PoseEstimate,
    seen: Seen,
    stamp_ns: StampArray,
) -> tuple[list[_core.PoseEstimate], list[_core.Outcome]]:
    """Drive a log by its odometry and by cylinders that are seen.

    Parameters
    ----------
    log : Log
    config : PoseEkfConfig
    start : PoseEstimate
    seen : list of (stamp, sightings)
    stamp_ns : int64 array, shape (n,)

    Returns
    -------
    list of PoseEstimate, list of Outcome
        At those of the stamps that are not before the start; of each sighting since.
    """
    table, mount = log["landmarks"], laser_of(log)
    places = zip(table["x_m"].tolist(), table["y_m"].tolist(), strict=True)
    known = _core.LandmarkMap([_core.Landmark(i, at) for i, at in enumerate(places)])
    ekf = _core.PoseEkf(config, _core.World(landmarks=_core.LandmarkSensor(known, mount)), start)
    odometry = _odometry_of(log)
    begun, poses, outcomes = 0, [], []
    events = [*seen, *((stamp, None) for stamp in stamp_ns.tolist())]
    for stamp, what in sorted(events, key=lambda each: (each[0], each[1] is None)):
        while begun < len(odometry) and odometry[begun][0] <= stamp:
            ekf.on(odometry[begun][1])
            begun += 1
        if stamp < start.stamp:
            continue
        if what is None:
            poses.append(ekf.estimate(stamp))
        elif what:
            outcomes += ekf.on_joint(what)
    return poses, outcomes


def laser_of(log: Log) -> _core.Pose2:
    """Return where the laser of a log sits on the body."""
    assert log.laser is not None
    return _core.Pose2(*map(float, log.laser["pose_in_body"]))


def _odometry_of(log: Log) -> list[tuple[int, _core.Velocity | _core.Increment]]:
    """Return the odometry of a log, each with the stamp from which it holds."""
    table = log["odometry"]
    stamps = table["stamp_ns"].tolist()
    if "v_mps" in table:
        rows = zip(stamps, table["v_mps"].tolist(), table["omega_radps"].tolist(), strict=True)
        return [(row[0], _core.Velocity(*row)) for row in rows]
    moved = np.column_stack([table["dx_m"], table["dy_m"], table["dheading_rad"]])[1:].tolist()
    return [
        (begin, _core.Increment(begin, end, _core.Pose2(*motion)))
        for begin, end, motion in zip(stamps[:-1], stamps[1:], moved, strict=True)
    ]


def compared(
    driven: tuple[list[_core.PoseEstimate], list[_core.Outcome]],
    point: tuple[float, float],
    reference: Trajectory,
    sigma: float,
) -> Drive:
    """Compare a point of the body with where a reference saw it, at the stamps of both."""
    config = _core.PositionConfig()
    config.antenna_forward_m, config.antenna_left_m = point
    model = _core.PositionModel(config)
    poses, outcomes = driven
    rows = np.searchsorted(reference.stamp_ns, [pose.stamp for pose in poses])
    seen, nees = reference.position[rows], []
    for pose, at in zip(poses, seen.tolist(), strict=True):
        fix = _core.PositionFix(pose.stamp, at, np.eye(2) * sigma**2)
        lin = model.linearize(pose.pose, fix)
        assert lin is not None  # of the antenna
        S = lin.jacobian @ pose.covariance @ lin.jacobian.T + lin.noise
        nees.append(float(lin.residual @ np.linalg.solve(S, lin.residual)))
    position = np.array([model.predict(pose.pose) for pose in poses]).reshape(-1, 2)
    fused = [outcome.verdict == _core.Verdict.FUSED for outcome in outcomes]
    share_fused = float(np.mean(fused)) if fused else 1.0
    return Drive(reference.stamp_ns[rows], position, seen, np.array(nees), share_fused)


# Car park --------------------------------------------------------------------------------------


def park_config(log: Log) -> _core.PoseEkfConfig:
    """Return the noise of the laser, and what the recording's notes have: 0.2 m/s, 4 degrees.

    These are of each reading of the truck; docs/models/motion.md, eq. (3.6), at its mean speed. It
    does not slip aside. The notes' 0.1 m and 1 degree of a pole have room for errors that last,
    which the filter knows.
    """
    stamps, speed = log["odometry"]["stamp_ns"], float(np.mean(np.abs(log["odometry"]["v_mps"])))
    seconds = float(np.median(np.diff(stamps))) / NANOSECONDS
    truck = _core.AckermannVehicle(
        _core.AckermannConfig(
            wheel_base_m=TRUCK.config.wheel_base_m,
            encoder_left_m=TRUCK.config.encoder_left_m,
            sigma_speed_mps=0.2,
            sigma_steering_rad=float(np.deg2rad(4.0)),
        )
    )
    sigma = np.sqrt(np.diag(truck.covariance(speed, 0.0)) * seconds / speed)
    config = _core.PoseEkfConfig()
    config.odometry.sigma_longitudinal_per_sqrt_m = float(sigma[0])
    config.odometry.sigma_lateral_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_m = float(sigma[1])
    config.odometry.sigma_heading_per_sqrt_rad = 0.0
    config.landmark.sigma_range_m = POLES.sigma_range_m
    config.landmark.sigma_bearing_rad = POLES.sigma_bearing_rad
    return config


def park_drive(log: Log, *, blind: bool = False) -> Drive:
    """Drive the car park without GPS, which says afterwards where the laser was.

    Parameters
    ----------
    log : Log
    blind : bool
        Whether no pole is looked at.
    """
    gps, mount = gps_of(log), laser_of(log)
    driven = _park_poses(log, gps.stamp_ns, blind=blind)
    return compared(driven, (mount.x, mount.y), gps, float(log["positions"]["sigma_m"][0]))


def _park_poses(
    log: Log, stamp_ns: StampArray, *, blind: bool = False
) -> tuple[list[_core.PoseEstimate], list[_core.Outcome]]:
    body = _core.Pose2(*PARK_LASER) * laser_of(log).inverse()
    start = _core.PoseEstimate(PARK_START_NS, body, np.diag(START_SIGMAS**2))
    seen = [] if blind else sightings_of(log, _core.CylinderDetector(POLES))
    return localize(log, park_config(log), start, seen, stamp_ns)


def gps_of(log: Log) -> Trajectory:
    """Return the positions of a log as a trajectory."""
    table = log["positions"]
    return Trajectory(table["stamp_ns"], np.column_stack([table["x_m"], table["y_m"]]))


@dataclass(frozen=True)
class Found:
    """Counts over the scans that determine the heading.

    Attributes
    ----------
    shown, found : int
        Poles whose tape a beam meets within `NEAR_M`, and those of them that were found.
    reported, false : int
        Cylinders found within `NEAR_M`, and those of them where no pole is.
    """

    shown: int
    found: int
    reported: int
    false: int


def poles_found(log: Log, config: _core.CylinderDetectorConfig = POLES) -> Found:
    """Count poles of the car park, turned to the tape that a scan shows, seen from GPS."""
    poles = np.column_stack([log["landmarks"]["x_m"], log["landmarks"]["y_m"]])
    scans, laser = scans_of(log), log.laser
    assert laser is not None
    beams = np.arange(log["scans"]["ranges_m"].shape[1])
    beam = laser["angle_min_rad"] + laser["angle_increment_rad"] * beams
    at, inside = interpolate(gps_of(log), log["scans"]["stamp_ns"])
    detector = _core.CylinderDetector(config)
    counts = np.zeros(4, np.int64)
    for row, eye in zip(np.flatnonzero(inside).tolist(), at.position, strict=True):
        scan = scans[row]
        ranges = scan.ranges
        bright = (scan.intensities >= POLES.least_intensity) & (ranges < NEAR_M)
        taped = _ends(ranges[bright] + POLES.radius_m, beam[bright])
        there = _turned(poles, eye, taped)
        if there is None:
            continue
        reported = [(c.range, c.bearing) for c in detector.detect(scan) if c.range < NEAR_M]
        off = _distances(_ends(*np.array(reported).reshape(-1, 2).T), there)
        shown = _distances(taped, there).min(axis=0) < AT_POLE_M
        found = (off < AT_POLE_M).any(axis=0) & shown
        false = ~(off < AT_POLE_M).any(axis=1)
        counts += [shown.sum(), found.sum(), len(reported), false.sum()]
    return Found(*counts.tolist())


def poles_in_view(log: Log, poses: list[_core.PoseEstimate]) -> NDArray[np.int64]:
    """Count poles that geometry has in view of the laser, and those of them that are found.

    Whether a beam met them does not count: half a degree at 10 m is 9 cm, and a pole 6 cm.

    Parameters
    ----------
    log : Log
    poses : list of PoseEstimate
        At stamps of scans.

    Returns
    -------
    int array, shape (4, 2)
        Found and in view, by the rings of `IN_VIEW_M`.
    """
    poles = np.column_stack([log["landmarks"]["x_m"], log["landmarks"]["y_m"]])
    scans = {scan.stamp: scan for scan in scans_of(log)}
    detector, mount = _core.CylinderDetector(POLES), laser_of(log)
    counts = np.zeros((len(IN_VIEW_M), 2), np.int64)
    for pose in poses:
        eye = (pose.pose * mount).inverse()
        there = np.array([eye.act(pole) for pole in poles])
        distance, bearing = np.hypot(*there.T), np.arctan2(there[:, 1], there[:, 0])
        view = (distance < NEAR_M) & (np.abs(bearing) < IN_VIEW_RAD)
        reported = [(c.range, c.bearing) for c in detector.detect(scans[pose.stamp])]
        off = _distances(_ends(*np.array(reported).reshape(-1, 2).T), there[view])
        found = (off < FROM_POSE_M).any(axis=0)
        ring = np.searchsorted(IN_VIEW_M, distance[view], side="right")
        np.add.at(counts, ring, np.column_stack([found, np.ones_like(found)]))
    return counts


def _ends(distance: FloatArray, bearing: FloatArray) -> FloatArray:
    ends: FloatArray = distance[:, np.newaxis] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    return ends


def _distances(points: FloatArray, others: FloatArray) -> FloatArray:
    off: FloatArray = np.linalg.norm(points[:, np.newaxis] - others, axis=-1)
    return off


def _turned(poles: FloatArray, eye: FloatArray, taped: FloatArray) -> FloatArray | None:
    """Return the poles in the laser's frame, turned so that tape ends at them; None if unsure."""
    if len(taped) < 2:
        return None
    heading = np.deg2rad(np.arange(0.0, 360.0, 0.25))
    c, s = np.cos(heading), np.sin(heading)
    turns = np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=1)
    turned = (turns @ (poles - eye).T).transpose(0, 2, 1)
    off = np.linalg.norm(turned[:, :, np.newaxis] - taped, axis=-1)
    best = int(np.argmin(np.minimum(off.min(axis=1), 1.0).mean(axis=1)))
    two = len(set(off[best].argmin(axis=0).tolist())) >= 2
    there: FloatArray = turned[best]
    return there if two and off[best].min(axis=0).max() < AT_POLE_M else None


def _park_claims(configs: Path) -> Iterator[Claim]:
    key, what, required = "acfr_carpark", "car park (real): ", f"<= {PARK_REQUIRED_M:g}"
    try:
        log = load_drive(configs, "acfr_carpark")
    except LogError as error:
        yield absent(key, f"{what}position RMSE of the laser", str(error), required)
        return
    counts = poles_found(log)
    yield share(f"{key}_found", f"{what}poles found, of those that a beam shows", counts.found,
                counts.shown, 0.97)  # fmt: skip
    yield from _view_claims(key, what, poles_in_view(log, _park_poses(
        log, log["scans"]["stamp_ns"])[0]))  # fmt: skip
    yield share(f"{key}_false", f"{what}cylinders that are none", counts.false,
                counts.reported, 0.02, at_most=True)  # fmt: skip
    drive = park_drive(log)
    rmse = rms(drive.off)
    yield _row(key, f"{what}position RMSE of the laser", "m", rmse, PARK_REQUIRED_M)
    yield _row(f"{key}_nees", f"{what}NEES of 2", "1", float(drive.nees.mean()))


def _view_claims(key: str, what: str, counts: NDArray[np.int64]) -> Iterator[Claim]:
    """Yield how many poles are found of all that are in view, in all and by distance."""
    found, shown = counts.sum(axis=0).tolist()
    of = f"{what}poles found, of all in view by geometry"
    yield share(f"{key}_in_view", f"{of}, within {NEAR_M:g} m", found, shown, 0.97)
    for low, high, (part, all_) in zip((0.0, *IN_VIEW_M), IN_VIEW_M, counts.tolist(), strict=False):
        yield share(f"{key}_in_view_{high:g}", f"{of}, {low:g} to {high:g} m", part, all_, None)


# Arena -----------------------------------------------------------------------------------------


def arena_config() -> _core.PoseEkfConfig:
    """Return the noise that the lectures have: 200 mm and 15 degrees, 0.35 of a way, 0.6 of a turn.

    Each wheel errs by 0.35 of its way in each step, and by 0.6 of the other's excess. As
    random walks, for its steps of 4 cm or 0.15 rad on wheels 173 mm apart. A laser that errs by 15
    mm has 200 mm for what lasts, so errors count as independent.
    """
    way_m, turn_rad, apart_m = 0.04, 0.15, 0.173
    config = _core.PoseEkfConfig()
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.35 * np.sqrt(way_m / 2.0)
    config.odometry.sigma_lateral_per_sqrt_m = 0.0
    config.odometry.sigma_heading_per_sqrt_m = 0.35 * np.sqrt(2.0 * way_m) / apart_m
    config.odometry.sigma_heading_per_sqrt_rad = 0.6 * np.sqrt(2.0 * turn_rad)
    config.landmark.sigma_range_m = 0.2
    config.landmark.sigma_bearing_rad = float(np.deg2rad(15.0))
    config.correlation_s = 0.0
    return config


def arena_cylinders(log: Log, to_centre_m: float = TO_CENTRE_M) -> Seen:
    """Return the cylinders of the arena, ranges corrected as the lectures have it.

    A cylinder of radius R is pi/4 R deep on average: from there its centre is as far again.
    """
    radius = float(log["landmarks"]["radius_m"][0])
    short = to_centre_m - 0.25 * np.pi * radius
    scans = {**log["scans"], "ranges_m": log["scans"]["ranges_m"] + short}
    detector = _core.CylinderDetector(
        _core.CylinderDetectorConfig(
            sigma_range_m=0.015, sigma_bearing_rad=0.006, radius_m=radius, least_corner_evidence=-20
        )
    )
    return sightings_of(replace(log, tables={**log.tables, "scans": scans}), detector)


def arena_drive(
    log: Log,
    config: _core.PoseEkfConfig | None = None,
    *,
    blind: bool = False,
    to_centre_m: float = TO_CENTRE_M,
) -> Drive:
    """Drive the arena from its start; the camera says afterwards where the axle was.

    Parameters
    ----------
    log : Log
    config : PoseEkfConfig, optional
        Instead of `arena_config`.
    blind : bool
        Whether no cylinder is looked at.
    to_centre_m : float
        From the mean range of a cylinder.
    """
    truth = Trajectory(log["truth"]["stamp_ns"],
                       np.column_stack([log["truth"]["x_m"], log["truth"]["y_m"]]))  # fmt: skip
    begin = int(log["odometry"]["stamp_ns"][0])
    start = _core.PoseEstimate(begin, _core.Pose2(*ARENA_START), np.diag(START_SIGMAS**2))
    seen = [] if blind else arena_cylinders(log, to_centre_m)
    driven = localize(log, config or arena_config(), start, seen, truth.stamp_ns)
    return compared(driven, (0.0, 0.0), truth, SIGMA_CAMERA_M)


def _arena_claims(configs: Path) -> Iterator[Claim]:
    key, what, required = "lego_arena", "Lego arena (real): ", f"<= {ARENA_REQUIRED_M:g}"
    try:
        log = load_drive(configs, "lego_arena")
    except LogError as error:
        yield absent(key, f"{what}mean position error", str(error), required)
        return
    drive, wheels = arena_drive(log), arena_drive(log, blind=True)
    mean = float(drive.off.mean())
    yield _row(key, f"{what}mean position error", "m", mean, ARENA_REQUIRED_M)
    yield _row(f"{key}_nees", f"{what}NEES of 2", "1", float(drive.nees.mean()))
    yield _row(f"{key}_wheels", f"{what}mean error of wheels alone", "m", float(wheels.off.mean()))


def _row(key: str, what: str, unit: str, value: float, at_most: float | None = None) -> Claim:
    required = "-" if at_most is None else f"<= {at_most:g}"
    met = at_most is None or value <= at_most
    return Claim(key, what, unit, None, value, value, value, required, met)
