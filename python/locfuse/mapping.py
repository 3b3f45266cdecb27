# SPDX-License-Identifier: Apache-2.0
"""Mapping landmarks along a log while localizing on them."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.types import Columns, FloatArray, Log, LogError, Trajectory


@dataclass(frozen=True)
class LandmarkMapping:
    """How a `LandmarkEkf` went along a log.

    Attributes
    ----------
    estimate : Trajectory
        After the sightings of each instant, with heading and covariance.
    landmark : int array, shape (m,)
        Ids of the confirmed landmarks, negative where no sighting named them.
    position : float64 array, shape (m, 2)
        Where they are in the end, metres in world.
    covariance : float64 array, shape (m, 2, 2)
    sightings : int array, shape (m,)
    verdict : uint8 array, shape (n,)
        Indices into `Verdict`, in the order of the log's sightings.
    wall_s : float
        That it took.
    """

    estimate: Trajectory
    landmark: NDArray[np.int32]
    position: FloatArray
    covariance: FloatArray
    sightings: NDArray[np.int32]
    verdict: NDArray[np.uint8]
    wall_s: float


def map_landmarks(
    log: Log,
    config: _core.LandmarkEkfConfig,
    start: _core.PoseEstimate,
    association: _core.Association = _core.Association.JOINT,
) -> LandmarkMapping:
    """Drive a log by its odometry and its sightings, and by nothing else.

    Parameters
    ----------
    log : Log
        With ``odometry`` as velocities and ``landmark_sightings``; names are not used.
    config : LandmarkEkfConfig
    start : PoseEstimate
    association : Association
        Which sighting is of which landmark.

    Returns
    -------
    LandmarkMapping

    Raises
    ------
    LogError
        If the log lacks one of the two, or its odometry is not velocities.
    """
    seen, odometry = log.tables.get("landmark_sightings"), log.tables.get("odometry")
    if seen is None or odometry is None or "v_mps" not in odometry:
        raise LogError("mapping needs landmark_sightings.csv, and odometry.csv with v_mps and "
                       f"omega_radps; the log has {sorted(log.tables)}")  # fmt: skip
    mount = (log.landmark_sensor or {"pose_in_body": [0.0, 0.0, 0.0]})["pose_in_body"]
    ekf = _core.LandmarkEkf(config, start, _core.Pose2(*mount))
    begin = time.perf_counter()
    stamps, group = np.unique(seen["stamp_ns"], return_inverse=True)
    rows = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1])
    driven = np.searchsorted(odometry["stamp_ns"], stamps, side="right")
    next_row, poses = 0, []
    verdict = np.zeros(len(group), np.uint8)
    for stamp, these, until in zip(stamps.tolist(), rows, driven.tolist(), strict=True):
        for row in range(next_row, until):
            ekf.on(_velocity(odometry, row))
        next_row = until
        sightings = [_sighting(seen, row) for row in these]
        verdict[these] = [o.verdict.value for o in ekf.on_joint(sightings, association)]
        poses.append(ekf.estimate(stamp))
    wall_s = time.perf_counter() - begin
    found = [landmark for landmark in ekf.landmarks() if landmark.confirmed]
    return LandmarkMapping(
        estimate=Trajectory(
            stamps,
            np.array([[e.pose.x, e.pose.y] for e in poses]).reshape(-1, 2),
            np.array([e.pose.heading for e in poses]),
            np.array([e.covariance for e in poses]).reshape(-1, 3, 3),
        ),
        landmark=np.array([landmark.id for landmark in found], np.int32),
        position=np.array([landmark.position for landmark in found]).reshape(-1, 2),
        covariance=np.array([landmark.covariance for landmark in found]).reshape(-1, 2, 2),
        sightings=np.array([landmark.sightings for landmark in found], np.int32),
        verdict=verdict,
        wall_s=wall_s,
    )


def _velocity(odometry: Columns, row: int) -> _core.Velocity:
    forward, turn_rate = odometry["v_mps"][row], odometry["omega_radps"][row]
    return _core.Velocity(int(odometry["stamp_ns"][row]), float(forward), float(turn_rate))


def _sighting(seen: Columns, row: int) -> _core.RangeBearing:
    return _core.RangeBearing(
        int(seen["stamp_ns"][row]),
        None,
        _number(seen["range_m"][row]),
        _number(seen["bearing_rad"][row]),
    )


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
