# SPDX-License-Identifier: Apache-2.0
"""Start of a run: a given pose, or one found from ranges, scans on a map, and motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_start_config
from locfuse.config.schema import RunConfig, StartSigma
from locfuse.eval.errors import LONGEST_GAP_S, interpolate
from locfuse.run.messages import Messages
from locfuse.run.missing_inputs import how_to_add
from locfuse.types import (
    NANOSECONDS,
    ConfigError,
    FloatArray,
    Hypothesis,
    Log,
    LogError,
    Start,
    Trajectory,
)


def start_of(config: RunConfig, truth: Trajectory | None, messages: Messages) -> _core.PoseEstimate:
    """Return where the estimator starts, and when.

    Raises ConfigError where the start is ``truth`` and the log has none, or none with a heading.
    """
    if config.searches_start:
        raise ConfigError(f"start is {config.start!r}; expected 'truth' or [x, y, heading_deg] "
                          "here")  # fmt: skip
    if not isinstance(config.start, str):
        return given_start(config.start, config.start_sigma, messages.begin_ns)
    if truth is None or truth.heading is None:
        lacks = "no truth.csv" if truth is None else "a truth.csv without headings"
        raise ConfigError(f"start is 'truth', but the log has {lacks}; "
                          "set start: [x, y, heading_deg]")  # fmt: skip
    if int(truth.stamp_ns[0]) > messages.end_ns:
        raise ConfigError("start is 'truth', but truth.csv begins after the last message; do all "
                          "files count time from the same origin?")  # fmt: skip
    stamp = max(int(truth.stamp_ns[0]), messages.begin_ns)
    at, inside = interpolate(truth, np.array([stamp], dtype=np.int64))
    if stamp > int(truth.stamp_ns[-1]):
        raise ConfigError("start is 'truth', but truth.csv ends before the first message")
    if not inside[0] or at.heading is None:
        raise ConfigError(
            f"start is 'truth', but truth.csv has a gap of more than {LONGEST_GAP_S:g} s at the "
            "first message; set start: [x, y, heading_deg]"
        )
    pose = _core.Pose2(float(at.position[0, 0]), float(at.position[0, 1]), float(at.heading[0]))
    return _core.PoseEstimate(stamp, pose, _covariance(config.start_sigma))


def start_height(truth: Trajectory | None, messages: Messages) -> float | None:
    """Return the height of the reference at the start, metres; None where it has none."""
    if truth is None or truth.height is None:
        return None
    stamp = max(int(truth.stamp_ns[0]), messages.begin_ns)
    at, _ = interpolate(truth, np.array([stamp], dtype=np.int64))
    return float(at.height[0]) if at.height is not None and len(at) else None


def given_start(
    start: tuple[float, float, float], sigma: StartSigma, stamp: int
) -> _core.PoseEstimate:
    """Return the start [x_m, y_m, heading_deg] of a configuration, at a stamp [ns]."""
    x, y, heading_deg = start
    pose = _core.Pose2(x, y, _core.wrap_angle(float(np.deg2rad(heading_deg))))
    return _core.PoseEstimate(stamp, pose, _covariance(sigma))


def _covariance(sigma: StartSigma) -> FloatArray:
    turn = np.deg2rad(sigma.heading_deg)
    covariance: FloatArray = np.diag([sigma.xy_m, sigma.xy_m, turn]) ** 2
    return covariance


def scans_of(log: Log) -> list[_core.LaserScan]:
    """Return the scans of a log as messages, of all its lasers; none where it has no scans.

    A scan of which an intensity is not known is one without.
    """
    if "scans" not in log or not log.has_laser:
        return []
    names = log["scans"].get("laser")
    geometries: dict[tuple[str, float, float], _core.LaserGeometry] = {}
    found = []
    for row, stamp in enumerate(log["scans"]["stamp_ns"].tolist()):
        laser, beams = log.scan_geometry(row)
        name = "" if names is None else str(names[row])
        key = name, laser["angle_min_rad"], laser["angle_increment_rad"]
        if key not in geometries:
            geometries[key] = laser_geometry(laser)
        bright = log["scans"]["intensities"][row, :beams] if "intensities" in log["scans"] else None
        known = bright is not None and bool(np.all(np.isfinite(bright)))
        found.append(_core.LaserScan(stamp, geometries[key], log["scans"]["ranges_m"][row, :beams],
                                     bright if known else None))  # fmt: skip
    return found


def laser_geometry(laser: Mapping[str, Any]) -> _core.LaserGeometry:
    """Return what `Log.laser` says of a laser as the C++ core takes it."""
    return _core.LaserGeometry(
        _core.Pose2(*(float(v) for v in laser["pose_in_body"])),
        angle_min=float(laser["angle_min_rad"]),
        angle_increment=float(laser["angle_increment_rad"]),
        range_min=float(laser["range_min_m"]),
        range_max=float(laser["range_max_m"]),
        time_increment=float(laser.get("time_increment_s", 0.0)),
    )


def grid_of(log: Log) -> _core.OccupancyGrid | None:
    """Return the map of a log, or None where it has no map."""
    return None if log.grid is None else log.grid.occupancy_grid()


def matcher_of(log: Log) -> _core.ScanMatcher | None:
    """Return a scan matcher on the map of a log, or None where it has no map.

    Raises ValueError where no cell of the map is occupied.
    """
    grid = grid_of(log)
    return None if grid is None else _core.ScanMatcher(grid)


def require_headings(config: RunConfig, log: Log) -> None:
    """Raise LogError where the start is ``srls_headings``, and the log has not what that needs."""
    there = {"ranges": "ranges" in log, "scans": "scans" in log and log.has_laser,
             "map": log.grid is not None}  # fmt: skip
    for what in there if config.start == "srls_headings" else ():
        if not there[what]:
            raise LogError(
                "start is 'srls_headings', which needs ranges, scans and a map, but the log has no "
                f"{what}; {how_to_add(log, what)}, or set start: auto"
            )


def start_from_nothing(
    config: RunConfig,
    log: Log,
    messages: _core.MessageLog,
    begin_ns: int,
    anchors: _core.AnchorMap,
    tags: Sequence[_core.Tag],
    landmarks: _core.LandmarkSensor | None = None,
) -> tuple[_core.Initializer, int, Start]:
    """Feed messages and scans to an `Initializer` until it is ready.

    Returns it, the stamp up to which messages were used, and how it went.
    Raises LogError where the log ends before one pose is left; the text says what is missing.
    """
    require_headings(config, log)
    scans = scans_of(log)
    matcher = matcher_of(log) if scans else None
    world = _core.World(anchors, list(tags), landmarks, matcher=matcher)
    initializer = _core.Initializer(build_start_config(config), world)
    run = _core.find_start(initializer, messages, scans if matcher is not None else [])
    state = initializer.state()
    if state.status != _core.StartStatus.READY:
        raise LogError(f"start is {config.start!r}, but the log ends before one pose is left: "
                       f"{state.reason}; set start: [x, y, heading_deg]")  # fmt: skip
    best = state.hypotheses[0].estimate
    start = Start(
        stamp_ns=best.stamp,
        seconds=(best.stamp - begin_ns) / NANOSECONDS,
        pose=_pose(best),
        covariance=best.covariance,
        steps=tuple((step.stamp, hypotheses_of(step.state.hypotheses)) for step in run.steps),
        used_scans=matcher is not None,
        sums_m=None if state.headings is None else state.headings.sums,
    )
    return initializer, run.used_until, start


def _pose(estimate: _core.PoseEstimate) -> FloatArray:
    return np.array([estimate.pose.x, estimate.pose.y, estimate.pose.heading])


def hypotheses_of(found: Sequence[_core.PoseHypothesis]) -> tuple[Hypothesis, ...]:
    """Return poses that fit as plain arrays: copies, as an estimator goes on with its own."""
    return tuple(Hypothesis(_pose(h.estimate), h.estimate.covariance.copy(), h.probability)
                 for h in found)  # fmt: skip


def returns_of(log: Log, stamp: int) -> FloatArray:
    """Return the end points in body, (n, 2) [m], of the scan nearest to an instant."""
    row = int(np.argmin(np.abs(log["scans"]["stamp_ns"] - stamp)))
    laser, beams = log.scan_geometry(row)
    ranges = log["scans"]["ranges_m"][row, :beams]
    angle = laser["angle_min_rad"] + laser["angle_increment_rad"] * np.arange(len(ranges))
    x, y, heading = laser["pose_in_body"]
    hit = np.isfinite(ranges) & (ranges > 0.0) & (ranges < laser["range_max_m"])
    angle, ranges = angle[hit] + heading, ranges[hit]
    return np.column_stack([x + ranges * np.cos(angle), y + ranges * np.sin(angle)])
