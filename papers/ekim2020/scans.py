# SPDX-License-Identifier: Apache-2.0
"""A robot that is switched on at every scan of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_anchors, build_estimator_config, build_initializer_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.run.messages import truth_of
from locfuse.run.start import matcher_of, scans_of
from locfuse.types import FloatArray, Log, wrap_angle
from papers.ekim2020.simulated import SIGMA_M
from papers.ekim2020.sites import epochs


@dataclass(frozen=True)
class PowerUps:
    """What a robot says that is switched on at each scan of a recording.

    Attributes
    ----------
    ready, fits : bool arrays, shape (n,)
        One pose was left; one of the poses that are left is right.
    position_m, heading_rad : float64 arrays, shape (n,)
        Errors of the likeliest pose; NaN where there is none.
    """

    ready: NDArray[np.bool_]
    fits: NDArray[np.bool_]
    position_m: FloatArray
    heading_rad: FloatArray


def power_ups(log: Log, config: RunConfig, within_m: float, within_deg: float) -> PowerUps:
    """Start anew at every scan, from the ranges heard last before it and the scan alone."""
    return judged(power_up_states(log, config), log, within_m, within_deg)


def power_up_states(log: Log, config: RunConfig) -> list[_core.StartState]:
    """Return what is known after each scan that has a truth, started anew at every one."""
    matcher = matcher_of(log)
    assert matcher is not None
    names = [str(name) for name in log["anchors"]["anchor"]]
    anchors = build_anchors(log["anchors"], names, config.anchors)
    ids = {name: number for number, name in enumerate(names)}
    tags = [_core.Tag(k, list(position)) for k, position in enumerate(log.tags.values())]
    tag_ids = {name: number for number, name in enumerate(log.tags)}
    settings = build_initializer_config(config.initializer)
    estimator = build_estimator_config(config.estimator)
    ranges = log["ranges"]
    states = []
    for scan, _ in _scans_and_truth(log):
        start = _core.Initializer(settings, estimator, anchors, tags, matcher)
        before = ranges["stamp_ns"] <= scan.stamp
        if before.any():
            newest = ranges["stamp_ns"][before].max()
            for row in np.flatnonzero(ranges["stamp_ns"] == newest):
                start.on(_core.Range(int(newest), tag_ids[str(ranges["tag"][row])],
                                     ids[str(ranges["anchor"][row])],
                                     float(ranges["range_m"][row])))  # fmt: skip
        start.on(scan)
        states.append(start.state())
    return states


def judged(
    states: Sequence[_core.StartState], log: Log, within_m: float, within_deg: float
) -> PowerUps:
    """Compare states at every scan with the truth of a log."""
    rows = [_judged(state, pose, within_m, within_deg)
            for state, (_, pose) in zip(states, _scans_and_truth(log), strict=True)]  # fmt: skip
    ready, fits, position, heading = zip(*rows, strict=True)
    return PowerUps(np.array(ready), np.array(fits), np.array(position), np.array(heading))


def _judged(
    state: _core.StartState, pose: FloatArray, within_m: float, within_deg: float
) -> tuple[bool, bool, float, float]:
    errors = [(float(np.hypot(h.estimate.pose.x - pose[0], h.estimate.pose.y - pose[1])),
               abs(float(wrap_angle(h.estimate.pose.heading - pose[2]))))
              for h in state.hypotheses]  # fmt: skip
    fits = any(d <= within_m and turn <= np.deg2rad(within_deg) for d, turn in errors)
    first = errors[0] if errors else (np.nan, np.nan)
    return state.status == _core.StartStatus.READY, fits, *first


def _scans_and_truth(log: Log) -> Iterator[tuple[_core.LaserScan, FloatArray]]:
    """Yield each scan that has a truth, and its true pose (x [m], y [m], heading [rad])."""
    truth = truth_of(log)
    assert truth is not None
    scans = scans_of(log)
    at, inside = interpolate(truth, np.array([scan.stamp for scan in scans], np.int64))
    assert at.heading is not None
    poses = np.column_stack([at.position, at.heading])
    return zip(compress(scans, inside), poses, strict=True)


def refined_errors(log: Log) -> FloatArray:
    """Return position errors [m] of the scan's pose alone, searched about the ranges' position."""
    matcher = matcher_of(log)
    assert matcher is not None
    errors = []
    for scan, true, position, covariance in _scans_and_fixes(log, "ml"):
        pose = matcher.search(scan, position, covariance).hypotheses[0].match.pose
        errors.append(float(np.hypot(pose.x - true[0], pose.y - true[1])))
    return np.array(errors)


def ten_degree_errors(log: Log) -> FloatArray:
    matcher = matcher_of(log)
    assert matcher is not None
    errors = []
    for scan, true, position, _ in _scans_and_fixes(log, "srls"):
        found = matcher.heading_search(scan, position).heading
        assert found is not None
        errors.append(abs(float(wrap_angle(found - true[2]))))
    return np.array(errors)


def _scans_and_fixes(
    log: Log, solver: str
) -> Iterator[tuple[_core.LaserScan, FloatArray, FloatArray, FloatArray]]:
    """Yield scan, true pose, and position and covariance from the ranges heard last before it."""
    anchors, ranges, height = epochs(log, next(iter(log.tags)))
    received_ns = np.unique(log["ranges"]["stamp_ns"])
    fixes = _core.locate_batch(anchors, ranges, SIGMA_M, height=height, solver=solver)
    for scan, true in _scans_and_truth(log):
        row = int(np.searchsorted(received_ns, scan.stamp, side="right")) - 1
        if row >= 0:
            yield scan, true, fixes.position[row], fixes.covariance[row]
