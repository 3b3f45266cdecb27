# SPDX-License-Identifier: Apache-2.0
"""What goes wrong: each fault changes the table it is meant for, and nothing else.

A fault draws for every row of its table, hit or not, from a generator of its own: what one fault
does never depends on another. Rows that drop out are marked, and taken away at the end.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.config import scenario
from locfuse.sim.sensors import point_in_world, seconds
from locfuse.sim.trajectory import Drive
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray, wrap_angle

Points = Mapping[str, tuple[float, float, float]]
Mask = NDArray[np.bool_]

MOVED = ("dx_m", "dy_m", "v_mps", "v_left_mps")  # columns of odometry
TURNED = ("dheading_rad", "omega_radps")
TOUCHING = 1e-9  # share of the line of sight; closer to an end than this is no crossing


@dataclass(frozen=True)
class World:
    """What is true, for faults that depend on where things are.

    `tags` are (x, y, z) in body and `anchors` in world, metres, by name; `odometry_ns`, shape (n,),
    are the stamps between which odometry reports motions, empty without odometry.
    """

    drive: Drive
    tags: Points
    anchors: Points
    odometry_ns: StampArray


def with_faults(
    tables: Mapping[str, Columns],
    faults: Sequence[tuple[scenario.Fault, np.random.Generator]],
    world: World,
) -> dict[str, Columns]:
    """Return the tables, by sensor, after all faults, in their order; `tables` is not changed.

    Faults of the laser are left to it: they act on what it sees. Kidnappings are in the drive.
    """
    result = dict(tables)
    keep = {source: np.ones(len(table["stamp_ns"]), np.bool_) for source, table in tables.items()}
    epoch = seconds(world.odometry_ns)
    for fault, child in faults:
        if isinstance(fault, scenario.LaserFault | scenario.Kidnap):
            continue
        source = scenario.fault_source(fault)
        table = result[source]
        if isinstance(fault, scenario.Dropouts):
            keep[source] &= ~_dropped(table, fault, child)
        elif isinstance(fault, scenario.Nlos):
            through = _walls_of(table, fault, world)
            result[source] = _nlos(table, fault, through, child)
            if fault.silent_walls is not None:
                keep[source] &= through < fault.silent_walls
        elif isinstance(fault, scenario.Bias):
            result[source] = _bias(table, fault)
        elif isinstance(fault, scenario.Wander):
            result[source] = _wander(table, fault, child)
        elif isinstance(fault, scenario.Outliers):
            result[source] = _outliers(table, fault, child)
        elif isinstance(fault, scenario.Latency):
            result[source] = _latency(table, fault, child)
        elif isinstance(fault, scenario.WheelSlip):
            result[source] = _wheel_slip(table, fault, epoch)
        else:
            result[source] = _slip_episodes(table, fault, epoch, child)
    return {
        source: table
        if keep[source].all()
        else {name: column[keep[source]] for name, column in table.items()}
        for source, table in result.items()
    }


def walls_between(
    tag: FloatArray, anchor: FloatArray, walls: Iterable[tuple[float, float, float, float]]
) -> NDArray[np.int64]:
    """Return how many walls each line of sight crosses, shape (n,).

    `tag` and `anchor` are x and y in world, metres, shape (n, 2); `walls` are (x1, y1, x2, y2),
    metres. The ends belong to the wall; a line that runs along a wall does not cross it.
    """
    sight = anchor - tag
    crossed = np.zeros(len(tag), np.int64)
    for x1, y1, x2, y2 in walls:
        along = np.array([x2 - x1, y2 - y1])
        to_wall = np.array([x1, y1]) - tag
        area = _cross(sight, along)
        parallel = area == 0.0
        area = np.where(parallel, 1.0, area)
        on_sight = _cross(to_wall, along) / area
        on_wall = _cross(to_wall, sight) / area
        crossed += (
            ~parallel
            & (on_sight > TOUCHING)
            & (on_sight < 1.0 - TOUCHING)
            & (on_wall >= 0.0)
            & (on_wall <= 1.0)
        )
    return crossed


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _walls_of(table: Columns, fault: scenario.Nlos, world: World) -> NDArray[np.int64]:
    """Return how many walls of a fault each range goes through."""
    pose = world.drive.pose_at(seconds(table["stamp_ns"]))
    tag = np.empty((len(pose), 2))
    for name, lever in world.tags.items():
        rows = table["tag"] == name
        tag[rows] = point_in_world(pose[rows], lever)[:, :2]
    anchor = np.array([world.anchors[name][:2] for name in table["anchor"].tolist()])
    return walls_between(tag, anchor.reshape(-1, 2), fault.walls)


def _nlos(
    table: Columns, fault: scenario.Nlos, through: NDArray[np.int64], rng: np.random.Generator
) -> Columns:
    extra = np.full(len(through), fault.extra_m)
    if fault.sigma_m > 0.0:
        # A detour is never negative: gamma, with the mean and deviation asked for.
        shape = (fault.extra_m / fault.sigma_m) ** 2
        extra = rng.gamma(shape, fault.extra_m / shape, size=len(through))
    long = np.where(through > 0, table["range_m"] + extra, table["range_m"])
    return {**table, "range_m": long}


def _bias(table: Columns, fault: scenario.Bias) -> Columns:
    biased = np.maximum(fault.scale * table["range_m"] + fault.offset_m, 0.0)
    if fault.anchor is not None:
        biased = np.where(table["anchor"] == fault.anchor, biased, table["range_m"])
    return {**table, "range_m": biased}


def _wander(table: Columns, fault: scenario.Wander, rng: np.random.Generator) -> Columns:
    drawn = rng.standard_normal(len(table["stamp_ns"]))
    error = np.empty(len(drawn))
    for anchor in np.unique(table["anchor"]):
        rows = np.flatnonzero(table["anchor"] == anchor)
        rows = rows[np.argsort(table["stamp_ns"][rows], kind="stable")]
        elapsed = np.diff(seconds(table["stamp_ns"][rows])) / fault.correlation_s
        now = drawn[rows[0]]
        error[rows[0]] = now
        for row, kept, innovation in zip(
            rows[1:], np.exp(-elapsed), np.sqrt(-np.expm1(-2.0 * elapsed)), strict=True
        ):
            now = kept * now + innovation * drawn[row]
            error[row] = now
    return {**table, "range_m": np.maximum(table["range_m"] + fault.sigma_m * error, 0.0)}


def _outliers(table: Columns, fault: scenario.Outliers, rng: np.random.Generator) -> Columns:
    n = len(table["stamp_ns"])
    hit = rng.random(n) < fault.probability
    direction = rng.uniform(-np.pi, np.pi, n)
    if fault.source == "ranges":
        shorter = (direction < 0.0) & (table["range_m"] >= fault.magnitude_m)
        error = np.where(shorter, -fault.magnitude_m, fault.magnitude_m)
        return {**table, "range_m": np.where(hit, table["range_m"] + error, table["range_m"])}
    x = table["x_m"] + fault.magnitude_m * np.cos(direction)
    y = table["y_m"] + fault.magnitude_m * np.sin(direction)
    return {**table, "x_m": np.where(hit, x, table["x_m"]), "y_m": np.where(hit, y, table["y_m"])}


def _dropped(table: Columns, fault: scenario.Dropouts, rng: np.random.Generator) -> Mask:
    stamp_ns = table["stamp_ns"]
    lost = rng.random(len(stamp_ns)) < (1.0 if fault.probability is None else fault.probability)
    if fault.from_s is not None and fault.to_s is not None:
        begin, end = round(fault.from_s * NANOSECONDS), round(fault.to_s * NANOSECONDS)
        lost &= (begin <= stamp_ns) & (stamp_ns < end)
    if fault.anchor is not None:
        lost &= table["anchor"] == fault.anchor
    return lost


def _latency(table: Columns, fault: scenario.Latency, rng: np.random.Generator) -> Columns:
    delay_s = fault.delay_s + fault.jitter_s * rng.random(len(table["stamp_ns"]))
    delay_ns = np.rint(delay_s * NANOSECONDS).astype(np.int64)
    return {**table, "arrival_ns": table.get("arrival_ns", table["stamp_ns"]) + delay_ns}


def _reported_between(table: Columns, epoch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return begin and end of the motion in each row of odometry, seconds."""
    if "dx_m" in table:  # motions up to the stamp, the first of which lasts no time
        return np.concatenate([epoch[:1], epoch[:-1]]), epoch
    return epoch[:-1], epoch[1:]  # velocities from the stamp on


def _wheel_slip(table: Columns, fault: scenario.WheelSlip, epoch: FloatArray) -> Columns:
    begin, end = _reported_between(table, epoch)
    inside = np.maximum(np.minimum(end, fault.to_s) - np.maximum(begin, fault.from_s), 0.0)
    share = np.divide(inside, end - begin, out=np.zeros_like(end), where=end > begin)
    translation = 1.0 + (fault.translation_factor - 1.0) * share
    rotation = 1.0 + (fault.rotation_factor - 1.0) * share
    factors = dict.fromkeys(MOVED, translation) | dict.fromkeys(TURNED, rotation)
    slipped = {name: factor * table[name] for name, factor in factors.items() if name in table}
    return {**table, **slipped}


def _slip_episodes(
    table: Columns, fault: scenario.SlipEpisodes, epoch: FloatArray, rng: np.random.Generator
) -> Columns:
    # Time slipped and angle turned since the beginning are straight between an episode's ends.
    time, slipped, turned = [0.0], [0.0], [0.0]
    while time[-1] < epoch[-1]:
        rests, lasts = rng.exponential(fault.every_s), rng.exponential(fault.lasting_s)
        turn = fault.turn_radps * lasts * (1.0 if rng.random() < 0.5 else -1.0)
        time += [time[-1] + rests, time[-1] + rests + lasts]
        slipped += [slipped[-1], slipped[-1] + lasts]
        turned += [turned[-1], turned[-1] + turn]
    begin, end = _reported_between(table, epoch)
    inside, more = (
        np.interp(end, time, known) - np.interp(begin, time, known) for known in (slipped, turned)
    )
    lasted = np.where(end > begin, end - begin, 1.0)
    factor = 1.0 + (fault.translation_factor - 1.0) * inside / lasted
    moved = {name: factor * table[name] for name in MOVED if name in table}
    if "dx_m" in table:
        moved["dheading_rad"] = wrap_angle(table["dheading_rad"] + more)
    else:
        moved["omega_radps"] = table["omega_radps"] + more / lasted
    return {**table, **moved}
