# SPDX-License-Identifier: Apache-2.0
"""Checks of headings and courses: their sense, their unit, and whether they move at all."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error
from locfuse.check.headings import heading_error
from locfuse.eval.dead_reckoning import Track, at_times
from locfuse.types import NANOSECONDS, FloatArray, StampArray, Trajectory, wrap_angle

APART_S = 1.0  # of two headings that are compared
MAX_TURN = 2.5  # between them, so that it has one sense [rad]
MIN_TURN = 1.0  # in all, root of the sum of squares [rad]
KNOWN = 0.5  # sigma of an offset that is said to be known [rad]
MIN_WAY_M = 1.0  # in 2 s, of which the direction is compared with a course
MIN_COURSES = 20
MAX_OFF = math.radians(20.0)  # of courses at the mean
_FILE = "headings.csv, heading_rad"


def headings_against_odometry(context: Context) -> Iterator[Finding]:
    """Report headings that turn the other way, in degrees, or not at all while odometry turns."""
    odometry = context.odometry
    if odometry is None or odometry.heading is None:
        return
    for is_course, what in ((False, "headings"), (True, "courses")):
        stamp, heading = _of(context, is_course, odometry)
        begin, end = _pairs(stamp)
        driven = at_times(odometry, stamp)[:, 2] if len(stamp) else heading
        turned = wrap_angle(driven[end] - driven[begin])
        usable = np.abs(turned) < MAX_TURN
        turned, begin, end = turned[usable], begin[usable], end[usable]
        if np.sqrt(np.sum(turned**2)) < MIN_TURN:
            continue
        slope, in_degrees = (float(wrap_angle(unit * (heading[end] - heading[begin])) @ turned)
                             / float(turned @ turned) for unit in (1.0, np.pi / 180.0)
                             )  # fmt: skip
        if slope < -0.5:
            yield error(f"{what} turn clockwise while odometry turns counter-clockwise", _FILE,
                        "a compass counts clockwise from north: write pi / 2 minus "
                        "each")  # fmt: skip
        elif abs(slope) < 0.5 < abs(in_degrees) and np.ptp(heading) > 4.0 * np.pi:
            yield error(f"{what} reach {np.max(np.abs(heading)):.4g}: degrees?", _FILE,
                        "write radians")  # fmt: skip
        elif abs(slope) < 0.3:
            yield error(f"{what} follow {slope:.0%} of the turns of odometry", _FILE,
                        "does the sensor publish an orientation at all? Leave 'headings' out of "
                        "use")  # fmt: skip


def headings_against_the_way(context: Context) -> Iterator[Finding]:
    """Report courses, and headings whose offset is said to be known, that point elsewhere."""
    tracks = context.references
    if not tracks:
        return
    path = tracks[0].path
    stamp, course = _of(context, True, path)
    if len(stamp):
        second = NANOSECONDS
        inside = (stamp > path.stamp_ns[0] + second) & (stamp < path.stamp_ns[-1] - second)
        stamp, course = stamp[inside], course[inside]
        way = at_times(path, stamp + second)[:, :2] - at_times(path, stamp - second)[:, :2]
        long = np.linalg.norm(way, axis=1) > MIN_WAY_M
        if long.sum() >= MIN_COURSES:
            off = course[long] - np.arctan2(way[long, 1], way[long, 0])
            mean = complex(np.mean(np.exp(1j * off)))
            angle = math.degrees(np.angle(mean))
            if abs(mean) < 0.3:
                yield error(f"courses have nothing to do with the way of {tracks[0].name}", _FILE,
                            "a course is counter-clockwise from the x axis, in radians; a velocity "
                            "in the frame of the body is none")  # fmt: skip
            elif abs(np.angle(mean)) > MAX_OFF:
                yield error(f"courses point {angle:.0f} deg beside the way of {tracks[0].name}",
                            _FILE, "is the x axis of the map that of the receiver, east? Set "
                            "ros.gps_origin, or turn them")  # fmt: skip
    models = context.models
    if models.kind == "pose" and models.calibration.sigma_heading_offset_rad < KNOWN:
        stamp, heading = _of(context, False, path)
        if len(stamp) > 1:
            at = Trajectory(stamp, at_times(path, stamp)[:, :2],
                            wrap_angle(heading - models.heading.offset_rad))  # fmt: skip
            found = heading_error(context.odometry, Track(_FILE, at, tracks[0].lever))
            if found is not None and found.is_gross:
                yield error(f"headings are {math.degrees(found.offset):.0f} deg beside the one in "
                            "which the robot drives", _FILE, "set estimator.heading.offset_rad, or "
                            "leave calibration.sigma_heading_offset_rad at pi: it is learnt"
                            )  # fmt: skip


def _of(context: Context, is_course: bool, path: Trajectory) -> tuple[StampArray, FloatArray]:
    """Return stamps, each once and within those of a path, and the headings or courses there."""
    table = context.used("headings")
    if table is None or not len(path):
        return np.empty(0, np.int64), np.empty(0)
    stamp = table["stamp_ns"]
    of_kind = (table.get("is_course", np.zeros(len(stamp))) != 0) == is_course
    inside = of_kind & (stamp >= path.stamp_ns[0]) & (stamp <= path.stamp_ns[-1])
    stamp, first = np.unique(stamp[inside], return_index=True)
    return stamp, table["heading_rad"][inside][first]


def _pairs(stamp: StampArray) -> tuple[StampArray, StampArray]:
    """Return the rows of headings that are a second apart."""
    later = np.searchsorted(stamp, stamp + round(APART_S * NANOSECONDS))
    begin = np.flatnonzero(later < len(stamp))
    return begin, later[begin]
