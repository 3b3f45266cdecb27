# SPDX-License-Identifier: Apache-2.0
"""Mapping while localizing in Victoria Park, from trees that are not surveyed, without GPS.

Two chains: trees that the dataset's own detector found and its publishers pass on, and trees that
our `CylinderDetector` finds in the raw scans.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from locfuse import _core
from locfuse.eval.errors import interpolate
from locfuse.run.start import scans_of
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, Trajectory
from papers.claims import Claim, absent
from papers.recorded import load_recording, ready_run
from papers.recordings.landmark_mapping import LandmarkMapping, map_landmarks, mapping_of
from papers.scores import rms

ANTENNA_M = (3.78, 0.5)
HEADING_DEG = 38.0  # at the first fix, as the recording's notes have it
REQUIRED_M = 6.0
FAR_M = 40.0  # beyond, half a degree between beams is wider than most trunks
CHAINS = {"trees": "trees of the dataset's own detector", "laser": "trees found in raw scans"}


@dataclass(frozen=True)
class Mapped:
    """One chain along the recording.

    Attributes
    ----------
    mapping : LandmarkMapping
    log : Log
        With the sightings that it mapped.
    off_m : float64 array, shape (n,)
        From each GPS fix to the antenna.
    detect_s : float
        How long finding trees took, on one thread; 0 where the dataset brings them.
    """

    mapping: LandmarkMapping
    log: Log
    off_m: FloatArray
    detect_s: float

    @property
    def rmse_m(self) -> float:
        """Root mean square of the distances to GPS."""
        return rms(self.off_m)

    @property
    def times_real_time(self) -> float:
        """How many seconds of the drive one second of computing maps."""
        stamps = self.log["odometry"]["stamp_ns"]
        return float(stamps[-1] - stamps[0]) / NANOSECONDS / (self.detect_s + self.mapping.wall_s)


def tree_parts(configs: Path) -> list[Callable[[], Iterator[Claim]]]:
    """Return what yields the rows, in parts; the folder is that of the ready configurations."""
    return [lambda chain=chain: _claims(configs, chain) for chain in CHAINS]  # type: ignore[misc]


@cache
def mapped_by(configs: Path | None, chain: str) -> Mapped:
    """Drive Victoria Park by odometry and the trees of one of `CHAINS`.

    With trees of the dataset's detector it is the run of the ready configuration, at the stamps of
    the trees; they are put together jointly, ours each with its nearest.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    if chain == "trees":
        result = ready_run(configs, "victoria_park.yaml")
        mapping = mapping_of(result)
        return Mapped(mapping, result.log, off_gps(result.log, mapping.estimate), 0.0)
    log, began = load_park(configs, chain), time.perf_counter()
    log = with_trees(log)
    detect_s = time.perf_counter() - began
    mapping = map_landmarks(log, truck(), start_of(log), _core.Association.NEAREST)
    return Mapped(mapping, log, off_gps(log, mapping.estimate), detect_s)


def load_park(configs: Path | None, run: str) -> Log:
    """Return the recording with trees of the dataset's detector, or with raw scans."""
    return load_recording(configs, "victoria_park", "victoria-park", run)[1]


def with_trees(log: Log) -> Log:
    """Return the log with trunks that our detector finds in its scans as sightings.

    Half of the trunks are one or two beams wide, which show no curvature: `least_evidence` is 0.
    """
    detector = _core.CylinderDetector(
        _core.CylinderDetectorConfig(
            sigma_range_m=0.03,
            sigma_bearing_rad=0.004,
            radius_max_m=1.0,
            least_beams=1,
            least_evidence=0.0,
        )
    )
    rows = [(scan.stamp, trunk.range, trunk.bearing) for scan in scans_of(log)
            for trunk in detector.detect(scan) if trunk.range < FAR_M]  # fmt: skip
    stamp, distance, bearing = zip(*rows, strict=True)
    seen = {"stamp_ns": np.array(stamp, np.int64), "landmark": np.full(len(rows), ""),
            "range_m": np.array(distance), "bearing_rad": np.array(bearing)}  # fmt: skip
    assert log.laser is not None
    mount = {"pose_in_body": log.laser["pose_in_body"]}
    return replace(log, tables={**log.tables, "landmark_sightings": seen}, landmark_sensor=mount)


def truck() -> _core.LandmarkEkfConfig:
    """Return the noise of a truck on grass, and of trunks seen by a laser; not fitted.

    A steering that is 1 degree off turns a wheel base of 2.83 m by 0.006 rad per metre, 0.06 rad in
    10 m: as a random walk 0.02 rad / sqrt(m). Wheels slip by some per cent. A trunk of one or two
    beams has a centre known to some 0.3 m; beams are 0.5 degrees apart, and a stamp that is 25 ms
    off turns by as much.
    """
    config = _core.LandmarkEkfConfig()
    config.odometry.sigma_longitudinal_per_sqrt_m = 0.1
    config.odometry.sigma_lateral_per_sqrt_m = 0.05
    config.odometry.sigma_heading_per_sqrt_m = 0.02
    config.odometry.sigma_heading_per_sqrt_rad = 0.05
    config.landmark.sigma_range_m = 0.3
    config.landmark.sigma_bearing_rad = float(np.deg2rad(1.0))
    return config


def start_of(log: Log) -> _core.PoseEstimate:
    """Return the first fix, known to 1 cm and 0.1 degrees: the map's frame begins there."""
    heading = float(np.deg2rad(HEADING_DEG))
    c, s = np.cos(heading), np.sin(heading)
    forward, left = ANTENNA_M
    x, y = float(log["positions"]["x_m"][0]), float(log["positions"]["y_m"][0])
    body = _core.Pose2(x - c * forward + s * left, y - s * forward - c * left, heading)
    return _core.PoseEstimate(0, body, np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2)


def antenna_of(estimate: Trajectory) -> Trajectory:
    """Return where the antenna is along a trajectory of the body."""
    assert estimate.heading is not None
    c, s = np.cos(estimate.heading), np.sin(estimate.heading)
    forward, left = ANTENNA_M
    arm = np.column_stack([c * forward - s * left, s * forward + c * left])
    return replace(estimate, position=estimate.position + arm)


def off_gps(log: Log, estimate: Trajectory) -> FloatArray:
    """Return how far each GPS fix is from the antenna of a body, shape (n,), metres."""
    fixes = log["positions"]
    at, inside = interpolate(estimate, fixes["stamp_ns"])
    gps = np.column_stack([fixes["x_m"], fixes["y_m"]])[inside]
    off: FloatArray = np.hypot(*(antenna_of(at).position - gps).T)
    return off


def _claims(configs: Path, chain: str) -> Iterator[Claim]:
    key, what = f"victoria_park_{chain}", f"Victoria Park (real), {CHAINS[chain]}: "
    try:
        mapped = mapped_by(configs, chain)
    except LogError as missing:
        yield absent(key, f"{what}position RMSE to GPS", str(missing), f"<= {REQUIRED_M:g}")
        return
    rmse, trees = mapped.rmse_m, float(len(mapped.mapping.landmark))
    for row, part, unit, value, required, met in (
        ("", "position RMSE to GPS", "m", rmse, f"<= {REQUIRED_M:g}", rmse <= REQUIRED_M),
        ("_end", "off GPS at the end, after 2.2 km", "m", float(mapped.off_m[-1]), "-", True),
        ("_mapped", "trees in the map", "1", trees, "-", True),
        ("_factor", "times faster than the drive", "1", mapped.times_real_time, ">= 1",
         mapped.times_real_time >= 1.0),
    ):  # fmt: skip
        yield Claim(f"{key}{row}", what + part, unit, None, value, value, value, required, met)
