# SPDX-License-Identifier: Apache-2.0
"""What is published, as the fields of standard messages: plain dicts that fit either ROS.

The keys are the names of the fields, nested as they are; what a message has besides keeps its
default. A stamp is ``{"ns": nanoseconds}``, which those who fill a message turn into the time of
their ROS; a ``level`` of diagnostics is an int, where ROS 2 wants a byte. Long arrays are numpy's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from locfuse import _core
from locfuse.io.rosbag import decode
from locfuse.types import FloatArray, GridMap, MappedLandmarks

Fields: TypeAlias = dict[str, Any]

# Variances of z, roll and pitch of a pose in the plane: held to be known, as AMCL writes them.
KNOWN = 0.0
RINGS = 4  # last bits by which a quaternion is moved at most
OK, WARN, ERROR, STALE = 0, 1, 2, 3  # levels of diagnostic_msgs
LEVELS: Mapping[str, int] = {"ok": OK, "degraded": WARN, "dead_reckoning": WARN,
                             "initializing": WARN, "ambiguous": WARN, "lost": ERROR}  # fmt: skip


@dataclass(frozen=True)
class Publication:
    """What to publish where.

    `type` is as ``geometry_msgs/PoseWithCovarianceStamped``, in either ROS. If `latched`, who
    subscribes later wants it, too: ``transient_local`` in ROS 2.
    """

    topic: str
    type: str
    fields: Fields
    latched: bool = False


def quaternion(heading: float) -> Fields:
    """Return a turn in the plane; `decode.heading_of` gives the same heading bit for bit.

    Half an angle, its sine and cosine and back may miss the last bit: then the quaternion is
    moved by as much.

    Examples
    --------
    >>> quaternion(0.0)
    {'x': 0.0, 'y': 0.0, 'z': 0.0, 'w': 1.0}
    """
    z, w = math.sin(0.5 * heading), math.cos(0.5 * heading)
    target = float(_core.wrap_angle(heading))
    for z_again, w_again in _around(z, w):
        if _core.wrap_angle(2.0 * math.atan2(z_again, w_again)) == target:
            z, w = z_again, w_again
            break
    return {"x": 0.0, "y": 0.0, "z": z, "w": w}


def _around(z: float, w: float) -> Iterable[tuple[float, float]]:
    """Yield a sine and cosine and those a few last bits beside them, the nearest first."""
    yield z, w
    up_z = down_z = z
    up_w = down_w = w
    for _ in range(RINGS):
        up_z, down_z = math.nextafter(up_z, 2.0), math.nextafter(down_z, -2.0)
        up_w, down_w = math.nextafter(up_w, 2.0), math.nextafter(down_w, -2.0)
        yield from ((up_z, w), (down_z, w), (z, up_w), (z, down_w), (up_z, up_w), (up_z, down_w),
                    (down_z, up_w), (down_z, down_w))  # fmt: skip


def header(stamp_ns: int, frame: str) -> Fields:
    """Return a std_msgs/Header."""
    return {"stamp": {"ns": int(stamp_ns)}, "frame_id": frame}


def _point(x: float, y: float, z: float = 0.0) -> Fields:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _pose(x: float, y: float, heading: float, z: float = 0.0) -> Fields:
    return {"position": _point(x, y, z), "orientation": quaternion(heading)}


def planar_covariance(covariance: ArrayLike) -> FloatArray:
    """Return the covariance (36,) of a ROS pose of that of (x, y, heading), shape (3, 3)."""
    full = np.zeros((6, 6))
    full[np.ix_((0, 1, 5), (0, 1, 5))] = covariance
    full[[2, 3, 4], [2, 3, 4]] = KNOWN
    return full.ravel()


def pose_with_covariance(
    topic: str,
    stamp_ns: int,
    pose: Sequence[float],
    covariance: ArrayLike,
    frame: str,
    latched: bool = False,
    height: tuple[float, float] | None = None,
    attitude: tuple[FloatArray, FloatArray] | None = None,
) -> Publication:
    """Return a geometry_msgs/PoseWithCovarianceStamped.

    `pose` is (x, y, heading) in `frame`, metres and radians; `covariance` has shape (3, 3). It is
    `latched` as the start of an AMCL. `height` is z [m] and its variance, 0 in the plane;
    `attitude` the unit quaternion (w, x, y, z), and the covariance (3, 3) of its error, about the
    axes of `frame` [rad^2], of a body that is not level.

    Examples
    --------
    >>> given = pose_with_covariance("pose", 5, (1.0, 2.0, 0.0), np.eye(3), "map")
    >>> given.fields["pose"]["pose"]["position"], given.fields["pose"]["covariance"][35]
    ({'x': 1.0, 'y': 2.0, 'z': 0.0}, np.float64(1.0))
    """
    full = planar_covariance(covariance)
    if height is not None:
        full[14] = height[1]
    at = _pose(pose[0], pose[1], pose[2], 0.0 if height is None else height[0])
    if attitude is not None:
        at["orientation"] = dict(zip("wxyz", map(float, attitude[0]), strict=True))
        full.reshape(6, 6)[3:, 3:] = attitude[1]
    fields = {"header": header(stamp_ns, frame), "pose": {"pose": at, "covariance": full}}
    return Publication(topic, "geometry_msgs/PoseWithCovarianceStamped", fields, latched)


def path(
    topic: str, frame: str, stamps_ns: Iterable[int], poses: Iterable[Sequence[float]]
) -> Publication:
    """Return a nav_msgs/Path of poses (x, y, heading), stamped as its last one."""
    given = [{"header": header(stamp, frame), "pose": _pose(*pose)}
            for stamp, pose in zip(stamps_ns, poses, strict=True)]  # fmt: skip
    last = given[-1]["header"]["stamp"]["ns"] if given else 0
    return Publication(topic, "nav_msgs/Path", {"header": header(last, frame), "poses": given})


def transform(
    stamp_ns: int, parent: str, child: str, pose: Sequence[float], z: float = 0.0
) -> Fields:
    """Return a geometry_msgs/TransformStamped: the pose (x, y, heading) of `child` in `parent`."""
    x, y, heading = pose
    moved = {"translation": _point(x, y, z), "rotation": quaternion(heading)}
    return {"header": header(stamp_ns, parent), "child_frame_id": child, "transform": moved}


def transforms(several: Sequence[Fields], static: bool = False) -> Publication:
    """Return transforms on ``tf``, or on ``tf_static``, which is latched."""
    fields = {"transforms": list(several)}
    return Publication("tf_static" if static else "tf", "tf2_msgs/TFMessage", fields, static)


def map_to_odom(in_map: Sequence[float], in_odom: Sequence[float]) -> tuple[float, float, float]:
    """Return the pose (x, y, heading) of odom in map from those of one body at one stamp.

    Examples
    --------
    >>> map_to_odom((3.0, 4.0, 0.0), (1.0, 1.0, 0.0))
    (2.0, 3.0, 0.0)
    """
    found = _core.Pose2(*map(float, in_map)) * _core.Pose2(*map(float, in_odom)).inverse()
    return found.x, found.y, found.heading


def diagnostic_status(name: str, level: int, message: str, values: Mapping[str, object]) -> Fields:
    """Return a diagnostic_msgs/DiagnosticStatus."""
    given = [{"key": key, "value": _text(value)} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": "",
            "values": given}  # fmt: skip


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def health_status(
    state: str,
    reason: str,
    within: float,
    wrong: float,
    protection: Sequence[float],
    of: str = "localization",
) -> Fields:
    """Return the status of a health report, `of` the localization or of watched poses.

    `state` is ``ok``, ``degraded``, ``dead_reckoning``, ``lost`` and so on; `reason` says in words
    why it is not ``ok``. `within` and `wrong` are probabilities that the position error is below
    the limit and that the robot is elsewhere; `protection` levels are (x_m, y_m, heading_rad).
    """
    x, y, heading = map(float, protection)
    values = {"state": state, "within": float(within), "wrong": float(wrong), "protection_x_m": x,
              "protection_y_m": y, "protection_heading_rad": heading}  # fmt: skip
    return diagnostic_status(f"locfuse: {of}", LEVELS.get(state, WARN), reason or state,
                             values)  # fmt: skip


def diagnostics(stamp_ns: int, statuses: Sequence[Fields]) -> Publication:
    """Return a diagnostic_msgs/DiagnosticArray."""
    fields = {"header": header(stamp_ns, ""), "status": list(statuses)}
    return Publication("diagnostics", "diagnostic_msgs/DiagnosticArray", fields)


def named_points(
    topic: str,
    names: Sequence[str],
    at: FloatArray,
    radii: FloatArray | None,
    frame: str,
    stamp_ns: int = 0,
) -> Publication:
    """Return a locfuse_msgs/NamedPoints, latched, of points (n, 3) and perhaps radii (n,)."""
    fields = {"header": header(stamp_ns, frame), "names": [str(name) for name in names],
              "points": [_point(*row) for row in np.asarray(at).tolist()],
              "radii": np.zeros(0) if radii is None else np.asarray(radii, np.float64)}  # fmt: skip
    return Publication(topic, "locfuse_msgs/NamedPoints", fields, latched=True)


def mapped_landmarks(
    topic: str, landmarks: MappedLandmarks, frame: str, stamp_ns: int
) -> Publication:
    """Return a locfuse_msgs/NamedPoints, latched, of landmarks that were mapped; z is 0."""
    at = np.column_stack([landmarks.position, np.zeros(len(landmarks))])
    return named_points(topic, landmarks.name.tolist(), at, None, frame, stamp_ns)


def occupancy_grid(topic: str, grid: GridMap, frame: str, stamp_ns: int = 0) -> Publication:
    """Return a nav_msgs/OccupancyGrid, latched."""
    height, width = grid.cells.shape
    x, y, yaw = grid.origin
    info = {"map_load_time": {"ns": int(stamp_ns)}, "resolution": float(grid.resolution_m),
            "width": width, "height": height, "origin": _pose(x, y, yaw)}  # fmt: skip
    fields = {"header": header(stamp_ns, frame), "info": info, "data": grid.cells.ravel()}
    return Publication(topic, "nav_msgs/OccupancyGrid", fields, latched=True)


def odometry(
    topic: str,
    stamp_ns: int,
    pose: Sequence[float],
    velocity: Sequence[float],
    frame: str,
    child_frame: str,
    z: float = 0.0,
) -> Publication:
    """Return a nav_msgs/Odometry of a pose (x, y, heading) and a velocity (v, omega[, left])."""
    (x, y, heading), (v, omega, *left) = pose, velocity
    twist = {"linear": _point(v, *(left or [0.0])), "angular": _point(0.0, 0.0, omega)}
    fields = {"header": header(stamp_ns, frame), "child_frame_id": child_frame,
              "pose": {"pose": _pose(x, y, heading, z)}, "twist": {"twist": twist}}  # fmt: skip
    return Publication(topic, "nav_msgs/Odometry", fields)


def imu(topic: str, row: decode.ImuRow, frame: str) -> Publication:
    """Return a sensor_msgs/Imu without orientation; covariances are not known."""
    return _imu(topic, row.stamp_ns, frame, rate=row.rate, force=row.force)


def heading(topic: str, stamp_ns: int, angle: float, sigma: float, frame: str) -> Publication:
    """Return a sensor_msgs/Imu with nothing but a yaw; without a sigma its variance is 0."""
    return _imu(topic, stamp_ns, frame, yaw=(angle, 0.0 if math.isnan(sigma) else sigma * sigma))


def _imu(
    topic: str,
    stamp_ns: int,
    frame: str,
    yaw: tuple[float, float] | None = None,
    rate: Sequence[float] | None = None,
    force: Sequence[float] | None = None,
) -> Publication:
    """Return a sensor_msgs/Imu; what there is not, of yaw with its variance, is marked so."""
    unknown, none = np.concatenate([[-1.0], np.zeros(8)]), (0.0, 0.0, 0.0)
    turned = unknown if yaw is None else np.diag([0.0, 0.0, yaw[1]]).ravel()
    fields = {"header": header(stamp_ns, frame), "orientation": quaternion(yaw[0] if yaw else 0.0),
              "orientation_covariance": turned, "angular_velocity": _point(*(rate or none)),
              "angular_velocity_covariance": np.zeros(9) if rate else unknown,
              "linear_acceleration": _point(*(force or none)),
              "linear_acceleration_covariance": np.zeros(9) if force else unknown}  # fmt: skip
    return Publication(topic, "sensor_msgs/Imu", fields)


def truth(topic: str, row: decode.TruthRow, child_frame: str) -> Publication:
    """Return a nav_msgs/Odometry of a reference; without a heading a geometry_msgs/PointStamped."""
    if math.isnan(row.heading):
        fields = {"header": header(row.stamp_ns, row.frame), "point": _point(row.x, row.y, row.z)}
        return Publication(topic, "geometry_msgs/PointStamped", fields)
    return odometry(topic, row.stamp_ns, (row.x, row.y, row.heading), (0.0, 0.0), row.frame,
                    child_frame, row.z)  # fmt: skip


def laser_scan(topic: str, row: decode.ScanRow) -> Publication:
    """Return a sensor_msgs/LaserScan; no return is infinity, an unknown intensity NaN."""
    ranges: NDArray[np.float32] = row.ranges.astype(np.float32)
    ranges[np.isnan(ranges)] = np.inf
    bright = np.zeros(0) if row.intensities is None else row.intensities
    last = row.angle_min + row.angle_increment * (len(ranges) - 1)
    each = row.time_increment if row.time_increment * len(ranges) <= decode.MAX_SWEEP_S else 0.0
    first_ns = row.stamp_ns - decode.half_sweep_ns(len(ranges), each)
    fields = {"header": header(first_ns, row.frame), "angle_min": row.angle_min,
              "time_increment": each, "angle_max": last,
              "angle_increment": row.angle_increment, "range_min": row.range_min,
              "range_max": row.range_max, "ranges": ranges,
              "intensities": bright.astype(np.float32)}  # fmt: skip
    return Publication(topic, "sensor_msgs/LaserScan", fields)


def uwb_ranges(topic: str, rows: Sequence[decode.RangeRow]) -> Publication:
    """Return a locfuse_msgs/UwbRanges, stamped as its last range."""
    given = [{"header": header(row.stamp_ns, row.frame), "tag": row.tag, "anchor": row.anchor,
             "range": row.range_m, "sigma": row.sigma_m or 0.0} for row in rows]  # fmt: skip
    head = given[-1]["header"] if given else header(0, "")
    return Publication(topic, "locfuse_msgs/UwbRanges", {"header": head, "ranges": given})


def landmark_sightings(topic: str, rows: Sequence[decode.SightingRow]) -> Publication:
    """Return a locfuse_msgs/LandmarkSightings, stamped as its last sighting."""
    given = [{"header": header(row.stamp_ns, row.frame), "landmark": row.landmark,
             "range": row.range_m, "bearing": row.bearing_rad,
             "sigma_range": row.sigma_range_m or 0.0,
             "sigma_bearing": row.sigma_bearing_rad or 0.0,
             "has_elevation": row.elevation_rad is not None, "elevation": row.elevation_rad or 0.0,
             "sigma_elevation": row.sigma_elevation_rad or 0.0} for row in rows]  # fmt: skip
    head = given[-1]["header"] if given else header(0, "")
    return Publication(
        topic, "locfuse_msgs/LandmarkSightings", {"header": head, "sightings": given}
    )


def altitude(topic: str, stamp_ns: int, z: float, sigma: float | None, frame: str) -> Publication:
    """Return a geometry_msgs/PointStamped, with a sigma a PoseWithCovarianceStamped: z alone."""
    if sigma is None:
        fields = {"header": header(stamp_ns, frame), "point": _point(0.0, 0.0, z)}
        return Publication(topic, "geometry_msgs/PointStamped", fields)
    unknown = decode.NOT_MEASURED_M**2 * np.eye(3)
    return pose_with_covariance(topic, stamp_ns, (0.0, 0.0, 0.0), unknown, frame,
                                height=(z, sigma * sigma))  # fmt: skip


def course(topic: str, stamp_ns: int, angle: float, sigma: float, frame: str) -> Publication:
    """Return a geometry_msgs/TwistWithCovarianceStamped of 1 m/s in that direction.

    Without a sigma its covariance is marked as not known.
    """
    variance = -1.0 if math.isnan(sigma) else sigma * sigma
    linear = _point(math.cos(angle), math.sin(angle))
    twist = {"linear": linear, "angular": _point(0.0, 0.0)}
    covariance = np.diag([variance, variance, *[0.0] * 4]).ravel()
    fields = {
        "header": header(stamp_ns, frame),
        "twist": {"twist": twist, "covariance": covariance},
    }
    return Publication(topic, "geometry_msgs/TwistWithCovarianceStamped", fields)


def tag_position(topic: str, row: decode.FixRow) -> Publication:
    """Return a locfuse_msgs/TagPosition."""
    fields = {"header": header(row.stamp_ns, row.frame), "tag": row.tag,
              "position": _point(row.x, row.y), "sigma": row.sigma_m}  # fmt: skip
    return Publication(topic, "locfuse_msgs/TagPosition", fields)


def text(topic: str, given: str) -> Publication:
    """Return a std_msgs/String, latched."""
    return Publication(topic, "std_msgs/String", {"data": given}, latched=True)
