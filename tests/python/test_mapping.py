# SPDX-License-Identifier: Apache-2.0
"""Mapping landmarks along a log: a made one, and Victoria Park."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import locfuse as lf
from locfuse.eval.errors import interpolate
from locfuse.mapping import LandmarkMapping, map_landmarks
from locfuse.plot import plot_landmarks, save
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, wrap_angle
from support_recordings import carried, converted

ANTENNA_M = (3.78, 0.5)
TREES = np.array([[5.0, 2.0], [9.0, -3.0], [13.0, 2.5], [17.0, -2.0]])


def straight() -> Log:
    """Return a drive of 1 m/s along x among four trees, seen without noise."""
    stamps = np.arange(0, 10 * NANOSECONDS, NANOSECONDS // 10)
    rows = [(t, x, y) for t in stamps[::5] for x, y in TREES - [t / NANOSECONDS, 0.0]]
    stamp, x, y = (np.array(column) for column in zip(*rows, strict=True))
    seen = {"stamp_ns": stamp, "landmark": np.full(len(stamp), ""), "range_m": np.hypot(x, y),
            "bearing_rad": np.arctan2(y, x)}  # fmt: skip
    still = np.zeros(len(stamps))
    odometry = {"stamp_ns": stamps, "v_mps": still + 1.0, "omega_radps": still}
    return Log(tables={"odometry": odometry, "landmark_sightings": seen})


def start_at(x: float, y: float, heading: float) -> lf.PoseEstimate:
    sigmas = np.array([0.01, 0.01, np.deg2rad(0.1)])
    return lf.PoseEstimate(0, lf.Pose2(x, y, heading), np.diag(sigmas**2))


def test_every_tree_of_a_made_log_is_mapped_where_it_is() -> None:
    mapping = map_landmarks(straight(), lf.LandmarkEkfConfig(), start_at(0.0, 0.0, 0.0))
    order = np.argsort(mapping.position[:, 0])
    np.testing.assert_allclose(mapping.position[order], TREES, atol=1e-6)
    assert sorted(mapping.landmark.tolist()) == [-4, -3, -2, -1]
    assert (mapping.sightings == 20).all()
    assert set(mapping.verdict.tolist()) == {lf.Verdict.FUSED.value}
    np.testing.assert_allclose(mapping.estimate.position[-1], [9.5, 0.0], atol=1e-6)


def test_a_log_without_sightings_is_refused() -> None:
    with pytest.raises(LogError, match="needs landmark_sightings"):
        map_landmarks(Log(tables={}), lf.LandmarkEkfConfig(), start_at(0.0, 0.0, 0.0))


def truck() -> lf.LandmarkEkfConfig:
    """Return the noise of a truck on grass, and of trunks seen by a laser; not fitted.

    A steering that is 1 degree off turns a wheel base of 2.83 m by 0.006 rad per metre, 0.06 rad in
    10 m: as a random walk 0.02 rad / sqrt(m). Wheels slip by some per cent. A trunk of one or two
    beams has a centre known to some 0.3 m; beams are 0.5 degrees apart, and a stamp that is 25 ms
    off turns by as much.
    """
    config = lf.LandmarkEkfConfig()
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.1
    config.odometry.sigma_lateral_per_sqrt_m = 0.05
    config.odometry.sigma_heading_per_sqrt_m = 0.02
    config.odometry.sigma_heading_per_sqrt_rad = 0.05
    config.landmark.sigma_range_m = 0.3
    config.landmark.sigma_bearing_rad = np.deg2rad(1.0)
    return config


def start_of(log: Log) -> lf.PoseEstimate:
    """Return the first fix, heading for 38 degrees, as the recording's notes have it."""
    heading = np.deg2rad(38.0)
    c, s = np.cos(heading), np.sin(heading)
    forward, left = ANTENNA_M
    first = log["positions"]["x_m"][0], log["positions"]["y_m"][0]
    return start_at(first[0] - c * forward + s * left, first[1] - s * forward - c * left, heading)


def errors_to_gps(log: Log, mapping: LandmarkMapping) -> FloatArray:
    fixes = log["positions"]
    at, inside = interpolate(mapping.estimate, fixes["stamp_ns"])
    gps = np.column_stack([fixes["x_m"], fixes["y_m"]])[inside]
    errors: FloatArray = np.hypot(*(carried(at, *ANTENNA_M) - gps).T)
    return errors


@pytest.fixture(scope="module")
def park(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return converted("victoria_park", tmp_path_factory.mktemp("park"))["trees"]


def rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def test_victoria_park_is_mapped_to_6_m_of_gps_which_is_not_told(park: Log, tmp_path: Path) -> None:
    mapping = map_landmarks(park, truck(), start_of(park))
    assert rms(errors_to_gps(park, mapping)) < 6.0
    assert 100 < len(mapping.landmark) < 400
    fixes = np.column_stack([park["positions"]["x_m"], park["positions"]["y_m"]])
    figure = plot_landmarks(mapping.estimate, mapping.position, mapping.covariance, fixes, "GPS")
    save(figure, tmp_path / "victoria_park.png")
    assert (tmp_path / "victoria_park.png").stat().st_size > 50_000


def test_victoria_park_without_recognizing_trees_is_far_off(park: Log) -> None:
    config = truck()
    config.max_landmarks = 0
    assert rms(errors_to_gps(park, map_landmarks(park, config, start_of(park)))) > 60.0


def test_victoria_park_with_mirrored_bearings_is_far_off(park: Log) -> None:
    seen = park["landmark_sightings"]
    mirrored = {**seen, "bearing_rad": wrap_angle(-seen["bearing_rad"])}
    wrong = replace(park, tables={**park.tables, "landmark_sightings": mirrored})
    config = truck()
    config.max_landmarks = 200
    assert rms(errors_to_gps(park, map_landmarks(wrong, config, start_of(park)))) > 12.0
