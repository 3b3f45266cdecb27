# SPDX-License-Identifier: Apache-2.0
"""What a 2D laser scanner sees of a grid map: where its beams end, plus noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.config.scenario import Covered, Glass, LaserFault, LaserSensor, MaxRange, People
from locfuse.sim.beams import cast
from locfuse.sim.obstacles import clearness, hidden_by, walk
from locfuse.sim.sensors import point_in_world, seconds
from locfuse.sim.sensors import stamps as stamps_of
from locfuse.sim.trajectory import Drive
from locfuse.types import NANOSECONDS, Columns, FloatArray, GridMap, StampArray

_ROUNDING_RAD = 1e-9  # a beam on the edge of a cover is covered


def geometry(sensor: LaserSensor) -> dict[str, Any]:
    """Return what ``laser`` of a log says of a scanner."""
    x, y, heading_deg = sensor.pose_in_body
    view = float(np.deg2rad(sensor.field_of_view_deg))
    steps = sensor.beams if sensor.field_of_view_deg == 360.0 else sensor.beams - 1
    way = 1.0 if sensor.mounting == "upright" else -1.0
    return {
        "pose_in_body": [x, y, float(np.deg2rad(heading_deg))],
        "angle_min_rad": -0.5 * way * view,
        "angle_increment_rad": way * view / steps,
        "range_min_m": sensor.range_min_m,
        "range_max_m": sensor.range_max_m,
    }


def stamps(sensor: LaserSensor, duration_s: float, share: float) -> StampArray:
    """Return the stamps of scans: from that share of a period on, up to the duration."""
    begin = share / sensor.rate_hz
    later: StampArray = stamps_of(sensor.rate_hz, duration_s - begin) + round(begin * NANOSECONDS)
    return later


def together(seen: Mapping[str, Columns], lasers: Mapping[str, LaserSensor]) -> Columns:
    """Return the scans of all lasers in order of their stamps, with the names of several."""
    if "" in seen:
        return seen[""]
    widest = max(sensor.beams for sensor in lasers.values())
    tables = []
    for name, sensor in lasers.items():
        n, beam = len(seen[name]["stamp_ns"]), geometry(sensor)
        own = {"beams": float(sensor.beams)} | {
            key: beam[key] for key in ("angle_min_rad", "angle_increment_rad")
        }
        ranges = np.pad(seen[name]["ranges_m"], ((0, 0), (0, widest - sensor.beams)),
                        constant_values=np.nan)  # fmt: skip
        tables.append({"stamp_ns": seen[name]["stamp_ns"], "laser": np.full(n, name),
                       **{key: np.full(n, value) for key, value in own.items()},
                       "ranges_m": ranges})  # fmt: skip
    whole = {key: np.concatenate([table[key] for table in tables]) for key in tables[0]}
    if len({sensor.beams for sensor in lasers.values()}) == 1:
        whole = {key: whole[key] for key in ("stamp_ns", "laser", "ranges_m")}
    order = np.argsort(whole["stamp_ns"], kind="stable")
    return {key: values[order] for key, values in whole.items()}


def scans(
    drive: Drive,
    stamp_ns: StampArray,
    grid: GridMap,
    sensor: LaserSensor,
    rng: np.random.Generator,
    faults: Sequence[tuple[LaserFault, np.random.Generator]] = (),
    discs: tuple[FloatArray, float] | None = None,
) -> Columns:
    """Return what the laser sees at each stamp, all beams at that instant.

    `discs` are middles, shape (k, 2), and radius of what stands in the way, metres. Each fault
    draws from its own generator; none changes the noise of a beam. ``ranges_m``, shape (n, beams),
    is metres to where each beam enters an occupied cell, plus noise; NaN where there was no return.
    """
    seen = geometry(sensor)
    x, y, heading = seen["pose_in_body"]
    pose = drive.pose_at(seconds(stamp_ns))
    start = point_in_world(pose, (x, y, 0.0))[:, :2]
    direction = pose[:, 2:] + heading + _beams(sensor)
    reach = sensor.range_max_m + 10.0 * sensor.sigma_m  # noise may bring back what is just beyond
    origin, heading_of = np.repeat(start, sensor.beams, axis=0), direction.ravel()
    glass = [(fault, child) for fault, child in faults if isinstance(fault, Glass)]
    through = None
    if glass:
        clear = np.maximum.reduce([clearness(grid, fault, child) for fault, child in glass])
        through = (clear, glass[0][1].random(direction.size))
    distance = cast(grid, origin, heading_of, reach, through).reshape(direction.shape)
    if discs is not None:
        standing = np.broadcast_to(discs[0], (len(start), *discs[0].shape))
        distance = np.minimum(distance, hidden_by(standing, discs[1], start, direction))
    for fault, child in faults:
        if isinstance(fault, People):
            people = walk(grid, fault, seconds(stamp_ns), child)
            distance = np.minimum(distance, hidden_by(people, fault.radius_m, start, direction))
    measured = distance + sensor.sigma_m * rng.standard_normal(direction.shape)
    lost = rng.random(direction.shape) < sensor.dropout
    lost |= (measured < sensor.range_min_m) | (measured > sensor.range_max_m)
    for fault, _ in faults:
        if isinstance(fault, Covered):
            lost |= covered(stamp_ns, sensor, fault)
    ranges = np.where(lost, np.nan, measured)
    for fault, child in faults:
        if isinstance(fault, MaxRange):
            full = np.isnan(ranges) & (child.random(ranges.shape) < fault.probability)
            ranges[full] = sensor.range_max_m
    return {"stamp_ns": stamp_ns, "ranges_m": ranges}


def covered(stamp_ns: StampArray, sensor: LaserSensor, fault: Covered) -> NDArray[np.bool_]:
    """Return which beams a cover hides at which stamps, shape (n, beams)."""
    after = np.mod(_beams(sensor) - np.deg2rad(fault.from_deg), 2.0 * np.pi)
    after = np.where(after > 2.0 * np.pi - _ROUNDING_RAD, 0.0, after)
    hidden = after <= np.deg2rad(fault.to_deg - fault.from_deg) + _ROUNDING_RAD
    when = np.ones(len(stamp_ns), np.bool_)
    if fault.from_s is not None and fault.to_s is not None:
        begin, end = round(fault.from_s * NANOSECONDS), round(fault.to_s * NANOSECONDS)
        when = (begin <= stamp_ns) & (stamp_ns < end)
    return np.asarray(when[:, None] & hidden)


def _beams(sensor: LaserSensor) -> FloatArray:
    """Return the angle of each beam from straight ahead of the laser, counter-clockwise, rad."""
    seen = geometry(sensor)
    angle: FloatArray = seen["angle_min_rad"] + seen["angle_increment_rad"] * np.arange(
        sensor.beams
    )
    return angle
