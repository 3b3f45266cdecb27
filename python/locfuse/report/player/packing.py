# SPDX-License-Identifier: Apache-2.0
"""Packs a run for the player, decimated to fit a page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against
from locfuse.report.decimation import stride
from locfuse.report.palette import BAND_SIGMAS, ELLIPSE_SIGMAS
from locfuse.report.player.messages import messages_part
from locfuse.report.player.parts import Part, encoded, encoded_bytes, shares, table_part
from locfuse.report.player.world import world_of
from locfuse.report.text import seconds, start_ns
from locfuse.types import (
    NANOSECONDS,
    Columns,
    FloatArray,
    Frame,
    Health,
    Log,
    RunResult,
    Trajectory,
)

MAX_BYTES = 4_000_000  # of a packed run as JSON

_MIN_BEAMS = 90  # per scan; beyond that whole scans are dropped
_MIN_PARTICLES = 300  # per cloud; beyond that whole clouds are dropped
_LEVELS = 65535  # of a coordinate of a particle
_METRICS = ("position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg",
            "nees_mean", "nees_dof")  # fmt: skip


def pack(
    result: RunResult,
    *,
    particles: Sequence[Frame] | None = None,
    max_bytes: int = MAX_BYTES,
    whole: bool = True,
) -> dict[str, Any]:
    """Return the data of a run for the player, ready for JSON.

    Parameters
    ----------
    result : RunResult
    particles : sequence of Frame, optional
        In order of time, instead of those of the run.
    max_bytes : int
        Maximum size of the JSON. Longer tables are decimated evenly; their ends stay, and rejected
        messages are dropped last. The key ``of`` of each table is its number of rows before.
    whole : bool
        False for a run that is still computing.

    Returns
    -------
    dict
        Times are seconds since ``start_ns``, the first message or estimate; lengths are metres,
        angles radians. Arrays are base64 of little-endian numbers, with their shape.

    Raises
    ------
    ValueError
        If the run has neither estimates nor messages, or the map and the names alone take more
        than `max_bytes`.
    """
    origin = start_ns(result)
    stamps = [s for s in (result.estimate.stamp_ns, result.outcomes.stamp_ns) if len(s)]
    fixed = {
        "name": str(result.config.get("name") or result.log.description or "run"),
        "start_ns": str(origin),  # as text: exceeds the integers of JavaScript
        "whole": whole,
        "start": 0.0,
        "end": (max(int(s.max()) for s in stamps) - origin) / NANOSECONDS,
        "ellipse_sigmas": ELLIPSE_SIGMAS,
        "band_sigmas": BAND_SIGMAS,
        "metrics": {key: result.metrics.get(key) for key in _METRICS},
        "events": _events(result, origin),
        **world_of(result, max_bytes // 4),
    }
    parts = _parts(result, result.frames if particles is None else particles, origin)
    words, parts["messages"] = messages_part(result, origin)
    fixed |= words
    dofs = np.unique(result.outcomes.dof[result.outcomes.dof > 0]).tolist()
    fixed["bands"] = {str(dof): band(dof) for dof in dofs}
    left = max_bytes - len(json.dumps(fixed)) - 200 * (len(parts) + 1)
    if left < 0:
        raise ValueError(f"max_bytes is {max_bytes}, but the map and the names of this run alone "
                         f"take {max_bytes - left}")  # fmt: skip
    given = shares({name: part.wanted for name, part in parts.items()}, left)
    return fixed | {name: part.packed(given[name]) for name, part in parts.items()}


def _parts(result: RunResult, particles: Sequence[Frame], origin: int) -> dict[str, Part]:
    parts = {"estimate": _track(result.estimate, origin)}
    if result.truth is not None and len(result.truth):
        parts["truth"] = _track(result.truth, origin)
        parts["errors"] = _errors(result, origin)
    if result.health is not None and len(result.health):
        parts["health"] = _health(result.health, origin)
    if "scans" in result.log and result.log.has_laser:
        parts["scans"] = _scans(result, origin)
    if particles:
        parts["particles"] = _particles(particles, origin)
    return parts


def _track(track: Trajectory, origin: int) -> Part:
    unknown = np.full(len(track), np.nan, np.float32)
    columns: dict[str, NDArray[Any]] = {
        "t": seconds(track.stamp_ns, origin),
        "x": track.position[:, 0],
        "y": track.position[:, 1],
        "heading": unknown if track.heading is None else track.heading.astype(np.float32),
    }
    if track.covariance is not None:
        P = track.covariance.astype(np.float32)
        columns["covariance"] = np.stack([P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]], axis=1)
        columns["sigma_heading"] = np.sqrt(np.maximum(P[:, 2, 2], 0.0))
    if track.height is not None:
        columns["height"] = track.height.astype(np.float32)
    if track.height_variance is not None:
        columns["sigma_height"] = np.sqrt(track.height_variance).astype(np.float32)
    return table_part(columns, np.zeros(len(track), np.bool_))


def _errors(result: RunResult, origin: int) -> Part:
    """Return estimate minus truth, with the claimed sigmas; keeps the largest error."""
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    n = len(errors)
    heading = np.full(n, np.nan) if errors.heading is None else errors.heading
    columns: dict[str, NDArray[Any]] = {
        "t": seconds(errors.stamp_ns, origin),
        "error": np.column_stack([errors.position, heading]).astype(np.float32),
    }
    if errors.sigma is not None:
        columns["sigma"] = errors.sigma.astype(np.float32)
    keep = np.zeros(n, np.bool_)
    if n:
        keep[np.argmax(np.hypot(*errors.position.T))] = True
    return table_part(columns, keep)


def _health(health: Health, origin: int) -> Part:
    states, state = np.unique(health.state, return_inverse=True)
    reasons, reason = np.unique(health.reason, return_inverse=True)
    columns: dict[str, NDArray[Any]] = {
        "t": seconds(health.stamp_ns, origin),
        "state": state.astype(np.uint8),
        "within": health.within.astype(np.float32),
        "reason": reason.astype(np.uint16),
    }
    edge = np.concatenate([[True], state[1:] != state[:-1]])
    table = table_part(columns, edge | np.append(edge[1:], True))
    names = {"states": states.tolist(), "reasons": reasons.tolist()}
    return Part(table.wanted + len(json.dumps(names)),
                lambda most: names | table.packed(most - len(json.dumps(names))))  # fmt: skip


def _scans(result: RunResult, origin: int) -> Part:
    """Return the scans in whole centimetres, 0 where a beam has no return, and of which laser."""
    table = result.log["scans"]
    ranges, lasers, of = _regular(result.log)
    n, beams = ranges.shape
    reach = np.array([laser["range_max_m"] for laser in lasers])[of, None]

    def packed(max_bytes: int) -> dict[str, Any]:
        most = max(max_bytes * 3 // 4, 1)
        fine = min(beams, max(_MIN_BEAMS, (most // max(n, 1) - 9) // 2))
        step = -(-beams // fine)
        shown = -(-beams // step)
        rows = _of_each(of, len(lasers), max(2, most // (2 * shown + 9)))
        part = ranges[rows, ::step]
        hit = np.isfinite(part) & (part > 0.0) & (part < reach[rows]) & (part < 655.0)
        return {
            "of": n,
            "t": encoded(seconds(table["stamp_ns"][rows], origin)),
            "laser": encoded(of[rows]),
            "ranges_cm": encoded(np.where(hit, np.round(100.0 * part), 0.0).astype(np.uint16)),
            "lasers": [
                {
                    "angle_min": float(laser["angle_min_rad"]),
                    "angle_increment": step * float(laser["angle_increment_rad"]),
                    "mount": [float(value) for value in laser["pose_in_body"]],
                }
                for laser in lasers
            ],
        }

    return Part(encoded_bytes(n * (2 * beams + 9)), packed)


def _of_each(of: NDArray[np.uint8], lasers: int, most: int) -> NDArray[np.intp]:
    """Return at most so many rows, evenly spaced among those of each laser."""
    rows = [np.flatnonzero(of == laser) for laser in range(lasers)]
    kept = [own[stride(len(own), max(2, most * len(own) // len(of)))] for own in rows]
    return np.sort(np.concatenate(kept))


def _regular(log: Log) -> tuple[FloatArray, list[Mapping[str, Any]], NDArray[np.uint8]]:
    """Return ranges (n, beams), the geometry of each laser, and which one a scan is of, (n,).

    Where scans of a laser differ, its geometry is that of the one with the most beams; the others
    have for each of these the beam that is nearest.
    """
    scans = log["scans"]
    names = scans.get("laser", np.full(len(scans["stamp_ns"]), ""))
    own, of = np.unique(names, return_inverse=True)
    ranges: FloatArray = scans["ranges_m"].copy()
    lasers = []
    for laser in range(len(own)):
        rows = np.flatnonzero(of == laser)
        widest = rows[int(np.argmax(scans["beams"][rows]))] if "beams" in scans else rows[0]
        lasers.append(log.scan_geometry(int(widest))[0])
        if "beams" in scans:
            ranges[rows] = _nearest_beams(scans, rows, int(widest))
    return ranges, lasers, of.astype(np.uint8)


def _nearest_beams(scans: Columns, rows: NDArray[np.intp], widest: int) -> FloatArray:
    """Return the ranges of some rows with the geometry of one scan, NaN after its last beam."""
    ranges, count = scans["ranges_m"][rows], scans["beams"][rows, None]
    start, step = (scans[key][rows, None] for key in ("angle_min_rad", "angle_increment_rad"))
    first, width = scans["angle_min_rad"][widest], scans["angle_increment_rad"][widest]
    at = np.arange(ranges.shape[1])
    beam = np.rint((first + width * at - start) / step).astype(np.intp)
    there = (beam >= 0) & (beam < count) & (at < scans["beams"][widest])
    nearest = np.take_along_axis(ranges, np.clip(beam, 0, ranges.shape[1] - 1), axis=1)
    return np.where(there, nearest, np.nan)


def _particles(frames: Sequence[Frame], origin: int) -> Part:
    """Return particle clouds as 16-bit coordinates in a box around them all."""
    clouds = [frame.particles[:, :2] for frame in frames]
    sizes = np.array([len(cloud) for cloud in clouds])
    low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0)
    high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0)
    scale = np.where(high > low, high - low, 1.0) / _LEVELS

    def packed(max_bytes: int) -> dict[str, Any]:
        most = max_bytes * 3 // 16
        each = max(_MIN_PARTICLES, most // len(frames))
        rows = stride(len(frames), max(2, most // int(max(1, np.minimum(sizes, each).mean()))))
        thin = [clouds[row][:: -(-len(clouds[row]) // each)] for row in rows]
        at = np.concatenate([np.round((cloud - low) / scale) for cloud in thin])
        stamps = np.array([frames[row].stamp_ns for row in rows], np.int64)
        return {
            "of": len(frames),
            "t": encoded(seconds(stamps, origin)),
            "first": encoded(np.cumsum([0, *map(len, thin)]).astype(np.uint32)),
            "xy": encoded(at.astype(np.uint16)),
            "low": low.tolist(),
            "scale": scale.tolist(),
            "ready": encoded(np.array([frames[row].ready for row in rows]).astype(np.uint8)),
        }

    return Part(encoded_bytes(4 * int(sizes.sum()) + 16 * len(frames)), packed)


def _events(result: RunResult, origin: int) -> list[dict[str, Any]]:
    """Return the events of the estimator: pose found, lost, switched to UWB."""
    events: list[tuple[int, str]] = []
    if result.start is not None:
        events.append((result.start.stamp_ns, "pose found from nothing"))
    for row in np.flatnonzero(result.outcomes.source == "switch").tolist():
        why = str(result.outcomes.reason[row]).split(":", 1)[0]
        events.append((int(result.outcomes.stamp_ns[row]), f"UWB took over: {why}"))
    if result.health is not None:
        events += _losses(result.health)
    if result.watched is not None:
        events += _losses(result.watched, "watched poses ", "no longer lost")
    return [{"t": (stamp - origin) / NANOSECONDS, "text": text} for stamp, text in sorted(events)]


def _losses(health: Health, of: str = "", found: str = "found again") -> list[tuple[int, str]]:
    lost = np.concatenate([[False], health.state == "lost"])
    events = []
    for row in np.flatnonzero(lost[1:] != lost[:-1]).tolist():
        text = of + (f"lost: {health.reason[row]}" if lost[row + 1] else found)
        events.append((int(health.stamp_ns[row]), text))
    return events[:1000]
