# SPDX-License-Identifier: Apache-2.0
"""The world of a robot as it becomes known: from a folder, from topics, from transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from locfuse.io.rosbag.decode import MessageError, Mount, TransformRow
from locfuse.io.rosbag.frames import FrameTree, laser_mount, sensor_pose, two_of_one
from locfuse.types import Columns, FloatArray, GridMap, Log


class World:
    """Anchors, landmarks, tags, mounts and map; what a folder says counts more than a topic.

    `given` is what the folder of the world says, its messages are not used; `base` is the body's
    frame. `log` is all that is known, replaced when that changes; `tree` holds the frames.
    """

    def __init__(self, given: Log, base: str) -> None:
        self._given = given
        self.log = given
        self.tree = FrameTree(base)
        self._of_laser: str | None = None  # frame of the first scan

    def add_transforms(self, rows: list[TransformRow]) -> None:
        """Take static transforms."""
        self.tree.add(rows)

    def add_map(self, grid: GridMap) -> bool:
        """Take a map; return whether it is new."""
        if self._given.grid is not None or _same_map(self.log.grid, grid):
            return False
        self.log = replace(self.log, grid=grid)
        return True

    def add_points(self, table: str, names: list[str], at: FloatArray,
                   radii: FloatArray | None) -> bool:  # fmt: skip
        """Take ``anchors`` or ``landmarks``, shape (n, 3); return whether they are new."""
        if table in self._given or not names:
            return False
        columns: dict[str, np.ndarray] = {table[:-1]: np.array(names)}
        columns |= {"x_m": at[:, 0].copy(), "y_m": at[:, 1].copy(), "z_m": at[:, 2].copy()}
        if table == "landmarks" and radii is not None:
            columns["radius_m"] = radii
        if table in self.log and _same_table(self.log[table], columns):
            return False
        self.log = replace(self.log, tables={**self.log.tables, table: columns})
        return True

    def add_tag(self, tag: str, frame: str) -> bool:
        """Place a tag at its frame, or at the frame of its name; return whether it is new.

        Raises MessageError if nothing says where it sits.
        """
        if tag in self.log.tags:
            return False
        for name in (frame, tag):
            if name and name in self.tree:
                mount = self.tree.mount(name)
                tags = {**self.log.tags, tag: (mount.x, mount.y, mount.z)}
                self.log = replace(self.log, tags=tags)
                return True
        raise MessageError(f"nothing says where on the body tag {tag} sits; give it in 'tags' of "
                           f"the log.yaml of ros.world, or publish the frame "
                           f"{frame or tag} on tf_static")  # fmt: skip

    def laser_mount(self, frame: str, increment: float) -> tuple[Mount, bool]:
        """Return where the laser of a scan sits, and whether head down: as `frames.laser_mount`.

        Raises MessageError where the folder places one laser, and scans of two come.
        """
        self._check_laser(frame)
        return laser_mount(self._given, self.tree, frame, increment)

    def sensor_pose(self, frame: str) -> FloatArray:
        """Return the pose (4, 4) in the body of the sensor of a cloud; errors as `laser_mount`."""
        self._check_laser(frame)
        return sensor_pose(self._given, self.tree, frame)

    def _check_laser(self, frame: str) -> None:
        if self._given.laser is not None:
            self._of_laser = self._of_laser if self._of_laser is not None else frame
            if frame != self._of_laser:
                raise MessageError(two_of_one(self._of_laser, frame))

    def add_landmark_sensor(self, frame: str) -> bool:
        """Take where landmarks are seen from; return whether it is new.

        Raises MessageError if nothing says where it sits.
        """
        if self._given.landmark_sensor is not None or not frame:
            return False
        mount = self.tree.mount(frame)
        sensor = {"pose_in_body": [mount.x, mount.y, mount.heading]}
        if self.log.landmark_sensor == sensor:
            return False
        self.log = replace(self.log, landmark_sensor=sensor)
        return True


def _same_map(one: GridMap | None, other: GridMap) -> bool:
    return (
        one is not None
        and one.resolution_m == other.resolution_m
        and one.origin == other.origin
        and np.array_equal(one.cells, other.cells)
    )


def _same_table(one: Columns, other: Columns) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(one[k], other[k]) for k in other)
