# SPDX-License-Identifier: Apache-2.0
"""The room of ekim2020, section 3.2, Figs. 2 and 9: five paths, recordings and the bound."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against
from locfuse.report.plot.style import save
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import run
from locfuse.run.start import drawn_start
from locfuse.sim.scenario import simulate
from locfuse.types import FloatArray, Log, LogError, Trajectory
from papers.claims import Claim, Progress, absent, claim_of
from papers.configs import example_configs
from papers.ekim2020 import power_up_claims
from papers.ekim2020.room_plot import plot_room
from papers.ekim2020.runs import recording

PATHS = ("circle", "eight", "square", "star", "waypoints")
RECORDINGS = {
    "ieu run3": ("ieu_gazebo.yaml", "run3", 0.010),
    "ieu straight": ("ieu_gazebo.yaml", "straight", 0.010),
    "ieu home": ("ieu_gazebo.yaml", "home", 0.010),
    "office (real)": ("mrpt_office.yaml", None, 0.13),
    "labyrinth (real)": ("tuc_labyrinth.yaml", None, 0.08),
    "Plaza1 (real)": ("plaza.yaml", None, 0.40),
}


def room_config(path: str, duration_s: float = 120.0) -> RunConfig:
    """Return the paper's room with a filter that knows the noise of its sensors.

    The pose source's 6 cm and the range's 1.5 % are the paper's; what the odometry adds per metre
    and radian is the simulator's.
    """
    odometry = {
        "sigma_longitudinal_per_sqrt_m": 0.03,
        "sigma_lateral_per_sqrt_m": 0.0,
        "sigma_heading_per_sqrt_m": 0.02,
        "sigma_heading_per_sqrt_rad": 0.03,
    }
    return parse_config(
        {
            "name": f"room, {path}",
            "simulation": {"path": {"shape": path}, "duration_s": duration_s},
            "start_sigma": {"xy_m": 0.1, "heading_deg": 3.0},
            "estimator": {
                "odometry": odometry,
                "range": {"sigma_m": 0.0, "sigma_relative": 0.015},
                "gate_range": 1.0,
                "gate_pose": 1.0,
            },
        }
    )


def ekim2020_claims(seeds: int, progress: Progress) -> list[Claim]:
    total = len(PATHS) * seeds + len(RECORDINGS) + 1
    done = 0
    rmse: dict[str, list[float]] = {path: [] for path in PATHS}
    source: dict[str, list[float]] = {path: [] for path in PATHS}
    bound: dict[str, list[float]] = {path: [] for path in PATHS}
    nees: dict[str, list[float]] = {path: [] for path in PATHS}
    for path in PATHS:
        config = room_config(path)
        assert config.simulation is not None
        for seed in range(seeds):
            log = simulate(config.simulation, np.random.default_rng(seed))
            truth = truth_of(log)
            assert truth is not None
            messages = to_messages(log, config)
            start = drawn_start(config, truth, messages, seed)
            result = run(config, log, start=start)
            errors = errors_against(result.estimate, truth)
            assert errors.nees is not None
            rmse[path].append(_rms(errors.position))
            nees[path].append(_last(errors.nees))
            source[path].append(_rms(_pose_source_errors(log, truth)))
            bound[path].append(_rms(linearized_at_truth(config, log, start)))
            done += 1
            progress(done, total)
    claims = []
    for path in PATHS:
        per_seed = np.array(rmse[path])
        claims += [
            claim_of(f"room_{path}_rmse", f"{path}: RMSE", "cm", 3.0,
                   100.0 * per_seed, "<= 2.6", lambda v: v <= 2.6),
            claim_of(f"room_{path}_gain", f"{path}: pose source / ours", "1", 2.0,
                   np.array(source[path]) / per_seed, ">= 2.3", lambda v: v >= 2.3),
            claim_of(f"room_{path}_bound", f"{path}: ours / bound", "1",
                   None, per_seed / np.array(bound[path]), "<= 1.05", lambda v: v <= 1.05),
            _nees_claim(path, nees[path]),
        ]  # fmt: skip
    for name, (file, of_dataset, limit) in RECORDINGS.items():
        claims.append(_recording_claim(name, file, of_dataset, limit))
        done += 1
        progress(done, total)
    claims += power_up_claims(example_configs())
    progress(total, total)
    return claims


def draw_room(folder: Path) -> Path:
    """Draw the eight of the first seed, as the paper's Figs. 2 and 9."""
    config = room_config("eight")
    assert config.simulation is not None
    log = simulate(config.simulation, np.random.default_rng(0))
    truth = truth_of(log)
    assert truth is not None
    result = run(config, log, start=drawn_start(config, truth, to_messages(log, config), 0))
    ours = 100.0 * _rms(errors_against(result.estimate, truth).position)
    source = 100.0 * _rms(_pose_source_errors(log, truth))
    figure = plot_room(_places(log["anchors"]), truth.position, _places(log["poses"]),
                       result.estimate.position,
                       f"2 m of it; RMSE: source {source:.1f} cm, EKF {ours:.1f} cm")  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    save(figure, folder / "room_paths.png")
    return folder / "room_paths.png"


def _places(table: Any) -> FloatArray:
    return np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64)


def _nees_claim(path: str, values: list[float]) -> Claim:
    """Mean over seeds, one independent value a seed, against its two-sided 95 % band."""
    low, high = band(3, len(values))
    mean = float(np.mean(values))
    spread = np.quantile(values, [0.05, 0.95])
    return Claim(f"room_{path}_nees", f"{path}: mean NEES", "1", None,
                 mean, float(spread[0]), float(spread[1]), f"{low:.2f}..{high:.2f}",
                 low <= mean <= high, "mean, not median: it is what the band is of")  # fmt: skip


def _last(nees: FloatArray) -> float:
    return float(nees[-1])


def _rms(errors: FloatArray) -> float:
    return math.sqrt(float(np.mean(np.sum(errors**2, axis=1))))


def _pose_source_errors(log: Log, truth: Trajectory) -> FloatArray:
    poses = log["poses"]
    at = np.searchsorted(truth.stamp_ns, poses["stamp_ns"])
    errors: FloatArray = np.column_stack([poses["x_m"], poses["y_m"]]) - truth.position[at]
    return errors


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
            told = _core.Pose2(odometry["dx_m"][k], odometry["dy_m"][k],
                               odometry["dheading_rad"][k])  # fmt: skip
            step = motion.propagate(before, driven, 0.0)
            told_step = motion.propagate(before, told, 0.0)
            e = step.jacobian @ e + _core.local(told_step.moved, step.moved)
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
    assert estimator.gate_range == 1.0 == estimator.gate_pose
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


def _recording_claim(name: str, file: str, of_dataset: str | None, limit: float) -> Claim:
    """Run a ready configuration on its recording, where that is present."""
    configs = example_configs()
    required = f"<= {limit:g}"
    claim = f"{name}: RMSE"
    id_ = name.split(" (")[0].replace(" ", "_") + "_rmse"
    if configs is None:
        return absent(id_, claim, "no examples/configs here", required)
    try:
        result = run(*recording(configs, file, of_dataset))
    except LogError as error:
        return absent(id_, claim, str(error), required)
    value = float(result.metrics["position_rmse_m"])
    return Claim(id_, claim, "m", None, value, value, value, required, value <= limit)
