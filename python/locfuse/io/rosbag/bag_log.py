# SPDX-License-Identifier: Apache-2.0
"""The log of a bag's tables, with mounts, world and the description that the bag carries."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.io.log_folder import MESSAGES
from locfuse.io.rosbag.bag_contents import BagContents, Laser
from locfuse.io.rosbag.decode import MessageError, decimal
from locfuse.io.rosbag.frames import laser_mount, two_of_one
from locfuse.types import Log

Columns = dict[str, NDArray[Any]]


def log_of(contents: BagContents, tables: dict[str, Columns]) -> Log | None:
    """Return a log of tables with what the world is known to be; None where no message is left."""
    described = dict(contents.settings.log) if contents.settings else {}
    world = contents.world
    for stem in ("anchors", "landmarks"):
        if stem in world:
            tables[stem] = dict(world[stem])
    tags = {**_tags(contents, described.get("tags", {}), world), **world.tags}
    lasers = _place_lasers(contents, tables, described)
    if "odometry" in tables and not _are_of_body(contents):
        tables.pop("odometry")
    if not any(len(tables[stem]["stamp_ns"]) for stem in MESSAGES if stem in tables):
        return None
    grid = world.grid or contents.grid
    name = world.map if world.grid is not None else described.get("map") or "map.yaml"
    return Log(
        tables=tables,
        tags=tags,
        **lasers,
        map=name if grid is not None else None,
        grid=grid,
        description=described.get("description", ""),
        licence=described.get("licence", ""),
        landmark_sensor=_landmark_sensor(contents, described.get("landmark_sensor"), world),
        origin="bag",
        gps_origin=described.get("gps_origin") or contents.fixes.origin,
    )


def _place_lasers(
    contents: BagContents, tables: dict[str, Columns], described: Mapping[str, Any]
) -> dict[str, Any]:
    """Return ``laser`` or ``lasers`` of a log, which then has no scan whose laser has no place."""
    scans, world = tables.get("scans", {}), contents.world
    if not contents.lasers:
        return {key: described.get(key) or getattr(world, key) or none
                for key, none in (("laser", None), ("lasers", {}))}  # fmt: skip
    first, *others = contents.lasers
    rows = len(scans.get("stamp_ns", ()))
    names = scans.pop("laser") if "laser" in scans else np.full(rows, first)
    placed: dict[str, Any] = {}
    for frame, laser in contents.lasers.items():
        own = described.get("lasers", {}).get(frame, described.get("laser"))
        try:
            if world.laser is not None and frame != first:
                raise MessageError(two_of_one(first, frame))
            placed[frame] = _placed(contents, frame, laser, own, scans, names == frame)
        except MessageError as error:
            if others:
                contents.warn(f"scans of {frame or 'a frame without name'} are left out: {error}")
            else:
                contents.skip_all("scans", f"{error}")
    there = np.isin(names, list(placed))
    if not there.any():
        tables.pop("scans", None)
        return {"laser": next(iter(placed.values()), None)}
    tables["scans"] = {key: values[there] for key, values in scans.items()}
    if len(placed) == 1:
        return {"laser": next(iter(placed.values()))}
    tables["scans"] = {"stamp_ns": tables["scans"]["stamp_ns"], "laser": names[there],
                       **tables["scans"]}  # fmt: skip
    return {"lasers": placed}


def _placed(
    contents: BagContents,
    frame: str,
    laser: Laser,
    described: Any,
    scans: Columns,
    rows: NDArray[np.bool_],
) -> dict[str, Any]:
    """Return a laser where its frame is; of one head down, angles of `rows` are turned round.

    Raises MessageError where nothing says where it is.
    """
    geometry = {"angle_min_rad": laser.angle_min, "angle_increment_rad": laser.angle_increment,
                "range_min_m": laser.range_min, "range_max_m": laser.range_max}  # fmt: skip
    if laser.time_increment:
        geometry["time_increment_s"] = laser.time_increment
    if described is not None and all(decimal(described.get(key, 0.0)) == value
                                for key, value in geometry.items()):  # fmt: skip
        return dict(described)
    pose, flipped = laser.mount, False
    if pose is None:
        pose, flipped = laser_mount(contents.world, contents.tree, frame, laser.angle_increment)
    if flipped:
        geometry |= {key: -geometry[key] for key in ("angle_min_rad", "angle_increment_rad")}
        for key in ("angle_min_rad", "angle_increment_rad"):
            if key in scans:
                scans[key] = np.where(rows, -scans[key], scans[key])
    return {"pose_in_body": [pose.x, pose.y, pose.heading], **geometry}


def _are_of_body(contents: BagContents) -> bool:
    """Return whether odometry is of the body, and warn of the frames that are taken for it."""
    try:
        warnings = [contents.tree.same_body(frame) for frame in sorted(contents.bodies)]
    except MessageError as error:
        contents.skip_all("odometry", f"{error}")
        return False
    for sentence in filter(None, warnings):
        contents.warn(sentence)
    return True


def _tags(
    contents: BagContents, described: Any, world: Log
) -> dict[str, tuple[float, float, float]]:
    found = {name: tuple(at) for name, at in described.items()}
    for tag, frame in contents.tag_frames.items():
        if tag in found or tag in world.tags:
            continue
        try:
            mount = contents.tree.mount(frame or tag)
            found[tag] = (mount.x, mount.y, mount.z)
        except MessageError as error:
            contents.warn(f"where the tag {tag!r} sits is not known: {error}")
    return found


def _landmark_sensor(contents: BagContents, described: Any, world: Log) -> Any:
    if world.landmark_sensor is not None:
        return world.landmark_sensor
    if described is not None or not contents.sight_frame or contents.settings is not None:
        return described
    try:
        x, y, _, heading = contents.tree.mount(contents.sight_frame)
    except MessageError as error:
        contents.warn(f"landmarks are taken as seen from the body's origin: {error}")
        return None
    return {"pose_in_body": [x, y, heading]}
