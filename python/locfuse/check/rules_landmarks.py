# SPDX-License-Identifier: Apache-2.0
"""Checks of the map of landmarks: against what is seen of it, and what it leaves open."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning
from locfuse.config.build import build_cylinder_detector
from locfuse.config.schema import IN_THE_PLANE
from locfuse.run.start import scans_of
from locfuse.types import FloatArray

_FILE = "landmarks.csv"
_LINE = 0.02  # width over length below which landmarks count as standing in one line
_SIMILAR = 0.1  # radii that differ by less than this share of the larger are the same
_SCANS = 200  # looked at with a free radius, spread over the log
_ARC = 8  # minimum beams to fit the radius of an arc
_ARCS = 20
_RARELY = 0.02  # cylinders per scan


@dataclass(frozen=True)
class _Seen:
    """The landmarks of a map, and how they are distinguished."""

    names: list[str]
    at: FloatArray  # (n, 2) [m]
    named: bool  # each sighting brings a name
    ranges: bool
    bearings: bool
    sigma_m: float  # of a range

    def __str__(self) -> str:
        return ", ".join(self.names)


def _seen(context: Context) -> _Seen | None:
    """Return the landmarks that sightings in use are of, None without any."""
    table, sightings = context.table("landmarks"), context.used("landmark_sightings")
    if table is None or sightings is None:
        return None
    sigma = sightings.get("sigma_range_m", context.config.estimator.landmark.sigma_range_m)
    return _Seen(
        names=[str(name) for name in table["landmark"]],
        at=np.column_stack([table["x_m"], table["y_m"]]),
        named=bool(np.all(sightings["landmark"] != "")),
        ranges=bool(np.any(np.isfinite(sightings["range_m"]))),
        bearings=bool(np.any(np.isfinite(sightings["bearing_rad"]))),
        sigma_m=float(np.median(sigma)),
    )


def _placed_otherwise(context: Context) -> bool:
    """Return whether something besides odometry and landmarks gives the position."""
    others = set(IN_THE_PLANE) - {"odometry", "landmark_sightings"}
    by_scans = context.log.grid is not None and context.table("scans") is not None
    return any(context.used(source) for source in others) or by_scans or bool(context.config.mcl)


def landmarks_in_one_place(context: Context) -> Iterator[Finding]:
    """Name landmarks in the same place, and those that overlap."""
    table = context.table("landmarks")
    if table is None or context.used("landmark_sightings") is None:
        return
    names, at = table["landmark"], np.column_stack([table["x_m"], table["y_m"]])
    radius = table.get("radius_m", np.zeros(len(names)))
    apart = np.linalg.norm(at[:, None] - at[None], axis=-1)
    both = radius[:, None] + radius[None]
    for i, j in np.argwhere(np.triu((apart < 1e-6) | (apart < both), 1)).tolist():
        if apart[i, j] < 1e-6:
            yield error(f"landmarks {names[i]} and {names[j]} have the same place", _FILE,
                        "measure both; one row is a copy")  # fmt: skip
        else:
            yield warning(f"landmarks {names[i]} and {names[j]} are {apart[i, j]:.2g} m apart, "
                          f"less than their radii together, {both[i, j]:.2g} m", _FILE,
                          "check their places and radii")  # fmt: skip


def unknown_landmarks(context: Context) -> Iterator[Finding]:
    """Name landmarks that are seen but not placed, or placed but never seen."""
    table, sightings = context.table("landmarks"), context.used("landmark_sightings")
    if table is None or sightings is None:
        return
    placed = [str(name) for name in table["landmark"]]
    names, counts = np.unique(sightings["landmark"], return_counts=True)
    seen = dict(zip(names.tolist(), counts.tolist(), strict=True))
    for name in sorted(set(seen) - set(placed) - {""}):
        share = 100.0 * seen[name] / len(sightings["stamp_ns"])
        yield warning(f"landmark {name!r} is seen ({share:.3g} % of the sightings) but has no "
                      "place: those sightings are ignored", _FILE,
                      f"add {name!r}, or correct its name; known are: "
                      f"{', '.join(placed)}")  # fmt: skip
    never = [] if "" in seen else [name for name in placed if name not in seen]
    if never:
        yield warning(f"landmarks {', '.join(never)} have a place but are never seen", _FILE,
                      "do their names match those in the log?")  # fmt: skip


def too_few_landmarks(context: Context) -> Iterator[Finding]:
    """Say what of the pose one or two landmarks, or a line of them, leave open."""
    seen = _seen(context)
    if seen is None or _placed_otherwise(context):
        return
    add = "add a landmark off the line, ranges, positions or poses"
    if len(seen.names) == 1:
        yield warning("one landmark leaves a turn about it open: position and heading are "
                      "unobservable together", _FILE,
                      "add a second landmark, ranges, positions or poses")  # fmt: skip
    elif not seen.bearings and _in_one_line(seen.at):
        judge = warning if context.config.start != "auto" else error
        yield judge(f"ranges only, to landmarks in one line ({seen}): every pose has a mirror "
                    "image across their line with the same ranges, and the start decides which is "
                    "taken", _FILE, add)  # fmt: skip
    elif len(seen.names) == 2 and not seen.ranges:
        yield warning(f"bearings only, of two landmarks ({seen}): standing still a circle of poses "
                      "through both fits; driving with odometry resolves it", _FILE,
                      "add a third landmark, or ranges")  # fmt: skip
    elif len(seen.names) == 2:
        yield note(f"two landmarks ({seen}): range and bearing of both fix the pose"
                   f"{'' if seen.named else ' but for which is which'}; while only one is in view, "
                   "a turn about it is open", _FILE)  # fmt: skip


def _in_one_line(at: FloatArray) -> bool:
    extents = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    return len(at) == 2 or bool(extents[1] < _LINE * extents[0])


def ambiguous_landmarks(context: Context) -> Iterator[Finding]:
    """Say that a map without names has poses that see the same: its constellation is symmetric."""
    seen = _seen(context)
    if seen is None or seen.named or len(seen.names) < 2:
        return
    poses = _symmetries(seen.at, 3.0 * seen.sigma_m, mirrored=not seen.bearings)
    if poses < 2:
        return
    x, y = seen.at.mean(axis=0)
    turn = (
        f"turned by {360 / poses:.3g} degrees about" if seen.bearings else "turned or mirrored at"
    )
    judge: Callable[[str, str, str], Finding] = note
    resolved = "the start decides which"
    if _placed_otherwise(context):
        resolved = "other sources resolve it"
    elif context.config.start == "auto":
        judge, resolved = error, "nothing resolves it"
    yield judge(f"the map of landmarks is the same {turn} ({x:.3g}, {y:.3g}), and sightings have "
                f"no names: {poses} poses see the same; {resolved}", _FILE,
                "place a landmark that breaks the symmetry, or give a start")  # fmt: skip


def _symmetries(at: FloatArray, within_m: float, *, mirrored: bool) -> int:
    """Return how many turns (and mirror images) map places (n, 2) on places, none included."""
    z = (at - at.mean(axis=0)) @ np.array([1.0, 1.0j])
    outer = z[np.argmax(np.abs(z))]
    count = 0
    for image in (z, z.conj()) if mirrored else (z,):
        first = image[np.argmax(np.abs(z))]
        for target in z[np.abs(np.abs(z) - abs(outer)) <= within_m]:
            turn = target / first
            turned = image * turn / abs(turn)
            off = np.abs(turned[:, None] - z[None])
            count += bool(np.all(off.min(axis=0) <= within_m) and np.all(
                off.min(axis=1) <= within_m))  # fmt: skip
    return count


def undetected_cylinders(context: Context) -> Iterator[Finding]:
    """Say that scans show no cylinder, or hardly any, and whether they show anything."""
    table, scans = context.log.tables.get("landmark_sightings"), context.table("scans")
    laser = context.log.laser
    if context.config.cylinders is None or table is None or scans is None or laser is None:
        return
    found, count = len(table["stamp_ns"]), len(scans["stamp_ns"])
    if found >= _RARELY * count:
        return
    ranges = scans["ranges_m"]
    empty = ~np.any((ranges > laser["range_min_m"]) & (ranges < laser["range_max_m"]), axis=1)
    blank = f"; {np.count_nonzero(empty)} scans have no return at all" if empty.any() else ""
    yield warning(f"{found or 'no'} cylinder{'' if found == 1 else 's'} found in {count} scans"
                  f"{blank}", "cylinders", "check radius_m, least_beams, sigma_range_m, and "
                  "whether the laser sees anything")  # fmt: skip


def mismatched_radii(context: Context) -> Iterator[Finding]:
    """Compare radii of the configuration, of the map, and of arcs fitted with a free radius."""
    cylinders, landmarks = context.config.cylinders, context.table("landmarks")
    if cylinders is None or landmarks is None:
        return
    given, placed = cylinders.radius_m, landmarks.get("radius_m", np.zeros(0))
    placed = placed[placed > 0.0]
    if given > 0.0 and len(placed) and not np.any(_similar(placed, given)):
        yield warning(f"cylinders.radius_m is {given:g} m, the landmarks of landmarks.csv have "
                      f"{_span(placed)}", "cylinders.radius_m", "measure one, and write it in "
                      "both")  # fmt: skip
    arcs = _radii_of_arcs(context)
    if len(arcs) < _ARCS:
        return
    middle = float(np.median(arcs))
    seen = f"{len(arcs)} arcs fitted with a free radius have {middle:.3g} m (median)"
    if given > 0.0 and not _similar(np.array([given]), middle).all():
        yield warning(f"cylinders.radius_m is {given:g} m, but {seen}: cylinders are missed, or "
                      "off along the beam", "cylinders.radius_m", f"set it to {middle:.2g}, or "
                      "leave it out to fit each")  # fmt: skip
    ends = np.array([placed.min(), placed.max()]) if len(placed) else np.full(2, middle)
    if not (_similar(ends, middle).any() or ends[0] < middle < ends[1]):
        yield warning(f"the landmarks of landmarks.csv have a radius of {_span(placed)}, but "
                      f"{seen}", f"{_FILE}, radius_m", "measure a landmark")  # fmt: skip


def _similar(radii: FloatArray, other: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(radii - other) <= _SIMILAR * np.maximum(radii, other))


def _span(radii: FloatArray) -> str:
    low, high = float(radii.min()), float(radii.max())
    return f"{low:g} m" if low == high else f"{low:g} to {high:g} m"


def _radii_of_arcs(context: Context) -> FloatArray:
    """Return the well-determined radii of arcs, of scans spread over the log."""
    cylinders = context.config.cylinders
    assert cylinders is not None
    scans = scans_of(context.log)
    detector = build_cylinder_detector(
        cylinders.model_copy(update={"method": "arcs", "radius_m": 0.0})
    )
    found = [
        one for scan in scans[:: max(1, len(scans) // _SCANS)] for one in detector.detect(scan)
    ]
    clear = [one.radius for one in found if one.beams >= _ARC
             and np.sqrt(one.covariance[2, 2]) < _SIMILAR * one.radius]  # fmt: skip
    return np.array(clear, np.float64)
