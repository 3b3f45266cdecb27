# SPDX-License-Identifier: Apache-2.0
"""Poses of another localizer beside wheels and ranges: no worse than the better of the two."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import interpolate
from locfuse.run.mcl import localize, with_poses_of
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, FloatArray, Log, StampArray, Trajectory, wrap_angle
from papers.claims import Claim, Progress, claims_of
from papers.starts import drawn_start

MAX_RATIO = 1.02  # of the RMSE of the position to that of the better part
NEES_BAND = (2.0, 4.0)  # of 3
ANCHORS: Mapping[int, Mapping[str, list[float]]] = {
    0: {},
    2: {"SW": [0, 0, 2], "SE": [10, 0, 2]},
    4: {"SW": [0, 0, 2], "SE": [10, 0, 2], "NE": [10, 10, 2], "NW": [0, 10, 2]},
}
DURATION_S = 300.0
SETTLED_S = 10.0  # after which errors count: that of the start is drawn
RATE_HZ = 2.0
SIGMA = np.array([0.06, 0.06, np.deg2rad(1.0)])  # of a pose, each axis
WHEELS = {
    "sigma_longitudinal_per_sqrt_m": 0.03,
    "sigma_lateral_per_sqrt_m": 0.0,
    "sigma_heading_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_rad": 0.03,
}

Poses = tuple[StampArray, FloatArray, FloatArray]  # stamps, (n, 3) poses, (n, 3) stated sigmas


@dataclass(frozen=True)
class Drive:
    """What a localizer that is simulated may use: the log, and the true poses at its stamps."""

    log: Log
    stamp_ns: StampArray
    true: FloatArray
    rng: np.random.Generator


def wandering(correlation_s: float, stated: float = 1.0) -> Callable[[Drive], Poses]:
    """Return a source whose errors are a Gauss-Markov process; 0 s: they are white."""

    def poses(of: Drive) -> Poses:
        kept = np.exp(-1.0 / (RATE_HZ * correlation_s)) if correlation_s > 0.0 else 0.0
        draws = of.rng.standard_normal(of.true.shape)
        errors = gauss_markov(draws, np.full(len(draws), kept))
        return of.stamp_ns, of.true + SIGMA * errors, np.tile(stated * SIGMA, (len(errors), 1))

    return poses


def gauss_markov(draws: FloatArray, kept: FloatArray) -> FloatArray:
    """Return errors of variance 1, of which row k keeps the share `kept[k]` of the one before."""
    errors = draws.copy()
    for k in range(1, len(errors)):
        errors[k] = kept[k] * errors[k - 1] + np.sqrt(1.0 - kept[k] ** 2) * draws[k]
    return errors


def turned_map(of: Drive) -> Poses:
    """Localize, with white errors, on a map that lies a degree and 10 cm off the anchors."""
    stamp_ns, z, sigmas = wandering(0.0)(of)
    angle = np.deg2rad(1.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = 0.1 * np.array([np.cos(2.0), np.sin(2.0)])
    return stamp_ns, np.column_stack([z[:, :2] @ turn.T + shift, z[:, 2] + angle]), sigmas


def by_the_same_wheels(of: Drive) -> Poses:
    """Localize by the wheels that the filter goes by, as AMCL does, and by scans at 2 Hz."""
    sigma = np.array([0.1, 0.1, np.deg2rad(2.0)])
    config = _core.PoseEkfConfig()
    for key, value in WHEELS.items():
        setattr(config.odometry, key, value)
    config.correlation_s = 0.0
    start = _core.PoseEstimate(int(of.stamp_ns[0]), _core.Pose2(*of.true[0].tolist()),
                               np.diag(sigma**2))  # fmt: skip
    ekf = _core.PoseEkf(config, _core.World(), start)
    seen = of.true + sigma * of.rng.standard_normal(of.true.shape)
    driven, row = increments(of.log), 0
    found, sigmas = np.empty_like(of.true), np.empty_like(of.true)
    for k, stamp in enumerate(of.stamp_ns.tolist()):
        while row < len(driven) and driven[row].stamp <= stamp:
            ekf.on(driven[row])
            row += 1
        ekf.on(_core.PoseObservation(stamp, _core.Pose2(*seen[k].tolist()), np.diag(sigma**2)))
        now = ekf.estimate()
        found[k] = now.pose.x, now.pose.y, now.pose.heading
        sigmas[k] = np.sqrt(np.diag(now.covariance))
    sigmas[:, :2] = np.sqrt((sigmas[:, :2] ** 2).mean(axis=1))[:, None]
    return of.stamp_ns, found, sigmas


def jumping(of: Drive) -> Poses:
    """Jump by 1 m for 5 s, every half minute."""
    stamp_ns, z, sigmas = wandering(0.0)(of)
    seconds = (stamp_ns - stamp_ns[0]) / NANOSECONDS
    for begin in np.arange(of.rng.uniform(15.0, 25.0), seconds[-1], 30.0):
        angle = of.rng.uniform(-np.pi, np.pi)
        off = (seconds >= begin) & (seconds < begin + 5.0)
        z[off, :2] += [np.cos(angle), np.sin(angle)]
    return stamp_ns, z, sigmas


def frozen(of: Drive) -> Poses:
    """Repeat a pose for 3 s, every half minute."""
    stamp_ns, z, sigmas = wandering(0.0)(of)
    seconds = (stamp_ns - stamp_ns[0]) / NANOSECONDS
    for begin in np.arange(of.rng.uniform(15.0, 25.0), seconds[-1], 30.0):
        rows = np.flatnonzero((seconds >= begin) & (seconds < begin + 3.0))
        z[rows] = z[rows[0]]
    return stamp_ns, z, sigmas


def late(of: Drive) -> Poses:
    """Stamp poses 0.3 s after the instant that they are of."""
    stamp_ns, z, sigmas = wandering(0.0)(of)
    truth = truth_of(of.log)
    assert truth is not None
    before, _ = interpolate(truth, np.maximum(stamp_ns - round(0.3 * NANOSECONDS), stamp_ns[0]))
    assert before.heading is not None
    return stamp_ns, z - of.true + np.column_stack([before.position, before.heading]), sigmas


SITUATIONS: Mapping[str, Callable[[Drive], Poses]] = {
    "white errors": wandering(0.0),
    "errors of 1 s": wandering(1.0),
    "errors of 5 s": wandering(5.0),
    "errors of 20 s": wandering(20.0),
    "errors of 5 s, twice the stated": wandering(5.0, stated=0.5),
    "map turned by a degree": turned_map,
    "by the same wheels": by_the_same_wheels,
    "jumps of 1 m": jumping,
    "frozen for 3 s": frozen,
    "stamps 0.3 s late": late,
}


def config_of(anchors: int, seed: int, **keys: Any) -> RunConfig:
    """Return wheels and ranges whose noise is known; of poses nothing is said."""
    return parse_config(
        {
            "simulation": {
                "path": {"shape": "waypoints", "speed_mps": 0.5, "turn_rate_radps": 0.7},
                "duration_s": DURATION_S,
                "anchors": ANCHORS[anchors],
                "odometry": {"rate_hz": 20},
                "ranges": {"sigma_m": 0.1, "sigma_relative": 0.0} if anchors else None,
                "poses": {"rate_hz": RATE_HZ},
                **keys,
            },
            "start_sigma": {"xy_m": 0.1, "heading_deg": 3.0},
            "estimator": {"odometry": WHEELS, "range": {"sigma_m": 0.1}},
            "seed": seed,
        }
    )


@dataclass(frozen=True)
class Compared:
    """Mean squares of one run: of the position [m^2], of the heading [rad^2]; and the mean NEES.

    Of the fused estimate, of the poses carried on by wheels, and of the filter without poses.
    """

    fused: FloatArray
    poses: FloatArray
    others: FloatArray
    nees: float
    nees_of_others: float


def drive(anchors: int, seed: int) -> tuple[RunConfig, Log]:
    config = config_of(anchors, seed)
    return config, load_log(config, None, seed)


def compare(situation: Callable[[Drive], Poses], anchors: int, seed: int,
            **keys: Any) -> Compared:  # fmt: skip
    """Fuse the poses of a situation, and not."""
    config, log = drive(anchors, seed)
    if keys:
        estimator = config.estimator.model_copy(update=keys)
        config = config.model_copy(update={"estimator": estimator})
    table = log["poses"]
    truth = truth_of(log)
    assert truth is not None
    of = Drive(log, table["stamp_ns"], _poses_of(truth, table["stamp_ns"]),
               np.random.default_rng([seed, 3]))  # fmt: skip
    stamp_ns, z, sigmas = situation(of)
    poses = {"stamp_ns": stamp_ns, "x_m": z[:, 0], "y_m": z[:, 1],
             "heading_rad": wrap_angle(z[:, 2]), "sigma_xy_m": sigmas[:, 0].copy(),
             "sigma_heading_rad": sigmas[:, 2].copy()}  # fmt: skip
    return compared(config, replace(log, tables={**log.tables, "poses": poses}), seed)


def particles(anchors: int, seed: int) -> Compared:
    """Fuse the product's own particles, by AMCL's defaults, in the room of ekim2020."""
    config = config_of(anchors, seed, laser={"rate_hz": 5.0}, map={}, poses=None)
    mcl = {"poses_hz": RATE_HZ, "spacing_m": 0.25, "spacing_heading_rad": 0.2,
           "min_particles": 500, "max_particles": 2000}  # fmt: skip
    config = parse_config({**config.model_dump(mode="json", exclude_unset=True), "mcl": mcl})
    log = load_log(config, None, seed)
    start = drawn_start(config, truth_of(log), to_messages(log, config), seed)
    with_poses = with_poses_of(localize(config, log, start=start), log, RATE_HZ)
    pose = config.estimator.pose.model_copy(update={"shares_odometry": True})  # as a run has it
    estimator = config.estimator.model_copy(update={"pose": pose})
    return compared(config.model_copy(update={"estimator": estimator}), with_poses, seed)


def compared(config: RunConfig, log: Log, seed: int) -> Compared:
    truth = truth_of(log)
    assert truth is not None
    start = drawn_start(config, truth, to_messages(log, config), seed)
    alone = config.model_copy(update={"mcl": None})
    tables = {name: table for name, table in log.tables.items() if name != "poses"}
    fused, nees = _errors(run(alone, log, start=start).estimate, truth)
    others, nees_of_others = _errors(
        run(alone, replace(log, tables=tables), start=start).estimate, truth
    )
    stamps, z = carried(log)
    return Compared(fused, _mean_squares(stamps, z, truth), others, nees, nees_of_others)


def carried(log: Log) -> tuple[StampArray, FloatArray]:
    """Return the poses of a log, each carried on by wheels until the next."""
    table = log["poses"]
    driven, row = increments(log), 0
    stamps, found = [], []
    pose: _core.Pose2 | None = None
    at = table["stamp_ns"].tolist()
    for u in driven:
        if pose is not None:
            pose = pose * u.motion
        while row < len(at) and at[row] <= u.stamp:
            pose = _core.Pose2(*(float(table[k][row]) for k in ("x_m", "y_m", "heading_rad")))
            row += 1
        if pose is not None:
            stamps.append(u.stamp)
            found.append((pose.x, pose.y, pose.heading))
    return np.array(stamps, np.int64), np.array(found)


def increments(log: Log) -> list[_core.Increment]:
    table = log["odometry"]
    stamps = table["stamp_ns"].tolist()
    return [
        _core.Increment(begin, end, _core.Pose2(*motion))
        for begin, end, *motion in zip(stamps[:-1], stamps[1:], *(
            table[name][1:].tolist() for name in ("dx_m", "dy_m", "dheading_rad")), strict=True)
    ]  # fmt: skip


def _poses_of(truth: Trajectory, stamp_ns: StampArray) -> FloatArray:
    at, _ = interpolate(truth, stamp_ns)
    assert at.heading is not None
    return np.column_stack([at.position, at.heading])


def _off(stamp_ns: StampArray, z: FloatArray, truth: Trajectory) -> FloatArray:
    off = z - _poses_of(truth, stamp_ns)
    off[:, 2] = wrap_angle(off[:, 2])
    return off


def _settled(stamp_ns: StampArray, truth: Trajectory) -> Any:
    return stamp_ns >= truth.stamp_ns[0] + round(SETTLED_S * NANOSECONDS)


def _mean_squares(stamp_ns: StampArray, z: FloatArray, truth: Trajectory) -> FloatArray:
    rows = _settled(stamp_ns, truth)
    squares = (_off(stamp_ns[rows], z[rows], truth) ** 2).mean(axis=0)
    return np.array([squares[0] + squares[1], squares[2]])


def _errors(estimate: Trajectory, truth: Trajectory) -> tuple[FloatArray, float]:
    assert estimate.heading is not None
    assert estimate.covariance is not None
    last = np.diff(estimate.stamp_ns, append=np.iinfo(np.int64).max) > 0
    rows = last & _settled(estimate.stamp_ns, truth)
    z = np.column_stack([estimate.position, estimate.heading])[rows]
    off = _off(estimate.stamp_ns[rows], z, truth)
    solved = np.linalg.solve(estimate.covariance[rows], off[:, :, None])[:, :, 0]
    squares = (off**2).mean(axis=0)
    return (np.array([squares[0] + squares[1], squares[2]]),
            float((off * solved).sum(axis=1).mean()))  # fmt: skip


def pose_source_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows of each situation: with no anchors, with two and with four."""
    parts = [
        partial(_rows, name, anchors, partial(compare, situation, anchors), seeds)
        for name, situation in SITUATIONS.items()
        for anchors in ANCHORS
        if anchors or situation is not turned_map  # without anchors its map is the world
    ]
    parts += [
        partial(_rows, "own particles", anchors, partial(particles, anchors), seeds)
        for anchors in ANCHORS
    ]
    return claims_of(parts, progress)


def _rows(
    name: str, anchors: int, compare_seed: Callable[[int], Compared], seeds: int
) -> Iterator[Claim]:
    runs = [compare_seed(seed) for seed in range(seeds)]
    key = f"{name.replace(',', '').replace(' ', '_')}_{anchors}"
    what = f"{name}, {anchors or 'no'} anchors"
    fused, poses, others = (
        np.array([getattr(run, of) for run in runs]) for of in ("fused", "poses", "others")
    )
    better = poses if poses[:, 0].mean() < others[:, 0].mean() else others
    rms = [np.sqrt(part.mean(axis=0)) for part in (fused, poses, others)]
    spread = np.quantile(np.sqrt(fused[:, 0] / better[:, 0]), [0.05, 0.95])
    ratio = float(rms[0][0] / min(rms[1][0], rms[2][0]))
    centimetres = ", ".join(f"{100.0 * part[0]:.1f}" for part in rms)
    degrees = ", ".join(f"{np.rad2deg(part[1]):.2f}" for part in rms)
    yield Claim(f"{key}_ratio", f"{what}: RMSE fused / of the better part", "x", None, ratio,
                float(spread[0]), float(spread[1]), f"<= {MAX_RATIO:g}", ratio <= MAX_RATIO,
                f"fused, poses, without: {centimetres} cm; {degrees} degrees")  # fmt: skip
    nees = np.array([run.nees for run in runs])
    mean, (low, high) = float(nees.mean()), np.quantile(nees, [0.05, 0.95])
    least, most = NEES_BAND
    yield Claim(f"{key}_nees", f"{what}: NEES of 3, mean", "1", None, mean, float(low),
                float(high), f"{least:g}..{most:g}", least <= mean <= most,
                f"without poses {np.mean([run.nees_of_others for run in runs]):.2f}")  # fmt: skip
