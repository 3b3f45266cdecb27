# SPDX-License-Identifier: Apache-2.0
"""Registration of a scan to a map from Python: point to line by look-up, and small_gicp's ICP."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse.core as lf
from hall import POSES, hall
from locfuse.types import FloatArray

HALL = hall()


def test_refine_call(benchmark: Any) -> None:
    matcher = lf.ScanMatcher(HALL.grid, lf.ScanMatcherConfig(sigma_range_m=0.02))
    step = HALL.angles[1] - HALL.angles[0]
    laser = lf.LaserGeometry(lf.Pose2(), HALL.angles[0], step, 0.05, 50.0)
    scans = [lf.LaserScan(0, laser, ranges_m) for ranges_m in HALL.ranges_m]
    guesses = [lf.Pose2(*guess) for guess in HALL.guess]
    benchmark.extra_info["items"] = POSES
    found = benchmark(
        lambda: [matcher.refine(*each).pose for each in zip(scans, guesses, strict=True)]
    )
    judge(benchmark, np.array([[pose.x, pose.y, pose.heading] for pose in found]))


def test_refine_small_gicp(benchmark: Any) -> None:
    small_gicp = pytest.importorskip("small_gicp", reason="small_gicp is not installed")

    def cloud(points: FloatArray) -> Any:
        return small_gicp.PointCloud(np.column_stack([points, np.zeros(len(points))]))

    target = cloud(HALL.surface)
    tree = small_gicp.KdTree(target, num_threads=1)
    sources = [cloud(HALL.points(k)) for k in range(POSES)]
    guesses = []
    for x, y, heading in HALL.guess:
        T = np.eye(4)
        T[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
        T[:2, 3] = x, y
        guesses.append(T)

    def align(source: Any, guess: Any) -> Any:
        return small_gicp.align(
            target, source, tree, guess, registration_type="ICP",
            max_correspondence_distance=1.0, num_threads=1, max_iterations=50,
        ).T_target_source  # fmt: skip

    benchmark.extra_info["items"] = POSES
    found = benchmark(lambda: [align(*each) for each in zip(sources, guesses, strict=True)])
    poses = [[T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])] for T in found]
    judge(benchmark, np.array(poses))


def judge(benchmark: Any, poses: Any) -> None:
    errors = HALL.errors(poses)
    benchmark.extra_info.update(errors)
    assert errors["right"] > 0.9
