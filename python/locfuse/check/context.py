# SPDX-License-Identifier: Apache-2.0
"""What the checks look at: a configuration, its log, and what both imply."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from locfuse.check.grid import bounds
from locfuse.check.headings import heading_error
from locfuse.check.positions import epochs, interpolated, located, residuals_of
from locfuse.config.schema import SOURCES, Estimator, RangeError, RunConfig
from locfuse.eval.dead_reckoning import Track, align, at_times, dead_reckon, levered
from locfuse.run.messages import corrected, truth_of
from locfuse.types import NANOSECONDS, Columns, FloatArray, Log, StampArray, Trajectory

_MIN_EPOCHS = 10
_MAX_ROWS = 20000


@dataclass(frozen=True)
class Fits:
    """Positions of one tag from its ranges alone, epoch by epoch.

    Metres. `ranges` (n, m) are corrected as configured, NaN where missing, and interpolated if to
    one anchor at a time. `position` (n, 2) is the tag's in world, by the ranges that agree;
    `explained` (n,) is whether enough of them do. `residual` (n, m) is range minus distance;
    `height` is the tag's; `stamp_ns` is (n,).
    """

    tag: str
    height: float
    stamp_ns: StampArray
    ranges: FloatArray
    position: FloatArray
    residual: FloatArray
    explained: NDArray[np.bool_]


@dataclass(frozen=True)
class Residuals:
    """Range minus distance, row by row.

    `against` says for people what the distance was taken from. Arrays are (n,), distances
    in metres. `freedom` is the share of the scatter that the fit left over; 1 against truth.
    `contradictory` is the share of moments left out as no position explains them; 0 against truth.
    """

    against: str
    anchor: NDArray[np.intp]
    distance: FloatArray
    value: FloatArray
    freedom: float
    contradictory: float = 0.0


@dataclass(frozen=True)
class Context:
    """A configuration with its log."""

    config: RunConfig
    log: Log

    def table(self, source: str) -> Columns | None:
        """Return a table of the log that has rows."""
        found = self.log.tables.get(source)
        return None if found is None or len(next(iter(found.values()))) == 0 else found

    def used(self, source: str) -> Columns | None:
        """Return the messages of a source that the configuration uses, None without any."""
        return self.table(source) if source in self.config.use else None

    def fused(self, source: str) -> Columns | None:
        """Return the same of a source that is fused: poses may be judged only."""
        is_watched = source == "poses" and self.config.watch_poses
        return None if is_watched else self.used(source)

    @property
    def models(self) -> Estimator:
        """Wheels and sensors."""
        return self.config.estimator

    @property
    def by_particles(self) -> bool:
        """Whether particles alone fuse all messages."""
        mcl = self.config.mcl
        return mcl is not None and mcl.poses_hz is None and mcl.switch is None

    @cached_property
    def names(self) -> list[str]:
        """Names of the anchors."""
        table = self.table("anchors")
        return [] if table is None else [str(name) for name in table["anchor"]]

    @cached_property
    def anchors(self) -> FloatArray:
        """Places of the anchors, shape (m, 3)."""
        table = self.table("anchors")
        if table is None:
            return np.empty((0, 3))
        return np.column_stack([table["x_m"], table["y_m"], table["z_m"]]).astype(np.float64)

    @cached_property
    def truth(self) -> Trajectory | None:
        """Reference trajectory."""
        return None if self.table("truth") is None else truth_of(self.log)

    @cached_property
    def placed_truth(self) -> Trajectory | None:
        """Reference trajectory, without headings if odometry contradicts them grossly."""
        truth = self.truth
        if truth is None or len(truth) < 2 or truth.heading is None:
            return truth
        found = heading_error(self.odometry, Track("truth.csv", truth))
        is_wrong = found is not None and found.is_gross
        return Trajectory(truth.stamp_ns, truth.position, None) if is_wrong else truth

    @cached_property
    def extent(self) -> float:
        """Largest side of the box around the anchors, metres; 0 without anchors."""
        if len(self.anchors) == 0:
            return 0.0
        return float(np.ptp(self.anchors[:, :2], axis=0).max())

    @cached_property
    def floor(self) -> tuple[FloatArray, FloatArray] | None:
        """Corners of the floor: the room of a simulation, the map, or a box around what is known.

        That is anchors and truth; None without any.
        """
        if self.config.simulation is not None:
            return np.zeros(2), np.array(self.config.simulation.room_m)
        if self.log.grid is not None:
            return bounds(self.log.grid)
        shown = [self.anchors[:, :2]]
        if self.truth is not None:
            shown.append(self.truth.position)
        points = np.vstack(shown)
        if len(points) == 0:
            return None
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.05 * max(float((high - low).max()), 1.0)
        return low - margin, high + margin

    @cached_property
    def height(self) -> float:
        """Height of the tag that speaks most, metres; 0 without tags."""
        name = self.main_tag or next(iter(self.log.tags), None)
        return self.log.tags[name][2] if name is not None else 0.0

    @cached_property
    def main_tag(self) -> str | None:
        """The placed tag with most ranges."""
        table = self.table("ranges")
        if table is None:
            return None
        names, counts = np.unique(table["tag"], return_counts=True)
        order = sorted(zip(counts.tolist(), names.tolist(), strict=True), reverse=True)
        return next((str(name) for _, name in order if name in self.log.tags), None)

    @cached_property
    def arms(self) -> dict[str, FloatArray]:
        """Places (2,) on the body of the tags whose ranges or positions are used."""
        received: set[str] = set()
        for source in ("ranges", "positions"):
            table = self.used(source)
            if table is not None and "tag" in table:
                received |= set(table["tag"].tolist())
        return {name: np.array(at[:2]) for name, at in self.log.tags.items() if name in received}

    @cached_property
    def begin_ns(self) -> int:
        """First stamp of what is used."""
        tables = (self.used(source) for source in SOURCES)
        return min((int(table["stamp_ns"].min()) for table in tables if table is not None),
                   default=0)  # fmt: skip

    @cached_property
    def duration_s(self) -> float:
        """From the first to the last stamp of what is used."""
        tables = (self.used(source) for source in SOURCES)
        last = max((int(table["stamp_ns"].max()) for table in tables if table is not None),
                   default=0)  # fmt: skip
        return (last - self.begin_ns) / NANOSECONDS

    @cached_property
    def antennas(self) -> tuple[Columns, tuple[float, float]] | None:
        """Positions of one antenna, and its place on the body; of several tags, the one of most."""
        table = self.used("positions")
        if table is None:
            return None
        antenna = self.models.position
        lever = (antenna.antenna_forward_m, antenna.antenna_left_m)
        names, counts = np.unique(table.get("tag", np.full(len(table["x_m"]), "")),
                                  return_counts=True)  # fmt: skip
        most = str(names[int(np.argmax(counts))])
        if most in self.arms:
            lever = (float(self.arms[most][0]), float(self.arms[most][1]))
        return _rows(table, table["tag"] == most) if "tag" in table else table, lever

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """Which ranges are from a known tag to a known anchor."""
        table = self.table("ranges")
        if table is None:
            return np.empty(0, np.bool_)
        known: NDArray[np.bool_] = np.isin(table["anchor"], self.names) & np.isin(
            table["tag"], list(self.log.tags)
        )
        return known

    def index(self, anchor: NDArray[np.str_]) -> NDArray[np.intp]:
        """Return the index of each anchor of a column; all of them must be known."""
        order = np.argsort(self.names)
        found = np.searchsorted(np.array(self.names)[order], anchor)
        place: NDArray[np.intp] = order[found]
        return place

    def corrected(self, table: Columns) -> FloatArray:
        """Return ranges without the offset and the scale that the configuration gives."""
        rest = self.config.anchors.get("all", RangeError())
        errors = [self.config.anchors.get(name, rest) for name in self.names]
        index = self.index(table["anchor"])
        offset, scale = (np.array([getattr(e, k) for e in errors]) for k in ("offset_m", "scale"))
        distance: FloatArray = (table["range_m"] - offset[index]) / scale[index]
        return distance

    def sigma_of(self, table: Columns, distance: FloatArray) -> FloatArray:
        """Return the standard deviation that the filter takes for each range."""
        if "sigma_m" in table:
            return np.asarray(table["sigma_m"], np.float64)
        noise = self.models.range
        sigma: FloatArray = np.hypot(noise.sigma_m, noise.sigma_relative * distance)
        return sigma

    @cached_property
    def typical_sigma(self) -> float:
        """Median standard deviation that the filter takes for a range, metres."""
        table = self.used("ranges")
        if table is not None and self.placed.any():
            rows = {key: values[self.placed] for key, values in table.items()}
            return float(np.median(self.sigma_of(rows, self.corrected(rows))))
        noise = self.models.range
        return float(np.hypot(noise.sigma_m, noise.sigma_relative * 0.5 * self.extent))

    @cached_property
    def fits(self) -> Fits | None:
        """Positions from ranges alone, None if there are too few."""
        table = self.used("ranges")
        if table is None or self.main_tag is None or len(self.anchors) < 3:
            return None
        mine = self.placed & (table["tag"] == self.main_tag)
        rows = {key: values[mine] for key, values in table.items()}
        if not len(rows["stamp_ns"]):
            return None
        order = np.argsort(rows["stamp_ns"], kind="stable")
        rows = {key: values[order] for key, values in rows.items()}
        index = self.index(rows["anchor"])
        distance = self.corrected(rows)
        for grouped in (epochs, interpolated):
            stamp, ranges = grouped(rows, index, distance, len(self.anchors))
            found, _, explained = located(self.anchors, ranges, self.typical_sigma,
                                         height=self.height)  # fmt: skip
            good = np.isfinite(found[:, 0])
            if np.count_nonzero(good) >= _MIN_EPOCHS:
                at, ranges = found[good], ranges[good]
                left = residuals_of(self.anchors, ranges, at, self.height)
                return Fits(self.main_tag, self.height, stamp[good], ranges, at, left,
                            explained[good])  # fmt: skip
        return None

    @cached_property
    def odometry(self) -> Trajectory | None:
        """Dead reckoning from the origin, without the errors that the configuration knows."""
        table = self.used("odometry")
        if table is None or len(table["stamp_ns"]) < 2:
            return None
        return dead_reckon({**table, **corrected(table, self.models.odometry)})

    @cached_property
    def references(self) -> list[Track]:
        """Other references of the robot's position, best first."""
        found = []
        if self.truth is not None and len(self.truth) > 1:
            found.append(Track("truth.csv", self.truth))
        poses = self.used("poses")
        if poses is not None:
            found.append(Track("poses.csv", _path_of(poses), (0.0, 0.0)))
        if self.antennas is not None:
            table, lever = self.antennas
            found.append(Track("positions.csv", _path_of(table), lever))
        if self.fits is not None:
            x, y, _ = self.log.tags[self.fits.tag]
            path = _increasing(self.fits.stamp_ns, self.fits.position, None)
            found.append(Track("ranges.csv", path, (x, y)))
        return [track for track in found if len(track.path) > 1]

    @cached_property
    def frame_of_truth(self) -> tuple[float, FloatArray] | None:
        """Turn and shift from the anchors' frame to that of the truth, None if they are the same.

        Judged by positions from ranges: the frames differ if a rigid motion lays them on the truth
        three times better, and they are off by more than the scatter without it.
        """
        if self.fits is None or self.placed_truth is None or len(self.placed_truth) < 2:
            return None
        stamp, truth = self.fits.stamp_ns, self.placed_truth
        inside = (stamp >= truth.stamp_ns[0]) & (stamp <= truth.stamp_ns[-1])
        inside &= self.fits.explained
        if np.count_nonzero(inside) < _MIN_EPOCHS:
            return None
        x, y, _ = self.log.tags[self.fits.tag]
        poses = at_times(truth, stamp[inside])
        fixed = levered(poses, (x, y) if truth.heading is not None else (0.0, 0.0))
        moved = self.fits.position[inside]
        before = float(np.median(np.linalg.norm(moved - fixed, axis=1)))
        fit = align(moved, fixed)
        c, s = np.cos(fit.angle), np.sin(fit.angle)
        turn = np.array([[c, -s], [s, c]])
        shift = np.median(fixed - moved @ turn.T, axis=0)
        after = float(np.median(np.linalg.norm(moved @ turn.T + shift - fixed, axis=1)))
        if fit.spread < 0.5 or before < max(0.5, 5.0 * self.typical_sigma) or after > before / 3.0:
            return None
        return fit.angle, shift

    @cached_property
    def residuals(self) -> Residuals | None:
        """Ranges against the truth where it is known, else against positions from ranges."""
        if self.frame_of_truth is None:
            found = self.against_truth()
            if found is not None:
                return found
        if self.fits is None:
            return None
        explained = self.fits.explained
        epoch, anchor = np.nonzero(np.isfinite(self.fits.residual) & explained[:, None])
        free = 1.0 - 2.0 * np.count_nonzero(explained) / max(len(epoch), 1)
        value = self.fits.residual[epoch, anchor]
        distance = self.fits.ranges[epoch, anchor] - value
        return Residuals("the best position of each moment", anchor, distance, value, free,
                         1.0 - float(np.mean(explained)))  # fmt: skip

    def against_truth(self, shift_ns: int = 0) -> Residuals | None:
        """Return ranges against the truth, whose clock reads `shift_ns` more; None without."""
        truth = self.placed_truth
        return None if truth is None else self._against_truth(truth, shift_ns)

    def _against_truth(self, truth: Trajectory, shift_ns: int) -> Residuals | None:
        table = self.used("ranges")
        if table is None or len(truth) < 2:
            return None
        at = table["stamp_ns"] + shift_ns
        rows = self.placed & (at >= truth.stamp_ns[0]) & (at <= truth.stamp_ns[-1])
        levers = np.array([self.log.tags.get(str(n), (0.0, 0.0, 0.0)) for n in table["tag"]])
        if truth.heading is None:
            rows &= np.hypot(levers[:, 0], levers[:, 1]) < 0.05
        chosen = np.flatnonzero(rows)
        chosen = chosen[:: max(1, len(chosen) // _MAX_ROWS)]
        if len(chosen) < _MIN_EPOCHS:
            return None
        part = {key: values[chosen] for key, values in table.items()}
        poses, lever = at_times(truth, at[chosen]), levers[chosen]
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x = poses[:, 0] + c * lever[:, 0] - s * lever[:, 1]
        y = poses[:, 1] + s * lever[:, 0] + c * lever[:, 1]
        index = self.index(part["anchor"])
        off = np.column_stack([x, y, lever[:, 2]]) - self.anchors[index]
        distance = np.linalg.norm(off, axis=1)
        return Residuals("truth.csv", index, distance, self.corrected(part) - distance, 1.0)


def _rows(table: Columns, chosen: NDArray[np.bool_]) -> Columns:
    return {key: values[chosen] for key, values in table.items()}


def _path_of(table: Columns) -> Trajectory:
    position = np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64)
    return _increasing(table["stamp_ns"], position, table.get("heading_rad"))


def _increasing(stamp: StampArray, position: FloatArray, heading: FloatArray | None) -> Trajectory:
    """Return a trajectory of rows in any order; of equal stamps the first stays."""
    _, rows = np.unique(stamp, return_index=True)
    return Trajectory(stamp[rows], position[rows], None if heading is None else heading[rows])
