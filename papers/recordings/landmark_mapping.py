# SPDX-License-Identifier: Apache-2.0
"""Mapping landmarks along a log while localizing on them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.run.messages import landmark_sensor_of, trajectory_of
from locfuse.types import Columns, FloatArray, Log, LogError, RunResult, Trajectory, rows_of


@dataclass(frozen=True)
class Instant:
    """Unnamed landmark observations of one stamp [ns], and the odometry since the one before.

    `driven` has the velocities with stamps up to it; `rows` are those of `seen` in the log's
    sightings.
    """

    stamp: int
    driven: list[_core.Velocity]
    seen: list[_core.RangeBearing]
    rows: NDArray[np.intp]


def instants_of(log: Log) -> Iterator[Instant]:
    """Yield the instants of a log at which landmarks are seen.

    Raises LogError where it has no sightings, or its odometry is not velocities.
    """
    seen, odometry = log.tables.get("landmark_sightings"), log.tables.get("odometry")
    if seen is None or odometry is None or "v_mps" not in odometry:
        raise LogError(
            "seeing landmarks needs landmark_sightings.csv, and odometry.csv with v_mps and "
            f"omega_radps; the log has {sorted(log.tables)}"
        )
    velocities = [
        _core.Velocity(*row)
        for row in zip(*(odometry[name].tolist() for name in ("stamp_ns", "v_mps", "omega_radps")),
                       odometry.get("v_left_mps", np.zeros(len(odometry["v_mps"]))).tolist(),
                       strict=True)
    ]  # fmt: skip
    sightings = [
        _core.RangeBearing(stamp, None, _number(distance), _number(bearing), covariance)
        for stamp, distance, bearing, covariance in zip(
            *(seen[name].tolist() for name in ("stamp_ns", "range_m", "bearing_rad")),
            _covariances(seen),
            strict=True,
        )
    ]
    stamps, group = np.unique(seen["stamp_ns"], return_inverse=True)
    rows = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1])
    until = np.searchsorted(odometry["stamp_ns"], stamps, side="right").tolist()
    for stamp, these, begin, end in zip(stamps.tolist(), rows, [0, *until], until, strict=False):
        yield Instant(stamp, velocities[begin:end], [sightings[row] for row in these], these)


def _covariances(seen: Columns) -> list[FloatArray | None]:
    if "sigma_range_m" not in seen:
        return [None] * len(seen["stamp_ns"])
    sigmas = np.column_stack([seen["sigma_range_m"], seen["sigma_bearing_rad"]])
    return [np.diag(sigma**2) for sigma in sigmas]


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value


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


def mapping_of(result: RunResult) -> LandmarkMapping:
    """Return the map of a run of `landmark_slam`, and its poses at the stamps of sightings.

    Ids of landmarks are their places in the map. Where all sightings of an instant were rejected
    the run has no pose.
    """
    found, metrics = result.landmarks, result.metrics
    assert found is not None
    seen = result.outcomes.source == "landmark_sightings"
    stamps = result.log["landmark_sightings"]["stamp_ns"]
    names = [verdict.name.lower() for verdict in _core.Verdict]
    return LandmarkMapping(
        estimate=rows_of(result.estimate, np.isin(result.estimate.stamp_ns, stamps)),
        landmark=np.arange(len(found), dtype=np.int32),
        position=found.position,
        covariance=found.covariance,
        sightings=found.sightings.astype(np.int32),
        verdict=np.array([names.index(one) for one in result.outcomes.verdict[seen]], np.uint8),
        wall_s=metrics["messages"] / metrics["messages_per_second"],
    )


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
    instants = list(instants_of(log))
    sensor = _core.LandmarkSensor(T_body_sensor=landmark_sensor_of(log))
    ekf = _core.LandmarkEkf(config, _core.World(landmarks=sensor), start)
    begin = time.perf_counter()
    poses = []
    verdict = np.zeros(sum(len(instant.rows) for instant in instants), np.uint8)
    for instant in instants:
        for velocity in instant.driven:
            ekf.on(velocity)
        outcomes = ekf.on_joint(instant.seen, association)
        verdict[instant.rows] = [outcome.verdict.value for outcome in outcomes]
        poses.append(ekf.estimate(instant.stamp))
    wall_s = time.perf_counter() - begin
    found = [landmark for landmark in ekf.landmarks() if landmark.confirmed]
    return LandmarkMapping(
        estimate=trajectory_of(poses),
        landmark=np.array([landmark.id for landmark in found], np.int32),
        position=np.array([landmark.position for landmark in found]).reshape(-1, 2),
        covariance=np.array([landmark.covariance for landmark in found]).reshape(-1, 2, 2),
        sightings=np.array([landmark.sightings for landmark in found], np.int32),
        verdict=verdict,
        wall_s=wall_s,
    )
