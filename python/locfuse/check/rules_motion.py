# SPDX-License-Identifier: Apache-2.0
"""Checks of odometry and start against other references of the robot's position."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning
from locfuse.check.headings import heading_error
from locfuse.eval.dead_reckoning import (
    Alignment,
    Track,
    align,
    at_times,
    compare,
    dead_reckon,
    levered,
    rms,
    spread,
)
from locfuse.types import NANOSECONDS, FloatArray, Trajectory, wrap_angle

_MIN_GAIN = 0.5  # another reading of the odometry must leave at most so much over
_STRAIGHT = 0.1  # share of its extent that a path may be off without being judged
_FIRST_M = 4.0
_SHIFTS_S = np.arange(-15, 16) * 0.1
_BIN_S = 0.25
_SURE = 20.0  # of a log likelihood ratio
_UNEXPLAINED = 0.25  # of the variance of turns, at most, where the right clock leaves it
_FLOOR_RAD = 2e-3
_TURNS = {
    -1.0: "turns the other way",
    math.pi / 180.0: "turns in degrees",
    180.0 / math.pi: "turns in radians where degrees were taken twice",
}


def turn_direction(context: Context) -> Iterator[Finding]:
    """Report odometry that turns the wrong way or in another unit, or a mirrored anchor map."""
    table = context.used("odometry")
    if context.odometry is None or table is None:
        return
    for track in context.references:
        as_is = compare(context.odometry, track)
        if not as_is or rms(as_is) < max(0.05, _jitter(track), _STRAIGHT * spread(as_is)):
            continue
        trials = {k: compare(dead_reckon(table, k), track) for k in _TURNS}
        best = min(trials, key=lambda k: rms(trials[k]))
        if rms(trials[best]) < _MIN_GAIN * rms(as_is):
            yield error(f"odometry {_TURNS[best]}: against {track.name} it is off by "
                        f"{rms(trials[best]):.2g} m so, by {rms(as_is):.2g} m as it is",
                        "odometry.csv" if track.name != "ranges.csv" else
                        "odometry.csv or anchors.csv", _sense_advice(best, track))  # fmt: skip
            return


def _sense_advice(turn: float, track: Track) -> str:
    if turn != -1.0:
        return "write radians"
    if track.name == "ranges.csv":
        return ("counter-clockwise is positive; or the anchors are mirrored: exchange x and y of "
                "one corner, or names across an axis")  # fmt: skip
    return "counter-clockwise is positive"


def _jitter(track: Track) -> float:
    """Return the noise of a track, from its bends from row to row, metres."""
    at = track.path.position
    if len(at) < 3:
        return 0.0
    bend = at[2:] - 2.0 * at[1:-1] + at[:-2]
    return float(np.median(np.linalg.norm(bend, axis=1)))


def scale_of_the_odometry(context: Context) -> Iterator[Finding]:
    """Report odometry that drives further or less far than the robot."""
    if context.odometry is None:
        return
    for track in context.references:
        found = [a for a in compare(context.odometry, track) if a.rms < 0.25 * a.spread]
        if not found:
            continue
        scale = float(np.median([a.scale for a in found]))
        measured = f"by {track.name} the robot drives {scale:.4g} times what odometry reports"
        if not 0.02 < scale < 50.0:
            unit = "centimetres" if -2.5 < math.log10(scale) < 2.5 else "millimetres"
            which = "odometry.csv" if scale < 1.0 else track.name
            yield error(f"{measured}: {unit}?", which, "write metres")
        elif not 0.85 < scale < 1.18:
            known = scale * context.models.odometry.distance_scale
            yield warning(measured, "odometry.csv", "check the gear ratio, or set "
                          f"estimator.odometry.distance_scale: {known:.4g}, which locfuse tune "
                          "finds, too")  # fmt: skip
        else:
            yield note(measured, "odometry.csv")
        return


def heading_against_the_course(context: Context) -> Iterator[Finding]:
    """Compare the heading of truth or poses with the course that odometry drives."""
    for track in context.references:
        found = heading_error(context.odometry, track)
        if found is None:
            continue
        off = math.degrees(found.offset)
        if found.is_clockwise:
            yield error(f"{track.name} reports headings that turn clockwise, as a compass does: "
                        f"{off:.0f} deg minus the heading in which the robot drives",
                        f"{track.name}, heading_rad",
                        f"write {off:.0f} deg minus each, in radians: heading is counter-clockwise "
                        "from the x axis")  # fmt: skip
            continue
        report = error if found.is_gross else warning
        yield report(f"{track.name} reports a heading {off:.0f} deg from the one in which odometry "
                     "drives", f"odometry.csv or {track.name}", _axes(found.offset)
                     )  # fmt: skip


def _axes(off: float) -> str:
    if abs(off) > math.radians(150.0):
        return "dx_m and v_mps are positive forward; or the heading is that of the back"
    if abs(abs(off) - math.pi / 2.0) < math.radians(20.0):
        return "x is forward and y is left; heading is counter-clockwise from x, not from north"
    return "heading is counter-clockwise from the x axis of world; mind the magnetic declination"


def clock_of_the_odometry(context: Context) -> Iterator[Finding]:
    """Report an offset between the clock of odometry and that of a reference."""
    if context.odometry is None:
        return
    for track in context.references:
        left = [_rate_misfit(context.odometry, track, float(shift)) for shift in _SHIFTS_S]
        if None in left:
            continue
        misfit, unexplained = np.array(left, dtype=np.float64).T
        best, now = int(np.argmin(misfit)), len(misfit) // 2
        is_observable = unexplained[best] < _UNEXPLAINED  # equal turns do not determine the clock
        if abs(_SHIFTS_S[best]) > 0.15 and misfit[now] - misfit[best] > _SURE and is_observable:
            yield warning(f"turns of odometry fit those of {track.name} best if its clock is "
                          f"shifted by {-_SHIFTS_S[best]:+.1f} s", "odometry.csv",
                          "stamp both with one clock, when the motion happens")  # fmt: skip
            return


def _rate_misfit(odometry: Trajectory, track: Track, shift_s: float) -> tuple[float, float] | None:
    """Return minus the log likelihood of the turns of a track, its scatter being unknown.

    And that scatter as a share of the variance of the turns. None without headings or with little
    to compare.
    """
    path, step = track.path, round(_BIN_S * NANOSECONDS)
    if path.heading is None:
        return None
    room = round(_SHIFTS_S[-1] * NANOSECONDS) + step
    begin = max(int(path.stamp_ns[0]), int(odometry.stamp_ns[0]) + room)
    end = min(int(path.stamp_ns[-1]), int(odometry.stamp_ns[-1]) - room)
    if not 20 * step <= end - begin < 2 * len(path) * step:
        return None
    stamp = np.arange(begin, end, step, dtype=np.int64)
    measured = np.diff(at_times(path, stamp)[:, 2])
    driven = np.diff(at_times(odometry, stamp + round(shift_s * NANOSECONDS))[:, 2])
    off = wrap_angle(measured - driven)
    scatter = float(np.mean(off**2)) + _FLOOR_RAD**2
    variance = float(np.var(wrap_angle(measured)))
    return 0.5 * len(off) * math.log(scatter), scatter / max(variance, 1e-12)


def start_against_the_first_metres(context: Context) -> Iterator[Finding]:
    """Compare the start with where the first metres, driven from there, are seen to lead."""
    start = context.config.start
    if isinstance(start, str) or context.odometry is None:
        return
    for track in context.references:
        if track.name == "truth.csv" and context.frame_of_truth is not None:
            continue
        found = _first_metres(context, track)
        if found is None:
            continue
        fit, place = found
        heading = math.radians(float(start[2]))
        turned = float(wrap_angle(fit.angle - heading))
        sigma = fit.rms / max(fit.spread, 1e-9)
        limit = max(math.radians(15.0), 3.0 * math.radians(context.config.start_sigma.heading_deg),
                    sigma)  # fmt: skip
        if abs(turned) > limit:
            yield error(f"start has a heading of {start[2]:g} deg, but over the first metres "
                        f"{track.name} shows {math.degrees(fit.angle):.0f} deg", "start",
                        f"set it to {math.degrees(fit.angle):.0f}")  # fmt: skip
        away = float(np.hypot(place[0] - start[0], place[1] - start[1]))
        if away > max(1.0, 5.0 * context.config.start_sigma.xy_m, 3.0 * fit.rms):
            yield error(f"start is ({start[0]:g}, {start[1]:g}), but {track.name} shows "
                        f"({place[0]:.2f}, {place[1]:.2f})", "start",
                        f"set it to ({place[0]:.2f}, {place[1]:.2f})")  # fmt: skip
        return


def _first_metres(context: Context, track: Track) -> tuple[Alignment, FloatArray] | None:
    """Return how the first metres of odometry lie on a track, and where they begin."""
    assert context.odometry is not None
    odometry, stamp = context.odometry, track.path.stamp_ns
    way = np.cumsum(np.linalg.norm(np.diff(odometry.position, axis=0, prepend=0.0), axis=1))
    last = int(np.searchsorted(way, _FIRST_M))
    end = odometry.stamp_ns[min(last, len(odometry) - 1)]
    inside = stamp[(stamp >= odometry.stamp_ns[0]) & (stamp <= end)]
    if len(inside) < 5:
        return None
    moved = levered(at_times(odometry, inside), track.lever)
    fixed = at_times(track.path, inside)[:, :2]
    fit = align(moved, fixed)
    if fit.spread < 0.4 or fit.rms > 0.5 * fit.spread:
        return None
    c, s = np.cos(fit.angle), np.sin(fit.angle)
    turned = moved @ np.array([[c, s], [-s, c]])
    return fit, np.median(fixed - turned, axis=0)
