# SPDX-License-Identifier: Apache-2.0
"""Values that the rooms hand to one another: frozen dataclasses of arrays, checked, no more."""

from __future__ import annotations

import difflib
import os
import reprlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from locfuse import _core

FloatArray = NDArray[np.float64]
StampArray = NDArray[np.int64]
Columns = Mapping[str, NDArray[Any]]

NANOSECONDS = 1_000_000_000

QUATERNION = ("qw", "qx", "qy", "qz")  # of a rotation from body to world
FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # cells of a GridMap
_BY_RANK = np.array([FREE, UNKNOWN, OCCUPIED], np.int8)  # what a cell of several becomes: the last
_SLACK = 1e-9  # cells; edges closer than this to one another are the same
RESOLUTIONS_M = (1e-6, 1e6)  # least and most of a GridMap
FARTHEST_M = 1e9  # that a place may be from the origin of the world
MAX_SPEED_MPS = 100.0  # of what moves: beyond it numbers are in other units, or damaged


class LogError(ValueError):
    """A log folder or one of its files is wrong; the text names file, line and column."""


class ConfigError(ValueError):
    """A configuration is wrong; the text names the key and what is allowed."""


# What PyYAML raises, beside its own errors, for tags that do not fit (`!!bool 3`, `!!int ''`),
# impossible dates, numbers and characters, and brackets without end.
YAML_ERRORS = (ValueError, LookupError, AttributeError, TypeError, ArithmeticError, RecursionError)

_AXES = ("x_m", "y_m", "heading_rad")
MAX_REASON = 200  # letters; some errors of other libraries quote what they could not read

_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 100


def wrap_angle(angle: ArrayLike) -> FloatArray:
    """Return angles in [-pi, pi), radians; those already inside keep every bit."""
    given = np.asarray(angle, dtype=np.float64)
    turned = np.mod(given + np.pi, 2.0 * np.pi) - np.pi
    turned = np.where(turned >= np.pi, -np.pi, turned)  # mod may round up to a full turn
    return np.where((given >= -np.pi) & (given < np.pi), given, turned)


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return advice on a misspelt name: the nearest valid one, or all of them."""
    options = list(valid)
    found = difflib.get_close_matches(name, options, n=1, cutoff=0.5)
    return f"did you mean {found[0]!r}?" if found else f"expected {', '.join(options)}"


def shown(value: object) -> str:
    """Return a value as messages show it: of what is long or deep only a part."""
    try:
        return _SHORT.repr(value)
    except ValueError:
        return "an integer of too many digits"


def words(error: BaseException) -> str:
    """Return what an error says, on one line and not too long."""
    reason = f"no field {error}" if isinstance(error, KeyError) else str(error)
    return " ".join(reason.split())[:MAX_REASON]


def no_folder(path: Path) -> str:
    """Return why a path is not the folder that was expected."""
    exists = os.path.exists(path)  # of a name that is too long `Path.exists` raises OSError
    return f"{path}: is a file; expected a folder" if exists else f"{path}: no such folder"


class Shown:
    """A dataclass whose repr says what its fields are like, not every number."""

    def __repr__(self) -> str:
        named = ((f.name, getattr(self, f.name)) for f in fields(self) if f.repr)  # type: ignore[arg-type]
        parts = (f"{name}={_likeness(value)}" for name, value in named if value is not None)
        return f"{type(self).__name__}({', '.join(parts)})"


def _likeness(value: object) -> str:
    """Return what a value is like: of an array type and shape, of a mapping its keys."""
    if isinstance(value, np.ndarray):
        return f"{'str' if value.dtype.kind == 'U' else value.dtype}{value.shape}"
    if isinstance(value, Mapping):
        return f"{{{', '.join(map(shown, value))}}}"
    if isinstance(value, tuple) and value and isinstance(value[0], Shown):
        return f"{len(value)} of {type(value[0]).__name__}"
    return repr(value) if isinstance(value, Shown) else shown(value)


class Table(Shown, ABC):
    """Rows over time, or of landmarks, that are columns of equal length by themselves."""

    @abstractmethod
    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of the file of the same name in a folder of results, in its order.

        ``stamp_ns`` stands for ``stamp_s``. Not copies: do not write into them.
        """

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame of `columns`; ``stamp_s``, seconds, is the index.

        Raises ImportError if the package pandas is not installed.
        """
        try:
            pandas = import_module("pandas")
        except ModuleNotFoundError as error:
            raise ImportError("to_pandas needs the package pandas: pip install pandas") from error
        columns = self.columns()
        stamp_ns = columns.pop("stamp_ns", None)
        if stamp_ns is None:
            return pandas.DataFrame(columns)
        index = pandas.Index(stamp_ns / NANOSECONDS, name="stamp_s")
        return pandas.DataFrame(columns, index=index)

    def _repr_html_(self) -> str:
        return _page(self)


def _page(value: object) -> str:
    """Return what a notebook shows. The report, which draws it, is of a room above this one."""
    html: str = import_module("locfuse.report.notebook").html(value)
    return html


@dataclass(frozen=True, repr=False)
class Trajectory(Table):
    """Poses over time in the world frame.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
        Strictly increasing stamps in nanoseconds.
    position : float64 array, shape (n, 2)
        x and y in metres.
    heading : float64 array, shape (n,), or None
        Radians in [-pi, pi); None where only positions are known.
    covariance : float64 array, shape (n, 3, 3), or None
        Of (x, y, heading), position error in world; None where unknown.
    height : float64 array, shape (n,), or None
        Metres over z = 0 of the world; None in the plane.
    height_variance : float64 array, shape (n,), or None
        Square metres.
    orientation : float64 array, shape (n, 4), or None
        Unit quaternions (w, x, y, z) from body to world; None of a body that is taken as level.
    orientation_covariance : float64 array, shape (n, 3, 3), or None
        Of its error, a rotation about the axes of the world, in square radians.
    """

    stamp_ns: StampArray
    position: FloatArray
    heading: FloatArray | None = None
    covariance: FloatArray | None = None
    height: FloatArray | None = None
    height_variance: FloatArray | None = None
    orientation: FloatArray | None = None
    orientation_covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(self.stamp_ns)
        expected = {"position": (n, 2), "heading": (n,), "covariance": (n, 3, 3), "height": (n,),
                    "height_variance": (n,), "orientation": (n, 4),
                    "orientation_covariance": (n, 3, 3)}  # fmt: skip
        for name, shape in expected.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise ValueError(f"Trajectory.{name} has shape {value.shape}, expected {shape}")
        if n > 1 and not np.all(np.diff(self.stamp_ns) > 0):
            row = int(np.argmin(np.diff(self.stamp_ns) > 0)) + 1
            raise ValueError(f"Trajectory stamps must increase strictly; row {row} does not")

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of ``estimate.csv`` that are known."""
        found: dict[str, NDArray[Any]] = {"stamp_ns": self.stamp_ns}
        found["x_m"], found["y_m"] = self.position.T
        if self.heading is not None:
            found["heading_rad"] = self.heading
        if self.covariance is not None:
            for row, first in enumerate(names := ("x", "y", "heading")):
                for column, second in enumerate(names[row:], row):
                    found[f"cov_{first}_{second}"] = self.covariance[:, row, column]
        if self.height is not None:
            found["z_m"] = self.height
        if self.height_variance is not None:
            found["cov_z_z"] = self.height_variance
        if self.orientation is not None:
            found.update(zip(QUATERNION, self.orientation.T, strict=True))
        if (tilt := self.orientation_covariance) is not None:
            found["cov_tilt_x_x"], found["cov_tilt_x_y"] = tilt[:, 0, 0], tilt[:, 0, 1]
            found["cov_tilt_y_y"] = tilt[:, 1, 1]
        return found


def rows_of(track: Trajectory, rows: NDArray[Any]) -> Trajectory:
    """Return some rows of a trajectory, chosen by a mask or by indices that increase."""
    columns = (track.heading, track.covariance, track.height, track.height_variance,
               track.orientation, track.orientation_covariance)  # fmt: skip
    return Trajectory(
        track.stamp_ns[rows],
        track.position[rows],
        *(None if column is None else column[rows] for column in columns),
    )


@dataclass(frozen=True, repr=False)
class GridMap(Shown):
    """A floor plan of square cells.

    Attributes
    ----------
    cells : int8 array, shape (height, width)
        0 free, 100 occupied, -1 unknown. Row 0 is the row of the lowest y, column 0 that of the
        lowest x, in the frame of the map.
    resolution_m : float
        Length of a cell's side, 1e-6 to 1e6.
    origin : (x_m, y_m, yaw_rad)
        Pose in world of the map's frame: the outer corner of cell (0, 0). No number beyond 1e9.

    Raises
    ------
    ValueError
        If there is no cell, a cell holds another value, or a number is out of bounds.
    """

    cells: NDArray[np.int8]
    resolution_m: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.cells.ndim != 2 or self.cells.size == 0:
            shape = self.cells.shape
            raise ValueError(f"GridMap.cells has shape {shape}, expected (height, width)")
        if self.cells.dtype != np.int8:
            raise ValueError(f"GridMap.cells is an array of {self.cells.dtype}, expected int8")
        odd = ~np.isin(self.cells, (FREE, OCCUPIED, UNKNOWN))
        if odd.any():
            raise ValueError(f"GridMap.cells holds {self.cells[odd][0]}, expected 0, 100 or -1")
        least, most = RESOLUTIONS_M
        if not least <= self.resolution_m <= most:
            raise ValueError(
                f"GridMap.resolution_m is {self.resolution_m}, expected {least:g} to {most:g}"
            )
        if len(self.origin) != 3 or not np.all(np.abs(self.origin) <= FARTHEST_M):
            raise ValueError(
                f"GridMap.origin is {self.origin}, expected three numbers within {FARTHEST_M:g}"
            )

    def occupancy_grid(self) -> _core.OccupancyGrid:
        """Return the same as the C++ core takes it."""
        return _core.OccupancyGrid(self.cells, self.resolution_m, _core.Pose2(*self.origin))

    def to_grid(self, p_world: FloatArray) -> FloatArray:
        """Return points of shape (..., 2) in the frame of the map, in cells: column, row."""
        x, y, yaw = self.origin
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dy = p_world[..., 0] - x, p_world[..., 1] - y
        return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1) / self.resolution_m

    def to_world(self, p_grid: FloatArray) -> FloatArray:
        """Return points of shape (..., 2) in world, metres, of columns and rows."""
        x, y, yaw = self.origin
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dy = self.resolution_m * p_grid[..., 0], self.resolution_m * p_grid[..., 1]
        return np.stack([x + c * dx - s * dy, y + s * dx + c * dy], axis=-1)

    def cropped(self, low: tuple[float, float], high: tuple[float, float]) -> GridMap:
        """Return the part of the map that a box touches; its cells stay where they are.

        Parameters
        ----------
        low, high : (x, y)
            South-western and north-eastern corner of the box in world, metres. On a map that is
            turned the part reaches around the whole box.

        Raises
        ------
        ValueError
            If the box has no area, or touches no cell.

        Examples
        --------
        >>> grid = GridMap(np.array([[0, 100, -1]], np.int8), 0.5, (1.0, 2.0, 0.0))
        >>> part = grid.cropped((1.6, 0.0), (9.0, 9.0))
        >>> part.cells.tolist(), part.origin
        ([[100, -1]], (1.5, 2.0, 0.0))
        """
        box = np.array([low, high], dtype=np.float64)
        if not (np.all(np.isfinite(box)) and np.all(box[0] < box[1])):
            raise ValueError(f"a box from {low} to {high}, expected low < high in x and y")
        at = self.to_grid(np.stack(np.meshgrid(box[:, 0], box[:, 1]), axis=-1)).reshape(-1, 2).T
        size = np.array(self.cells.shape[::-1])
        first = np.clip(np.floor(at.min(axis=1) + _SLACK), 0, size).astype(np.intp)
        last = np.clip(np.ceil(at.max(axis=1) - _SLACK), 0, size).astype(np.intp)
        if not np.all(first < last):
            raise ValueError(f"a box from {low} to {high}, which touches no cell of the map")
        (left, bottom), (right, top) = first.tolist(), last.tolist()
        x, y = self.to_world(np.array([left, bottom], np.float64)).tolist()
        origin = (x, y, self.origin[2])
        return GridMap(self.cells[bottom:top, left:right].copy(), self.resolution_m, origin)

    def resampled(self, resolution_m: float) -> GridMap:
        """Return the same map in cells of another size, none of which promises too much.

        A cell is occupied if it overlaps an occupied one; else unknown if it overlaps an unknown
        one or reaches beyond the edge; else free. So walls and the unknown may grow by up to a new
        cell, and free space never does.

        Parameters
        ----------
        resolution_m : float
            Side of the new cells; the outer corner of cell (0, 0) and the yaw stay.

        Raises
        ------
        ValueError
            If the resolution is not positive.

        Examples
        --------
        >>> grid = GridMap(np.array([[0, 0, 0, 100, 0], [0, 0, 0, 0, 0]], np.int8), 0.1)
        >>> grid.resampled(0.2).cells.tolist()
        [[0, 100, -1]]
        """
        if not (np.isfinite(resolution_m) and resolution_m > 0.0):
            raise ValueError(f"resolution_m is {resolution_m}, expected > 0")
        rank = np.where(self.cells == OCCUPIED, 2, self.cells == UNKNOWN).astype(np.int8)
        for axis in (0, 1):
            rank = _highest(rank, axis, resolution_m / self.resolution_m)
        return GridMap(np.take(_BY_RANK, rank), float(resolution_m), self.origin)


def _highest(rank: NDArray[np.int8], axis: int, ratio: float) -> NDArray[np.int8]:
    """Return the highest rank along an axis in steps of `ratio` cells; 1 beyond the edge."""
    rank = np.moveaxis(rank, axis, 0)
    old = len(rank)
    k = np.arange(max(1, int(np.ceil(old / ratio - _SLACK))))
    begin = np.floor(k * ratio + _SLACK).astype(np.intp)
    end = np.minimum(np.ceil((k + 1) * ratio - _SLACK), old + 1).astype(np.intp)
    wide = np.pad(rank, ((0, 2), (0, 0)), constant_values=1)
    found = np.maximum.reduceat(wide, np.column_stack([begin, end]).ravel(), axis=0)[::2]
    return np.moveaxis(found, 0, axis)


@dataclass(frozen=True, repr=False)
class Log(Shown):
    """A recording: one table per message kind, and the geometry that goes with it.

    Attributes
    ----------
    tables : mapping of file stem to columns
        Stems and column names are those of the log folder (docs/log_format.md), as ``odometry``,
        ``ranges`` or ``truth``. ``stamp_s`` is held as ``stamp_ns`` (int64), as are ``arrival_s``,
        ``begin_s`` and ``end_s``; names (tag, anchor, landmark, laser) are arrays of
        str; the beams of ``scans`` are one column ``ranges_m`` of shape (n, beams), NaN where there
        was no return, and perhaps ``intensities`` of the same shape, NaN where none is known;
        where scans differ, ``beams`` of a row count, and its ``angle_min_rad`` and
        ``angle_increment_rad``; of several lasers ``laser`` has the name; everything else is
        float64. Absent files are absent keys.
    tags : mapping of tag name to (x, y, z)
        Tag positions in the body frame, metres.
    laser : mapping or None
        ``pose_in_body`` [x_m, y_m, heading_rad], ``angle_min_rad``, ``angle_increment_rad``,
        ``range_min_m``, ``range_max_m``. None where there are several.
    lasers : mapping of name to such a mapping
        Several of them, whose names are in the column ``laser`` of ``scans``; else empty.
    gps_origin : tuple or None
        Latitude and longitude [deg, WGS 84] of the map's origin, and the angle [deg] of its x axis
        from east, counter-clockwise, where they are known.
    landmark_sensor : mapping or None
        ``pose_in_body`` [x_m, y_m, heading_rad]: from where landmarks are sighted; None is the
        body's origin, looking forward.
    map : str or None
        File name of a ROS map yaml.
    grid : GridMap or None
        What that file holds.
    origin : str
        ``folder``, ``bag`` or ``simulation``: where people add what is not there.
    """

    tables: Mapping[str, Columns]
    tags: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    laser: Mapping[str, Any] | None = None
    map: str | None = None
    grid: GridMap | None = None
    description: str = ""
    licence: str = ""
    landmark_sensor: Mapping[str, Any] | None = None
    origin: str = field(default="folder", compare=False)
    lasers: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    gps_origin: tuple[float, float, float] | None = None

    def __contains__(self, stem: str) -> bool:
        return stem in self.tables

    @property
    def has_laser(self) -> bool:
        """Whether a laser is known, or several."""
        return self.laser is not None or bool(self.lasers)

    def scan_geometry(self, row: int) -> tuple[Mapping[str, Any], int]:
        """Return the laser as it was for a row of ``scans``, and how many beams that has.

        Raises LogError where the log has no laser, or none of that name.
        """
        scans = self.tables["scans"]
        laser = self.lasers.get(str(scans["laser"][row])) if "laser" in scans else self.laser
        if laser is None:
            named = f" {str(scans['laser'][row])!r}" if "laser" in scans else ""
            raise LogError(f"the log has scans, but nothing is known of the laser{named}")
        if "beams" not in scans:
            return laser, scans["ranges_m"].shape[1]
        own = {key: float(scans[key][row]) for key in ("angle_min_rad", "angle_increment_rad")}
        return {**laser, **own}, int(scans["beams"][row])

    def __getitem__(self, stem: str) -> Columns:
        return self.tables[stem]


@dataclass(frozen=True, repr=False)
class Outcomes(Table):
    """What became of each message, one row per message in order of delivery.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
    source : array of str, shape (n,)
        ``odometry``, ``ranges``, ``positions``, ``poses``, ``landmark_sightings``, ``altitudes``,
        ``headings``, ``scans``, or ``switch`` where UWB took over from scans.
    tag, anchor : arrays of str, shape (n,)
        Names for ranges; for sightings the landmark's stands in `anchor`; else empty strings.
    verdict : array of str, shape (n,)
        ``fused``, ``gated``, ``not_modelled``, ``ignored``, ``stale`` or
        ``implausible``.
    nis, log_likelihood, residual : float64 arrays, shape (n,)
        Normalised innovation squared, log density of the innovation, and its first row in the
        measurement's unit; NaN where nothing was compared. The residual of a fix that was rejected
        by its conditioner is the distance from the last, metres.
    dof : int64 array, shape (n,)
        Rows of the innovation; 0 where nothing was compared.
    reason : array of str, shape (n,)
        Why a message was not fused, or what a switch was for; else empty.
    """

    stamp_ns: StampArray
    source: NDArray[np.str_]
    tag: NDArray[np.str_]
    anchor: NDArray[np.str_]
    verdict: NDArray[np.str_]
    nis: FloatArray
    dof: NDArray[np.int64]
    log_likelihood: FloatArray
    residual: FloatArray
    reason: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of ``outcomes.csv``."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True, repr=False)
class Hypothesis(Shown):
    """A pose that fits: ``pose`` (3,) x, y [m], heading [rad], its covariance, its probability."""

    pose: FloatArray
    covariance: FloatArray
    probability: float


@dataclass(frozen=True, repr=False)
class Start(Shown):
    """How a run that was started from nothing found its pose.

    It was ready at `stamp_ns`, `seconds` after the first message, with `pose` and `covariance` of
    (x, y, heading), metres and radians. `steps` are (stamp_ns, hypotheses): what fitted whenever
    that changed, the last being the start itself. `used_scans`: there were scans and a map to
    match. `sums_m`, shape (36,): of ``srls_headings``, the sum of distances from the map at each.
    """

    stamp_ns: int
    seconds: float
    pose: FloatArray
    covariance: FloatArray
    steps: tuple[tuple[int, tuple[Hypothesis, ...]], ...]
    used_scans: bool
    sums_m: FloatArray | None = None


@dataclass(frozen=True, repr=False)
class Health(Table):
    """How far an estimate may be trusted, ten times a second.

    Attributes
    ----------
    stamp_ns : int64 array, shape (n,)
    state : array of str, shape (n,)
        ``ok``, ``degraded``, ``dead_reckoning``, ``lost`` and so on.
    within, wrong : float64 arrays, shape (n,)
        Probability that the position error is below the limit; that the robot is somewhere else.
    protection : float64 array, shape (n, 3)
        |error| in x, y (metres) and heading (radians) exceeds these with the stated risk at most;
        infinite where that cannot be said.
    reason : array of str, shape (n,)
        Why the state is not ``ok``, in words.
    """

    stamp_ns: StampArray
    state: NDArray[np.str_]
    within: FloatArray
    wrong: FloatArray
    protection: FloatArray
    reason: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of ``health.csv``; NaN where there is no protection level."""
        level = np.where(np.isfinite(self.protection), self.protection, np.nan)
        return {
            "stamp_ns": self.stamp_ns,
            "state": self.state,
            "within": self.within,
            "wrong": self.wrong,
            **dict(zip((f"protection_{axis}" for axis in _AXES), level.T, strict=True)),
            "reason": self.reason,
        }


@dataclass(frozen=True, repr=False)
class Watched(Health):
    """How far the poses of another localizer may be trusted, with each row of the run's `Health`.

    `within` is of position and heading; `protection` of its pose.

    Attributes
    ----------
    error : float64 array, shape (n, 3)
        Its pose, carried on by odometry, less the estimate: x, y (metres), heading (radians); NaN
        before there are both.
    """

    error: FloatArray

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of ``watched.csv``."""
        error = zip((f"error_{axis}" for axis in _AXES), self.error.T, strict=True)
        return {**super().columns(), **dict(error)}


@dataclass(frozen=True, repr=False)
class MappedLandmarks(Table):
    """Landmarks as an estimator that maps them knows them at the end, in order of discovery.

    Attributes
    ----------
    name : array of str, shape (n,)
        ``new1``, ``new2`` ... where no sighting named them.
    position : float64 array, shape (n, 2)
        Metres in world.
    covariance : float64 array, shape (n, 2, 2)
        Zero where the position was given as exact.
    sightings : int64 array, shape (n,)
        How many were fused.
    """

    name: NDArray[np.str_]
    position: FloatArray
    covariance: FloatArray
    sightings: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.name)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of ``landmarks.csv`` of a log folder."""
        x, y = self.position.T
        xx, xy, yy = self.covariance[:, 0, 0], self.covariance[:, 0, 1], self.covariance[:, 1, 1]
        return {"landmark": self.name, "x_m": x, "y_m": y,
                "cov_x_x": xx, "cov_x_y": xy, "cov_y_y": yy}  # fmt: skip


@dataclass(frozen=True, repr=False)
class Frame(Shown):
    """What an `Mcl` believed after a scan.

    `particles`, shape (n, 4), are x, y [m], heading [rad], weight; of a large cloud, evenly chosen
    ones. `pose`, shape (3,), is the estimate.
    """

    stamp_ns: int
    particles: FloatArray
    pose: FloatArray
    ready: bool


@dataclass(frozen=True, repr=False)
class RunResult:
    """One run: what was asked, what came in, what was estimated, how good it was.

    Attributes
    ----------
    config : dict
        The effective configuration, every default filled in.
    log : Log
    estimate : Trajectory
        With heading and covariance; one row per distinct stamp.
    truth : Trajectory or None
        As recorded or simulated, on its own stamps.
    outcomes : Outcomes
    metrics : dict
        What ``metrics.json`` holds.
    start : Start or None
        How ``start: auto`` went.
    health : Health or None
        Of an EKF.
    watched : Watched or None
        With ``watch_poses``.
    landmarks : MappedLandmarks or None
        Of an estimator that maps.
    frames : tuple of Frame
        With ``mcl``, particles on the way, evenly chosen of a long run; else empty.
    """

    config: Mapping[str, Any]
    log: Log
    estimate: Trajectory
    truth: Trajectory | None
    outcomes: Outcomes
    metrics: Mapping[str, Any]
    start: Start | None = None
    health: Health | None = None
    frames: tuple[Frame, ...] = ()
    landmarks: MappedLandmarks | None = None
    watched: Watched | None = None

    def __repr__(self) -> str:
        keys = ("position_rmse_m", "heading_rmse_deg", "nees_mean", "duration_s", "messages")
        found = ((key, self.metrics.get(key)) for key in keys)
        known = (f"{key}={value if isinstance(value, int) else f'{value:.4g}'}"
                 for key, value in found if value is not None)  # fmt: skip
        name = shown(self.config.get("name", ""))
        return f"RunResult({', '.join([name, f'{len(self.estimate)} poses', *known])})"

    def _repr_html_(self) -> str:
        return _page(self)
