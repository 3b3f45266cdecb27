# SPDX-License-Identifier: Apache-2.0
"""From the tables of a bag to a log: where things are, and what the bag's own log said."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from locfuse.io.log_folder import MESSAGES
from locfuse.io.rosbag.bag_contents import Heard, logger
from locfuse.io.rosbag.decode import MessageError, decimal
from locfuse.types import Log

Columns = dict[str, NDArray[Any]]


def log_of(heard: Heard, tables: dict[str, Columns]) -> Log | None:
    """Return a log of tables with what the world is known to be; None where no message is left."""
    told = dict(heard.settings.log) if heard.settings else {}
    world = heard.world
    for stem in ("anchors", "landmarks"):
        if stem in world:
            tables[stem] = dict(world[stem])
    tags = {**_tags(heard, told.get("tags", {}), world), **world.tags}
    laser = _laser(heard, told.get("laser"), world)
    if laser is None and "scans" in tables:
        tables.pop("scans")
    if "odometry" in tables and not _are_of_body(heard):
        tables.pop("odometry")
    if not any(len(tables[stem]["stamp_ns"]) for stem in MESSAGES if stem in tables):
        return None
    grid = world.grid or heard.grid
    name = world.map if world.grid is not None else told.get("map") or "map.yaml"
    return Log(
        tables=tables,
        tags=tags,
        laser=laser,
        map=name if grid is not None else None,
        grid=grid,
        description=told.get("description", ""),
        licence=told.get("licence", ""),
        landmark_sensor=_landmark_sensor(heard, told.get("landmark_sensor"), world),
        origin="bag",
    )


def _laser(heard: Heard, told: Any, world: Log) -> Any:
    if heard.laser is None:
        return told or world.laser
    frame, start, increment, nearest, farthest, *_ = heard.laser
    geometry = {"angle_min_rad": start, "angle_increment_rad": increment,
                "range_min_m": nearest, "range_max_m": farthest}  # fmt: skip
    if told is not None and all(decimal(told[key]) == value
                                for key, value in geometry.items()):  # fmt: skip
        return dict(told)
    try:
        if world.laser is not None:
            pose = list(world.laser["pose_in_body"])
            flipped = frame in heard.tree and heard.tree.upside_down(frame)
        else:
            x, y, _, heading = heard.tree.mount(frame)
            pose, flipped = [x, y, heading], heard.tree.upside_down(frame)
    except MessageError as error:
        heard.lost("scans", f"{error}")
        return None
    if flipped:
        geometry |= {"angle_min_rad": -start, "angle_increment_rad": -increment}
    return {"pose_in_body": pose, **geometry}


def _are_of_body(heard: Heard) -> bool:
    """Return whether odometry is of the body; what is taken for it is told."""
    try:
        told = [heard.tree.same_body(frame) for frame in sorted(heard.bodies)]
    except MessageError as error:
        heard.lost("odometry", f"{error}")
        return False
    for sentence in filter(None, told):
        heard.tell(sentence)
    return True


def _tags(heard: Heard, told: Any, world: Log) -> dict[str, tuple[float, float, float]]:
    found = {name: tuple(at) for name, at in told.items()}
    for tag, frame in heard.tag_frames.items():
        if tag in found or tag in world.tags:
            continue
        try:
            mount = heard.tree.mount(frame or tag)
            found[tag] = (mount.x, mount.y, mount.z)
        except MessageError as error:
            heard.tell(f"where the tag {tag!r} sits is not known: {error}")
    return found


def _landmark_sensor(heard: Heard, told: Any, world: Log) -> Any:
    if world.landmark_sensor is not None:
        return world.landmark_sensor
    if told is not None or not heard.sight_frame or heard.settings is not None:
        return told
    try:
        x, y, _, heading = heard.tree.mount(heard.sight_frame)
    except MessageError as error:
        logger.warning(f"{heard.path}: landmarks are taken as seen from the body's origin: {error}")
        return None
    return {"pose_in_body": [x, y, heading]}
