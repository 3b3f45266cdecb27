# SPDX-License-Identifier: Apache-2.0
"""Cylinders and landmarks of single beams from Python: scans in, what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

import locfuse.core as lf

AROUND = lf.LaserGeometry(lf.Pose2(), -math.pi, math.pi / 180, 0.1, 12.0)
ANGLE = -math.pi + np.arange(360) * math.pi / 180


def ranges_to_disc(x: float, y: float, radius: float) -> np.ndarray:
    ahead = x * np.cos(ANGLE) + y * np.sin(ANGLE)
    left = y * np.cos(ANGLE) - x * np.sin(ANGLE)
    hit = (np.abs(left) < radius) & (ahead > 0.0)
    return np.where(hit, ahead - np.sqrt(np.maximum(radius**2 - left**2, 0.0)), np.nan)


def test_a_cylinder_is_found_with_its_covariance() -> None:
    scan = lf.LaserScan(0, AROUND, ranges_to_disc(1.5, 1.5, 0.4))
    precise = lf.CylinderDetectorConfig(sigma_range_m=0.001)
    [free] = lf.CylinderDetector(precise).detect(scan)
    assert free.range == pytest.approx(math.sqrt(4.5), abs=2e-3)
    assert free.bearing == pytest.approx(math.pi / 4, abs=1e-3)
    assert free.radius == pytest.approx(0.4, abs=2e-3)
    assert free.covariance.shape == (3, 3)
    assert np.all(np.linalg.eigvalsh(free.covariance) > 0.0)
    detector = lf.CylinderDetector(lf.CylinderDetectorConfig(radius_m=0.4, sigma_range_m=0.002))
    assert detector.config.sigma_range_m == 0.002
    [known] = detector.detect(scan)
    assert known.radius == 0.4
    assert np.all(known.covariance[2] == 0.0)
    assert (known.first, known.last, known.beams) == (free.first, free.last, free.beams)
    assert "beams=" in repr(known)


def test_intensities_tell_poles() -> None:
    ranges = ranges_to_disc(1.5, 1.5, 0.4)
    intensities = np.zeros(360)
    config = lf.CylinderDetectorConfig(radius_m=0.4, least_intensity=1.0)
    dull = lf.LaserScan(0, AROUND, ranges, intensities=intensities)
    assert dull.intensities.shape == (360,)
    assert lf.LaserScan(0, AROUND, ranges).intensities.shape == (0,)
    assert lf.CylinderDetector(config).detect(dull) == []
    intensities[220:230] = 2.0
    [found] = lf.CylinderDetector(config).detect(lf.LaserScan(0, AROUND, ranges, intensities))
    assert found.range == pytest.approx(math.sqrt(4.5), abs=0.01)


def test_single_beams_tell_landmarks() -> None:
    scan = lf.LaserScan(0, AROUND, ranges_to_disc(2.0, 0.0, 0.5))
    closest = lf.closest_beam(scan, first=160, last=200, radius=0.5)
    assert closest.beam == 180
    assert closest.range == pytest.approx(2.0)
    discs = [lf.Landmark(0, [2.0, 0.0], 0.5), lf.Landmark(1, [-2.0, 0.0], radius=0.5)]
    seen = lf.recognize_landmarks(scan, predicted=lf.Pose2(), landmarks=lf.LandmarkMap(discs))
    assert [s.beam for s in seen] == [180, -1]
    assert seen[0].range == pytest.approx(1.5)
    assert seen[1].range == -1.0


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="least_beams is 0, expected a number >= 1 and "):
        lf.CylinderDetector(lf.CylinderDetectorConfig(least_beams=0))
    with pytest.raises(ValueError, match="intensities are 3, expected none or 360"):
        lf.LaserScan(0, AROUND, np.ones(360), np.ones(3))
    with pytest.raises(ValueError, match="intensities has shape"):
        lf.LaserScan(0, AROUND, np.ones(360), np.ones((360, 1)))
    scan = lf.LaserScan(0, AROUND, np.ones(360))
    with pytest.raises(ValueError, match="intensities is empty"):
        lf.CylinderDetector(lf.CylinderDetectorConfig(least_intensity=1.0)).detect(scan)
    with pytest.raises(ValueError, match="last is beam 360"):
        lf.closest_beam(scan, 0, 360, 0.1)
    with pytest.raises(ValueError, match="radius of a landmark is -1 m"):
        lf.closest_beam(scan, 0, 1, -1.0)
