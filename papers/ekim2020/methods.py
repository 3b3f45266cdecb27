# SPDX-License-Identifier: Apache-2.0
"""Global initialization at every scan of a recording, and the filter linearized at the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.build import build_anchors, build_estimator_config, build_initializer_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.run.messages import truth_of
from locfuse.run.start import matcher_of, scans_of
from locfuse.types import FloatArray, Log, wrap_angle
from papers.ekim2020.world import SIGMA_M, Trials, epochs


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
    """Start anew at every scan, from the last ranges before it and the scan alone."""
    return judged(power_up_states(log, config), log, within_m, within_deg)


def power_up_states(log: Log, config: RunConfig, method: str = "auto") -> list[_core.StartState]:
    """Return what is known after each scan that has a truth, started anew at every one."""
    matcher = matcher_of(log)
    assert matcher is not None
    names = [str(name) for name in log["anchors"]["anchor"]]
    anchors = build_anchors(log["anchors"], names, config.anchors)
    ids = {name: number for number, name in enumerate(names)}
    tags = [_core.Tag(k, list(position)) for k, position in enumerate(log.tags.values())]
    tag_ids = {name: number for number, name in enumerate(log.tags)}
    settings = build_initializer_config(config.initializer, method)
    settings.estimator = build_estimator_config(config.estimator)
    ranges = log["ranges"]
    states = []
    for scan, _ in _scans_and_truth(log):
        start = _core.Initializer(settings, _core.World(anchors, tags, matcher=matcher))
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
    for scan, true, position, covariance in _scans_and_fixes(log):
        pose = matcher.search(scan, position, covariance).hypotheses[0].match.pose
        errors.append(float(np.hypot(pose.x - true[0], pose.y - true[1])))
    return np.array(errors)


def ten_degree_errors(log: Log, config: RunConfig) -> FloatArray:
    """Return heading errors [rad] of ``start: srls_headings``, whether it is ready or not."""
    states = power_up_states(log, config, "srls_headings")
    errors = []
    for state, (_, true) in zip(states, _scans_and_truth(log), strict=True):
        if state.headings is not None:  # else no ranges came before the scan
            assert state.headings.heading is not None
            errors.append(abs(float(wrap_angle(state.headings.heading - true[2]))))
    return np.array(errors)


def _scans_and_fixes(
    log: Log,
) -> Iterator[tuple[_core.LaserScan, FloatArray, FloatArray, FloatArray]]:
    """Yield scan, true pose, and position and covariance from the last ranges before it."""
    anchors, ranges, height = epochs(log, next(iter(log.tags)))
    range_ns = np.unique(log["ranges"]["stamp_ns"])
    fixes = _core.locate_batch(anchors, ranges, SIGMA_M, height=height)
    for scan, true in _scans_and_truth(log):
        row = int(np.searchsorted(range_ns, scan.stamp, side="right")) - 1
        if row >= 0:
            yield scan, true, fixes.position[row], fixes.covariance[row]


def rmse_over_bound(drawn: Trials, sigma: float, solver: str) -> tuple[float, FloatArray]:
    """Return RMSE / Cramer-Rao bound of a solver, and the NEES of each trial."""
    found = _core.locate_batch(drawn.anchors, drawn.ranges, sigma, solver=solver)
    error = found.position - drawn.points
    nees: FloatArray = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
    bound = np.sqrt(np.mean(np.trace(drawn.bound, axis1=1, axis2=2)))
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))) / bound), nees


def linearized_at_truth(config: RunConfig, log: Log, start: _core.PoseEstimate) -> FloatArray:
    """Return position errors of the same filter with every Jacobian taken at the truth.

    With them the error obeys a linear system, for which the Kalman filter is optimal: no filter
    that only sees the messages does better. The models are the library's own; the recursion is
    written out here for the error e = estimate - truth.

    Returns
    -------
    float64 array, shape (n, 2)
        At every stamp of the truth but the first, metres.
    """
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    estimator = config.estimator
    motion, ranges = _models(config, log)
    odometry, poses = log["odometry"], log["poses"]
    true_poses = [_core.Pose2(x, y, h) for (x, y), h in zip(truth.position, truth.heading,
                                                            strict=True)]  # fmt: skip
    at = {int(stamp): row for row, stamp in enumerate(truth.stamp_ns)}
    range_rows = _rows_by_stamp(log["ranges"]["stamp_ns"])
    pose_rows = _rows_by_stamp(poses["stamp_ns"])
    anchor_ids = {str(name): i for i, name in enumerate(log["anchors"]["anchor"])}
    pose_model = _core.PoseModel()

    e = _core.local(start.pose, true_poses[0])
    P = start.covariance.copy()
    errors = []
    previous = int(odometry["stamp_ns"][0])
    for k in range(len(odometry["stamp_ns"])):
        stamp = int(odometry["stamp_ns"][k])
        here = true_poses[at[stamp]]
        if k > 0:
            before = true_poses[at[previous]]
            driven = before.inverse() * here
            measured = _core.Pose2(odometry["dx_m"][k], odometry["dy_m"][k],
                               odometry["dheading_rad"][k])  # fmt: skip
            step = motion.propagate(before, driven, 0.0)
            measured_step = motion.propagate(before, measured, 0.0)
            e = step.jacobian @ e + _core.local(measured_step.moved, step.moved)
            P = step.jacobian @ P @ step.jacobian.T + step.noise
        for row in range_rows.get(stamp, ()):
            z = _core.Range(stamp, 0, anchor_ids[str(log["ranges"]["anchor"][row])],
                            float(log["ranges"]["range_m"][row]))  # fmt: skip
            lin = ranges.linearize(here, z)
            assert lin is not None
            e, P = _linear_update(e, P, lin)
        for row in pose_rows.get(stamp, ()):
            sigma = [poses["sigma_xy_m"][row], poses["sigma_xy_m"][row],
                     poses["sigma_heading_rad"][row]]  # fmt: skip
            pose = _core.Pose2(poses["x_m"][row], poses["y_m"][row], poses["heading_rad"][row])
            seen = _core.PoseObservation(stamp, pose, np.diag(np.square(sigma)))
            lin = pose_model.linearize(here, seen)
            assert lin is not None
            e, P = _linear_update(e, P, lin)
        errors.append(e[:2])
        previous = stamp
    assert estimator.range.gate == 1.0 == estimator.pose.gate
    return np.array(errors)


def _linear_update(
    e: FloatArray, P: FloatArray, lin: _core.Linearization
) -> tuple[FloatArray, FloatArray]:
    H, R = lin.jacobian, lin.noise
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    A = np.eye(3) - K @ H
    return e + K @ (lin.residual - H @ e), A @ P @ A.T + K @ R @ K.T


def _models(config: RunConfig, log: Log) -> tuple[_core.OdometryMotion, _core.RangeModel]:
    from locfuse.config.build import build_anchors, build_estimator_config

    built = build_estimator_config(config.estimator)
    names = [str(name) for name in log["anchors"]["anchor"]]
    anchors = build_anchors(log["anchors"], names, config.anchors)
    tags = [_core.Tag(i, list(position)) for i, position in enumerate(log.tags.values())]
    return _core.OdometryMotion(built.odometry), _core.RangeModel(built.range, anchors, tags)


def _rows_by_stamp(stamps: Any) -> dict[int, list[int]]:
    rows: dict[int, list[int]] = {}
    for row, stamp in enumerate(stamps.tolist()):
        rows.setdefault(stamp, []).append(row)
    return rows
