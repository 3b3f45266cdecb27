# SPDX-License-Identifier: Apache-2.0
"""What many messages of a topic say, as columns: `locfuse.io.rosbag.decode`, message for message.

Here is decided which messages mean something; why one does not, `decode` says of it alone. Numbers
may overflow on the way: who calls these switches the warnings of numpy off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from locfuse.config.ros import plain
from locfuse.io.log_folder import MAX_RANGE_M, MAX_SPEED_MPS, MAX_TURN_RATE_RADPS
from locfuse.io.rosbag.decode import (
    FLOAT_MAX,
    LEAST_LENGTH,
    NOT_MEASURED_M,
    PLANAR,
    UNIT_M,
    decimal,
    decimals,
    within,
)
from locfuse.io.rosbag.geodesy import Origin, to_plane
from locfuse.io.rosbag.increments import wrapped
from locfuse.io.rosbag.unpack import Places, Texts, Unpacked
from locfuse.types import NANOSECONDS, FloatArray

Flags = NDArray[np.bool_]
NOWHERE = (0.0, 0.0, 0.0)


class Laser(NamedTuple):
    """The geometry of scans: metres and radians; `bright` is whether there are intensities."""

    frame: str
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    beams: int
    bright: bool


@dataclass
class Said:
    """What messages say.

    Attributes
    ----------
    good : bool array, shape (messages,)
        Which of the messages mean something.
    rows : int64 array, shape (n,)
        Which message each row of the table is of.
    columns : dict of arrays, shape (n,) or (n, beams)
    spoilt : int64 array
        Messages that lost single elements, once for each.
    first : object
        What the first good message says for all that follow: the geometry of a laser, the frame of
        a sensor of landmarks, the origin of fixes.
    frames : list of (message, tag, frame)
        In which frame a tag sits, as a message was the first to say.
    """

    good: Flags
    rows: Places
    columns: dict[str, NDArray[Any]]
    spoilt: Places = field(default_factory=lambda: np.zeros(0, np.int64))
    first: Any = None
    frames: list[tuple[int, str, str]] = field(default_factory=list)


def odometry(messages: Unpacked, use: str) -> Said:
    """Return poses, speeds and turn rates; `use` is the half that must be there."""
    stamp, good = _stamps(messages)
    x, y = _real(messages, "pose.pose.position", "x", "y")
    v, omega = messages.real("twist.twist.linear.x"), messages.real("twist.twist.angular.z")
    if use == "pose":
        heading, turned = _headings(messages, "pose.pose.orientation")
        good &= _finite(x, y) & turned
    else:
        heading = np.full(len(x), math.nan)
        good &= (np.abs(v) <= MAX_SPEED_MPS) & (np.abs(omega) <= MAX_TURN_RATE_RADPS)
    return _chosen(good, stamp_ns=stamp, x=x, y=y, heading=heading, v_mps=v, omega_radps=omega)


def truth(messages: Unpacked, frame: str) -> Said:
    """Return where the body was, as a reference in `frame` says."""
    stamp, good = _stamps(messages)
    turned: Flags | bool = True
    if "point.x" in messages:
        at, heading = "point", np.full(len(stamp), math.nan)
    else:
        pose = "pose" if "pose.position.x" in messages else "pose.pose"
        at = f"{pose}.position"
        heading, turned = _headings(messages, f"{pose}.orientation")
    x, y, z = _real(messages, at, "x", "y", "z")
    good &= _finite(x, y, z) & turned & _in_frame(messages, frame)
    return _chosen(good, stamp_ns=stamp, x_m=x, y_m=y, z_m=z, heading_rad=heading)


def poses(messages: Unpacked, frame: str) -> Said:
    """Return poses in `frame` with their sigmas; -1 or 0 where a driver says that it knows none."""
    stamp, good = _stamps(messages)
    x, y = _real(messages, "pose.pose.position", "x", "y")
    heading, turned = _headings(messages, "pose.pose.orientation")
    good &= _finite(x, y) & turned & _in_frame(messages, frame)
    good &= messages.counts("pose.covariance") == 36
    elements = np.ravel_multi_index(PLANAR, (6, 6)).ravel().tolist()
    covariance = np.zeros((len(messages), 9))
    covariance[good] = messages.elements("pose.covariance", good, elements)
    xy, turn = 0.5 * (covariance[:, 0] + covariance[:, 4]), covariance[:, 8]
    unknown = covariance[:, 0] == -1.0
    none = ~covariance.any(axis=1)
    good &= ~np.isnan(covariance).any(axis=1) & (unknown | none | ((xy > 0.0) & (turn > 0.0)))
    of_xy, of_heading = (
        np.where(unknown, -1.0, np.minimum(np.sqrt(variance), NOT_MEASURED_M))
        for variance in (xy, turn)
    )  # fmt: skip
    return _chosen(good, stamp_ns=stamp, x_m=x, y_m=y, heading_rad=heading, sigma_xy_m=of_xy,
                   sigma_heading_rad=of_heading)  # fmt: skip


def positions(messages: Unpacked, frame: str, origin: Origin | None) -> Said:
    """Return positions; fixes are metres from `origin`, or from the first of them."""
    if "position.x" in messages and "tag" in messages:
        return _tag_positions(messages, frame)
    fixed = messages.number("status.status") >= 0
    stamp, good = _stamps(messages)
    latitude, longitude = messages.real("latitude"), messages.real("longitude")
    altitude = messages.real("altitude")
    good &= (np.abs(latitude) <= 90.0) & (np.abs(longitude) <= 360.0)
    good &= messages.counts("position_covariance") == 9
    covariance = np.zeros((len(messages), 3))
    covariance[good] = messages.elements("position_covariance", good, (0, 4, 8))
    variance = 0.5 * ((covariance[:, 0] + covariance[:, 1] + covariance[:, 2]) - covariance[:, 2])
    good &= ~np.isnan(variance)
    known = (messages.number("position_covariance_type") != 0) & (variance > 0.0)
    sigma = np.where(known, np.minimum(np.sqrt(variance), NOT_MEASURED_M), -1.0)  # fmt: skip
    rows = np.flatnonzero(good & fixed)
    there = np.column_stack([latitude, longitude, np.where(np.isfinite(altitude), altitude, 0.0)])
    if origin is None and len(rows):
        origin = (float(latitude[rows[0]]), float(longitude[rows[0]]), 0.0)
    at = np.array([to_plane(phi, lam, height, origin or NOWHERE)
                   for phi, lam, height in there[rows].tolist()]).reshape(-1, 2)  # fmt: skip
    columns = {"stamp_ns": stamp[rows], "tag": np.full(len(rows), ""), "x_m": at[:, 0],
               "y_m": at[:, 1], "sigma_m": sigma[rows]}  # fmt: skip
    return Said(good | ~fixed, rows, columns, first=origin)


def _tag_positions(messages: Unpacked, frame: str) -> Said:
    stamp, good = _stamps(messages)
    x, y = _real(messages, "position", "x", "y")
    sigma = messages.real("sigma")
    good &= _finite(x, y) & (((sigma >= 0.0) & (sigma < math.inf)) | (sigma == -1.0))
    good &= _in_frame(messages, frame)
    return _chosen(good, stamp_ns=stamp, tag=messages.text("tag").array(), x_m=x, y_m=y,
                   sigma_m=sigma)  # fmt: skip


def ranges(messages: Unpacked, unit: str, tag: str) -> Said:
    """Return ranges of a UwbRanges, a UwbRange or a UwbData; sigmas are NaN where not known."""
    if "destination_id" in messages:
        return _uwb_data(messages, unit, tag)
    path = "" if "anchor" in messages else "ranges[]."
    owner, stamp, good, frames, whole = _inner(messages, path, "anchor")
    anchors = messages.text(f"{path}anchor")
    distance, sigma = _real(messages, path[:-1], "range", "sigma")
    good &= anchors.each([name != "" for name in anchors.names])
    good &= _lengths(distance) & _lengths(sigma)
    tags = messages.text(f"{path}tag").renamed(lambda name: name or tag)
    columns = {"stamp_ns": stamp, "tag": tags, "anchor": anchors, "range_m": distance,
               "sigma_m": np.where(sigma == 0.0, math.nan, sigma)}  # fmt: skip
    return _singly(columns, frames, owner, good, ~good, whole)


def _uwb_data(messages: Unpacked, unit: str, tag: str) -> Said:
    ids, distances = messages.counts("destination_id"), messages.counts("distance")
    alike = (ids == distances) & (ids == messages.counts("stamp"))
    owner = messages.owner("stamp[].sec")
    inside = alike[owner]
    stamp, good = (values[inside] for values in _stamp(messages, "stamp[]"))
    numbers, codes = np.unique(messages.flat("destination_id", alike), return_inverse=True)
    distance = messages.flat("distance", alike).astype(np.float64) * UNIT_M[unit]
    good &= _lengths(distance) & (stamp > 0)
    failed = distance == 0.0
    columns = {"stamp_ns": stamp, "tag": Texts.all(tag, len(stamp)),
               "anchor": Texts([str(int(one)) for one in numbers.tolist()], codes),
               "range_m": distance, "sigma_m": np.full(len(stamp), math.nan)}  # fmt: skip
    return _singly(columns, Texts.all("", len(stamp)), owner[inside], good & ~failed,
                   ~good & ~failed, alike)  # fmt: skip


def range_of(messages: Unpacked, tag: str, anchor: str) -> Said:
    """Return what a sensor_msgs/Range says, on a topic of one anchor, within its reach."""
    n = len(messages)
    stamp, good = _stamps(messages)
    distance, nearest, farthest = (_decimal(messages, path)
                                   for path in ("range", "min_range", "max_range"))  # fmt: skip
    beyond = (farthest > 0.0) & ~((nearest <= distance) & (distance <= farthest))
    beyond = good & (np.isinf(distance) | (beyond & ~np.isnan(distance)))
    good &= _lengths(distance) & ~beyond
    columns = {"stamp_ns": stamp, "tag": Texts.all(tag, n), "anchor": Texts.all(anchor, n),
               "range_m": distance, "sigma_m": np.full(n, math.nan)}  # fmt: skip
    frames = messages.text("header.frame_id").renamed(plain)
    return _singly(columns, frames, np.arange(n), good, ~good & ~beyond, np.ones(n, bool))


def _singly(
    columns: dict[str, Any], frames: Texts, owner: Places, good: Flags, bad: Flags, whole: Flags
) -> Said:  # fmt: skip
    """Return the `good` of ranges, of messages that are `whole` and not all `bad`."""
    far = good & (columns["range_m"] > MAX_RANGE_M)
    good, bad = good & ~far, bad | far
    n = len(whole)
    kept = ~_none(owner[good], n)
    whole = whole & (kept | _none(owner[bad], n))
    chosen = np.flatnonzero(good & whole[owner])
    tags = columns["tag"]
    _, first = np.unique(tags.codes[chosen], return_index=True)
    said = [(int(owner[k]), tags.names[tags.codes[k]], frames.names[frames.codes[k]])
            for k in chosen[np.sort(first)].tolist()]  # fmt: skip
    table = {name: (values.array() if isinstance(values, Texts) else values)[chosen]
             for name, values in columns.items()}  # fmt: skip
    return Said(whole, owner[chosen], table, owner[bad & whole[owner]], frames=said)


def sightings(messages: Unpacked, sensor: str | None) -> Said:
    """Return landmarks seen from the frame `sensor`, or from that of the first of them."""
    path = "" if "bearing" in messages else "sightings[]."
    owner, stamp, good, frames, whole = _inner(messages, path, "landmark")
    distance, bearing, sigma_range, sigma_bearing = _real(
        messages, path[:-1], "range", "bearing", "sigma_range", "sigma_bearing"
    )
    good &= _lengths(distance) & np.isfinite(bearing) & _lengths(sigma_range)
    good &= _lengths(sigma_bearing) & ((sigma_range > 0.0) == (sigma_bearing > 0.0))
    whole &= _none(owner[~good], len(messages))
    chosen = np.flatnonzero(whole[owner])
    if sensor is None and len(chosen):
        sensor = frames.names[frames.codes[chosen[0]]]
    there = frames.each([name == sensor for name in frames.names])
    whole &= _none(owner[~there], len(messages))
    chosen = np.flatnonzero(whole[owner])
    known = sigma_range > 0.0
    columns = {
        "stamp_ns": stamp,
        "landmark": messages.text(f"{path}landmark").array(),
        "range_m": distance,
        "bearing_rad": bearing,
        "sigma_range_m": np.where(known, sigma_range, math.nan),
        "sigma_bearing_rad": np.where(known, sigma_bearing, math.nan),
    }
    table = {name: values[chosen] for name, values in columns.items()}
    return Said(whole, owner[chosen], table, first=sensor)


def scans(messages: Unpacked, laser: Laser | None) -> Said:
    """Return the scans of a `laser`, or of that of the first of them."""
    stamp, good = _stamps(messages)
    start, step, nearest, farthest = (
        _decimal(messages, key) for key in ("angle_min", "angle_increment", "range_min",
                                            "range_max")
    )  # fmt: skip
    beams, bright = messages.counts("ranges"), messages.counts("intensities")
    good &= _finite(start, step) & (beams > 0) & (step != 0.0) & (nearest >= 0.0)
    good &= (nearest < farthest) & (farthest < math.inf) & ((bright == 0) | (bright == beams))
    frames = messages.text("header.frame_id").renamed(plain)
    if laser is None and good.any():
        k = int(np.argmax(good))
        laser = Laser(frames.names[frames.codes[k]], float(start[k]), float(step[k]),
                      float(nearest[k]), float(farthest[k]), int(beams[k]),
                      bool(bright[k]))  # fmt: skip
    if laser is None:
        return Said(good, np.flatnonzero(good), {})
    good &= frames.each([name == laser.frame for name in frames.names])
    for ours, theirs in zip(
        (start, step, nearest, farthest, beams, bright > 0), laser[1:], strict=True
    ):
        good &= ours == theirs
    columns: dict[str, NDArray[Any]] = {"stamp_ns": stamp[good]}
    told = messages.elements("ranges", good, laser.beams).astype(np.float32)
    columns["ranges_m"] = within(decimals(told), laser.range_min, laser.range_max)
    if laser.bright:
        returned = messages.elements("intensities", good, laser.beams).astype(np.float64)
        columns["intensities"] = within(returned, 0.0, FLOAT_MAX)
    return Said(good, np.flatnonzero(good), columns, first=laser)


# Parts of messages -----------------------------------------------------------------------------


def _chosen(good: Flags, **columns: NDArray[Any]) -> Said:
    """Return the good ones of messages that say one row each."""
    return Said(good, np.flatnonzero(good), {name: one[good] for name, one in columns.items()})


def _stamp(messages: Unpacked, path: str) -> tuple[Places, Flags]:
    """Return stamps [ns], and whether they are any."""
    seconds, rest = messages.number(f"{path}.sec"), messages.number(f"{path}.nanosec")
    good = (rest >= 0) & (rest < NANOSECONDS)
    return seconds.astype(np.int64) * NANOSECONDS + rest.astype(np.int64), good


def _stamps(messages: Unpacked) -> tuple[Places, Flags]:
    """Return stamps of headers [ns], and whether they are set."""
    stamp, good = _stamp(messages, "header.stamp")
    return stamp, good & (stamp > 0)


def _inner(messages: Unpacked, path: str, key: str) -> tuple[Places, Places, Flags, Texts, Flags]:
    """Return headers of elements, which have that of their message where they leave theirs empty.

    These are: the message that each is of, stamps [ns], whether these are set, frames; and which
    messages have a stamp that is any.
    """
    owner = messages.owner(f"{path}{key}")
    stamp, good = _stamp(messages, f"{path}header.stamp")
    frames = messages.text(f"{path}header.frame_id")
    whole = np.ones(len(messages), bool)
    if path:
        outer, whole = _stamp(messages, "header.stamp")
        stamp = np.where(stamp == 0, outer[owner], stamp)
        frames = frames.or_else(messages.text("header.frame_id"), owner)
    return owner, stamp, good & (stamp > 0), frames.renamed(plain), whole


def _real(messages: Unpacked, path: str, *keys: str) -> list[FloatArray]:
    return [messages.real(f"{path}.{key}" if path else key) for key in keys]


def _decimal(messages: Unpacked, path: str) -> FloatArray:
    """Return float32 numbers as `decimal` reads them."""
    told, which = np.unique(messages.number(path).astype(np.float32), return_inverse=True)
    return np.array([decimal(one) for one in told.tolist()])[which]


def _headings(messages: Unpacked, path: str) -> tuple[FloatArray, Flags]:
    """Return headings as `heading_of` does, and whether the quaternions turn anything at all.

    The functions of `math`, as those of numpy differ in last bits from processor to processor.
    """
    x, y, z, w = _real(messages, path, "x", "y", "z", "w")
    length = x * x + y * y + z * z + w * w
    good = (length > LEAST_LENGTH) & (length < math.inf)
    flat = (x == 0.0) & (y == 0.0)
    up = np.where(flat, z, 2.0 * (w * z + x * y))
    ahead = np.where(flat, w, w * w + x * x - y * y - z * z)
    angle = np.array(list(map(math.atan2, up.tolist(), ahead.tolist())), np.float64)
    return wrapped(np.where(flat, 2.0 * angle, angle)), good


def _in_frame(messages: Unpacked, expected: str) -> Flags:
    """Return which messages are in a frame, or name none."""
    frames = messages.text("header.frame_id").renamed(plain)
    return frames.each([name in ("", plain(expected)) for name in frames.names])


def _finite(*several: FloatArray) -> Flags:
    finite = np.ones(several[0].shape, bool)
    for values in several:
        finite &= np.isfinite(values)
    return finite


def _lengths(values: FloatArray) -> Flags:
    """Return which numbers can be a distance, or its sigma."""
    return (values >= 0.0) & (values < math.inf)


def _none(rows: Places, n: int) -> Flags:
    """Return which of n messages are not among `rows`."""
    held: Flags = np.bincount(rows, minlength=n) == 0
    return held
