# SPDX-License-Identifier: Apache-2.0
"""What each sensor says along a drive: the geometry written out, plus the stated noise.

Every function returns the columns of one table of a log. The random draws depend only on how many
rows there are: the noise of one sensor is the same whatever its sigmas and wherever the robot is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from locfuse.config.scenario import (
    AltitudeSensor,
    Flight,
    HeadingSensor,
    ImuSensor,
    OdometrySensor,
    PoseSensor,
    PositionSensor,
    RangeSensor,
    SightingSensor,
)
from locfuse.io.log_folder import FORCES, GRAVITY_MPS2, RATES
from locfuse.sim.trajectory import Drive, sinc
from locfuse.types import NANOSECONDS, Columns, FloatArray, StampArray, wrap_angle


def stamps(rate_hz: float, duration_s: float) -> StampArray:
    """Return the stamps of a sensor from 0 to the duration, both included.

    The k-th is round(k * 1e9 / rate) nanoseconds.
    """
    ticks = np.arange(int(duration_s * rate_hz) + 2)
    with np.errstate(over="ignore"):  # the one after the last may be beyond all integers
        at_ns = np.rint(ticks * float(NANOSECONDS) / rate_hz)
    return np.asarray(at_ns[at_ns <= round(duration_s * NANOSECONDS)], np.int64)


def seconds(stamp_ns: StampArray) -> FloatArray:
    """Return stamps as seconds, shape as given."""
    return np.asarray(stamp_ns / NANOSECONDS, dtype=np.float64)


def heights(flight: Flight | None, stamp_ns: StampArray) -> FloatArray:
    """Return the heights of the body over z = 0, shape (n,), metres."""
    if flight is None:
        return np.zeros(len(stamp_ns))
    turn = 2.0 * np.pi * seconds(stamp_ns) / flight.period_s
    return np.asarray(flight.height_m + flight.swing_m * np.sin(turn))


def point_in_world(pose: FloatArray, point_in_body: tuple[float, float, float]) -> FloatArray:
    """Return where a point of the body (forward, left, up) is in world, shape (n, 3), metres.

    `pose`, shape (n, 3), is x, y [m] and heading [rad]; the body moves on z = 0.
    """
    forward, left, up = point_in_body
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    return np.column_stack(
        [
            pose[:, 0] + c * forward - s * left,
            pose[:, 1] + s * forward + c * left,
            np.full(len(pose), up),
        ]
    )


def relative_poses(pose: FloatArray) -> FloatArray:
    """Return each pose in the body frame of the one before.

    `pose`, shape (n, 3), is x, y [m] and heading [rad] in world; the result, shape (n - 1, 3), is
    dx, dy [m], dheading [rad in -pi to pi].
    """
    dx, dy = np.diff(pose[:, 0]), np.diff(pose[:, 1])
    c, s = np.cos(pose[:-1, 2]), np.sin(pose[:-1, 2])
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, wrap_angle(np.diff(pose[:, 2]))])


def forward_and_turn(motion: FloatArray) -> FloatArray:
    """Return arc length and turn of motions: rows 1 and 3 of the SE(2) logarithm.

    `motion`, shape (n, 3), is dx, dy [m], dheading [rad]; the result, shape (n, 2), is metres
    forward and radians. The lateral row, which is zero on an arc, is left out.
    """
    half = 0.5 * motion[:, 2]
    forward = np.cos(half) / sinc(half) * motion[:, 0] + half * motion[:, 1]
    return np.column_stack([forward, motion[:, 2]])


def odometry(
    drive: Drive, stamp_ns: StampArray, sensor: OdometrySensor, rng: np.random.Generator
) -> Columns:
    """Return what the wheels say between stamps.

    Over an interval with a chord of d metres and a turn of a radians, in the body frame at its
    beginning, the variances are sigma_longitudinal^2 |d|, sigma_lateral^2 |d| and
    sigma_heading_per_sqrt_m^2 |d| + sigma_heading_per_sqrt_rad^2 |a|: over a distance they add
    up to the same at any rate. A turn bias is added, per second.

    ``increments`` are n rows of dx_m, dy_m, dheading_rad since the row before; the first is zero.
    ``velocities`` are n - 1 rows of v_mps, omega_radps, held until the next stamp; what holds until
    the last stamp is reported by the row before it.
    """
    motion = relative_poses(drive.pose_at(seconds(stamp_ns)))
    distance, turn = np.hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])
    variance = np.column_stack(
        [
            sensor.sigma_longitudinal_per_sqrt_m**2 * distance,
            sensor.sigma_lateral_per_sqrt_m**2 * distance,
            sensor.sigma_heading_per_sqrt_m**2 * distance
            + sensor.sigma_heading_per_sqrt_rad**2 * turn,
        ]
    )
    motion = motion + np.sqrt(variance) * rng.standard_normal(motion.shape)
    motion[:, 2] += sensor.turn_bias_radps * np.diff(seconds(stamp_ns))
    motion[:, 2] = wrap_angle(motion[:, 2])
    if sensor.output == "velocities":
        rate = forward_and_turn(motion) / np.diff(seconds(stamp_ns))[:, None]
        return {"stamp_ns": stamp_ns[:-1], "v_mps": rate[:, 0], "omega_radps": rate[:, 1]}
    motion = np.concatenate([np.zeros((1, 3)), motion])
    return {
        "stamp_ns": stamp_ns,
        "dx_m": motion[:, 0],
        "dy_m": motion[:, 1],
        "dheading_rad": motion[:, 2],
    }


def ranges(
    drive: Drive,
    stamp_ns: StampArray,
    tags: Mapping[str, tuple[float, float, float]],
    anchors: Mapping[str, tuple[float, float, float]],
    sensor: RangeSensor,
    rng: np.random.Generator,
    flight: Flight | None = None,
) -> Columns:
    """Return the distance from every tag to every anchor at each stamp.

    `tags` are (x, y, z) in body, `anchors` in world, metres, by name. n * tags * anchors rows of
    tag, anchor and range_m are by stamp, tag, anchor. A range that noise would take below zero is
    zero.
    """
    pose = drive.pose_at(seconds(stamp_ns))
    tag_at = np.stack([point_in_world(pose, tag) for tag in tags.values()], axis=1)
    tag_at[:, :, 2] += heights(flight, stamp_ns)[:, None]
    anchor_at = np.array(list(anchors.values()), dtype=np.float64)
    distance = np.linalg.norm(tag_at[:, :, None, :] - anchor_at, axis=-1)
    sigma = np.hypot(sensor.sigma_m, sensor.sigma_relative * distance)
    measured = distance + sigma * rng.standard_normal(distance.shape)
    names = np.meshgrid(np.array(list(tags)), np.array(list(anchors)), indexing="ij")
    return {
        "stamp_ns": np.repeat(stamp_ns, len(tags) * len(anchors)),
        "tag": np.tile(names[0].ravel(), len(stamp_ns)),
        "anchor": np.tile(names[1].ravel(), len(stamp_ns)),
        "range_m": np.maximum(measured, 0.0).ravel(),
    }


def poses(
    drive: Drive, stamp_ns: StampArray, sensor: PoseSensor, rng: np.random.Generator
) -> Columns:
    """Return true poses plus white noise, as if another localizer had found them.

    The columns are x_m, y_m, heading_rad, and the sigmas they were drawn with.
    """
    sigma_heading = np.deg2rad(sensor.sigma_heading_deg)
    sigma = np.array([sensor.sigma_xy_m, sensor.sigma_xy_m, sigma_heading])
    pose = drive.pose_at(seconds(stamp_ns))
    pose = pose + sigma * rng.standard_normal(pose.shape)
    return {
        "stamp_ns": stamp_ns,
        "x_m": pose[:, 0],
        "y_m": pose[:, 1],
        "heading_rad": wrap_angle(pose[:, 2]),
        "sigma_xy_m": np.full(len(pose), sensor.sigma_xy_m),
        "sigma_heading_rad": np.full(len(pose), sigma_heading),
    }


def positions(
    drive: Drive,
    stamp_ns: StampArray,
    tags: Mapping[str, tuple[float, float, float]],
    sensor: PositionSensor,
    rng: np.random.Generator,
) -> Columns:
    """Return true positions of the antenna, or of tags, plus white noise, as GPS or an RTLS might.

    `tags` are (x, y, z) in body, metres, by name. n rows of x_m, y_m and sigma_m; with tags of the
    sensor n * tags rows that also have a tag, by stamp, tag.
    """
    pose = drive.pose_at(seconds(stamp_ns))
    antenna = (sensor.antenna_forward_m, sensor.antenna_left_m, 0.0)
    levers = [tags[name] for name in sensor.tags] or [antenna]
    point = np.stack([point_in_world(pose, lever)[:, :2] for lever in levers], axis=1)
    point = point.reshape(-1, 2) + sensor.sigma_xy_m * rng.standard_normal((point.size // 2, 2))
    columns: Columns = {
        "stamp_ns": np.repeat(stamp_ns, len(levers)),
        "x_m": point[:, 0],
        "y_m": point[:, 1],
        "sigma_m": np.full(len(point), sensor.sigma_xy_m),
    }
    if not sensor.tags:
        return columns
    return {**columns, "tag": np.tile(np.array(sensor.tags), len(stamp_ns))}


def sightings(
    drive: Drive,
    stamp_ns: StampArray,
    landmarks: Mapping[str, tuple[float, float]],
    sensor: SightingSensor,
    rng: np.random.Generator,
    flight: Flight | None = None,
    landmark_height_m: float = 0.0,
) -> Columns:
    """Return range, bearing and perhaps elevation of each landmark in view, from the body.

    `landmarks` are (x, y) in world, metres, by name. Rows of landmark (empty if unnamed), range_m,
    bearing_rad and, of a sensor that measures it, elevation_rad are by stamp and landmark. Ranges
    are along the line of sight; one that noise would take below zero is zero.
    """
    pose = drive.pose_at(seconds(stamp_ns))
    forward, left, turn_deg = sensor.pose_in_body
    eye = point_in_world(pose, (forward, left, 0.0))[:, :2]
    at = np.array(list(landmarks.values()), dtype=np.float64)
    off = at - eye[:, None, :]
    level = np.hypot(off[..., 0], off[..., 1])
    rise = (landmark_height_m - sensor.up_m - heights(flight, stamp_ns))[:, None]
    distance = np.hypot(level, rise)
    heading = pose[:, 2] + np.deg2rad(turn_deg)
    bearing = wrap_angle(np.arctan2(off[..., 1], off[..., 0]) - heading[:, None])
    noise = rng.standard_normal((*distance.shape, 2))
    half = 0.5 * np.deg2rad(sensor.field_of_view_deg)
    seen = (distance <= sensor.range_max_m) & (np.abs(bearing) <= half)
    distance = np.maximum(distance + sensor.sigma_range_m * noise[..., 0], 0.0)
    bearing = wrap_angle(bearing + np.deg2rad(sensor.sigma_bearing_deg) * noise[..., 1])
    names = np.array(list(landmarks) if sensor.landmarks == "named" else [""] * len(landmarks))
    row, column = np.nonzero(seen)
    found: Columns = {
        "stamp_ns": stamp_ns[row],
        "landmark": names[column],
        "range_m": distance[row, column],
        "bearing_rad": bearing[row, column],
    }
    if sensor.sigma_elevation_deg is None:
        return found
    error = np.deg2rad(sensor.sigma_elevation_deg) * rng.standard_normal(level.shape)
    elevation = np.clip(np.arctan2(rise, level) + error, -0.5 * np.pi, 0.5 * np.pi)
    return {**found, "elevation_rad": elevation[row, column]}


def altitudes(
    flight: Flight | None, stamp_ns: StampArray, sensor: AltitudeSensor, rng: np.random.Generator
) -> Columns:
    """Return heights of the altimeter plus white noise: n rows of height_m and sigma_m."""
    height = heights(flight, stamp_ns) + sensor.altimeter_up_m
    return {"stamp_ns": stamp_ns,
            "height_m": height + sensor.sigma_m * rng.standard_normal(len(height)),
            "sigma_m": np.full(len(height), sensor.sigma_m)}  # fmt: skip


_COURSE_S = 0.02  # between the two places of an antenna that a course is the direction of
_COURSE_MPS = 0.1  # below which it has none


def headings(
    drive: Drive, stamp_ns: StampArray, sensor: HeadingSensor, antenna: PositionSensor | None,
    rng: np.random.Generator,
) -> Columns:  # fmt: skip
    """Return headings of the body, or courses of the antenna where it moves, plus white noise."""
    t = seconds(stamp_ns)
    true = drive.pose_at(t)[:, 2] + np.deg2rad(sensor.offset_deg)
    is_course = sensor.kind == "course"
    if is_course:
        arm = (antenna.antenna_forward_m, antenna.antenna_left_m) if antenna else (0.0, 0.0)
        ahead, behind = (
            point_in_world(drive.pose_at(np.maximum(t + k * _COURSE_S, t[0])), (*arm, 0.0))[:, :2]
            for k in (0.5, -0.5)
        )
        way = ahead - behind
        moves = np.hypot(way[:, 0], way[:, 1]) > _COURSE_S * _COURSE_MPS
        stamp_ns, true = stamp_ns[moves], np.arctan2(way[moves, 1], way[moves, 0])
    sigma = np.deg2rad(sensor.sigma_deg)
    table: Columns = {
        "stamp_ns": stamp_ns,
        "heading_rad": wrap_angle(true + sigma * rng.standard_normal(len(true))),
        "sigma_rad": np.full(len(true), sigma),
    }
    return {**table, "is_course": np.ones(len(true))} if is_course else table


def imu(
    drive: Drive,
    stamp_ns: StampArray,
    sensor: ImuSensor,
    rng: np.random.Generator,
    flight: Flight | None = None,
) -> Columns:
    """Return rates and forces in the axes of the sensor, from the poses half a sample around.

    A body that flies stays level.
    """
    step = 1.0 / sensor.rate_hz
    t = seconds(stamp_ns)
    ahead, here, behind = (drive.pose_at(np.maximum(t + k * step, t[0])) for k in (0.5, 0.0, -0.5))
    span = t + 0.5 * step - np.maximum(t - 0.5 * step, t[0])
    rate, force = np.zeros((2, len(t), 3))
    rate[:, 2] = (1.0 + sensor.scale) * wrap_angle(ahead[:, 2] - behind[:, 2]) / span
    acceleration = (ahead + behind - 2.0 * here)[:, :2] / (0.5 * step) ** 2
    acceleration[t < 0.5 * step] = 0.0
    c, s = np.cos(here[:, 2]), np.sin(here[:, 2])
    force[:, 0] = c * acceleration[:, 0] + s * acceleration[:, 1]
    force[:, 1] = c * acceleration[:, 1] - s * acceleration[:, 0]
    force[:, 2] = GRAVITY_MPS2
    if flight is not None:
        turns_per_s = 2.0 * np.pi / flight.period_s
        force[:, 2] -= turns_per_s**2 * (heights(flight, stamp_ns) - flight.height_m)
    walk = sensor.bias_walk_radps_per_sqrt_s * np.sqrt(step) * rng.standard_normal(rate.shape)
    white = sensor.sigma_rate_radps_per_sqrt_hz * np.sqrt(sensor.rate_hz)
    rate = rate @ _turned(sensor.mount_deg) + sensor.bias_radps + np.cumsum(walk, axis=0)
    rate += white * rng.standard_normal(rate.shape)
    force = force @ _turned(sensor.mount_deg)
    force += sensor.sigma_force_mps2 * rng.standard_normal(force.shape)
    return {"stamp_ns": stamp_ns, **dict(zip(RATES, rate.T.copy(), strict=True)),
            **dict(zip(FORCES, force.T.copy(), strict=True))}  # fmt: skip


def _turned(mount_deg: tuple[float, float, float]) -> FloatArray:
    """Return the axes of a sensor in body, a column each, by roll, pitch and yaw [deg]."""
    (cr, cp, cy), (sr, sp, sy) = (f(np.deg2rad(mount_deg)) for f in (np.cos, np.sin))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def truth(drive: Drive, stamp_ns: StampArray, flight: Flight | None = None) -> Columns:
    """Return the true poses: n rows of x_m, y_m, of a flight z_m, and heading_rad."""
    pose = drive.pose_at(seconds(stamp_ns))
    z = {} if flight is None else {"z_m": heights(flight, stamp_ns)}
    return {"stamp_ns": stamp_ns, "x_m": pose[:, 0], "y_m": pose[:, 1], **z,
            "heading_rad": pose[:, 2]}  # fmt: skip
