# SPDX-License-Identifier: Apache-2.0
"""The cylinder detector in simulated scans: missed cylinders, false ones, errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from locfuse import _core
from locfuse.config.scenario import People
from locfuse.sim.obstacles import hidden_by, walk
from locfuse.types import FloatArray, GridMap
from papers.claims import Claim, Progress, claim_of, claims_of
from papers.wells.world import BEAM_RAD, CYLINDERS, RADIUS_M, SIGMA_BEAM_M

RANGE_MIN_M, RANGE_MAX_M = 0.05, 12.0
MIN_BEAMS = 8  # that end on a cylinder which must be found
NEAR_M = 0.5  # of a cylinder: it is the one that was found
MAX_RANGE_M = 3.5  # centres whose error counts
# Expected with the radius free and known, and how far off: 99.9 % of the mean of 400.
NEES = {False: (3.0, 0.45), True: (2.0, 0.33)}
SCANS = 30  # of a seed, with cylinders to find
SCANS_FALSE = 200  # the same, of worlds without a cylinder
THIN_M = (0.5, 0.2, 0.1)  # radii of cylinders that stand alone
# Somebody who walks, at the height of a laser: two legs that swing.
LEG_M, ASIDE_M, STRIDE_M = 0.07, 0.1, 0.7  # radius, of each from the middle, of a step
WALKERS, WALK_S, SCANS_PER_S = 3, 12.0, 5.0
POLE_M = 0.1
POLES = np.array([[3.0, 2.5], [7.0, 3.0], [5.0, 6.0]])
ROOM_M = (10.0, 8.0)
_THIN = {"radius_m": POLE_M, "least_corner_evidence": -20.0, "least_beams": 3}
LEGS: dict[str, tuple[str, dict[str, float]]] = {  # what a detector knows where people walk
    "default": ("nothing known", {}),
    "poles": ("poles of 0.1 m known", _THIN),
    "pairs": ("poles of 0.1 m known, pairs are legs", {**_THIN, "leg_distance_m": 0.8}),
    "pillars": ("pillars of 0.3 m known", {"radius_m": 0.3}),
}


@dataclass
class Found:
    """What became of cylinders with `MIN_BEAMS` beams and more."""

    in_view: int = 0
    missed: int = 0
    false_ones: int = 0
    off_m: list[float] = field(default_factory=list)
    bound_m2: list[FloatArray] = field(default_factory=list)  # Cramer and Rao's, of the centre
    closest_off_m: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)


def cylinder_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return all rows."""
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(lambda name=name, known=known: _found(name, known, seeds)
          for name in WORLDS for known in (False, True)),
        *(lambda name=name: _false(name, seeds) for name in BOXES),
        *(lambda name=name: _walking(name, seeds) for name in LEGS),
    ]  # fmt: skip
    return claims_of(parts, progress)


def _found(name: str, known: bool, seeds: int) -> Iterator[Claim]:
    found = look_for(name, known, seeds)
    key = f"cylinders_{name}_{'known' if known else 'free'}"
    what = f"{WORLDS[name][0]}, radius {'known' if known else 'free'}: "
    clean = name == "wells"
    yield Claim(f"{key}_missed", f"{what}missed", "", None, found.missed, found.missed,
                found.missed, "0" if clean else "-", found.missed == 0 or not clean,
                f"of {found.in_view} that {MIN_BEAMS} beams and more show")  # fmt: skip
    yield claim_of(f"{key}_error", f"{what}error of the centre", "mm", None,
                   [1e3 * off for off in found.off_m], "<= 5", lambda v: v <= 5.0)  # fmt: skip
    times = float(np.median(found.closest_off_m) / np.median(found.off_m))
    yield Claim(f"{key}_times", f"{what}closest beam / ours, medians", "", None, times, times,
                times, ">= 4", times >= 4.0)  # fmt: skip
    bound = 1e3 * float(np.median(errors_at_bound(found)))
    yield Claim(f"{key}_bound", f"{what}median error at the bound", "mm", None, bound, bound,
                bound, "-", True)  # fmt: skip
    nees = float(np.mean(found.nees))
    expected, slack = NEES[known]
    low, high = expected - slack, expected + slack
    yield Claim(f"{key}_nees", f"{what}NEES, mean", "", None, nees, nees, nees,
                f"{low:.2f}..{high:.2f}", low <= nees <= high)  # fmt: skip


def _false(name: str, seeds: int) -> Iterator[Claim]:
    count = sum(len(one) for one in false_ones(name, seeds))
    scans = seeds * SCANS_FALSE
    rate = 1e3 * count / scans
    yield Claim(f"cylinders_false_{name}", f"{BOXES[name][0]}: false ones in 1,000 scans", "", None,
                rate, rate, rate, "< 1", rate < 1.0, f"{count} in {scans} scans")  # fmt: skip


def _walking(name: str, seeds: int) -> Iterator[Claim]:
    found = walked(name, seeds)
    key, what = f"cylinders_legs_{name}", f"{WALKERS} people walk, {LEGS[name][0]}: "
    scans = seeds * round(WALK_S * SCANS_PER_S)
    rate = 1e3 * found.false_ones / scans
    yield Claim(f"{key}_false", f"{what}false ones in 1,000 scans", "", None, rate, rate, rate, "-",
                True, f"{found.false_ones} in {scans} scans")  # fmt: skip
    if name == "pillars":  # there is none
        return
    share = 100.0 * (1.0 - found.missed / found.in_view)
    yield Claim(f"{key}_poles", f"{what}poles found", "%", None, share, share, share, "-", True,
                f"of {found.in_view} that {MIN_BEAMS} beams and more show")  # fmt: skip


# Worlds -----------------------------------------------------------------------------------------


def _box(middle: FloatArray, size: FloatArray, turn: float) -> FloatArray:
    """Return the four walls of a box, shape (4, 2, 2): wall, end, (x, y)."""
    corners = 0.5 * size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    c, s = np.cos(turn), np.sin(turn)
    turned = middle + corners @ np.array([[c, s], [-s, c]])
    return np.stack([turned, np.roll(turned, -1, axis=0)], axis=1)


def scan_of(
    eye: FloatArray, discs: FloatArray, radius_m: ArrayLike, walls: FloatArray,
    rng: np.random.Generator,
) -> tuple[_core.LaserScan, list[FloatArray]]:  # fmt: skip
    """Return what 360 beams see, and the bearings in its frame of those that end on each disc.

    Parameters
    ----------
    eye : float64 array, shape (3,)
        Pose of the laser, m and rad.
    discs : float64 array, shape (n, 2)
    radius_m : array_like, shape () or (n,)
    walls : float64 array, shape (m, 2, 2)
        Ends of each, in m.
    rng : numpy Generator
    """
    angle = eye[2] + BEAM_RAD
    radii = np.broadcast_to(np.asarray(radius_m, dtype=np.float64), len(discs)).tolist()
    far = np.array([hidden_by(disc[None, None], radius, eye[None, :2], angle[None])[0]
                    for disc, radius in zip(discs, radii, strict=True)])  # fmt: skip
    far = far.reshape(-1, len(angle))
    wall = _to_walls(eye[:2], angle, walls)
    nearest = np.minimum(far.min(axis=0, initial=np.inf), wall)
    on = [BEAM_RAD[(one == nearest) & (one < RANGE_MAX_M)] for one in far]
    ranges = nearest + SIGMA_BEAM_M * rng.standard_normal(len(angle))
    laser = _core.LaserGeometry(_core.Pose2(), float(BEAM_RAD[0]), float(np.deg2rad(1.0)),
                                RANGE_MIN_M, RANGE_MAX_M)  # fmt: skip
    inside = (ranges > RANGE_MIN_M) & (ranges < RANGE_MAX_M)
    return _core.LaserScan(0, laser, np.where(inside, ranges, np.nan)), on


def _to_walls(start: FloatArray, angle: FloatArray, walls: FloatArray) -> FloatArray:
    """Return how far beams go until they meet a wall, infinite where none does."""
    if len(walls) == 0:
        return np.full(angle.shape, np.inf)
    along = np.stack([np.cos(angle), np.sin(angle)])
    a, edge = walls[:, 0] - start, walls[:, 1] - walls[:, 0]
    across = along[0] * edge[:, 1:] - along[1] * edge[:, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (a[:, :1] * edge[:, 1:] - a[:, 1:] * edge[:, :1]) / across
        share = (a[:, :1] * along[1] - a[:, 1:] * along[0]) / across
    hit = (reach > 0.0) & (share >= 0.0) & (share <= 1.0)
    nearest: FloatArray = np.where(hit, reach, np.inf).min(axis=0)
    return nearest


def _wells(rng: np.random.Generator) -> FloatArray:
    while True:
        eye = rng.uniform([-3.8, -3.8, -np.pi], [3.8, 3.8, np.pi])
        if np.hypot(*(CYLINDERS - eye[:2]).T).min() > RADIUS_M + 0.3:
            return eye


def _alone(radius_m: float, rng: np.random.Generator) -> FloatArray:
    """Return where the laser is if the cylinder stands at the origin."""
    range_m, side = radius_m + rng.uniform(0.5, MAX_RANGE_M), rng.uniform(-np.pi, np.pi)
    return np.array([range_m * np.cos(side), range_m * np.sin(side), rng.uniform(-np.pi, np.pi)])


_NO_WALLS = np.empty((0, 2, 2))
_ROOM_OF_WELLS = _box(np.zeros(2), np.array([9.0, 8.0]), 0.0)
World = tuple[str, FloatArray, float, FloatArray, Callable[[np.random.Generator], FloatArray]]
WORLDS: dict[str, World] = {
    "wells": ("world of wells", CYLINDERS, RADIUS_M, _NO_WALLS, _wells),
    "room": ("the same in a room of 9 x 8 m", CYLINDERS, RADIUS_M, _ROOM_OF_WELLS, _wells),
    **{f"{radius:g}": (f"radius {radius:g} m", np.zeros((1, 2)), radius, _NO_WALLS,
                       partial(_alone, radius)) for radius in THIN_M},
}  # fmt: skip


def _free_boxes(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return a room of 8 x 6 m with three boxes that stand free, and where the laser is."""
    walls = [_box(np.zeros(2), np.array([8.0, 6.0]), 0.0)]
    for x in (-2.6, 0.0, 2.6):
        middle = np.array([x + rng.uniform(-0.3, 0.3), rng.uniform(1.4, 1.8)])
        walls.append(_box(middle, rng.uniform(0.3, 1.2, 2), rng.uniform(-np.pi, np.pi)))
    return np.concatenate(walls), rng.uniform([-3.5, -2.5, -np.pi], [3.5, 0.3, np.pi])


def _any_boxes(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return the same with six boxes anywhere, across each other and through walls."""
    walls = [_box(np.zeros(2), np.array([8.0, 6.0]), 0.0)]
    boxes = [(rng.uniform([-4.0, -3.0], [4.0, 3.0]), rng.uniform(0.2, 1.5, 2),
              rng.uniform(-np.pi, np.pi)) for _ in range(6)]  # fmt: skip
    walls += [_box(*box) for box in boxes]
    while True:
        eye = rng.uniform([-3.8, -2.8, -np.pi], [3.8, 2.8, np.pi])
        if not any(_is_inside(eye[:2], *box) for box in boxes):
            return np.concatenate(walls), eye


def _is_inside(place: FloatArray, middle: FloatArray, size: FloatArray, turn: float) -> bool:
    off, c, s = place - middle, np.cos(turn), np.sin(turn)
    return bool(abs(c * off[0] + s * off[1]) <= 0.5 * size[0] + 0.2
                and abs(c * off[1] - s * off[0]) <= 0.5 * size[1] + 0.2)  # fmt: skip


BOXES = {
    "boxes": ("a room with three boxes that stand free", _free_boxes),
    "clutter": ("a room with six boxes across each other and through walls", _any_boxes),
}


def legs_of(time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return where the legs of people are who walk about the room.

    Returns
    -------
    float64 array, shape (n, 2 * people, 2)
        The right legs after all left ones, which swing against each other.
    """
    cells = np.zeros((round(ROOM_M[1] / 0.1), round(ROOM_M[0] / 0.1)), np.int8)
    people = People(count=WALKERS)
    fine = np.arange(0.0, time_s[-1] + 0.2, 0.1)
    way = walk(GridMap(cells, 0.1), people, fine, rng)
    step = np.diff(way, axis=0)
    length = np.hypot(step[..., 0], step[..., 1])
    ahead = step / np.maximum(length, 1e-9)[..., None]
    walks = length > 1e-3 * length.max()  # or has turned away from a wall
    ahead[0, ~walks[0]] = (1.0, 0.0)
    for k in range(1, len(ahead)):  # who stands faces on
        ahead[k] = np.where(walks[k][:, None], ahead[k], ahead[k - 1])
    gone = np.concatenate([np.zeros((1, WALKERS)), np.cumsum(length, axis=0)])
    at = np.searchsorted(fine, time_s + 1e-9) - 1
    phase = gone[at] / STRIDE_M * np.pi + rng.uniform(-np.pi, np.pi, WALKERS)
    along, left = ahead[at], ahead[at] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    swing = (0.5 * STRIDE_M * np.sin(phase))[..., None] * along
    legs = [way[at] + side * (ASIDE_M * left + swing) for side in (1.0, -1.0)]
    both: FloatArray = np.concatenate(legs, axis=1)
    return both


# Runs -------------------------------------------------------------------------------------------


def _judge(
    into: Found, found: list[_core.Cylinder], scan: _core.LaserScan, centres: FloatArray,
    on: list[FloatArray], radius_m: float, known: bool,
) -> None:  # fmt: skip
    at = np.array([[one.range * np.cos(one.bearing), one.range * np.sin(one.bearing)]
                   for one in found]).reshape(-1, 2)  # fmt: skip
    off = np.hypot(*(at[:, None] - centres).transpose(2, 0, 1))
    into.false_ones += int(np.sum(off.min(axis=1, initial=np.inf) > NEAR_M))
    for disc, beams in enumerate(on):
        if len(beams) < MIN_BEAMS:
            continue
        into.in_view += 1
        near = np.flatnonzero(off[:, disc] <= NEAR_M)
        if len(near) == 0:
            into.missed += 1
            continue
        best = near[np.argmin(off[near, disc])]
        one, centre = found[best], centres[disc]
        range_m, bearing = np.hypot(*centre), np.arctan2(centre[1], centre[0])
        if range_m > radius_m + MAX_RANGE_M:
            continue
        into.off_m.append(float(off[best, disc]))
        into.bound_m2.append(_bound(centre, radius_m, beams, known))
        beam = _core.closest_beam(scan, one.first, one.last, radius_m)
        end = beam.range * np.array([np.cos(beam.bearing), np.sin(beam.bearing)])
        into.closest_off_m.append(float(np.hypot(*(end - centre))))
        error = np.array([one.range - range_m, _core.wrap_angle(float(one.bearing - bearing)),
                          one.radius - radius_m])  # fmt: skip
        rows = 2 if known else 3
        P = one.covariance[:rows, :rows]
        into.nees.append(float(error[:rows] @ np.linalg.solve(P, error[:rows])))


def errors_at_bound(found: Found) -> FloatArray:
    """Return one draw per centre of the error [m] at the Cramer-Rao bound."""
    root = np.linalg.cholesky(np.array(found.bound_m2))
    normal = np.random.default_rng(0).standard_normal((len(root), 2, 1))
    errors: FloatArray = np.hypot(*(root @ normal)[..., 0].T)
    return errors


def _bound(centre: FloatArray, radius_m: float, bearings: FloatArray, known: bool) -> FloatArray:
    """Return the minimum covariance of a centre [m^2] that ranges to a circle leave.

    A point p on it moves along its beam b by (n . dc + dr) / (n . b), n the normal at p.
    """
    along = np.column_stack([np.cos(bearings), np.sin(bearings)])
    middle = along @ centre
    aside = np.sum(centre**2) - middle**2
    near = middle - np.sqrt(np.maximum(radius_m**2 - aside, 0.0))
    normal = (near[:, None] * along - centre) / radius_m
    rows = np.column_stack([normal, np.ones(len(bearings))])[:, : 2 if known else 3]
    rows /= SIGMA_BEAM_M * np.sum(normal * along, axis=1)[:, None]
    bound: FloatArray = np.linalg.inv(rows.T @ rows)[:2, :2]
    return bound


def _from(eye: FloatArray, places: FloatArray) -> FloatArray:
    """Return places in the laser's frame."""
    off, c, s = places - eye[:2], np.cos(eye[2]), np.sin(eye[2])
    return np.column_stack([c * off[:, 0] + s * off[:, 1], c * off[:, 1] - s * off[:, 0]])


def _detector(**changed: float) -> _core.CylinderDetector:
    settings: dict[str, Any] = {"sigma_range_m": SIGMA_BEAM_M, **changed}
    return _core.CylinderDetector(_core.CylinderDetectorConfig(**settings))


def look_for(name: str, known: bool, seeds: int) -> Found:
    """Look for the cylinders of one of the `WORLDS`, from `SCANS` places a seed."""
    _, discs, radius_m, walls, place = WORLDS[name]
    detector = _detector(radius_m=radius_m if known else 0.0)
    result = Found()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for _ in range(SCANS):
            eye = place(rng)
            scan, on = scan_of(eye, discs, radius_m, walls, rng)
            _judge(result, detector.detect(scan), scan, _from(eye, discs), on, radius_m, known)
    return result


def false_ones(name: str, seeds: int) -> Iterator[list[_core.Cylinder]]:
    """Yield what is taken for cylinders in each scan of one of the `BOXES`, where there is none."""
    detector = _detector()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for _ in range(SCANS_FALSE):
            walls, eye = BOXES[name][1](rng)
            yield detector.detect(scan_of(eye, np.empty((0, 2)), 0.0, walls, rng)[0])


def walked(name: str, seeds: int) -> Found:
    """Stand in a room with three poles where people walk, who may walk through a pole."""
    detector = _detector(**LEGS[name][1])
    walls = _box(0.5 * np.array(ROOM_M), np.array(ROOM_M), 0.0)
    time = np.arange(round(WALK_S * SCANS_PER_S)) / SCANS_PER_S
    result = Found()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        legs = legs_of(time, rng)
        radii = [POLE_M] * len(POLES) + [LEG_M] * legs.shape[1]
        eye = np.array([5.0, 4.0, 0.0]) + rng.uniform([-3, -2, -np.pi], [3, 2, np.pi])
        for k in range(len(time)):
            discs = np.concatenate([POLES, legs[k]])
            scan, on = scan_of(eye, discs, radii, walls, rng)
            _judge(result, detector.detect(scan), scan, _from(eye, POLES), on[: len(POLES)],
                   POLE_M, True)  # fmt: skip
    return result
