# SPDX-License-Identifier: Apache-2.0
"""Why a message of a bag means nothing, in a sentence.

Which ones do, `decode_many` decides for all at once; these look at one that does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from locfuse.io.log_folder import MAX_RANGE_M, MAX_SPEED_MPS, MAX_TURN_RATE_RADPS
from locfuse.io.rosbag import decode
from locfuse.io.rosbag.bag_contents import Heard
from locfuse.io.rosbag.decode import MessageError, RangeRow
from locfuse.io.rosbag.frames import check_frame
from locfuse.types import FloatArray

Check = Callable[[Any, Heard], None]


def odometry(message: Any, heard: Heard) -> None:
    """Refuse a message, as all that follow do: each raises MessageError."""
    use = heard.odometry_from()
    row = decode.odometry(message, use)
    if use == "twist" and (abs(row.v) > MAX_SPEED_MPS or abs(row.omega) > MAX_TURN_RATE_RADPS):
        raise MessageError(f"{row.v:g} m/s and {row.omega:g} rad/s, which no robot drives")


def truth(message: Any, heard: Heard) -> None:
    row = decode.truth(message)
    check_frame("poses of the reference", row.frame, heard.ros.frames.map)


def scan(message: Any, heard: Heard) -> None:
    row = decode.scan(message)
    if heard.laser != (*row[1:6], len(row.ranges), row.intensities is not None):
        raise MessageError("the scan has another frame, geometry or number of beams than the "
                           "first: a log has one laser")  # fmt: skip


def ranges(message: Any, heard: Heard) -> None:
    errors: list[MessageError] = []
    rows = decode.ranges(message, heard.ros.uwb_unit, heard.ros.uwb_tag, errors.append)
    for error in errors:
        raise error
    for row in rows:
        _range(row)


def range_of(anchor: str, message: Any, heard: Heard) -> None:
    row = decode.range_of(message, heard.ros.uwb_tag, anchor)
    if row is not None:
        _range(row)


def _range(row: RangeRow) -> None:
    if row.range_m > MAX_RANGE_M:
        raise MessageError(f"a range of {row.range_m:g} m; are distances in mm? ros.uwb_unit says "
                           "what they are")  # fmt: skip


def pose(message: Any, heard: Heard) -> None:
    row = decode.pose(message)
    check_frame("poses", row.frame, heard.ros.frames.map)
    _variances(row.covariance)


def _variances(covariance: FloatArray) -> None:
    xy, heading = 0.5 * (covariance[0, 0] + covariance[1, 1]), covariance[2, 2]
    if covariance.any() and covariance[0, 0] != -1.0 and not (xy > 0.0 and heading > 0.0):
        raise MessageError(f"the variances of x, y and heading are {covariance[0, 0]:g}, "
                           f"{covariance[1, 1]:g} and {heading:g}; expected > 0, or all 0 or -1 "
                           "first where they are not known")  # fmt: skip


def position(message: Any, heard: Heard) -> None:
    row = decode.fix(message, heard.origin or (0.0, 0.0, 0.0))
    if row is not None and not hasattr(message, "latitude"):
        check_frame("positions", row.frame, heard.ros.frames.map)


def sightings(message: Any, heard: Heard) -> None:
    for row in decode.sightings(message):
        if row.frame != heard.sight_frame:
            raise MessageError(f"a sighting is in frame {row.frame!r}, the first in "
                               f"{heard.sight_frame!r}: a log has one such sensor")  # fmt: skip
