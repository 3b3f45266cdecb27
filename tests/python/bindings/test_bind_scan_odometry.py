# SPDX-License-Identifier: Apache-2.0
"""Local maps and scan odometry from Python: scans in, motions out, what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

import locfuse.core as lf

AROUND = lf.LaserGeometry(lf.Pose2(), -math.pi, math.pi / 180, 0.1, 12.0)
NOISE = np.diag([0.02, 0.01, 0.02]) ** 2


def seen_at(x: float, stamp: int = 0) -> lf.LaserScan:
    """Return what is seen x m from the middle of a room of 8 x 6 m."""
    angle = -math.pi + np.arange(360) * math.pi / 180
    with np.errstate(divide="ignore"):
        ahead = (np.where(np.cos(angle) > 0, 4.0, -4.0) - x) / np.cos(angle)
        return lf.LaserScan(stamp, AROUND, np.minimum(ahead, 3.0 / np.abs(np.sin(angle))))


def test_a_scan_is_fitted_to_another() -> None:
    local_map = lf.LocalMap([(seen_at(0.0), lf.Pose2(1.0, 2.0, 0.0))])
    alone = local_map.match(seen_at(0.2), lf.Pose2(1.1, 2.05, 0.02))
    assert alone.reason is lf.ScanMatchReason.CONVERGED
    np.testing.assert_allclose(lf.local(alone.pose, lf.Pose2(1.2, 2.0, 0.0)), 0.0, atol=1e-3)
    assert alone.covariance is not None
    held = local_map.match(seen_at(0.2), lf.Pose2(1.1, 2.05, 0.02), NOISE)
    assert held.covariance is not None
    assert np.trace(held.covariance) < np.trace(alone.covariance)
    empty = lf.LocalMap([]).match(seen_at(0.2), lf.Pose2(), NOISE)
    assert empty.reason is lf.ScanMatchReason.TOO_FEW_MATCHES


def test_scan_odometry_tells_increments_for_a_filter() -> None:
    odometry = lf.ScanOdometry(lf.ScanOdometryConfig(window_scans=2, key_distance_m=0.15))
    assert odometry.config.window_scans == 2
    assert odometry.config.map.sigma_range_m == lf.LocalMapConfig().sigma_range_m
    keys = []
    for k in range(5):
        told = odometry.on(seen_at(0.1 * k, stamp=k), lf.Pose2(0.12, 0.0, 0.0), NOISE)
        keys.append(told.key)
        assert (told.increment.begin, told.increment.stamp) == (max(k - 1, 0), k)
        assert told.increment.motion.x == pytest.approx(0.1 if k else 0.0, abs=2e-3)
        assert told.covariance.shape == (3, 3)
    assert keys == [0, 0, 0, 2, 2]
    assert told.pose.x == pytest.approx(0.4, abs=2e-3)
    assert told.match.converged


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match=r"trimmed_share is 1.5, expected at least 0"):
        lf.LocalMap([], lf.LocalMapConfig(trimmed_share=1.5))
    with pytest.raises(ValueError, match="window_scans is 0, expected 1 or more"):
        lf.ScanOdometry(lf.ScanOdometryConfig(window_scans=0))
    odometry = lf.ScanOdometry()
    odometry.on(seen_at(0.0, stamp=5), lf.Pose2(), NOISE)
    with pytest.raises(ValueError, match="stamp of the scan is 5 ns, expected later"):
        odometry.on(seen_at(0.0, stamp=5), lf.Pose2(), NOISE)
    with pytest.raises(ValueError, match="semidefinite"):
        odometry.on(seen_at(0.0, stamp=6), lf.Pose2(), -NOISE)
    with pytest.raises(ValueError, match="positive definite"):
        lf.LocalMap([(seen_at(0.0), lf.Pose2())]).match(seen_at(0.0), lf.Pose2(), -NOISE)
