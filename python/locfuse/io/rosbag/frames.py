# SPDX-License-Identifier: Apache-2.0
"""Where sensors sit on the body, as static transforms say."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from locfuse import _core
from locfuse.config.ros import plain
from locfuse.io.rosbag.decode import MessageError, Mount, TransformRow, heading_of
from locfuse.types import FloatArray, Log

MIN_UPRIGHT = 0.94  # cosine of 20 degrees: what is tilted more is no sensor of a plane
SAME_M, SAME_RAD = 1e-3, 1e-3  # up to which two frames of the plane are one


class _Quaternion(NamedTuple):
    x: float
    y: float
    z: float
    w: float


class FrameTree:
    """Static transforms between frames, as they were received.

    `base` is the body's frame.

    Examples
    --------
    >>> tree = FrameTree("base_link")
    >>> tree.add([TransformRow("base_link", "mast", 0.5, 0.0, 1.0, (0.0, 0.0, 0.0, 1.0)),
    ...           TransformRow("mast", "laser", 0.0, 0.0, 0.25, (0.0, 0.0, 0.0, 1.0))])
    >>> tree.mount("laser")
    Mount(x=0.5, y=0.0, z=1.25, heading=0.0)
    """

    def __init__(self, base: str) -> None:
        self.base = plain(base)
        self._rows: dict[str, TransformRow] = {}  # by child

    def add(self, transforms: Iterable[TransformRow]) -> None:
        """Take transforms; the last of a child counts."""
        for row in transforms:
            child = plain(row.child)
            self._rows[child] = row._replace(parent=plain(row.parent), child=child)

    def __contains__(self, frame: str) -> bool:
        """Return whether transforms lead from a frame to the body."""
        return plain(frame) == self.base or self._in_body(plain(frame)) is not None

    def mount(self, frame: str) -> Mount:
        """Return where a frame sits on the body, and where its x axis points in the plane.

        Raises MessageError if no static transforms lead from the frame to the body: names both.
        """
        row = self._rows.get(plain(frame))
        if row is not None and row.parent == self.base:  # as published, to the last bit
            return Mount(row.x, row.y, row.z, heading_of(_Quaternion(*row.quaternion)))
        pose = self.pose(frame)
        heading = float(_core.wrap_angle(math.atan2(pose[1, 0], pose[0, 0])))
        return Mount(float(pose[0, 3]), float(pose[1, 3]), float(pose[2, 3]), heading)

    def upside_down(self, frame: str) -> bool:
        """Return whether a sensor of the plane hangs head down, so that angles count clockwise.

        Raises MessageError as `mount`; or if the sensor does not look into the plane.
        """
        up = float(self.pose(frame)[2, 2])
        if abs(up) < MIN_UPRIGHT:
            tilt = np.degrees(np.arccos(abs(up)))
            raise MessageError(f"{plain(frame)} is tilted by {tilt:.0f} deg against {self.base}; "
                               "expected a sensor that looks into the plane")  # fmt: skip
        return up < 0.0

    def same_body(self, frame: str) -> str:
        """Return a warning about odometry of a frame, nothing where that is the body's.

        Drivers call the body ``base_footprint``, ``base_link``, ``base``: a name that nothing
        places elsewhere is taken for another of the body's. Raises MessageError if static
        transforms place the frame elsewhere on the body.
        """
        if plain(frame) in ("", self.base):
            return ""
        if frame not in self:
            return (f"odometry is of {plain(frame)!r}, which no static transform places on "
                    f"{self.base!r}: they are taken for the same; if they are, set "
                    f"ros.frames.base: {plain(frame)}")  # fmt: skip
        at = self.mount(frame)
        if max(abs(at.x), abs(at.y)) > SAME_M or abs(at.heading) > SAME_RAD:
            raise MessageError(
                f"odometry is of {plain(frame)!r}, which sits at x {at.x:.3g} m, y {at.y:.3g} m, "
                f"{math.degrees(at.heading):.3g} deg on {self.base!r}; set ros.frames.base: "
                f"{plain(frame)}, and give mounts in that frame"
            )
        return ""

    def pose(self, frame: str) -> FloatArray:
        """Return the pose of a frame in the body, shape (4, 4); MessageError as `mount`."""
        found = self._in_body(plain(frame))
        if found is None:
            raise MessageError(
                f"no static transform leads from {plain(frame) or 'a frame without name'} to "
                f"{self.base}; publish it on tf_static, or say in ros.world where the sensor is"
            )
        return found

    def turn(self, frame: str) -> FloatArray | None:
        """Return the axes of a frame in the body, a column each, shape (3, 3).

        None where they are those of the body, or no static transforms lead from the frame to it.
        """
        pose = self._in_body(plain(frame))
        if pose is None or np.array_equal(pose[:3, :3], np.eye(3)):
            return None
        return np.asarray(pose[:3, :3], np.float64)

    def _in_body(self, frame: str) -> FloatArray | None:
        """Return the pose (4, 4) of a frame in the body: up from both to what they share."""
        ours, theirs = self._ancestors(self.base), self._ancestors(frame)
        for shared, pose in theirs.items():
            if shared in ours:
                return np.asarray(np.linalg.solve(ours[shared], pose), np.float64)
        return None

    def _ancestors(self, frame: str) -> dict[str, FloatArray]:
        """Return the pose of a frame in itself, its parent, and so on, nearest first."""
        found = {frame: np.eye(4)}
        pose = found[frame]
        while frame in self._rows:
            row = self._rows[frame]
            frame = row.parent
            if frame in found:
                break  # a loop, which tf refuses as well
            pose = _matrix(row) @ pose
            found[frame] = pose
        return found


def laser_mount(world: Log, tree: FrameTree, frame: str, increment: float) -> tuple[Mount, bool]:
    """Return where the laser of a scan sits, and whether head down.

    What a world says of `frame`, or of its only laser, counts more than transforms. `increment` is
    the angle between two beams, as the scan has it [rad]. Raises MessageError if nothing says where
    it sits, or it does not look into the plane.
    """
    given = world.lasers.get(frame, world.laser)
    if given is not None:
        x, y, heading = map(float, given["pose_in_body"])
        return Mount(x, y, 0.0, heading), float(given["angle_increment_rad"]) * increment < 0.0
    return tree.mount(frame), tree.upside_down(frame)


def sensor_pose(world: Log, tree: FrameTree, frame: str) -> FloatArray:
    """Return the pose (4, 4) in the body of the sensor of a cloud, as `laser_mount`."""
    given = world.lasers.get(frame, world.laser)
    if given is None:
        return tree.pose(frame)
    x, y, heading = map(float, given["pose_in_body"])
    half = 0.5 * heading
    turn = (0.0, 0.0, math.sin(half), math.cos(half))
    return _matrix(TransformRow(tree.base, frame, x, y, 0.0, turn))


def two_of_one(first: str, other: str) -> str:
    """Return why scans of another frame have no place where the world has one laser."""
    return (f"scans come in the frames {first!r} and {other!r}, but the world places one laser; "
            "give each in 'lasers' of its log.yaml")  # fmt: skip


def check_frame(what: str, found: str, expected: str) -> None:
    """Refuse a message in another frame; one that names none is taken at its word.

    Raises MessageError if the names differ by more than a leading slash.

    Examples
    --------
    >>> check_frame("poses", "/map", "map")
    >>> check_frame("poses", "odom", "map")
    Traceback (most recent call last):
    locfuse.io.rosbag.decode.MessageError: poses are in frame 'odom', expected 'map'; see ros.frames
    """
    if found and plain(found) != plain(expected):
        raise MessageError(f"{what} are in frame {plain(found)!r}, expected {plain(expected)!r}; "
                           "see ros.frames")  # fmt: skip


def _matrix(row: TransformRow) -> FloatArray:
    """Return a transform as (4, 4); the quaternion need not have length 1."""
    x, y, z, w = row.quaternion
    n = x * x + y * y + z * z + w * w
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n],
        [2 * (x * y + z * w) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - x * w) / n],
        [2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, 1 - 2 * (x * x + y * y) / n],
    ]
    pose[:3, 3] = row.x, row.y, row.z
    return pose
