# SPDX-License-Identifier: Apache-2.0
"""The numbers of a configuration that recordings say something of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from pydantic import BaseModel

from locfuse.config.schema import RunConfig
from locfuse.run.odometry import uses_gyro
from locfuse.tune.drive import Drive
from locfuse.tune.maximize import Variable

# Sigmas below these do nothing to any estimate [m], [rad] and the same per root of m, rad and s.
NOTHING = 1e-5
_ENDS = {"distance_scale": (1e-3, 1e3), "turn_scale": (1e-3, 1e3), "direction_rad": (-0.5, 0.5),
         "latency_s": (-5.0, 5.0), "antenna_forward_m": (-1e3, 1e3), "antenna_left_m": (-1e3, 1e3)
         }  # fmt: skip
_OFFSET = "estimator.calibration.sigma_anchor_offset_m"
_OFFSET_LASTS = "estimator.calibration.anchor_offset_correlation_s"


@dataclass(frozen=True)
class Quantity:
    """A key of the configuration with a number, and its value `now`.

    A sigma is positive, and found in its logarithm. Any other value is
    kept where the recording does not contradict it; an interval wider than `wide` to each side
    says nothing.
    """

    key: str
    unit: str
    now: float
    is_sigma: bool
    wide: float = math.inf
    first: float = 0.0  # of a sigma that is 0 now

    @property
    def variable(self) -> Variable:
        """What is maximized."""
        if self.is_sigma:
            begin = self.now if self.now > 0.0 else self.first
            return Variable(math.log(max(begin, NOTHING)), 0.2, 0.03, 0.5, 1.0,
                            math.log(NOTHING), math.log(1e4))  # fmt: skip
        step = 0.2 * self.wide
        low, high = _ENDS[self.key.rsplit(".", 1)[-1]]
        return Variable(self.now, step, 0.01 * step, 3.0 * step, 10.0 * step, low, high)

    def value(self, at: float) -> float:
        """Return the value at a coordinate of the variable."""
        return math.exp(at) if self.is_sigma else at

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        return math.log(max(value, NOTHING)) if self.is_sigma else value


def quantities(config: RunConfig, drives: Sequence[Drive]) -> list[Quantity]:
    """Return what may be found of a configuration with these recordings."""
    sources = {source for drive in drives for source in config.use
               if len(drive.log.tables.get(source, {}).get("stamp_ns", ()))}  # fmt: skip
    found = [*_of_wheels(config, drives, sources), *_of_sensors(config, drives, sources)]
    if config.estimator.kind == "air":
        found += _of_air(config, sources)
    return found


def with_values(config: RunConfig, values: Mapping[str, float | str]) -> RunConfig:
    """Return a configuration with some of its keys changed; nothing is validated."""
    for key, value in values.items():
        config = _with(config, key.split("."), value)
    calibration = config.estimator.calibration
    if calibration.sigma_anchor_offset_m == 0.0 < calibration.anchor_offset_correlation_s:
        config = _with(config, _OFFSET_LASTS.split("."), 0.0)  # of no offsets
    return config


def changes(values: Mapping[str, float | str]) -> dict[str, Any]:
    """Return the part of a configuration that changes with these values, as in a file."""
    changed: dict[str, Any] = {}
    for key, value in values.items():
        node = changed
        *parents, last = key.split(".")
        for parent in parents:
            node = node.setdefault(parent, {})
        node[last] = short(value)
    return changed


def _of_wheels(config: RunConfig, drives: Sequence[Drive], sources: set[Any]) -> Iterator[Quantity]:
    if "odometry" not in sources:
        return
    has_gyro = uses_gyro(config) and any(
        len(drive.log.tables.get("imu", {}).get("stamp_ns", ())) for drive in drives)  # fmt: skip
    keys = ["sigma_longitudinal_per_sqrt_m", "sigma_lateral_per_sqrt_m"]
    keys += [] if has_gyro else ["sigma_heading_per_sqrt_m", "sigma_heading_per_sqrt_rad"]
    wheels = config.estimator.odometry
    keys += [key for key in type(wheels).model_fields
             if key.endswith("_per_sqrt_s") and getattr(wheels, key) > 0.0]  # fmt: skip
    for key in keys:
        yield _sigma(config, f"estimator.odometry.{key}", 0.01)
    if config.scan_odometry is None:
        calibration = config.estimator.calibration
        if calibration.sigma_scale == 0.0:
            yield _plain(config, "estimator.odometry.distance_scale", 0.05)
        # Without anything that sees the heading, the direction is told by that of the start alone.
        if calibration.sigma_direction_rad == 0.0 and sources & {"landmark_sightings", "poses"}:
            yield _plain(config, "estimator.odometry.direction_rad", 0.05)
        if calibration.sigma_turn_scale == 0.0 and not has_gyro:
            yield _plain(config, "estimator.odometry.turn_scale", 0.05)
    if has_gyro:
        yield _sigma(config, "imu.sigma_turn_per_sqrt_s", 0.001)


def _of_sensors(
    config: RunConfig, drives: Sequence[Drive], sources: set[Any]
) -> Iterator[Quantity]:
    calibration = config.estimator.calibration
    is_late = {"ranges": calibration.sigma_range_delay_s, "landmark_sightings":
               calibration.sigma_delay_s}  # fmt: skip
    made = {"landmark_sightings"} if config.cylinders is not None else set()
    if "ranges" in sources:
        if _unsaid(drives, "ranges", "sigma_m"):
            yield _sigma(config, "estimator.range.sigma_m", 0.1)
            yield _sigma(config, "estimator.range.sigma_relative", 0.01)
        if calibration.sigma_anchor_offset_m > 0.0:
            yield _sigma(config, _OFFSET, 0.05)
            if calibration.anchor_offset_correlation_s > 0.0:
                yield _sigma(config, _OFFSET_LASTS, 10.0)
    if "positions" in sources:
        for column, key in ((False, "sigma_m"), (True, "least_sigma_m")):
            if _unsaid(drives, "positions", "sigma_m") != column:
                yield _sigma(config, f"estimator.position.{key}", 0.5)
        if all("tag" not in drive.log.tables.get("positions", {}) for drive in drives):
            for axis in ("forward", "left"):
                yield _plain(config, f"estimator.position.antenna_{axis}_m", 0.3)
    if "landmark_sightings" in sources - made and _unsaid(drives, "landmark_sightings",
                                                          "sigma_range_m"):  # fmt: skip
        yield _sigma(config, "estimator.landmark.sigma_range_m", 0.1)
        yield _sigma(config, "estimator.landmark.sigma_bearing_rad", 0.02)
        yield _sigma(config, "estimator.landmark.sigma_range_relative", 0.01)
    if "headings" in sources:
        key = "sigma_rad" if _unsaid(drives, "headings", "sigma_rad") else "least_sigma_rad"
        yield _sigma(config, f"estimator.heading.{key}", 0.05)
    if "altitudes" in sources and _unsaid(drives, "altitudes", "sigma_m"):
        yield _sigma(config, "estimator.air.altitude.sigma_m", 0.1)
    changes_pace = "odometry" in sources and any(
        drive.steps is None or drive.steps.change_pace for drive in drives)  # fmt: skip
    for source, section in (("ranges", "range"), ("positions", "position"),
                            ("landmark_sightings", "landmark"), ("headings", "heading"),
                            ("altitudes", "air.altitude")):  # fmt: skip
        if changes_pace and source in sources - made and is_late.get(source, 0.0) == 0.0:
            yield _plain(config, f"estimator.{section}.latency_s", 0.2)


def _of_air(config: RunConfig, sources: set[Any]) -> Iterator[Quantity]:
    air = config.estimator.air
    if air.motion == "inertial":
        for key in ("sigma_turn_per_sqrt_s", "sigma_velocity_per_sqrt_s"):
            yield _sigma(config, f"imu.{key}", 0.01)
    if air.motion == "constant_velocity":
        for key in type(air.constant_velocity).model_fields:
            yield _sigma(config, f"estimator.air.constant_velocity.{key}", 0.1)
    if air.motion == "odometry":
        yield _sigma(config, "estimator.air.sigma_height_per_sqrt_s", 0.05)


def _sigma(config: RunConfig, key: str, first: float) -> Quantity:
    return Quantity(key, _unit(key), float(attrgetter(key)(config)), is_sigma=True, first=first)


def _plain(config: RunConfig, key: str, wide: float) -> Quantity:
    return Quantity(key, _unit(key), float(attrgetter(key)(config)), is_sigma=False, wide=wide)


def _unit(key: str) -> str:
    for ending, unit in (("_per_sqrt_m", "/√m"), ("_per_sqrt_rad", "/√rad"),
                         ("_per_sqrt_s", "/√s")):  # fmt: skip
        if key.endswith(ending):
            of = "rad" if "heading" in key or "turn" in key else "m"
            return ("m/s" if "velocity" in key or "climb" in key else of) + unit
    return next((unit for ending, unit in (("_m", "m"), ("_rad", "rad"), ("_s", "s"))
                 if key.endswith(ending)), "")  # fmt: skip


def _unsaid(drives: Sequence[Drive], source: str, column: str) -> bool:
    """Return whether most messages of a source bring no sigma of their own."""
    tables = [drive.log.tables[source] for drive in drives if source in drive.log.tables]
    said = [int(np.sum(table[column] > 0.0)) if column in table else 0 for table in tables]
    return 2 * sum(said) < sum(len(table["stamp_ns"]) for table in tables)


def _with(model: Any, path: Sequence[str], value: float | str) -> Any:
    first, *rest = path
    inner: BaseModel | float | str = _with(getattr(model, first), rest, value) if rest else value
    return model.model_copy(update={first: inner})


def short(value: float | str) -> float | str:
    """Return a value with the digits that count."""
    if isinstance(value, str):
        return value
    return float(f"{value:.3g}") if abs(value - 1.0) > 0.2 else round(value, 4)
