# SPDX-License-Identifier: Apache-2.0
"""Positions of a GPS or of tags: where the map begins, and which antenna they are of."""

from __future__ import annotations

import math
from typing import Any

from locfuse.io.geodesy import Origin, origin_at
from locfuse.io.georeference import UNKNOWN_SIGMA_M, agree, origin_sentence
from locfuse.io.rosbag import decode
from locfuse.io.rosbag.decode import FixRow, MessageError
from locfuse.io.rosbag.frames import FrameTree
from locfuse.types import NANOSECONDS


class Fixes:
    """Makes rows of fixes; the first that the next one agrees with is the origin of the map.

    Unless `origin` is given. Receivers may publish zeros, or once the place where they were last
    on, before they know better: two fixes agree that a vehicle can go between. `sentence` says,
    from then on, which origin it is.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> def at(latitude, second):
    ...     return Message(header=Message(stamp=Message(sec=second, nanosec=0), frame_id="gps"),
    ...         status=Message(status=0), latitude=latitude, longitude=8.4, altitude=0.0,
    ...         position_covariance=[1.0] * 9, position_covariance_type=2)
    >>> fixes = Fixes(None)
    >>> fixes.rows(at(48.0, 1)), fixes.rows(at(49.0, 2))
    ([], [])
    >>> [round(row.y, 1) for row in fixes.rows(at(49.00001, 3))]
    [0.0, 1.1]
    """

    def __init__(self, origin: Origin | None) -> None:
        self.origin = origin
        self.sentence = ""
        self._first: Any = None  # a fix that waits for one that agrees

    def rows(self, message: Any) -> list[FixRow]:
        """Return what a NavSatFix or TagPosition says, and the fix before it if that waited.

        Raises MessageError as `decode.fix`, and for zeros before there is an origin; a fix that the
        next one does not agree with is lost.
        """
        if self.origin is not None or not hasattr(message, "latitude"):
            row = decode.fix(message, self.origin)
            return [] if row is None else [row]
        if decode.fix(message, (0.0, 0.0, 0.0)) is None:
            return []
        if message.latitude == 0.0 and message.longitude == 0.0:
            raise MessageError("latitude and longitude are 0, as of a receiver without a fix")
        first, self._first = self._first, message
        found = [] if first is None else _rows_from(first, message)
        if not found or not _agree(*found):
            return []
        self._begin_at(first)
        return found

    def last_row(self) -> list[FixRow]:
        """Return the fix that still waits when no other comes."""
        if self._first is None:
            return []
        found = _rows_from(self._first)
        self._begin_at(self._first)
        return found

    def _begin_at(self, first: Any) -> None:
        self._first, self.origin = None, _origin_at(first)
        self.sentence = origin_sentence(self.origin)


def _origin_at(message: Any) -> Origin:
    return origin_at(message.latitude, message.longitude)


def _rows_from(first: Any, *others: Any) -> list[FixRow]:
    """Return fixes in a map whose origin is the first."""
    rows = (decode.fix(message, _origin_at(first)) for message in (first, *others))
    return [row for row in rows if row is not None]


def is_beside(frame: str, tree: FrameTree) -> bool:
    """Return whether static transforms place an antenna beside the body's origin.

    Its fixes are then those of a tag that is named after the frame.
    """
    if not frame or frame not in tree:
        return False
    mount = tree.mount(frame)
    return mount.x != 0.0 or mount.y != 0.0


def unplaced(frame: str, base: str) -> str:
    """Return a sentence on fixes of a frame that nothing places on the body."""
    return (
        f"positions are of {frame!r}, which no static transform places on {base!r}: they are taken "
        "for those of its origin, or of the antenna where estimator.position says"
    )


def overridden(frame: str, tree: FrameTree) -> str:
    """Return a sentence on a place of an antenna that something else counts more than."""
    at = tree.mount(frame)
    return (
        f"static transforms place the antenna {frame!r} at ({at.x:.3g}, {at.y:.3g}) m; "
        "estimator.position.antenna_forward_m and antenna_left_m count instead"
    )


def _agree(here: FixRow, there: FixRow) -> bool:
    """Return whether a vehicle can go from one fix, the origin, to another."""
    seconds = abs(there.stamp_ns - here.stamp_ns) / NANOSECONDS
    sigma = math.hypot(*(UNKNOWN_SIGMA_M if row.sigma_m <= 0.0 else row.sigma_m
                         for row in (here, there)))  # fmt: skip
    return agree(math.hypot(there.x, there.y), seconds, sigma)
