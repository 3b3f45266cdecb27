# SPDX-License-Identifier: Apache-2.0
"""Exports a run for the rerun viewer: every row, on a timeline of seconds since the start."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against, interpolate
from locfuse.io.whole import whole_file
from locfuse.report.palette import ANCHOR, ELLIPSE_SIGMAS, ESTIMATE, MUTED, REJECTED, TRUTH
from locfuse.report.player.messages import seen_of
from locfuse.report.text import start_ns
from locfuse.types import ConfigError, FloatArray, GridMap, Log, RunResult, StampArray, Trajectory

_SCAN = "#B0407F"
_ARROW_M = 0.5
_REJECTED_VERDICTS = ("gated", "not_modelled", "implausible")


def check_rerun(path: Path) -> None:
    """Raise ConfigError before the work if the recording cannot be written.

    The path must end in ``.rrd``, and rerun must be installed.
    """
    if path.suffix.lower() != ".rrd":
        raise ConfigError(f"{path}: a rerun recording needs a name that ends in .rrd")
    _library()


def write_rerun(result: RunResult, path: Path) -> Path:
    """Write a run for the rerun viewer.

    The path ends in ``.rrd``; it is returned. Below ``world`` are map, anchors, landmarks, truth,
    estimate with its ellipse, scan, ranges and particles; ``nis``, ``health`` and ``error`` are
    curves and ``messages`` lists the rejected ones with their reasons. Raises ConfigError as
    `check_rerun`.
    """
    check_rerun(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        _write(_library(), result, part)
    return path


def _write(rr: Any, result: RunResult, part: Path) -> None:
    stream = rr.RecordingStream("locfuse")
    stream.save(part, default_blueprint=_blueprint(rr, result))
    stream.send_recording_name(str(result.config.get("name") or "run"))
    writer = _Writer(rr, stream, start_ns(result))
    writer.world(result.log)
    writer.track("world/estimate", result.estimate, ESTIMATE)
    if result.truth is not None and len(result.truth):
        writer.track("world/truth", result.truth, TRUTH)
        writer.errors(result)
    if result.estimate.covariance is not None:
        writer.ellipse(result.estimate)
    if "scans" in result.log and result.log.has_laser:
        writer.scans(result.log, result.estimate)
    writer.ranges(result)
    writer.particles(result)
    writer.nis(result)
    writer.health(result)
    writer.messages(result)
    stream.flush()
    stream.disconnect()


def _library() -> Any:
    try:
        return importlib.import_module("rerun")
    except ModuleNotFoundError as error:
        raise ConfigError("--rerun needs the package rerun-sdk: pip install 'locfuse[rerun]' "
                          f"(there is no module {error.name})") from error  # fmt: skip


def _blueprint(rr: Any, result: RunResult) -> Any:
    """Return the initial layout of the viewer: world at the left, curves and texts at the right."""
    b = importlib.import_module("rerun.blueprint")
    curves = [b.TimeSeriesView(origin="nis", name="NIS")]
    if result.truth is not None:
        curves.insert(0, b.TimeSeriesView(origin="error", name="estimate minus truth"))
    if result.health is not None:
        curves.append(b.TimeSeriesView(origin="health", name="health"))
    words = b.TextLogView(origin="messages", name="rejected")
    return b.Blueprint(b.Horizontal(b.Spatial3DView(origin="world", name="world"),
                                    b.Vertical(*curves, words), column_shares=[3, 2]))  # fmt: skip


class _Writer:
    """Sends the parts of a run; z is 0 for everything but anchors and landmarks."""

    def __init__(self, rr: Any, stream: Any, origin_ns: int) -> None:
        self._rr = rr
        self._stream = stream
        self._origin_ns = origin_ns

    def world(self, log: Log) -> None:
        rr = self._rr
        self._always("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        if log.grid is not None:
            self._map(log.grid)
        for stem, name, colour in (("anchors", "anchor", ANCHOR), ("landmarks", "landmark", MUTED)):
            if stem not in log or len(log[stem][name]) == 0:
                continue
            table = log[stem]
            z = table.get("z_m", np.zeros(len(table[name])))
            at = np.column_stack([table["x_m"], table["y_m"], z])
            points = rr.Points3D(at, labels=table[name].tolist(), colors=_rgb(colour), radii=0.08)
            self._always(f"world/{stem}", points)

    def _map(self, grid: GridMap) -> None:
        height, width = grid.cells.shape
        x, y, yaw = grid.origin
        drawn = self._rr.GridMap(
            data=grid.cells[::-1].tobytes(),  # a picture begins at its top, a map at its bottom
            format=self._rr.components.ImageFormat(width=width, height=height, color_model="L",
                                                   channel_datatype="U8"),
            cell_size=grid.resolution_m,
            translation=[x, y, -0.01],
            quaternion=self._rr.Quaternion(xyzw=[0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)]),
            colormap=self._rr.components.Colormap.RvizMap,
        )  # fmt: skip
        self._always("world/map", drawn)

    def track(self, entity: str, track: Trajectory, colour: str) -> None:
        rr, at = self._rr, _flat(track.position)
        path = rr.LineStrips3D([at], colors=_rgb(colour), radii=0.01)
        self._always(f"{entity}/path", path)
        self._always(entity, rr.Points3D.from_fields(colors=_rgb(colour), radii=0.1))
        self._send(entity, track.stamp_ns, rr.Points3D.columns(positions=at))
        if track.heading is None:
            return
        ahead = _flat(_ARROW_M * np.column_stack([np.cos(track.heading), np.sin(track.heading)]))
        self._always(f"{entity}/heading", rr.Arrows3D.from_fields(colors=_rgb(colour)))
        self._send(f"{entity}/heading", track.stamp_ns,
                   rr.Arrows3D.columns(origins=at, vectors=ahead))  # fmt: skip

    def ellipse(self, track: Trajectory) -> None:
        assert track.covariance is not None
        values, vectors = np.linalg.eigh(track.covariance[:, :2, :2])
        half = ELLIPSE_SIGMAS * np.sqrt(np.maximum(values[:, ::-1], 0.0))
        turn = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]) / 2.0
        nothing = np.zeros(len(turn))
        self._outlines("world/estimate/ellipse", ESTIMATE)
        self._send("world/estimate/ellipse", track.stamp_ns, self._rr.Ellipsoids3D.columns(
            centers=_flat(track.position),
            half_sizes=_flat(half),
            quaternions=np.column_stack([nothing, nothing, np.sin(turn), np.cos(turn)]),
        ))  # fmt: skip

    def scans(self, log: Log, estimate: Trajectory) -> None:
        """Send the ends of beams of each laser, from its estimated pose."""
        names = log["scans"].get("laser", np.full(len(log["scans"]["stamp_ns"]), ""))
        for name in np.unique(names).tolist():
            entity = f"world/scan/{name}" if name else "world/scan"
            self._scans_of(entity, log, np.flatnonzero(names == name), estimate)

    def _scans_of(
        self, entity: str, log: Log, rows: NDArray[np.intp], estimate: Trajectory
    ) -> None:
        laser, _ = log.scan_geometry(int(rows[0]))
        table = {name: column[rows] for name, column in log["scans"].items()}
        at, inside = interpolate(estimate, table["stamp_ns"])
        if len(at) == 0:
            return
        assert at.heading is not None
        ranges: FloatArray = table["ranges_m"][inside]
        x, y, mount = (float(value) for value in laser["pose_in_body"])
        first, step = (table.get(key, np.full(len(inside), laser[key]))[inside, None]
                       for key in ("angle_min_rad", "angle_increment_rad"))  # fmt: skip
        beam = first + step * np.arange(ranges.shape[1])
        angle = at.heading[:, None] + mount + beam
        c, s = np.cos(at.heading)[:, None], np.sin(at.heading)[:, None]
        px = at.position[:, :1] + c * x - s * y + ranges * np.cos(angle)
        py = at.position[:, 1:] + s * x + c * y + ranges * np.sin(angle)
        hit = np.isfinite(ranges) & (ranges > 0.0) & (ranges < laser["range_max_m"])
        points = np.column_stack([px[hit], py[hit]])
        self._clouds(entity, _SCAN, at.stamp_ns, points, hit.sum(axis=1))

    def particles(self, result: RunResult) -> None:
        if result.frames:
            stamps = np.array([frame.stamp_ns for frame in result.frames], np.int64)
            points = np.concatenate([frame.particles[:, :2] for frame in result.frames])
            sizes = np.array([len(frame.particles) for frame in result.frames])
            self._clouds("world/particles", ESTIMATE, stamps, points, sizes)

    def ranges(self, result: RunResult) -> None:
        """Send each range as a circle around its anchor at the height of the tag."""
        outcomes, log = result.outcomes, result.log
        if "anchors" not in log:
            return
        seen = seen_of(result)[:, 0]
        table = log["anchors"]
        at = np.column_stack([table["x_m"], table["y_m"], table["z_m"]])
        height = {name: tag[2] for name, tag in log.tags.items()}
        for name, anchor in zip(table["anchor"].tolist(), at, strict=True):
            of = (outcomes.source == "ranges") & (outcomes.anchor == name) & np.isfinite(seen)
            rows = np.flatnonzero(of)
            if len(rows) == 0:
                continue
            up = anchor[2] - np.array([height.get(tag, 0.0) for tag in outcomes.tag[rows].tolist()])
            radius = np.sqrt(np.maximum(seen[rows] ** 2 - up**2, 0.0))
            colour = np.where(np.isin(outcomes.verdict[rows], _REJECTED_VERDICTS)[:, None],
                              _rgb(REJECTED), _rgb(ANCHOR))  # fmt: skip
            entity = f"world/ranges/{self._rr.escape_entity_path_part(name)}"
            self._outlines(entity, None)  # static colours would hide those of the rows
            self._send(entity, outcomes.stamp_ns[rows], self._rr.Ellipsoids3D.columns(
                centers=np.tile([anchor[0], anchor[1], 0.0], (len(rows), 1)),
                half_sizes=_flat(np.column_stack([radius, radius])),
                colors=colour.astype(np.uint8),
            ))  # fmt: skip

    def nis(self, result: RunResult) -> None:
        """Send NIS by source and degrees of freedom, with its 95 % band."""
        outcomes = result.outcomes
        compared = np.isfinite(outcomes.nis) & (outcomes.dof > 0)
        sources, dofs = outcomes.source[compared].tolist(), outcomes.dof[compared].tolist()
        for source, dof in sorted(set(zip(sources, dofs, strict=True))):
            rows = np.flatnonzero(compared & (outcomes.source == source) & (outcomes.dof == dof))
            entity = f"nis/{source}_{dof}"
            self._always(entity, self._rr.SeriesPoints(colors=_rgb(ESTIMATE), marker_sizes=2.0))
            stamps = outcomes.stamp_ns[rows]
            self._curve(entity, stamps, outcomes.nis[rows])
            ends = np.array([stamps.min(), stamps.max()])
            for name, limit in zip(("low", "high"), band(dof), strict=True):
                self._curve(f"{entity}_band_{name}", ends, np.full(2, limit))

    def health(self, result: RunResult) -> None:
        health = result.health
        if health is None or len(health) == 0:
            return
        self._curve("health/within", health.stamp_ns, health.within)
        self._curve("health/wrong", health.stamp_ns, health.wrong)
        edge = np.concatenate([[True], health.state[1:] != health.state[:-1]])
        changes = zip(health.state[edge].tolist(), health.reason[edge].tolist(), strict=True)
        texts = [f"{state.replace('_', ' ')}: {why}".removesuffix(": ") for state, why in changes]
        self._send("messages/health", health.stamp_ns[edge], self._rr.TextLog.columns(text=texts))

    def errors(self, result: RunResult) -> None:
        assert result.truth is not None
        errors = errors_against(result.estimate, result.truth)
        columns = {"x": errors.position[:, 0], "y": errors.position[:, 1]}
        if errors.heading is not None:
            columns["heading"] = errors.heading
        for name, column in columns.items():
            self._curve(f"error/{name}", errors.stamp_ns, column)

    def messages(self, result: RunResult) -> None:
        """Send the rejected messages with their reasons."""
        outcomes = result.outcomes
        rows = np.flatnonzero(
            np.isin(outcomes.verdict, _REJECTED_VERDICTS) & (outcomes.source != "scans")
        )
        texts = [
            f"{outcomes.source[row]} {outcomes.anchor[row]}".strip() + f": {outcomes.reason[row]}"
            for row in rows.tolist()
        ]
        if texts:
            columns = self._rr.TextLog.columns(text=texts, level=["WARN"] * len(texts))
            self._send("messages/turned_down", outcomes.stamp_ns[rows], columns)

    def _outlines(self, entity: str, colour: str | None) -> None:
        style = self._rr.Ellipsoids3D.from_fields(
            colors=None if colour is None else _rgb(colour),
            fill_mode=self._rr.components.FillMode.MajorWireframe,
        )
        self._always(entity, style)

    def _clouds(
        self, entity: str, colour: str, at: StampArray, points: FloatArray, sizes: NDArray[np.int64]
    ) -> None:
        """Send point clouds: `sizes` says how many of the points belong to each stamp."""
        self._always(entity, self._rr.Points3D.from_fields(colors=_rgb(colour), radii=0.03))
        columns = self._rr.Points3D.columns(positions=_flat(points)).partition(lengths=sizes)
        self._send(entity, at, columns)

    def _always(self, entity: str, what: Any) -> None:
        self._stream.log(entity, what, static=True)

    def _curve(self, entity: str, stamp_ns: StampArray, values: FloatArray) -> None:
        self._send(entity, stamp_ns, self._rr.Scalars.columns(scalars=values))

    def _send(self, entity: str, stamp_ns: StampArray, columns: Any) -> None:
        since = (stamp_ns - self._origin_ns).astype("timedelta64[ns]")
        self._stream.send_columns(entity, [self._rr.TimeColumn("time", duration=since)], columns)


def _flat(xy: FloatArray) -> NDArray[np.float32]:
    """Return points of the plane, (n, 2), in space."""
    return np.column_stack([xy, np.zeros(len(xy))]).astype(np.float32)


def _rgb(colour: str) -> list[int]:
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
