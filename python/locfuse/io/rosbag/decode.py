# SPDX-License-Identifier: Apache-2.0
"""What a ROS message says, in our units: rows of numbers and names.

A message is anything with the fields of the standard one, so that those of ROS 1 (``rospy``), of
ROS 2 (``rclpy``) and of bags (``rosbags``) all do; types are never looked at. Stamps are
nanoseconds, lengths metres, angles radians in [-pi, pi), names of frames without leading slash.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import lru_cache, partial, wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.ros import plain
from locfuse.io.geodesy import Origin, to_plane
from locfuse.types import (
    FARTHEST_M,
    FREE,
    NANOSECONDS,
    OCCUPIED,
    RESOLUTIONS_M,
    UNKNOWN,
    FloatArray,
    GridMap,
)

# Which elements of a ROS covariance (6, 6) are those of (x, y, heading).
PLANAR = np.ix_((0, 1, 5), (0, 1, 5))
# Probabilities in percent at which map_server takes a cell for free and for occupied.
FREE_UP_TO, OCCUPIED_FROM = 19, 66
FLOAT_MAX = float(np.finfo(np.float64).max)
UNIT_M = {"m": 1.0, "mm": 1e-3}
MAX_SWEEP_S = 1.0  # of one turn of a laser
NO_LIMIT_M = 1e4  # the range_max of a laser that states an infinite one: no laser sees as far
JUST_BELOW = 0.998  # of range_max, from where drivers mean no return
SHARED = 8  # beams of one reading, from which on it may be a counter that ended
GAP = 0.5  # of that reading, which nothing else may exceed
MIN_LENGTH = 1e-12  # squared, of a quaternion that was set
NOT_MEASURED_M = 1e6  # a sigma of infinity, as a log can have it
NOT_MEASURED_RAD = 10.0
SIGMA_GROUND_MPS = 0.1  # of a velocity over ground that comes without a sigma
MIN_COURSE_SIGMAS = 3.0  # below which a velocity has no direction


P = ParamSpec("P")
Row = TypeVar("Row")


class MessageError(ValueError):
    """A message cannot mean anything; the text says what is wrong with which field."""


def is_message(expected: str) -> Callable[[Callable[P, Row]], Callable[P, Row]]:
    """Have a function say that its message is no such one, where a field is missing or another."""

    def of(read: Callable[P, Row]) -> Callable[P, Row]:
        @wraps(read)
        def checked(*args: P.args, **kwargs: P.kwargs) -> Row:
            try:
                return read(*args, **kwargs)
            except MessageError:
                raise
            except (AttributeError, TypeError, ValueError, OverflowError) as error:
                raise MessageError(f"the message is no {expected} ({error})") from None

        return checked

    return of


class OdometryRow(NamedTuple):
    """Where wheels say the body is, in a frame that drifts, and how fast it is there."""

    stamp_ns: int
    x: float
    y: float
    heading: float
    v: float
    omega: float
    frame: str
    child_frame: str
    z: float = 0.0
    left: float = 0.0


class ImuRow(NamedTuple):
    """Three rates of a gyro [rad/s] and, where there is one, forces of an accelerometer [m/s^2]."""

    stamp_ns: int
    rate: tuple[float, ...]
    force: tuple[float, ...] | None


class Mount(NamedTuple):
    """Pose of a frame in the body: metres and radians."""

    x: float
    y: float
    z: float
    heading: float


class ScanRow(NamedTuple):
    """A turn of a laser: `ranges` [m] and `intensities`, float64 (beams,), NaN for no return.

    `stamp_ns` is that of the middle beam; `saturated` [m] is a reading that many beams share, taken
    for no return, where there is one; `time_increment` [s] is from one beam to the next. `mount`
    is where the beams begin in the body, where that is not the frame, but upright.
    """

    stamp_ns: int
    frame: str
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: FloatArray
    intensities: FloatArray | None
    saturated: float | None = None
    time_increment: float = 0.0
    mount: Mount | None = None


def half_sweep_ns(beams: int, time_increment: float) -> int:
    """Return the time from the first beam of a scan, the stamp of its message, to its middle."""
    return round(0.5 * (beams - 1) * time_increment * NANOSECONDS)


class RangeRow(NamedTuple):
    """A distance between a tag and an anchor; `sigma_m` is None where it is not known."""

    stamp_ns: int
    tag: str
    anchor: str
    range_m: float
    sigma_m: float | None
    frame: str


class PoseRow(NamedTuple):
    """A pose of another localizer; `covariance` is (3, 3), of x, y and heading."""

    stamp_ns: int
    frame: str
    x: float
    y: float
    heading: float
    covariance: FloatArray


class TruthRow(NamedTuple):
    """Where the body was, as a reference says; `heading` is NaN where it does not say."""

    stamp_ns: int
    x: float
    y: float
    z: float
    heading: float
    frame: str


class FixRow(NamedTuple):
    """A position of a tag or, with an empty `tag`, the antenna; `sigma_m` -1 where not known."""

    stamp_ns: int
    x: float
    y: float
    sigma_m: float
    tag: str
    frame: str


class SightingRow(NamedTuple):
    """A landmark seen from `frame`; sigmas are None where they are not known."""

    stamp_ns: int
    landmark: str
    range_m: float
    bearing_rad: float
    sigma_range_m: float | None
    sigma_bearing_rad: float | None
    frame: str
    elevation_rad: float | None = None  # None where it is not measured
    sigma_elevation_rad: float | None = None


class AltitudeRow(NamedTuple):
    """Height of an altimeter; `sigma_m` is None where not known; a range down has no `frame`."""

    stamp_ns: int
    height_m: float
    sigma_m: float | None
    frame: str


class HeadingRow(NamedTuple):
    """Heading of the body, or course; `sigma_rad` is None where not known."""

    stamp_ns: int
    heading_rad: float
    sigma_rad: float | None
    is_course: bool


class TransformRow(NamedTuple):
    """Pose of the frame `child` in `parent`; `quaternion` is (x, y, z, w)."""

    parent: str
    child: str
    x: float
    y: float
    z: float
    quaternion: tuple[float, float, float, float]


def stamp_ns(stamp: Any) -> int:
    """Return a stamp of ROS 1 (``secs``, ``nsecs``) or ROS 2 (``sec``, ``nanosec``) [ns]; 0 is 0.

    Raises MessageError if it has neither, or its nanoseconds are no part of a second.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> stamp_ns(Message(sec=3, nanosec=5)), stamp_ns(Message(secs=3, nsecs=5))
    (3000000005, 3000000005)
    """
    try:
        seconds, rest = stamp.sec, stamp.nanosec
    except AttributeError:
        try:
            seconds, rest = stamp.secs, stamp.nsecs
        except AttributeError:
            raise MessageError(f"the stamp {stamp!r} has no seconds and nanoseconds") from None
    if not 0 <= rest < NANOSECONDS:
        raise MessageError(f"the stamp has {rest} nanoseconds, expected 0 to 999999999")
    return int(seconds) * NANOSECONDS + int(rest)


@is_message("nav_msgs/Odometry")
def odometry(message: Any, use: str = "pose") -> OdometryRow:
    """Return what a nav_msgs/Odometry says.

    `use` is ``pose`` or ``twist``: the half that is checked; of the other NaN may come. Raises
    MessageError if it is no Odometry, its stamp is 0, or a number that is used is not finite.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> at = Message(position=Message(x=1.0, y=2.0, z=0.0),
    ...              orientation=Message(x=0.0, y=0.0, z=1.0, w=1.0))
    >>> moving = Message(linear=Message(x=0.5, y=0.0, z=0.0), angular=Message(x=0, y=0, z=0.25))
    >>> row = odometry(Message(header=Message(stamp=Message(sec=1, nanosec=0), frame_id="/odom"),
    ...     child_frame_id="base_link", pose=Message(pose=at), twist=Message(twist=moving)))
    >>> row.x, row.y, round(row.heading, 3), row.v, row.omega, row.frame
    (1.0, 2.0, 1.571, 0.5, 0.25, 'odom')
    """
    header, child = message.header, message.child_frame_id
    pose, twist = message.pose.pose, message.twist.twist
    at, v, omega = pose.position, float(twist.linear.x), float(twist.angular.z)
    left = float(twist.linear.y)  # NaN where a driver does not measure it
    left = left if math.isfinite(left) else 0.0
    x, y, z = float(at.x), float(at.y), float(at.z)
    stamp = stamped(header)
    if use == "pose":
        _finite((x, "pose.position.x"), (y, "pose.position.y"))
        heading = heading_of(pose.orientation)
    else:
        _finite((v, "twist.linear.x"), (omega, "twist.angular.z"))
        heading = math.nan
    return OdometryRow(stamp, x, y, heading, v, omega, plain(header.frame_id), plain(child), z,
                       left)  # fmt: skip


@is_message("sensor_msgs/Imu")
def imu(message: Any) -> ImuRow:
    """Return what a sensor_msgs/Imu says; a covariance of -1 first marks what is not measured.

    Raises MessageError if it is no Imu, its stamp is 0, it has no gyro, or a number is not finite.
    """
    rate, force = (tuple(float(getattr(vector, axis)) for axis in "xyz")
                   for vector in (message.angular_velocity, message.linear_acceleration)
                   )  # fmt: skip
    stamp = stamped(message.header)
    if float(message.angular_velocity_covariance[0]) == -1.0:
        raise MessageError("angular_velocity is marked as not measured (covariance -1)")
    _finite(*((value, f"angular_velocity.{axis}") for value, axis in zip(rate, "xyz", strict=True)))
    known = float(message.linear_acceleration_covariance[0]) != -1.0
    known = known and all(map(math.isfinite, force))
    return ImuRow(stamp, rate, force if known else None)


def heading_of(quaternion: Any) -> float:
    """Return where the x axis of a body points that a quaternion turns, in the plane [rad].

    Its length does not matter. Without roll and pitch this undoes `encode.quaternion` bit for bit.
    Raises MessageError if it has no length, as one that was never set, or is not finite.
    """
    x, y, z, w = (float(quaternion.x), float(quaternion.y), float(quaternion.z),
                  float(quaternion.w))  # fmt: skip
    length = x * x + y * y + z * z + w * w
    if not MIN_LENGTH < length < math.inf:
        raise MessageError(f"the orientation ({x:g}, {y:g}, {z:g}, {w:g}) is no rotation; "
                           "expected a quaternion of length 1")  # fmt: skip
    if x == 0.0 and y == 0.0:
        return float(_core.wrap_angle(2.0 * math.atan2(z, w)))
    return float(_core.wrap_angle(math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)))


@is_message("sensor_msgs/LaserScan")
def scan(message: Any) -> ScanRow:
    """Return what a sensor_msgs/LaserScan says.

    No returns are readings up to range_min, and from range_max on or just below; what is not
    finite; and the highest reading of a scan where many beams share it, far from all others: a
    counter that ended. A range_max that is infinite is no limit. A float32 stands for the shortest
    decimal that it is nearest to: of a laser that counts millimetres come millimetres. A
    time_increment by which a turn would take longer than a second is none.

    Raises MessageError if it is no LaserScan, its stamp is 0, it has no beam, or its geometry is
    none.
    """
    header = message.header
    given = np.asarray(message.ranges, np.float32)
    bright = np.asarray(message.intensities, np.float32)
    geometry = tuple(decimal(getattr(message, key)) for key in
                     ("angle_min", "angle_increment", "range_min", "range_max"))  # fmt: skip
    stamp = stamped(header)
    start, increment, nearest, farthest = geometry
    _finite((start, "angle_min"), (increment, "angle_increment"))
    if len(given) == 0:
        raise MessageError("the scan has no beam")
    if increment == 0.0:
        raise MessageError("angle_increment is 0, expected the angle between two beams")
    if not 0.0 <= nearest < farthest or math.isinf(nearest):
        raise MessageError(f"range_min and range_max are {nearest:g} and {farthest:g}, expected "
                           "0 <= range_min < range_max")  # fmt: skip
    farthest = min(farthest, max(NO_LIMIT_M, 2.0 * nearest))
    if len(bright) not in (0, len(given)):
        raise MessageError(f"the scan has {len(given)} ranges and {len(bright)} intensities; "
                           "expected as many, or none")  # fmt: skip
    ranges = within(decimals(given), math.nextafter(nearest, math.inf), JUST_BELOW * farthest)
    saturated = _saturated(ranges)
    if saturated is not None:
        ranges[ranges == saturated] = math.nan
    intensities = within(bright.astype(np.float64), 0.0, FLOAT_MAX) if len(bright) else None
    each = decimal(getattr(message, "time_increment", 0.0))
    if not 0.0 <= each * len(ranges) <= MAX_SWEEP_S:
        each = 0.0
    return ScanRow(stamp + half_sweep_ns(len(ranges), each), plain(header.frame_id), start,
                   increment, nearest, farthest, ranges, intensities, saturated, each)  # fmt: skip


def _saturated(ranges: FloatArray) -> float | None:
    """Return the highest reading where it is what a driver writes for no return.

    Returns of one surface differ by a beam's noise, and those of a room fill the way up to the
    farthest; a counter that ended repeats its last number, with a gap below.
    """
    there = ranges[np.isfinite(ranges)]
    if len(there) < SHARED:
        return None
    highest = there.max()
    others = there[there < highest]
    if len(there) - len(others) < SHARED or not len(others):
        return None
    return float(highest) if others.max() < GAP * highest else None


def saturated_readings(found: Iterable[float]) -> str:
    """Return a sentence on readings that were taken for no return."""
    readings = " and ".join(f"{reading:g} m" for reading in sorted(found))
    return f"many beams of a scan read exactly {readings}, far from all others: no return"


def within(values: FloatArray, low: float, high: float) -> FloatArray:
    """Return the array itself, NaN now where it was not in [low, high]."""
    with np.errstate(invalid="ignore"):
        values[~((values >= low) & (values <= high))] = math.nan
    return values


@lru_cache(4096)  # each scan repeats its geometry
def decimal(value: float | np.float32) -> float:
    """Return the shortest decimal that is nearest to a float32: 0.1 for 0.10000000149."""
    single = np.float32(value)
    return float(str(single)) if np.isfinite(single) else float(single)


def decimals(values: NDArray[np.float32]) -> FloatArray:
    """Return float32 (n,) as float64, at the shortest decimal of 3 to 6 places, if one is it."""
    wide = values.astype(np.float64)
    found = wide.copy()
    left = np.isfinite(values)
    for scale in (1e3, 1e4, 1e5, 1e6):
        if not left.any():
            break
        rounded = np.rint(wide * scale) / scale
        hit = left & (rounded.astype(np.float32) == values)
        found[hit] = rounded[hit]
        left &= ~hit
    return found


@is_message("locfuse_msgs/UwbRanges, UwbRange or UwbData")
def ranges(
    message: Any,
    unit: str = "m",
    tag: str = "tag",
    on_error: Callable[[MessageError], None] | None = None,
) -> list[RangeRow]:
    """Return what a UwbRanges, a UwbRange or a UwbData says.

    Of a UwbData ids become names, a distance of 0 is a ranging that failed, and distances are in
    `unit`, ``m`` or ``mm``; `tag` is the name where the message has none. `on_error` is called with
    the error of a single range, which is left out. Raises MessageError without `on_error`, or if
    the message is something else, a stamp is 0, a range negative or not finite, an anchor without
    name, or arrays differ in length.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> rows = ranges(Message(destination_id=[7, 9], distance=[1500, 0],
    ...     stamp=[Message(sec=1, nanosec=0)] * 2), unit="mm")
    >>> [(row.tag, row.anchor, row.range_m) for row in rows]
    [('tag', '7', 1.5)]
    """
    if hasattr(message, "destination_id"):
        return _uwb_data(message, unit, tag, on_error)
    if hasattr(message, "anchor"):
        return [_uwb_range(message, tag, 0, "")]
    if not hasattr(message, "ranges") or (len(message.ranges) and
                                          not hasattr(message.ranges[0], "anchor")):  # fmt: skip
        raise MessageError(f"{type(message).__name__} holds no ranges to anchors; expected "
                           "locfuse_msgs/UwbRanges, UwbRange or UwbData")  # fmt: skip
    outer = stamp_ns(message.header.stamp)
    frame = message.header.frame_id
    each = (partial(_uwb_range, one, tag, outer, frame) for one in message.ranges)
    return _each(each, on_error)


def _each(
    rows: Iterable[Callable[[], RangeRow | None]], on_error: Callable[[MessageError], None] | None
) -> list[RangeRow]:
    found = []
    for make in rows:
        try:
            row = make()
        except MessageError as error:
            if on_error is None:
                raise
            on_error(error)
        else:
            if row is not None:
                found.append(row)
    return found


def _uwb_range(message: Any, tag: str, outer: int, frame: str) -> RangeRow:
    stamp = stamp_ns(message.header.stamp) or outer
    anchor, distance, sigma = str(message.anchor), float(message.range), float(message.sigma)
    _after_zero(stamp)
    if not anchor:
        raise MessageError("a range has no anchor; expected its name")
    _distance(distance, f"the range to {anchor}")
    if not 0.0 <= sigma < math.inf:
        raise MessageError(f"the sigma of the range to {anchor} is {sigma:g}; expected > 0, or 0 "
                           "where it is not known")  # fmt: skip
    return RangeRow(stamp, str(message.tag) or tag, anchor, distance, sigma or None,
                    plain(message.header.frame_id or frame))  # fmt: skip


def _uwb_data(
    message: Any, unit: str, tag: str, on_error: Callable[[MessageError], None] | None
) -> list[RangeRow]:
    ids, distances, stamps = message.destination_id, message.distance, message.stamp
    if not len(ids) == len(distances) == len(stamps):
        raise MessageError(f"destination_id, distance and stamp have {len(ids)}, {len(distances)} "
                           f"and {len(stamps)} elements; expected as many of each")  # fmt: skip

    def row(anchor: Any, given: Any, stamp: Any) -> RangeRow | None:
        distance = float(given) * UNIT_M[unit]
        _distance(distance, f"the distance to {int(anchor)}")
        if distance == 0.0:
            return None
        at = stamp_ns(stamp)
        _after_zero(at)
        return RangeRow(at, tag, str(int(anchor)), distance, None, "")

    each = zip(ids, distances, stamps, strict=True)
    return _each((partial(row, *one) for one in each), on_error)


@is_message("sensor_msgs/Range")
def range_of(message: Any, tag: str, anchor: str) -> RangeRow | None:
    """Return what a sensor_msgs/Range says, on a topic of one anchor; None out of its reach.

    Raises MessageError if it is no Range, its stamp is 0, or its range negative or NaN.
    """
    header, distance = message.header, decimal(message.range)
    nearest, farthest = decimal(message.min_range), decimal(message.max_range)
    stamp = stamped(header)
    if math.isinf(distance) or (farthest > 0.0 and not nearest <= distance <= farthest
                                and not math.isnan(distance)):  # fmt: skip
        return None
    _distance(distance, f"the range to {anchor}")
    return RangeRow(stamp, tag, anchor, distance, None, plain(header.frame_id))


@is_message("geometry_msgs/PoseWithCovarianceStamped")
def pose(message: Any, *, is_stamped: bool = True) -> PoseRow:
    """Return what a geometry_msgs/PoseWithCovarianceStamped says.

    Raises MessageError if it is something else, its stamp is 0 though it `is_stamped`, a number is
    NaN, or the orientation no rotation.
    """
    header, at = message.header, message.pose.pose.position
    x, y, orientation = float(at.x), float(at.y), message.pose.pose.orientation
    given = np.array(message.pose.covariance, np.float64)
    stamp = stamped(header) if is_stamped else stamp_ns(header.stamp)
    _finite((x, "pose.position.x"), (y, "pose.position.y"))
    if given.size != 36:
        raise MessageError(f"the covariance has {given.size} elements, expected 36")
    covariance = given.reshape(6, 6)[PLANAR]
    if np.isnan(covariance).any():
        raise MessageError("the covariance holds NaN; expected -1 first where it is not known")
    return PoseRow(stamp, plain(header.frame_id), x, y, heading_of(orientation), covariance)


@is_message("nav_msgs/Odometry, geometry_msgs/PoseStamped or PointStamped")
def truth(message: Any) -> TruthRow:
    """Return what a reference says: a nav_msgs/Odometry, PoseStamped or PointStamped.

    Raises MessageError if it is none of them, its stamp is 0, or a number is not finite.
    """
    header, given = message.header, getattr(message, "point", None)
    orientation = None
    if given is None:
        at = message.pose if hasattr(message.pose, "position") else message.pose.pose
        given, orientation = at.position, at.orientation
    x, y, z = float(given.x), float(given.y), float(given.z)
    stamp = stamped(header)
    _finite((x, "x"), (y, "y"), (z, "z"))
    heading = math.nan if orientation is None else heading_of(orientation)
    return TruthRow(stamp, x, y, z, heading, plain(header.frame_id))


@is_message("nav_msgs/Path of two poses")
def relation(message: Any) -> tuple[int, int, float, float, float]:
    """Return begin, end, dx, dy and dheading of a nav_msgs/Path of two poses, the first at 0.

    Raises MessageError if it is no such path.
    """
    (first, last) = message.poses
    at = last.pose.position
    found = (stamp_ns(first.header.stamp), stamp_ns(last.header.stamp), float(at.x),
             float(at.y), heading_of(last.pose.orientation))  # fmt: skip
    _finite((found[2], "x"), (found[3], "y"))
    return found


@is_message("sensor_msgs/NavSatFix or locfuse_msgs/TagPosition")
def fix(message: Any, origin: Origin | None = None) -> FixRow | None:
    """Return what a sensor_msgs/NavSatFix or a locfuse_msgs/TagPosition says; None without a fix.

    `origin` of the map is (latitude_deg, longitude_deg, heading_deg), its x axis that much
    counter-clockwise from east; only a NavSatFix needs it. Raises MessageError if the message is
    something else, its stamp is 0, or a number out of bounds or not finite.
    """
    if hasattr(message, "position") and hasattr(message, "tag"):
        return _tag_position(message)
    header, status = message.header, int(message.status.status)
    latitude, longitude = float(message.latitude), float(message.longitude)
    altitude, kind = float(message.altitude), int(message.position_covariance_type)
    covariance = np.array(message.position_covariance, np.float64)
    if status < 0:
        return None
    stamp = stamped(header)
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
        raise MessageError(f"latitude and longitude are {latitude:g} and {longitude:g}; expected "
                           "degrees")  # fmt: skip
    if covariance.size != 9:
        raise MessageError(f"position_covariance has {covariance.size} elements, expected 9")
    of_x, of_y, of_z = covariance[[0, 4, 8]].tolist()
    variance = 0.5 * ((of_x + of_y + of_z) - of_z)
    if math.isnan(variance):
        raise MessageError("position_covariance holds NaN; expected type 0 where it is not known")
    known = kind != 0 and variance > 0.0
    if origin is None:
        raise MessageError("a latitude needs the origin of the map; set ros.gps_origin")
    x, y = to_plane(latitude, longitude, altitude if math.isfinite(altitude) else 0.0, origin)
    return FixRow(stamp, x, y, min(math.sqrt(variance), NOT_MEASURED_M) if known else -1.0, "",
                  plain(header.frame_id))  # fmt: skip


def _tag_position(message: Any) -> FixRow:
    stamp = stamped(message.header)
    x, y, sigma = float(message.position.x), float(message.position.y), float(message.sigma)
    _finite((x, "position.x"), (y, "position.y"))
    if not (0.0 <= sigma < math.inf or sigma == -1.0):
        raise MessageError(f"sigma is {sigma:g}; expected > 0, or 0 or -1 where it is not known")
    return FixRow(stamp, x, y, sigma, str(message.tag), plain(message.header.frame_id))


@is_message("locfuse_msgs/LandmarkSightings or LandmarkSighting")
def sightings(message: Any) -> list[SightingRow]:
    """Return what a LandmarkSightings or a LandmarkSighting says.

    Raises MessageError if it is something else, a stamp is 0, a number not finite, or a range
    negative.
    """
    if hasattr(message, "bearing"):
        return [_sighting(message, 0, "")]
    if not hasattr(message, "sightings"):
        raise MessageError(f"{type(message).__name__} holds no sightings of landmarks; expected "
                           "locfuse_msgs/LandmarkSightings or LandmarkSighting")  # fmt: skip
    outer = stamp_ns(message.header.stamp)
    frame = message.header.frame_id
    return [_sighting(one, outer, frame) for one in message.sightings]


def _sighting(message: Any, outer: int, frame: str) -> SightingRow:
    stamp = stamp_ns(message.header.stamp) or outer
    _after_zero(stamp)
    name = str(message.landmark)
    called = name or "a landmark without name"
    distance, bearing = float(message.range), float(message.bearing)
    _distance(distance, f"the range to {called}")
    _finite((bearing, f"the bearing of {called}"))
    has_elevation = getattr(message, "has_elevation", False)  # not there in older ones
    elevation = float(message.elevation) if has_elevation else 0.0
    if not abs(elevation) <= 0.5 * math.pi:
        raise MessageError(f"the elevation of {called} is {elevation:g} rad, expected a number "
                           "from -pi/2 to pi/2")  # fmt: skip
    sigmas = [float(message.sigma_range), float(message.sigma_bearing)]
    sigmas += [float(message.sigma_elevation)] if has_elevation else []
    known = any(sigmas)
    if not all(0.0 <= sigma < math.inf and (sigma > 0.0) == known for sigma in sigmas):
        third = f" and sigma_elevation {sigmas[2]:g}" if has_elevation else ""
        raise MessageError(f"sigma_range and sigma_bearing of {called} are {sigmas[0]:g} and "
                           f"{sigmas[1]:g}{third}; expected both > 0, or both 0")  # fmt: skip
    given = [*sigmas, None] if known else [None] * 3
    return SightingRow(stamp, name, distance, bearing, given[0], given[1],
                       plain(message.header.frame_id or frame),
                       elevation if has_elevation else None, given[2])  # fmt: skip


@is_message("sensor_msgs/Range, geometry_msgs/PoseWithCovarianceStamped or PointStamped")
def altitude(message: Any) -> AltitudeRow | None:
    """Return what an altimeter says: a Range down to z = 0, or z of a pose or a point in world.

    None where the ground is out of its reach. Raises MessageError if the message is something else,
    its stamp is 0, or a number not finite.
    """
    if hasattr(message, "range"):
        down = range_of(message, "", "the ground")
        return None if down is None else AltitudeRow(down.stamp_ns, down.range_m, None, "")
    stamp, frame = stamped(message.header), plain(message.header.frame_id)
    if hasattr(message, "point"):
        z, variance = float(message.point.z), 0.0
    else:
        z = float(message.pose.pose.position.z)
        variance = float(np.array(message.pose.covariance, np.float64).reshape(6, 6)[2, 2])
    _finite((z, "z"))
    if math.isnan(variance):
        raise MessageError("the variance of z is NaN, expected 0 where it is not known")
    known = variance > 0.0
    return AltitudeRow(stamp, z, min(math.sqrt(variance), NOT_MEASURED_M) if known else None, frame)


@is_message("sensor_msgs/Imu or geometry_msgs/QuaternionStamped")
def heading(message: Any, origin: Origin | None) -> HeadingRow:
    """Return where an orientation points in the plane: an Imu's, or a QuaternionStamped.

    `origin` is that of the map, from whose x axis headings count. Raises MessageError if it is
    something else, its stamp is 0, or it has no orientation.
    """
    stamp, sigma = stamped(message.header), None
    if hasattr(message, "quaternion"):
        turned = message.quaternion
    else:
        turned, covariance = message.orientation, message.orientation_covariance
        if float(covariance[0]) == -1.0:
            raise MessageError("orientation is marked as not measured (covariance -1)")
        variance = float(covariance[8])
        if math.isnan(variance):
            raise MessageError("the variance of yaw is NaN, expected 0 where it is not known")
        sigma = min(math.sqrt(variance), NOT_MEASURED_RAD) if variance > 0.0 else None
    return HeadingRow(stamp, _from_map(heading_of(turned), origin), sigma, False)


@is_message("geometry_msgs/TwistWithCovarianceStamped or TwistStamped")
def course(message: Any, origin: Origin | None) -> HeadingRow | None:
    """Return in which direction a velocity over ground points; None of one that hardly moves.

    Raises MessageError if it is something else, its stamp is 0, or a number not finite.
    """
    stamp, twist, sigma = stamped(message.header), message.twist, SIGMA_GROUND_MPS
    is_known = True
    if hasattr(twist, "twist"):
        variances = float(twist.covariance[0]), float(twist.covariance[7])
        if any(map(math.isnan, variances)):
            raise MessageError("the variances of the velocity are NaN, expected 0 where they are "
                               "not known")  # fmt: skip
        is_known = variances[0] != -1.0
        sigma = math.sqrt(0.5 * sum(variances)) if min(variances) > 0.0 else sigma
        twist = twist.twist
    east, north = float(twist.linear.x), float(twist.linear.y)
    _finite((east, "twist.linear.x"), (north, "twist.linear.y"))
    speed = math.hypot(east, north)
    if not speed > MIN_COURSE_SIGMAS * sigma:
        return None
    direction = _from_map(math.atan2(north, east), origin)
    return HeadingRow(stamp, direction, sigma / speed if is_known else None, True)


def _from_map(heading: float, origin: Origin | None) -> float:
    """Return a heading from the map's x axis of one from east."""
    return float(_core.wrap_angle(heading - math.radians(origin[2] if origin else 0.0)))


@is_message("nav_msgs/OccupancyGrid")
def grid(message: Any) -> GridMap:
    """Return the map that a nav_msgs/OccupancyGrid holds, in world coordinates.

    As map_server writes probabilities: from 66 % a cell is occupied, up to 19 % free, between them
    unknown, as is -1.

    Raises MessageError if it is something else or without metadata: no cell, no resolution, no
    origin, or another number of cells than width times height; or if it is nowhere, or of no size.
    """
    info, data = message.info, np.asarray(message.data, np.int8)
    width, height = int(info.width), int(info.height)
    resolution = decimal(info.resolution)
    at, orientation = info.origin.position, info.origin.orientation
    x, y = float(at.x), float(at.y)
    if width * height != len(data) or len(data) == 0:
        raise MessageError(f"the map is {width} x {height} cells and holds {len(data)}; expected "
                           "width times height, at least 1")  # fmt: skip
    least, most = RESOLUTIONS_M
    if not least <= resolution <= most:
        raise MessageError(f"the resolution of the map is {resolution:g} m, expected {least:g} to "
                           f"{most:g}")  # fmt: skip
    if not (abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M):
        raise MessageError(f"the origin of the map is at ({x:g}, {y:g}) m, expected numbers within "
                           f"{FARTHEST_M:g}")  # fmt: skip
    try:
        yaw = heading_of(orientation)
    except MessageError as error:
        raise MessageError(f"the map's origin is not set: {error}") from None
    odd = (data < -1) | (data > 100)
    if odd.any():
        raise MessageError(f"a cell of the map is {data[odd][0]}, expected -1 to 100")
    cells = np.full(len(data), UNKNOWN, np.int8)
    cells[(data >= 0) & (data <= FREE_UP_TO)] = FREE
    cells[data >= OCCUPIED_FROM] = OCCUPIED
    return GridMap(cells.reshape(height, width), resolution, (x, y, yaw))


@is_message("locfuse_msgs/NamedPoints")
def points(message: Any) -> tuple[list[str], FloatArray, FloatArray | None]:
    """Return names, points (n, 3) and radii (n,) or None of a locfuse_msgs/NamedPoints.

    Raises MessageError if it is something else, lengths differ, a name is empty or there twice, or
    a number is not finite or a radius not positive.
    """
    names = [str(name) for name in message.names]
    at = np.array([[p.x, p.y, p.z] for p in message.points], np.float64).reshape(-1, 3)
    radii = np.asarray(message.radii, np.float64)
    if len(at) != len(names) or len(radii) not in (0, len(names)):
        raise MessageError(f"there are {len(names)} names, {len(at)} points and {len(radii)} "
                           "radii; expected as many of each, or no radii")  # fmt: skip
    for name in names:
        if not name or names.count(name) > 1:
            raise MessageError(f"the name {name!r} is empty or there twice")
    if not np.isfinite(at).all():
        raise MessageError(f"the point {names[int(np.argmin(np.isfinite(at).all(axis=1)))]} is "
                           "not finite")  # fmt: skip
    if not ((radii > 0.0) & np.isfinite(radii)).all():
        raise MessageError("a radius is not positive; leave radii empty where not known")
    return names, at, radii if len(radii) else None


@is_message("tf2_msgs/TFMessage")
def transforms(message: Any) -> list[TransformRow]:
    """Return what a tf2_msgs/TFMessage or a geometry_msgs/TransformStamped says.

    Raises MessageError if it is something else, a frame has no name, or a transform is none.
    """
    several = message.transforms if hasattr(message, "transforms") else [message]
    return [_transform(one) for one in several]


def _transform(message: Any) -> TransformRow:
    parent, child = plain(message.header.frame_id), plain(message.child_frame_id)
    at, turned = message.transform.translation, message.transform.rotation
    if not parent or not child or parent == child:
        raise MessageError(f"a transform leads from {child!r} to {parent!r}; expected two frames")
    quaternion = (float(turned.x), float(turned.y), float(turned.z), float(turned.w))
    where = (float(at.x), float(at.y), float(at.z))
    length = sum(part * part for part in quaternion)
    if not (all(map(math.isfinite, where)) and MIN_LENGTH < length < math.inf):
        raise MessageError(f"the transform from {child} to {parent} is none: translation {where}, "
                           f"rotation {quaternion}")  # fmt: skip
    return TransformRow(parent, child, *where, quaternion)


@is_message("stamped message")
def frame_of(message: Any) -> str:
    """Return the frame that a message is in.

    Raises MessageError if it has no header.
    """
    return str(message.header.frame_id)


def stamped(header: Any) -> int:
    """Return the stamp of a header [ns]; MessageError where it is 0 or no time."""
    stamp = stamp_ns(header.stamp)
    _after_zero(stamp)
    return stamp


def _after_zero(stamp: int) -> None:
    if stamp <= 0:
        raise MessageError("the stamp is 0; the driver must stamp its messages")


def _finite(*values: tuple[float, str]) -> None:
    for value, what in values:
        if not math.isfinite(value):
            raise MessageError(f"{what} is {value:g}, expected a finite number")


def _distance(value: float, what: str) -> None:
    if not 0.0 <= value < math.inf:
        raise MessageError(f"{what} is {value:g} m, expected a finite number that is not negative")
