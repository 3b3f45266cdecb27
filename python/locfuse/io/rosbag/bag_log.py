# SPDX-License-Identifier: Apache-2.0
"""The log of a bag's tables, with mounts, world and the description that the bag carries."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from locfuse.io.log_folder import MESSAGES
from locfuse.io.rosbag.bag_contents import BagContents
from locfuse.io.rosbag.decode import MessageError, decimal
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
    laser = _laser(contents, tables.get("scans", {}), described.get("laser"), world)
    if laser is None and "scans" in tables:
        tables.pop("scans")
    if "odometry" in tables and not _are_of_body(contents):
        tables.pop("odometry")
    if not any(len(tables[stem]["stamp_ns"]) for stem in MESSAGES if stem in tables):
        return None
    grid = world.grid or contents.grid
    name = world.map if world.grid is not None else described.get("map") or "map.yaml"
    return Log(
        tables=tables,
        tags=tags,
        laser=laser,
        map=name if grid is not None else None,
        grid=grid,
        description=described.get("description", ""),
        licence=described.get("licence", ""),
        landmark_sensor=_landmark_sensor(contents, described.get("landmark_sensor"), world),
        origin="bag",
    )


def _laser(contents: BagContents, scans: Columns, described: Any, world: Log) -> Any:
    if contents.laser is None:
        return described or world.laser
    frame, start, increment, nearest, farthest, each, _ = contents.laser
    geometry = {"angle_min_rad": start, "angle_increment_rad": increment,
                "range_min_m": nearest, "range_max_m": farthest}  # fmt: skip
    if each:
        geometry["time_increment_s"] = each
    if described is not None and all(decimal(described.get(key, 0.0)) == value
                                for key, value in geometry.items()):  # fmt: skip
        return dict(described)
    try:
        if world.laser is not None:
            pose = list(world.laser["pose_in_body"])
            flipped = float(world.laser["angle_increment_rad"]) * increment < 0.0  # head down
        else:
            x, y, _, heading = contents.tree.mount(frame)
            pose, flipped = [x, y, heading], contents.tree.upside_down(frame)
    except MessageError as error:
        contents.skip_all("scans", f"{error}")
        return None
    if flipped:
        geometry |= {"angle_min_rad": -start, "angle_increment_rad": -increment}
        for name in ("angle_min_rad", "angle_increment_rad"):
            if name in scans:
                scans[name] = -scans[name]
    return {"pose_in_body": pose, **geometry}


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
