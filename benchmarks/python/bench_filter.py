# SPDX-License-Identifier: Apache-2.0
"""The pose EKF from Python, in bulk and call by call, compared to filterpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse as lf
from circle import (
    ANCHORS,
    SIGMA_MOTION,
    SIGMA_RANGE,
    SIGMA_START,
    START,
    Circle,
    circle,
    message_columns,
    message_log,
)
from circle import pose_ekf as new_ekf

BULK = circle(100_000)
SHORT = circle(2_000)
RMSE_M = 0.1  # any correct filter converges well below


def test_replay(benchmark: Any) -> None:
    columns, ekf = message_columns(BULK), new_ekf()
    benchmark.extra_info["items"] = len(message_log(columns))
    record = benchmark(lambda: lf.replay(ekf, message_log(columns), record=False))
    last = record.last.pose
    assert np.hypot(last.x - BULK.truth[-1, 0], last.y - BULK.truth[-1, 1]) < 5 * RMSE_M


def test_replay_recorded(benchmark: Any) -> None:
    replay_recorded(benchmark, BULK)


def test_replay_short(benchmark: Any) -> None:
    replay_recorded(benchmark, SHORT)


def replay_recorded(benchmark: Any, drive: Circle) -> None:
    columns, ekf = message_columns(drive), new_ekf()
    benchmark.extra_info["items"] = len(message_log(columns))

    def run() -> Any:
        record = lf.replay(ekf, message_log(columns))
        return record.stamp_ns, record.poses, record.covariances, record.verdict, record.nis

    _, poses, _, verdict, _ = benchmark(run)
    assert len(verdict) == drive.range_m.size + len(drive.motion)
    benchmark.extra_info["rmse_m"] = drive.rmse(poses[1:, :2])
    assert benchmark.extra_info["rmse_m"] < RMSE_M


def test_epoch_call(benchmark: Any) -> None:
    benchmark.extra_info["items"] = len(SHORT.motion)
    anchor = np.arange(len(ANCHORS), dtype=np.int32)
    motions = [lf.Pose2(*motion) for motion in SHORT.motion]
    stamps = SHORT.stamp_ns.tolist()
    ranges = list(SHORT.range_m)

    def run() -> lf.PoseEkf:
        ekf = new_ekf()
        for k, motion in enumerate(motions):
            ekf.on_epoch(stamps[k], stamps[k + 1], motion, anchor, ranges[k])
        return ekf

    now = benchmark(run).estimate().pose
    assert np.hypot(now.x - SHORT.truth[-1, 0], now.y - SHORT.truth[-1, 1]) < 5 * RMSE_M


def test_filterpy(benchmark: Any) -> None:
    kalman = pytest.importorskip("filterpy.kalman", reason="filterpy is not installed")
    benchmark.extra_info["items"] = len(SHORT.motion) * (1 + len(ANCHORS))
    noise = np.diag(SIGMA_MOTION**2)
    variance = np.array([[SIGMA_RANGE**2]])

    def jacobian(x: Any, anchor: Any) -> Any:
        d = x[:2] - anchor
        return np.append(d / np.hypot(*d), 0.0).reshape(1, 3)

    def expected(x: Any, anchor: Any) -> Any:
        return np.array([np.hypot(x[0] - anchor[0], x[1] - anchor[1])])

    def run() -> Any:
        ekf = kalman.ExtendedKalmanFilter(dim_x=3, dim_z=1)
        ekf.x, ekf.P = START.copy(), np.diag(SIGMA_START**2)
        positions = np.empty((len(SHORT.motion), 2))
        for k, (dx, dy, turn) in enumerate(SHORT.motion):
            c, s = np.cos(ekf.x[2]), np.sin(ekf.x[2])
            G = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            ekf.F = np.eye(3)
            ekf.F[0, 2], ekf.F[1, 2] = -s * dx - c * dy, c * dx - s * dy
            ekf.x = ekf.x + [c * dx - s * dy, s * dx + c * dy, turn]
            ekf.P = ekf.F @ ekf.P @ ekf.F.T + G @ noise @ G.T
            for anchor, z in zip(ANCHORS, SHORT.range_m[k], strict=True):
                ekf.update(np.array([z]), jacobian, expected, variance, (anchor,), (anchor,))
            positions[k] = ekf.x[:2]
        return positions

    benchmark.extra_info["rmse_m"] = SHORT.rmse(benchmark(run))
    assert benchmark.extra_info["rmse_m"] < RMSE_M
