# SPDX-License-Identifier: Apache-2.0
"""The floor, the lap and the sensors of celan2017, sections III and IV; results/accuracy.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby, pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.scenario import Covered, Dropouts, LaserSensor, OdometrySensor, WheelSlip
from locfuse.sim import laser, sensors
from locfuse.sim.faults import World, walls_between, with_faults
from locfuse.sim.maps import FloorPlan, floor_plan, furnished
from locfuse.sim.space import cell_of, largest_part, middle_of, room_for, steps_from, way
from locfuse.sim.trajectory import Drive, drive_of, legs
from locfuse.types import Columns, FloatArray, GridMap, Log
from papers.celan2017.warp import Shift, bend, bent

Cell: TypeAlias = NDArray[np.int64]  # row and column

SIZE_M = (50.0, 25.0)
RESOLUTION_M = 0.05
DISTORTION_M = 0.2  # of the map at its worst; none where the anchors are
LAP_M = 200.0
STRAIGHTENED = 0.91  # length of a way over that of its steps from cell to cell
CLEARANCE_M = 0.35  # of the middle of a machine that is 53 cm wide
PLAN_M = 0.1  # cells in which ways are planned
SPEED_MPS, TURN_RADPS = 0.26, 0.6  # with its turns on the spot 0.22 m/s on average
STAND_S = 2.0
LASER = LaserSensor(rate_hz=5.0, beams=360, range_min_m=0.2, range_max_m=6.0, sigma_m=0.015,
                    dropout=0.02)  # fmt: skip
ODOMETRY_HZ = 7.5
# What the wheels add at random, and what they get wrong all the time: drawn once for each drive.
SIGMA_LONGITUDINAL, SIGMA_PER_SQRT_M, SIGMA_PER_SQRT_RAD = 0.02, 0.01, 0.02
SIGMA_TURN_BIAS_RADPS = 0.0011  # unequal wheels
SIGMA_ROTATION = 0.02  # wrong track
SIGMA_SCALE = 0.01  # wrong radius
TAGS = {"front": (0.5, 0.0, 1.0), "left": (-0.4, 0.3, 1.0), "right": (-0.4, -0.3, 1.0)}
ANCHOR_M = 2.5  # height
UWB_HZ = 1.0
UWB_RANGE_M = 20.0  # of the master anchor
SIGMA_RANGE_M = 0.17  # of a range in line of sight: 12 cm of a position in the room
SIGMA_OFFSET_M = 0.05  # of an anchor, constant in a drive: what its calibration leaves
NLOS_M, SIGMA_NLOS_M = 0.4, 0.3  # by which a range through a wall is long
SILENT_WALLS = 2  # that a range does not get through
MIN_RANGES = 3  # of which the RTLS makes a position
OUTAGE_EVERY_S, OUTAGE_S = 120.0, 8.0  # of the whole RTLS, such as of its WiFi; means


@dataclass(frozen=True)
class Floor:
    """A floor as it is, and the map of it that the robot has.

    Attributes
    ----------
    plan : FloorPlan
    true : GridMap
    map : GridMap
        Bent: what stands at p is drawn at p + shift(p).
    shift : callable
        Takes points, shape (n, 2), metres.
    anchors : mapping of name to (x, y, z)
        In world, metres; the first is the master.
    """

    plan: FloorPlan
    true: GridMap
    map: GridMap
    shift: Shift
    anchors: dict[str, tuple[float, float, float]]

    def in_open_room(self, point: FloatArray) -> NDArray[np.bool_]:
        """Return which points, shape (n, 2), lie in the room with the anchors."""
        x1, y1, x2, y2 = self.plan.open_room
        return np.asarray(np.all((point > [x1, y1]) & (point < [x2, y2]), axis=1))


@dataclass(frozen=True)
class Lap:
    """A lap of the floor and all that the sensors said of it.

    Attributes
    ----------
    floor : Floor
    drive : Drive
    duration_s, length_m : float
    log : Log
        Tables ``odometry``, ``scans``, ``ranges`` (with tag and anchor), ``truth`` and ``anchors``;
        its grid is the bent map.
    fixes : columns
        ``stamp_ns``, ``tag``, ``x_m``, ``y_m`` and the ``covariance``, shape (n, 2, 2), that the
        RTLS states of them.
    """

    floor: Floor
    drive: Drive
    duration_s: float
    length_m: float
    log: Log
    fixes: Columns


def floor_of(seed: int) -> Floor:
    """Return a floor of 50 m x 25 m, five anchors in its open room, and a bent map of it."""
    rng = np.random.default_rng([seed, 0])
    plan = floor_plan(rng, SIZE_M)
    true = furnished(plan, rng, SIZE_M, RESOLUTION_M)
    shift = bend(rng, (0.0, 0.0, *SIZE_M), plan.open_room, DISTORTION_M)
    x1, y1, x2, y2 = plan.open_room
    inset = 0.1
    at = [(x1 + inset, y1 + inset), (x2 - inset, y1 + inset), (x2 - inset, y2 - inset),
          (x1 + inset, y2 - inset), (0.5 * (x1 + x2), y1 + inset)]  # fmt: skip
    anchors = {f"A{k}": (x, y, ANCHOR_M) for k, (x, y) in enumerate(at, 1)}
    return Floor(plan, true, bent(true, shift, 2.0 * DISTORTION_M), shift, anchors)


class Ways:
    """Ways of the scrubber over a floor, from cell to cell."""

    def __init__(self, floor: Floor) -> None:
        self._grid = floor.true.resampled(PLAN_M)
        self._room = largest_part(room_for(self._grid, CLEARANCE_M))
        self._free = np.argwhere(self._room)
        self._where = middle_of(self._grid, self._free)
        self._steps: dict[tuple[int, int], NDArray[np.int64]] = {}

    def cell_at(self, point: tuple[float, float]) -> Cell:
        """Return the cell of a place."""
        return np.asarray(cell_of(self._grid, np.array([point]))[0])

    def cell_in(self, box: Sequence[float], rng: np.random.Generator) -> Cell:
        """Return a cell of a room."""
        x1, y1, x2, y2 = box
        cells = self._free[np.all((self._where > [x1, y1]) & (self._where < [x2, y2]), axis=1)]
        return np.asarray(cells[rng.integers(len(cells))])

    def length(self, tour: Sequence[Cell]) -> float:
        """Return about how long a tour is, metres."""
        steps = sum(int(self._steps_from(a)[b[0], b[1]]) for a, b in pairwise(tour))
        return STRAIGHTENED * self._grid.resolution_m * steps

    def points(self, tour: Sequence[Cell]) -> list[FloatArray]:
        """Return where a tour begins, turns and ends, metres in world."""
        points = [middle_of(self._grid, tour[0][None])[0]]
        for here, there in pairwise(tour):
            points += way(self._grid, self._room, here, there)
        return points

    def _steps_from(self, cell: Cell) -> NDArray[np.int64]:
        row, column = int(cell[0]), int(cell[1])
        if (row, column) not in self._steps:
            self._steps[row, column] = steps_from(self._room, (row, column))
        return self._steps[row, column]


def stops(floor: Floor, rng: np.random.Generator) -> list[FloatArray]:
    """Return the points of a round trip of about `LAP_M` through hallways and some of the rooms.

    It begins in the room with the anchors, goes around the two long hallways clockwise or the other
    way, into rooms as they come, to a place in each, and back to two more places of its first room.
    """
    plan, ways = floor.plan, Ways(floor)
    width, depth = SIZE_M
    south = plan.doors[0][1] + 1.0  # middle of the hallway
    corners = [(x, y) for x in (1.0, width - 1.0) for y in (south, depth - south)]
    chosen = [(_turned_from_home(plan, corner), ways.cell_at(corner)) for corner in corners]
    others = [(_turned_from_home(plan, door), ways.cell_in(box, rng))
              for door, box in zip(plan.doors[1:], plan.rooms[1:], strict=True)]  # fmt: skip
    home, *more = (ways.cell_in(plan.open_room, rng) for _ in range(3))
    way_round = 1 if rng.random() < 0.5 else -1

    def tour(chosen: list[tuple[float, Cell]]) -> list[Cell]:
        stops = [cell for _, cell in sorted(chosen, key=lambda stop: way_round * stop[0])]
        return [home, *stops, *more, home]

    for at in rng.permutation(len(others)).tolist():
        longer = [*chosen, others[at]]
        if ways.length(tour(longer)) <= LAP_M:
            chosen = longer
    return ways.points(tour(chosen))


def _turned_from_home(plan: FloorPlan, point: tuple[float, float]) -> float:
    """Return how far a place is around the middle of the floor, clockwise from the open room."""
    middle = 0.5 * np.array(SIZE_M)
    (x, y), (x0, y0) = ((np.array(at) - middle) / middle for at in (point, plan.doors[0]))
    return float(np.mod(np.arctan2(y0, x0) - np.arctan2(y, x), 2.0 * np.pi))


@lru_cache(maxsize=2)
def lap(seed: int) -> Lap:
    """Return a floor, a lap of it, and what the sensors say; all from one seed."""
    floor = floor_of(seed)
    for_way, for_odometry, *others = np.random.default_rng([seed, 1]).spawn(6)
    for_laser, for_ranges, for_offsets, for_outages = others
    points = stops(floor, for_way)
    drive, duration_s = there_and_back(points, SPEED_MPS, TURN_RADPS, STAND_S)
    scans_ns = sensors.stamps(LASER.rate_hz, duration_s)
    seen = laser.scans(drive, scans_ns, floor.true, LASER, for_laser)
    uwb_ns = sensors.stamps(UWB_HZ, duration_s)
    measured = radios(floor, drive, uwb_ns, for_ranges, for_offsets)
    received = with_faults(dict(zip(("ranges", "positions"), measured, strict=True)),
                        [(out, for_outages) for out in outages(duration_s, for_outages)],
                        World(drive, {}, {}, uwb_ns))  # fmt: skip
    odometry = wheels(drive, duration_s, for_odometry)
    stamp_ns = np.unique(np.concatenate([scans_ns, uwb_ns, odometry["stamp_ns"]]))
    at = np.array(list(floor.anchors.values()))
    log = Log(
        tables={
            "odometry": odometry,
            "scans": seen,
            "ranges": received["ranges"],
            "truth": sensors.truth(drive, stamp_ns),
            "anchors": {"anchor": np.array(list(floor.anchors)), "x_m": at[:, 0], "y_m": at[:, 1],
                        "z_m": at[:, 2]},
        },
        tags=TAGS,
        laser=laser.geometry(LASER),
        map="map.yaml",
        grid=floor.map,
        description=f"Simulated: lap of celan2017, seed {seed}",
    )  # fmt: skip
    length_m = float(np.hypot(*np.diff(np.array(points), axis=0).T).sum())
    return Lap(floor, drive, duration_s, length_m, log, received["positions"])


def outages(duration_s: float, rng: np.random.Generator) -> list[Dropouts]:
    """Return when the RTLS reports neither ranges nor positions, as faults of both."""
    found, time_s = [], float(rng.exponential(OUTAGE_EVERY_S))
    while time_s < duration_s:
        end_s = time_s + float(rng.exponential(OUTAGE_S))
        found += [Dropouts(source="ranges", from_s=time_s, to_s=end_s),
                  Dropouts(source="positions", from_s=time_s, to_s=end_s)]  # fmt: skip
        time_s = end_s + float(rng.exponential(OUTAGE_EVERY_S))
    return found


def wheels(drive: Drive, duration_s: float, rng: np.random.Generator) -> Columns:
    """Return encoders at 7.5 Hz, whose wheels and track are not quite what they are taken for."""
    bias, rotation, scale = rng.standard_normal(3) * [SIGMA_TURN_BIAS_RADPS, SIGMA_ROTATION,
                                                     SIGMA_SCALE]  # fmt: skip
    sensor = OdometrySensor(
        rate_hz=ODOMETRY_HZ,
        sigma_longitudinal_per_sqrt_m=SIGMA_LONGITUDINAL,
        sigma_heading_per_sqrt_m=SIGMA_PER_SQRT_M,
        sigma_heading_per_sqrt_rad=SIGMA_PER_SQRT_RAD,
        turn_bias_radps=bias,
    )
    stamp_ns = sensors.stamps(ODOMETRY_HZ, duration_s)
    measured = {"odometry": sensors.odometry(drive, stamp_ns, sensor, rng)}
    wrong = WheelSlip(from_s=0.0, to_s=duration_s, translation_factor=1.0 + scale,
                      rotation_factor=1.0 + rotation)  # fmt: skip
    return with_faults(measured, [(wrong, rng)], World(drive, {}, {}, stamp_ns))["odometry"]


def radios(
    floor: Floor, drive: Drive, stamp_ns: NDArray[np.int64], for_noise: np.random.Generator,
    for_offsets: np.random.Generator, sigma_offset_m: float = SIGMA_OFFSET_M,
) -> tuple[Columns, Columns]:  # fmt: skip
    """Return the ranges of three tags to five anchors, and the positions the RTLS makes of them.

    A range has white noise, its anchor's offset, and is longer by a gamma distributed detour where
    a wall of the floor is in the way; through `SILENT_WALLS` none is received, nor any of a tag
    farther than `UWB_RANGE_M` from the master anchor. A position is the least squares one of its
    ranges, `MIN_RANGES` or more, to first order; the covariance that is stated with it knows of
    the noise alone.

    Returns
    -------
    ranges : columns
        ``stamp_ns``, ``tag``, ``anchor``, ``range_m``.
    fixes : columns
        As in `Lap`.
    """
    anchor = np.array(list(floor.anchors.values()))
    offset = sigma_offset_m * for_offsets.standard_normal(len(anchor))
    pose = drive.pose_at(sensors.seconds(stamp_ns))
    tag = np.stack([sensors.point_in_world(pose, at) for at in TAGS.values()], axis=1)  # n, 3, xyz
    off = tag[:, :, None] - anchor  # n, tags, anchors, xyz
    distance = np.linalg.norm(off, axis=-1)
    pairs = np.broadcast_arrays(tag[:, :, None, :2], anchor[:, :2])
    flat = [points.reshape(-1, 2) for points in pairs]
    walls = dict.fromkeys(floor.plan.walls)  # what two rooms share stands there twice
    through = walls_between(flat[0], flat[1], walls).reshape(distance.shape)
    shape = (NLOS_M / SIGMA_NLOS_M) ** 2
    detour = np.where(through > 0, for_noise.gamma(shape, NLOS_M / shape, distance.shape), 0.0)
    error = SIGMA_RANGE_M * for_noise.standard_normal(distance.shape) + offset + detour
    received = (through < SILENT_WALLS) & (distance[:, :, :1] <= UWB_RANGE_M)
    names, anchors = np.array(list(TAGS)), np.array(list(floor.anchors))
    epoch, which, of = np.nonzero(received)
    ranges = {"stamp_ns": stamp_ns[epoch], "tag": names[which], "anchor": anchors[of],
              "range_m": np.maximum((distance + error)[received], 0.0)}  # fmt: skip
    located = received.sum(axis=2) >= MIN_RANGES
    epoch, which = np.nonzero(located)
    H = (off[..., :2] / distance[..., None] * received[..., None])[located]  # k, anchors, 2
    P = np.linalg.inv(H.swapaxes(1, 2) @ H)
    shift = (P @ H.swapaxes(1, 2) @ error[located][..., None])[..., 0]
    at = tag[located][:, :2] + shift
    fixes = {"stamp_ns": stamp_ns[epoch], "tag": names[which], "x_m": at[:, 0], "y_m": at[:, 1],
             "covariance": SIGMA_RANGE_M**2 * P}  # fmt: skip
    return ranges, fixes


BLIND_S, SEEN_S = 180.0, 20.0  # with nothing in sight, and thereafter until the end of the lap
SPIN_WAY, SPIN_TURN = 1.25, 1.1  # reported by the wheels there over what is driven


def radios_known(lap: Lap) -> tuple[_core.AnchorMap, list[_core.Tag]]:
    """Return anchors and tags with the ids of the messages."""
    places = lap.floor.anchors.values()
    anchors = _core.AnchorMap([_core.Anchor(k, list(at)) for k, at in enumerate(places)])
    return anchors, tags_known()


def half(lap: Lap) -> tuple[Covered, ...]:
    """Return the cardboard of Fig. 12, over the right half."""
    return (Covered(from_deg=-180.0, to_deg=0.0),)


def hall(lap: Lap) -> tuple[Covered, ...]:
    """Return the cardboard, and a time with nothing in sight, as in a hall wider than the reach."""
    end_s = lap.duration_s - SEEN_S
    return (*half(lap), Covered(from_deg=-180.0, to_deg=180.0, from_s=end_s - BLIND_S,
                                to_s=end_s))  # fmt: skip


def spinning(lap: Lap) -> Columns:
    """Return the odometry of wheels that spin in that hall, as on a floor that is wet."""
    end_s = lap.duration_s - SEEN_S
    slip = WheelSlip(from_s=end_s - BLIND_S, to_s=end_s, translation_factor=SPIN_WAY,
                     rotation_factor=SPIN_TURN)  # fmt: skip
    odometry = {"odometry": lap.log["odometry"]}
    world = World(lap.drive, {}, {}, lap.log["odometry"]["stamp_ns"])
    return with_faults(odometry, [(slip, np.random.default_rng(0))], world)["odometry"]


def covered(lap: Lap, covers: tuple[Covered, ...]) -> Log:
    scans = lap.log["scans"]
    hidden = [laser.covered(scans["stamp_ns"], LASER, cover) for cover in covers]
    table = {**scans, "ranges_m": np.where(np.any(hidden, axis=0), np.nan, scans["ranges_m"])}
    return replace(lap.log, tables={**lap.log.tables, "scans": table})


def increments(odometry: Columns) -> Iterator[_core.Increment]:
    """Yield the motions of a table of odometry."""
    stamps = odometry["stamp_ns"].tolist()
    motions = zip(
        *(odometry[key].tolist() for key in ("dx_m", "dy_m", "dheading_rad")), strict=True
    )
    for begin, end, motion in zip(stamps[:-1], stamps[1:], list(motions)[1:], strict=True):
        yield _core.Increment(begin, end, _core.Pose2(*motion))


def ranges_of(lap: Lap) -> Iterator[_core.Range]:
    table = lap.log["ranges"]
    tags, anchors = list(TAGS), list(lap.floor.anchors)
    columns = (table[key].tolist() for key in ("stamp_ns", "tag", "anchor", "range_m"))
    for stamp, tag, anchor, distance in zip(*columns, strict=True):
        yield _core.Range(stamp, tags.index(tag), anchors.index(anchor), distance)


def tags_known() -> list[_core.Tag]:
    """Return the tags with the ids of the messages."""
    return [_core.Tag(k, list(at)) for k, at in enumerate(TAGS.values())]


def tag_fixes(fixes: Columns) -> Iterator[_core.PositionFix]:
    """Yield the positions that an RTLS gives, one tag after the other."""
    ids = {name: k for k, name in enumerate(TAGS)}
    rows = zip(*(fixes[key].tolist() for key in ("stamp_ns", "tag", "x_m", "y_m")),
               fixes["covariance"], strict=True)  # fmt: skip
    for stamp, tag, x, y, covariance in rows:
        yield _core.PositionFix(stamp, [x, y], covariance, ids[tag])


def tag_poses(fixes: Columns) -> Iterator[_core.PoseObservation]:
    """Yield the pose that fits the positions of all three tags best, wherever all are received."""
    stamps, count = np.unique(fixes["stamp_ns"], return_counts=True)
    received = set(stamps[count == len(TAGS)].tolist())
    arms = {k: at[:2] for k, at in enumerate(TAGS.values())}
    every = (z for z in tag_fixes(fixes) if z.stamp in received)
    for stamp, together in groupby(every, key=lambda z: z.stamp):
        epoch = list(together)
        fit = _core.rigid_fit(np.array([arms[z.tag] for z in epoch if z.tag is not None]),
                              np.array([z.position for z in epoch]),
                              np.array([z.covariance for z in epoch]))  # fmt: skip
        if fit.status == _core.RigidFitStatus.FITTED:
            yield _core.PoseObservation(stamp, fit.pose, fit.covariance)


def there_and_back(
    points: Sequence[FloatArray], speed_mps: float, turn_rate_radps: float, stand_s: float
) -> tuple[Drive, float]:
    """Return the drive from point to point that ends as it began, and how long it takes.

    It turns in place the short way, drives straight, and stands at the end. `points` are x and y in
    world, metres. Raises ValueError where the last is not the first, or there are less than three.
    """
    if len(points) < 3 or not np.array_equal(points[0], points[-1]):
        raise ValueError(f"{len(points)} points, expected three or more, the last being the first")
    start, motions, back = legs(np.array(points), speed_mps, turn_rate_radps)
    motions += [*back, (stand_s, 0.0, 0.0)]
    return drive_of(start, motions), sum(seconds for seconds, _, _ in motions)
