# SPDX-License-Identifier: Apache-2.0
"""Checks of where the anchors are, and of which states they leave unobservable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, note, warning
from locfuse.check.grid import on_map
from locfuse.check.positions import dop
from locfuse.config.schema import IN_THE_PLANE
from locfuse.types import FloatArray

_LINE = 0.02  # width over length below which anchors count as standing in one line
_NEARLY_LINE = 0.08
_PLANE = 0.02
_STILL_M = 0.2
_LOST = 100.0  # dilution beyond which more is no worse


def anchors_in_one_place(context: Context) -> Iterator[Finding]:
    """Name anchors in the same place, and nearly so."""
    if context.used("ranges") is None:
        return
    for i, j in combinations(range(len(context.names)), 2):
        a, b = context.names[i], context.names[j]
        off = context.anchors[i] - context.anchors[j]
        apart, flat = float(np.linalg.norm(off)), float(np.linalg.norm(off[:2]))
        if apart < 1e-6:
            yield error(f"anchors {a} and {b} have the same place", "anchors.csv",
                        "measure both; one row is a copy")  # fmt: skip
        elif apart < max(0.3, 2.0 * context.typical_sigma) and apart < 0.2 * context.extent:
            yield warning(f"anchors {a} and {b} are {apart:.2g} m apart: nearly one anchor",
                          "anchors.csv", "move one of them, or check their places")  # fmt: skip
        elif flat < 0.05 * context.extent:
            yield note(f"anchors {a} and {b} stand above one another: for a robot on a floor they "
                       "are one direction", "anchors.csv")  # fmt: skip


def anchors_in_one_line(context: Context) -> Iterator[Finding]:
    """Say which anchors leave a mirror image of every position, or no position at all."""
    if context.used("ranges") is None:
        return
    anchors = _received(context)
    names = ", ".join(anchors)
    at = np.array([context.anchors[context.names.index(name), :2] for name in anchors])
    answers = "; other sources resolve the side" if _placed_otherwise(context) else ""
    judge = warning if answers or not context.config.searches_start else error
    if len(at) == 1:
        yield judge(f"one anchor ({names}): ranges fix a circle, not a position{answers}",
                    "anchors.csv", "add two anchors that are not in one line with it")  # fmt: skip
        return
    if len(at) == 0:
        return
    length, width = _length_and_width(at)
    if len(at) == 2 or width < _LINE * length:
        why = "two anchors" if len(at) == 2 else "anchors in one line"
        yield judge(f"{why} ({names}): every position has a mirror image across their line with "
                    f"the same ranges, and the start decides which is taken{answers}",
                    "anchors.csv", "add an anchor well off the line")  # fmt: skip
    elif width < _NEARLY_LINE * length:
        yield warning(f"anchors {names} are nearly in one line ({width:.2g} m wide, {length:.3g} m "
                      "long): the mirror image of a position fits almost as well", "anchors.csv",
                      "add an anchor well off the line")  # fmt: skip


def _received(context: Context) -> list[str]:
    """Return the placed anchors that speak."""
    table = context.used("ranges")
    received = set() if table is None else set(table["anchor"].tolist())
    return [name for name in context.names if name in received]


def _placed_otherwise(context: Context) -> bool:
    others = context.fused("poses"), context.used("positions"), context.config.mcl
    return any(other is not None for other in others)


def _length_and_width(at: FloatArray) -> tuple[float, float]:
    """Return the extents of points along and across their main direction."""
    off = at - at.mean(axis=0)
    _, _, axes = np.linalg.svd(off, full_matrices=False)
    sides = np.ptp(off @ axes.T, axis=0)
    return float(sides[0]), float(sides[1]) if len(sides) > 1 else 0.0


def anchors_in_one_plane(context: Context) -> Iterator[Finding]:
    """Report whether ranges determine height, and how the tag's height is known otherwise."""
    if context.used("ranges") is None or len(context.anchors) < 4:
        return
    off = context.anchors - context.anchors.mean(axis=0)
    _, _, axes = np.linalg.svd(off, full_matrices=False)
    thick = float(np.ptp(off @ axes[2]))
    if thick > _PLANE * context.extent:
        return
    level = float(np.ptp(context.anchors[:, 2])) <= _PLANE * context.extent
    height = float(context.anchors[:, 2].mean())
    how = f"at one height ({height:.3g} m)" if level else "in one plane"
    same = ", that of the tag" if level and abs(height - context.height) < 0.1 else ""
    yield note(f"anchors {', '.join(context.names)} are coplanar, {how}{same}: ranges do not give "
               f"a height from its mirror image; the tag's, {context.height:g} m, is taken as "
               "known", "anchors.csv")  # fmt: skip


def tags_on_the_floor(context: Context) -> Iterator[Finding]:
    """Name tags at height zero below anchors that all hang high."""
    if context.used("ranges") is None or len(context.anchors) == 0:
        return
    lowest = float(context.anchors[:, 2].min())
    for name, (_, _, z) in context.log.tags.items():
        if z == 0.0 and lowest > 0.8:
            yield warning(f"tag {name} has height 0, the lowest anchor {lowest:.3g} m: was the "
                          "tag's height left out?", "log.yaml, tags",
                          "measure heights of tags and anchors from the same floor")  # fmt: skip


def unobservable_states(context: Context) -> Iterator[Finding]:
    """Report which of position and heading no source in use observes."""
    sources = [s for s in IN_THE_PLANE if context.fused(s)]
    if not sources or context.config.mcl is not None:  # scans on a map give both
        return
    if sources == ["odometry"]:
        yield warning("position and heading are unobservable: odometry alone drifts from the start "
                      "on", "use", "use ranges, positions, poses or landmarks as well")  # fmt: skip
    if "landmark_sightings" in sources:  # see rules_landmarks
        return
    if "poses" in sources or not {"ranges", "positions"} & set(sources):
        return
    if _arms_apart(context):
        return
    if context.config.is_inertial:
        yield note("heading is unobservable standing still and in a steady circle; changes of "
                   "speed resolve it", "estimator.air.motion")  # fmt: skip
        return
    if "odometry" not in sources:
        yield warning("heading is unobservable: nothing measures it, and without odometry driving "
                      "does not help", "use",
                      "use odometry, or a second tag half a metre from the first")  # fmt: skip
        return
    text = "ranges to one tag" if "ranges" in sources else "fixes of one antenna"
    driven = _driven(context)
    if driven < _STILL_M:
        yield warning(f"heading is unobservable: {text} do not give it standing still, and the "
                      f"odometry drives {driven:.2g} m in all", "odometry.csv",
                      "the heading stays what start says; drive some metres")  # fmt: skip
    else:
        yield note(f"heading is unobservable standing still ({text}); driving resolves it: "
                   f"{driven:.3g} m in this log", "use")  # fmt: skip


def _arms_apart(context: Context) -> bool:
    """Return whether ranges or positions of several tags give the heading."""
    arms = np.array(list(context.arms.values())).reshape(-1, 2)
    if len(arms) < 2:
        return False
    sigma = context.typical_sigma
    if context.used("ranges") is None and context.antennas is not None:
        sigma = float(np.median(context.antennas[0]["sigma_m"]))
    return float(np.ptp(arms, axis=0).max()) > sigma


def _driven(context: Context) -> float:
    """Return the length of the path that odometry reports, metres."""
    if context.odometry is None:
        return 0.0
    return float(np.linalg.norm(np.diff(context.odometry.position, axis=0), axis=1).sum())


def geometry_where_the_robot_is(context: Context) -> Iterator[Finding]:
    """Report the dilution of precision along the way, and how much of it is outside the anchors."""
    where = _where(context)
    if where is None or len(_received(context)) < 3:
        return
    values = np.minimum(dop(_core.cramer_rao(context.anchors, where, 1.0, context.height)), _LOST)
    typical, worst = float(np.median(values)), float(np.quantile(values, 0.95))
    outside = 1.0 - float(inside_hull(where, context.anchors[:, :2]).mean())
    text = (
        f"horizontal dilution of precision along the way: median {typical:.2g}, 95 % {worst:.2g}; "
        f"{100 * outside:.0f} % of the way is outside the anchors' hull"
    )
    if worst > 5.0:
        yield warning(f"{text}: an error of a range counts {worst:.2g} times", "anchors.csv",
                      "add the anchor that the picture of the layout proposes")  # fmt: skip
    else:
        yield note(text, "anchors.csv")


def _where(context: Context) -> FloatArray | None:
    if context.used("ranges") is None:
        return None
    if context.truth is not None and context.frame_of_truth is None:
        return context.truth.position[:: max(1, len(context.truth) // 1000)]
    return None if context.fits is None else context.fits.position


def hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex hull of points (n, 2), counter-clockwise."""
    ordered = sorted(set(map(tuple, points.tolist())))
    if len(ordered) < 3:
        return np.array(ordered).reshape(-1, 2)
    chains: list[list[tuple[float, ...]]] = []
    for way in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for at in way:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], at) <= 0.0:
                chain.pop()
            chain.append(at)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def inside_hull(points: FloatArray, corners: FloatArray) -> NDArray[np.bool_]:
    """Return which points (n, 2) lie inside the convex hull of others or on it."""
    ring = hull(corners)
    if len(ring) < 3:
        return np.zeros(len(points), np.bool_)
    edge = np.roll(ring, -1, axis=0) - ring
    off = points[:, None, :] - ring[None]
    side = edge[:, 0] * off[..., 1] - edge[:, 1] * off[..., 0]
    size = np.linalg.norm(edge, axis=1) * 1e-9
    return np.asarray(np.all(side >= -size, axis=1))


def start_outside_floors(context: Context) -> Iterator[Finding]:
    """Name a start off the map, outside the room, or far from every anchor."""
    start = context.config.start
    if isinstance(start, str):
        return
    at = np.array([[start[0], start[1]]])
    grid = context.log.grid
    if grid is not None and not on_map(grid, at)[0]:
        yield error(f"start ({start[0]:g}, {start[1]:g}) is off the map", "start",
                    "give [x_m, y_m, heading_deg] in the frame of the map")  # fmt: skip
        return
    if context.floor is None:
        return
    low, high = context.floor
    margin = 0.0 if context.config.simulation is not None else float((high - low).max())
    if np.any(at[0] < low - margin) or np.any(at[0] > high + margin):
        yield error(f"start ({start[0]:g}, {start[1]:g}) is outside the floor, which reaches from "
                    f"({low[0]:.3g}, {low[1]:.3g}) to ({high[0]:.3g}, {high[1]:.3g})", "start",
                    "give [x_m, y_m, heading_deg] in the frame of the anchors")  # fmt: skip
