# SPDX-License-Identifier: Apache-2.0
"""Reader of the MRPT office run: UWB ranges, laser scans, wheel odometry, grid map, reference.

MRPT stores objects one after another, little-endian, usually gzipped as a whole. Every object is

    1 byte   length of the class name, with bit 7 set
    n bytes  class name, ASCII
    1 byte   version of the layout
    ...      the fields of that class and version; objects may nest
    1 byte   0x88, the end flag

Only the classes and versions of this recording are known; others end in a LogError that names
class, version and byte. Offsets count bytes of the unpacked data.
"""

from __future__ import annotations

import configparser
import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from locfuse.io.csv_table import unpacked
from locfuse.types import Columns, FloatArray, Log, LogError

T = TypeVar("T")
Triple = tuple[float, float, float]
GridMap = tuple[NDArray[np.uint8], float, Triple]

END_FLAG = 0x88
TICK_NS = 100  # MRPT counts time in steps of 100 ns


class Reader:
    """Primitives read in order from unpacked bytes; every failure names file and byte."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.offset = 0
        try:
            data = path.read_bytes()
            self.data = unpacked(data) if data.startswith(b"\x1f\x8b") else data
        except (OSError, EOFError, ValueError, zlib.error) as error:
            raise LogError(f"{path}: cannot be read or unpacked: {error}") from error

    def error(self, text: str, offset: int) -> LogError:
        return LogError(f"{self.path}: byte {offset}: {text}")

    def take(self, size: int) -> bytes:
        left = len(self.data) - self.offset
        if size > left:
            raise self.error(f"truncated: {size} more bytes expected, {left} left", self.offset)
        self.offset += size
        return self.data[self.offset - size : self.offset]

    def fields(self, layout: str) -> tuple[Any, ...]:
        """Read packed fields by their `struct` letters."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def count(self) -> int:
        return int(self.fields("I")[0])

    def array(self, kind: str, size: int) -> NDArray[Any]:
        return np.frombuffer(self.take(size * np.dtype(kind).itemsize), kind)

    def one_of(self, known: Mapping[tuple[str, int], Callable[[Reader], T]]) -> T:
        """Read one object whose class and version must be among `known`."""
        start = self.offset
        (head,) = self.fields("B")
        name = self.take(head & 0x7F).decode("latin-1") if head & 0x80 else ""
        if not (name.isascii() and name.isidentifier()):
            raise self.error("no MRPT object starts here", start)
        (version,) = self.fields("B")
        if (name, version) not in known:
            expected = " or ".join(f"{other} version {number}" for other, number in known)
            raise self.error(f"cannot read {name} version {version}, expected {expected}", start)
        value = known[name, version](self)
        if self.fields("B") != (END_FLAG,):
            raise self.error(f"{name} from byte {start} does not end here", self.offset - 1)
        return value


class Scan(NamedTuple):
    """One laser scan: beams counter-clockwise from the right [m], NaN where invalid."""

    ticks: int
    ranges: FloatArray
    geometry: tuple[float, float, float, Triple]  # aperture, step, longest range, pose in body


class Reply(NamedTuple):
    """Range [m] from the antenna, at its place on the robot, to a beacon; 0 means no reply."""

    beacon: int
    distance: float
    antenna: Triple


def read_triple(reader: Reader) -> Triple:
    """CPoint3D (x, y, z) or CPose2D (x, y, heading)."""
    a, b, c = reader.fields("3d")
    return a, b, c


def read_matrix(reader: Reader) -> FloatArray:
    rows, columns = reader.fields("2I")
    return reader.array("<f8", rows * columns).reshape(rows, columns)


def read_pose3d(reader: Reader) -> Triple:
    """CPose3D, a homogeneous 4x4 matrix, as (x, y, heading)."""
    start = reader.offset
    transform = reader.one_of({("CMatrixD", 0): read_matrix})
    if transform.shape != (4, 4):
        raise reader.error(f"pose matrix of shape {transform.shape}, expected (4, 4)", start)
    heading = float(np.arctan2(transform[1, 0], transform[0, 0]))
    return _shortest(transform[0, 3]), _shortest(transform[1, 3]), heading


def read_scan(reader: Reader) -> Scan:
    aperture, right_to_left, longest = reader.fields("fBf")
    pose = reader.one_of({("CPose3D", 1): read_pose3d})
    beams = reader.count()
    ranges = reader.array("<f4", beams).astype(np.float64)
    ranges[reader.array("u1", beams) == 0] = np.nan
    _sigma, ticks, _beam_width = reader.fields("fqf")
    reader.take(reader.count())  # the sensor's label
    reader.fields("d")  # change of pitch during the scan
    step = aperture / max(beams - 1, 1)
    return Scan(ticks, ranges[:: 1 if right_to_left else -1], (aperture, step, longest, pose))


def read_replies(reader: Reader) -> list[Reply]:
    replies = []
    _nearest, _farthest, _sigma, count = reader.fields("3fI")
    for _ in range(count):
        x, y, z = reader.one_of({("CPoint3D", 1): read_triple})
        distance, beacon = reader.fields("fI")
        replies.append(Reply(beacon, distance, (_shortest(x), _shortest(y), _shortest(z))))
    reader.one_of({("CPose2D", 1): read_triple})  # a rough position of the recorder's own
    reader.take(reader.count())  # the sensor's label
    reader.fields("q")  # stamp, always 0 in this recording
    return replies


OBSERVATIONS: Mapping[tuple[str, int], Callable[[Reader], Scan | list[Reply]]] = {
    ("CObservation2DRangeScan", 6): read_scan,
    ("CObservationBeaconRanges", 3): read_replies,
}


def read_frame(reader: Reader) -> tuple[Scan, list[Reply]]:
    """CSensoryFrame: one scan, and the replies of the beacons if there were any."""
    start = reader.offset
    observations = [reader.one_of(OBSERVATIONS) for _ in range(reader.count())]
    scans = [item for item in observations if isinstance(item, Scan)]
    if len(scans) != 1:
        raise reader.error(f"frame with {len(scans)} laser scans, expected 1", start)
    return scans[0], [r for item in observations if not isinstance(item, Scan) for r in item]


def read_motion(reader: Reader) -> Triple:
    """CActionRobotMovement2D: (dx, dy, dheading) of the wheels; the rest is skipped."""
    start = reader.offset
    if (method := reader.count()) != 0:
        raise reader.error(f"motion estimated by method {method}, expected 0 (odometry)", start)
    motion = reader.one_of({("CPose2D", 1): read_triple})
    reader.fields("I6f I6f")  # settings of the Gaussian and of the particle motion model
    reader.fields("BffBii")  # velocities and encoder ticks, not filled in
    reader.fields("q")  # stamp, half-way between the two frames
    return motion


def read_actions(reader: Reader) -> Triple:
    """CActionCollection: the one motion from the frame before it to the frame after it."""
    start = reader.offset
    if (count := reader.count()) != 1:
        raise reader.error(f"{count} actions between two frames, expected 1", start)
    return reader.one_of({("CActionRobotMovement2D", 6): read_motion})


def read_grid(reader: Reader) -> GridMap:
    """COccupancyGridMap2D: cells from the bottom, log-odds of being free in sixteenths."""
    start = reader.offset
    bits, columns, rows, x_min, _x_max, y_min, _y_max, resolution = reader.fields("B2I5f")
    if bits != 8:
        raise reader.error(f"grid cells of {bits} bits, expected 8", start)
    log_odds = reader.array("i1", rows * columns).reshape(rows, columns)[::-1] / 16.0
    reader.fields("fBffBHf")  # settings for inserting scans
    reader.fields("i4fIfBfIfBifif")  # settings for the likelihood of scans
    reader.array("<f4", reader.count())  # weights of the same
    reader.fields("BB")  # two flags
    image = np.rint(255.0 / (1.0 + np.exp(-log_odds))).astype(np.uint8)
    return image, _shortest(resolution), (_shortest(x_min), _shortest(y_min), 0.0)


def read_gridmap(path: Path) -> GridMap:
    """Read an MRPT occupancy grid file (``.gridmap``, ``.gridmap.gz``) as parts of a ROS map.

    Returns
    -------
    image : uint8 array, shape (rows, columns)
        Row 0 is the top (largest y); 0 occupied, 255 free, 128 unknown, linear in probability.
    resolution_m : float
        Side of a cell in metres.
    origin : tuple of float
        x and y in metres of the lower left corner of the image, and its heading 0 in radians.

    Raises
    ------
    LogError
        If the file cannot be read, is truncated, or holds something else.
    """
    reader = Reader(path)
    grid = reader.one_of({("COccupancyGridMap2D", 3): read_grid})
    if reader.offset != len(reader.data):
        raise reader.error("data after the end of the grid map", reader.offset)
    return grid


def read_mrpt_office(datasets: Path, config_files: Path | None = None) -> Log:
    """Read the whole MRPT office run (343 frames, 363 s, 112 m).

    Stamps count from the scan of frame 0. Ranges have no stamp of their own and take that of their
    frame's scan. An odometry row is the motion since the frame before, in the robot axes of that
    frame; frame 0 has neither odometry nor reference. Reference, anchors and `read_gridmap` share
    one frame in which the run starts at the origin.

    Parameters
    ----------
    datasets : Path
        Folder with ``uwb_ro-localization_demo.rawlog`` and ``uwb_ro-localization_demo_GT.txt``.
    config_files : Path, optional
        Folder with ``ro-localization/UWB_localization_demo.ini``; by default ``config_files``
        beside `datasets`.

    Returns
    -------
    Log
        Tables ``odometry``, ``ranges``, ``scans``, ``truth`` and ``anchors``; `map` is None.

    Raises
    ------
    LogError
        If a file cannot be read, is truncated, or holds something unexpected.
    """
    config_files = config_files or datasets.parent / "config_files"
    reader = Reader(datasets / "uwb_ro-localization_demo.rawlog")
    scans: list[Scan] = []
    replies: list[tuple[int, Reply]] = []
    motions: list[Triple] = []
    while reader.offset < len(reader.data) or not scans:
        scan, measured = reader.one_of({("CSensoryFrame", 2): read_frame})
        replies += [(len(scans), reply) for reply in measured if reply.distance != 0.0]
        scans.append(scan)
        motions.append(reader.one_of({("CActionCollection", 0): read_actions}))

    shapes = {(len(scan.ranges), scan.geometry) for scan in scans}
    antennas = {reply.antenna for _, reply in replies}
    if len(shapes) != 1 or len(antennas) != 1:
        found = f"{len(shapes)} laser geometries and {len(antennas)} antenna positions"
        raise LogError(f"{reader.path}: {found}, expected one of each")
    aperture, step, longest, pose = scans[0].geometry
    stamp_ns = np.array([scan.ticks - scans[0].ticks for scan in scans], np.int64) * TICK_NS
    dx, dy, dheading = np.array(motions[:-1]).reshape(-1, 3).T  # the last leads to no frame
    tables: dict[str, Columns] = {
        "odometry": {"stamp_ns": stamp_ns[1:], "dx_m": dx, "dy_m": dy, "dheading_rad": dheading},
        "ranges": {
            "stamp_ns": stamp_ns[[frame for frame, _ in replies]],
            "tag": np.full(len(replies), "antenna"),
            "anchor": np.array([str(reply.beacon) for _, reply in replies]),
            "range_m": np.array([reply.distance for _, reply in replies], np.float64),
        },
        "scans": {"stamp_ns": stamp_ns, "ranges_m": np.stack([scan.ranges for scan in scans])},
        "truth": _read_reference(datasets / "uwb_ro-localization_demo_GT.txt", stamp_ns),
        "anchors": _read_anchors(config_files / "ro-localization" / "UWB_localization_demo.ini"),
    }
    return Log(
        tables=tables,
        tags={"antenna": antennas.pop()},
        laser={
            "pose_in_body": list(pose),
            "angle_min_rad": -aperture / 2,
            "angle_increment_rad": step,
            "range_min_m": 0.0,
            "range_max_m": longest,
        },
        description="MRPT office run: UWB ranges, 2D laser scans, wheel odometry and reference",
        licence="BSD-3-Clause",
    )


def _shortest(value: float) -> float:
    """Return the shortest decimal that is the same number in the file's single precision."""
    return float(str(np.float32(value)))


def _read_reference(path: Path, stamp_ns: NDArray[np.int64]) -> Columns:
    """Read rows of index, x, y, heading; row k belongs to frame k + 1."""
    try:
        rows = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError) as error:
        raise LogError(f"{path}: {error}") from error
    if rows.shape != (len(stamp_ns) - 1, 4):
        raise LogError(f"{path}: table of {rows.shape}, expected {(len(stamp_ns) - 1, 4)}")
    for row in np.flatnonzero(rows[:, 0] != np.arange(len(rows))):
        raise LogError(f"{path}: line {row + 1}: index {rows[row, 0]:g}, expected {row}")
    return {
        "stamp_ns": stamp_ns[1:],
        "x_m": rows[:, 1],
        "y_m": rows[:, 2],
        "heading_rad": rows[:, 3],
    }


def _read_anchors(path: Path) -> Columns:
    """Read the beacons and move them into the frame whose origin is the start of the run."""
    settings = configparser.ConfigParser(inline_comment_prefixes=("//",), interpolation=None)
    try:
        settings.read_string(path.read_text(encoding="utf-8"))
        start = settings["OdometryEstimation"]
        x0, y0, heading_deg = (float(start[f"odometry_{key}"]) for key in ("X", "Y", "PHI"))
        beacons = settings["MetricMap_landmarksMap_00_creationOpts"]
        names = [f"beacon_{i + 1:03d}" for i in range(int(beacons["nBeacons"]))]
        ids = [str(int(beacons[f"{name}_ID"])) for name in names]
        rows = [[float(beacons[f"{name}_{axis}"]) for axis in "XYZ"] for name in names]
    except KeyError as error:
        raise LogError(f"{path}: section or key {error} is missing") from error
    except (OSError, configparser.Error, ValueError) as error:
        raise LogError(f"{path}: {error}") from error
    x, y, z = np.array(rows).reshape(-1, 3).T
    cos, sin = np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))
    return {
        "anchor": np.array(ids),
        "x_m": cos * (x - x0) + sin * (y - y0),
        "y_m": cos * (y - y0) - sin * (x - x0),
        "z_m": z,
    }
