# SPDX-License-Identifier: Apache-2.0
"""Estimators in the plane on simulated logs, by a filter that knows the noise of its sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_recovering_config
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig, StartSigma
from locfuse.eval.errors import interpolate
from locfuse.run.messages import radios_of, to_messages, truth_of
from locfuse.run.run import load_log, run
from locfuse.types import FloatArray, Log, RunResult, Trajectory
from papers.consistency.sample import Sample, pose_nees, with_sigmas_times
from papers.recordings.landmark_mapping import instants_of
from papers.recordings.map_localization import drawn, simulated
from papers.starts import drawn_start

WHEELS = {
    "sigma_longitudinal_per_sqrt_m": 0.03,
    "sigma_lateral_per_sqrt_m": 0.0,
    "sigma_heading_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_rad": 0.03,
}
NOTHING: Mapping[str, Any] = {"anchors": {}, "ranges": None, "poses": None}
RANGES = {"ranges": {"sigma_m": 0.1, "sigma_relative": 0.0}}
POSTS = {"landmarks": {"a": [2, 2], "b": [8, 2], "c": [8, 8], "d": [2, 8]},
         "landmark_sightings": {"rate_hz": 2}}  # fmt: skip
TAGS = {"tags": {"front": [0.5, 0, 1], "left": [-0.4, 0.3, 1], "right": [-0.4, -0.3, 1]},
        "positions": {"sigma_xy_m": 0.1, "tags": ["front", "left", "right"]}}  # fmt: skip
LATE = [{"kind": "latency", "source": "ranges", "delay_s": 0.05, "jitter_s": 0.3},
        {"kind": "latency", "source": "poses", "delay_s": 0.2, "jitter_s": 0.5}]  # fmt: skip
SIGMA_TURN_BIAS, SIGMA_SCALE = 0.02, 0.02
MCL = {"min_particles": 1000, "max_particles": 1000, "beams": 180, "independent_beams": 30.0,
       "sigma_map_m": 0.0, "sigma_map_rad": 0.0, "spacing_m": 0.05}  # fmt: skip

# What each scenario of the pose EKF simulates beside the wheels.
SCENES: Mapping[str, Mapping[str, Any]] = {
    "ranges": {**RANGES, "poses": None},
    "poses": {"ranges": None, "anchors": {}, "poses": {"sigma_heading_deg": 2.0}},
    "fixes, held velocities": {
        **NOTHING,
        "odometry": {"output": "velocities"},
        "positions": {"antenna_forward_m": 0.4, "antenna_left_m": -0.1},
    },
    "tags of an RTLS": {**NOTHING, **TAGS},
    "landmarks": {**NOTHING, **POSTS},
    "ranges and poses, late": {**RANGES, "faults": LATE},
}


def config_of(scene: Mapping[str, Any], seed: int, calibration: Mapping[str, float]) -> RunConfig:
    """Return a configuration without gates, whose filter knows the noise of the simulation."""
    of_antenna = ("antenna_forward_m", "antenna_left_m")
    lever = {key: value for key, value in scene.get("positions", {}).items() if key in of_antenna}
    return parse_config(
        {
            "simulation": {"path": {"shape": "eight", "speed_mps": 0.5}, "duration_s": 20, **scene},
            "start_sigma": {"xy_m": 0.1, "heading_deg": 3.0},
            "estimator": {
                "odometry": WHEELS,
                "range": {"sigma_m": 0.1, "gate": 1.0},
                "position": {**lever, "gate": 1.0},
                "pose": {"gate": 1.0},
                "landmark": {
                    "sigma_range_m": 0.05,
                    "sigma_bearing_rad": float(np.deg2rad(1.0)),
                    "gate": 1.0,
                },
                "calibration": dict(calibration),
                "correlation_s": 0,  # simulated errors are independent
            },
            "seed": seed,
        }
    )


def pose_ekf(scene: str, seed: int, factor: float) -> Sample:
    """Drive a scene of `SCENES`."""
    return sample_of(_fused(config_of(SCENES[scene], seed, {}), factor))


def scale(seed: int, factor: float) -> Sample:
    """Estimate the scale errors of distance and turns."""
    of_way, of_turns = np.random.default_rng([seed, 2]).standard_normal(2) * SIGMA_SCALE
    slip = {"kind": "wheel_slip", "from_s": 0, "to_s": 20, "translation_factor": 1 / (1 + of_way),
            "rotation_factor": 1 / (1 + of_turns)}  # fmt: skip
    scene = {**SCENES["landmarks"], "faults": [slip]}
    learns = {"sigma_scale": SIGMA_SCALE, "sigma_turn_scale": SIGMA_SCALE}
    result = _fused(config_of(scene, seed, learns), factor)
    return sample_of(result, {"scale": of_way, "turn scale": of_turns})


def turn_bias(seed: int, factor: float) -> Sample:
    """Learn the bias of a gyro."""
    bias = float(np.random.default_rng([seed, 2]).standard_normal()) * SIGMA_TURN_BIAS
    scene = {**SCENES["landmarks"], "odometry": {"turn_bias_radps": bias}}
    learns = {"sigma_turn_bias_radps": SIGMA_TURN_BIAS}
    return sample_of(_fused(config_of(scene, seed, learns), factor), {"turn bias": bias})


def wandering(seed: int, factor: float) -> Sample:
    """Track range errors that stay correlated for seconds."""
    fault = {"kind": "wander", "sigma_m": 0.2, "correlation_s": 5.0}
    learns = {"sigma_anchor_offset_m": 0.2, "anchor_offset_correlation_s": 5.0}
    config = config_of({**SCENES["ranges"], "faults": [fault]}, seed, learns)
    return sample_of(_fused(config, factor))


def start_from_nothing(seed: int, factor: float) -> Sample:
    """Find the start from ranges; the sample is of the start itself."""
    config = config_of(SCENES["ranges"], seed, {}).model_copy(update={"start": "auto"})
    result = _fused(config, factor)
    assert result.start is not None
    found = _core.PoseEstimate(result.start.stamp_ns, _core.Pose2(*result.start.pose.tolist()),
                               result.start.covariance)  # fmt: skip
    return Sample(pose_nees(_truth_at(result.truth, found.stamp), found))


def recovering_ekf(seed: int, factor: float) -> Sample:
    """Start from nothing by itself and go on, message by message."""
    config, log = _with_stated_sigmas(config_of(SCENES["ranges"], seed, {}), factor)
    messages = to_messages(log, config)
    settings = build_recovering_config(config)
    ekf = _core.RecoveringEkf(settings, _core.World(*radios_of(log, messages, config)))
    sample = Sample()
    for source, message in _in_order(log):
        outcome = ekf.on(message)
        if source != "odometry":
            sample.add(source, outcome)
    inside = ekf.estimator()
    assert inside is not None
    last = inside.estimate()
    return Sample(pose_nees(_truth_at(truth_of(log), last.stamp), last), sample.nis)


def landmark_ekf(seed: int, factor: float) -> Sample:
    """Map four posts while localizing on them; the start's heading turns the whole map."""
    scene = {**SCENES["landmarks"], "odometry": {"output": "velocities"}}
    config, log = _with_stated_sigmas(config_of(scene, seed, {}), factor)
    start_sigma = StartSigma(xy_m=0.1, heading_deg=3.0)
    config = config.model_copy(update={"start_sigma": start_sigma})
    truth = truth_of(log)
    assert truth is not None
    settings = _core.LandmarkEkfConfig()
    for name in WHEELS:
        setattr(settings.odometry, name, getattr(config.estimator.odometry, name))
    settings.landmark.sigma_range_m = config.estimator.landmark.sigma_range_m
    settings.landmark.sigma_bearing_rad = config.estimator.landmark.sigma_bearing_rad
    settings.landmark.gate = settings.gate_new = 1.0
    settings.correlation_s = 0.0  # simulated errors are independent
    ekf = _core.LandmarkEkf(
        settings, _core.World(), drawn_start(config, truth, to_messages(log, config), seed, factor)
    )
    names = log["landmark_sightings"]["landmark"]
    ids = {str(name): row for row, name in enumerate(log["landmarks"]["landmark"])}
    sample = Sample()
    for instant in instants_of(log):
        for velocity in instant.driven:
            ekf.on(velocity)
        for seen, row in zip(instant.seen, instant.rows, strict=True):
            named = _core.RangeBearing(seen.stamp, ids[str(names[row])], seen.range, seen.bearing)
            sample.add("landmark_sightings", ekf.on(named))
        last = ekf.estimate(instant.stamp)
    sample.nees = pose_nees(_truth_at(truth, last.stamp), last)
    first = ekf.landmarks()[0]  # errors of the others go with that of the first
    off = np.array([log["landmarks"][key][first.id] for key in ("x_m", "y_m")]) - first.position
    sample.nees["a landmark"] = (float(off @ np.linalg.solve(first.covariance, off)), 2)
    return sample


def mcl(seed: int, factor: float) -> Sample:
    """Track by particles on the map that the world was made of."""
    config, log = simulated(seed, **MCL)
    assert config.mcl is not None
    config = config.model_copy(update={
        "mcl": with_sigmas_times(config.mcl, factor),
        "estimator": with_sigmas_times(config.estimator, factor),
    })  # fmt: skip
    return sample_of(run(config, log, start=drawn(log, seed)))


def _fused(config: RunConfig, factor: float) -> RunResult:
    config, log = _with_stated_sigmas(config, factor)
    truth = truth_of(log)
    assert truth is not None
    if config.start == "auto":
        return run(config, log)
    start = drawn_start(config, truth, to_messages(log, config), config.seed, factor)
    return run(config, log, start=start)


def _with_stated_sigmas(config: RunConfig, factor: float) -> tuple[RunConfig, Log]:
    """Return configuration and log with every sigma that the filter uses times `factor`."""
    log = load_log(config, None, config.seed)
    tables = {
        stem: {name: factor * column if name.startswith("sigma_") else column
               for name, column in table.items()}
        for stem, table in log.tables.items()
    }  # fmt: skip
    estimator = with_sigmas_times(config.estimator, factor)
    return config.model_copy(update={"estimator": estimator}), replace(log, tables=tables)


def sample_of(result: RunResult, errors: Mapping[str, float] | None = None) -> Sample:
    """Return the sample of a run, whose calibrated errors are known."""
    estimate = result.estimate
    assert estimate.heading is not None
    assert estimate.covariance is not None
    stamp = int(estimate.stamp_ns[-1])
    x, y = estimate.position[-1].tolist()
    pose = _core.Pose2(x, y, float(estimate.heading[-1]))
    last = _core.PoseEstimate(stamp, pose, estimate.covariance[-1])
    sample = Sample(pose_nees(_truth_at(result.truth, stamp), last))
    for name, value in (errors or {}).items():
        learnt = result.metrics["calibration"][name]
        sample.nees[name] = (((learnt["value"] - value) / learnt["sigma"]) ** 2, 1)
    outcomes = result.outcomes
    fused = (outcomes.verdict == "fused") & (outcomes.dof > 0)
    for source in np.unique(outcomes.source[fused]).tolist():
        rows = fused & (outcomes.source == source)
        sample.nis[source] = (float(outcomes.nis[rows].sum()), int(outcomes.dof[rows].sum()))
    return sample


def _truth_at(truth: Trajectory | None, stamp: int) -> FloatArray:
    assert truth is not None
    at, _ = interpolate(truth, np.array([stamp], np.int64))
    assert at.heading is not None
    return np.array([*at.position[0], at.heading[0]])


def _in_order(log: Log) -> list[tuple[str, _core.Increment | _core.Range]]:
    """Return increments and ranges of one tag in the order in which they take effect."""
    driven, measured = log["odometry"], log["ranges"]
    ids = {str(name): row for row, name in enumerate(log["anchors"]["anchor"])}
    stamps = driven["stamp_ns"].tolist()
    found: list[tuple[int, str, _core.Increment | _core.Range]] = [
        (begin, "odometry", _core.Increment(begin, end, _core.Pose2(*motion)))
        for begin, end, *motion in zip(stamps[:-1], stamps[1:], *(
            driven[name][1:].tolist() for name in ("dx_m", "dy_m", "dheading_rad")), strict=True)
    ]  # fmt: skip
    found += [
        (stamp, "ranges", _core.Range(stamp, 0, ids[anchor], distance))
        for stamp, anchor, distance in zip(
            *(measured[name].tolist() for name in ("stamp_ns", "anchor", "range_m")), strict=True)
    ]  # fmt: skip
    found.sort(key=lambda entry: (entry[0], entry[1] == "odometry"))
    return [entry[1:] for entry in found]


FLOOR: Mapping[str, Callable[[int, float], Sample]] = {
    **{f"PoseEkf: {scene}": partial(pose_ekf, scene) for scene in SCENES},
    "PoseEkf: landmarks, learns scales": scale,
    "PoseEkf: landmarks, learns turn bias": turn_bias,
    "PoseEkf: ranges, follows their errors": wandering,
    "Initializer: ranges": start_from_nothing,
    "RecoveringEkf: ranges": recovering_ekf,
    "LandmarkEkf: four posts": landmark_ekf,
}
