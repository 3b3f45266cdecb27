# SPDX-License-Identifier: Apache-2.0
"""What a mouse does to a scene: put things down, move them, take them away."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from locfuse.config.scenario import Nlos, Points, Roam
from locfuse.studio.document import Draft, Key, Problem, RefusedError
from locfuse.studio.scene import Scene

NLOS = {"kind": "nlos", "extra_m": 0.5, "sigma_m": 0.2}  # of the first wall that blocks ranges
CYLINDER_M = 0.15  # radius of landmarks once the first one is drawn as a cylinder
_SIM: Key = ("simulation",)
_ANCHORS: Key = (*_SIM, "anchors")
_LANDMARKS: Key = (*_SIM, "landmarks")
_WALLS: Key = (*_SIM, "map", "walls")
_FAULTS: Key = (*_SIM, "faults")


def add_anchor(scene: Scene, x: float, y: float) -> str:
    """Put an anchor down, as high as the one before; with the first one ranges are switched on."""

    def change(draft: Draft) -> None:
        there = draft.get(_ANCHORS) or {}
        z = list(there.values())[-1][2] if there else 0.0
        draft.set((*_ANCHORS, name), [x, y, z])
        if not there and draft.get((*_SIM, "ranges")) is None:
            draft.set((*_SIM, "ranges"), {})

    name = free_name("A", _names(scene, "anchors"))
    scene.edit(change)
    return name


def add_landmark(scene: Scene, x: float, y: float, *, cylinder: bool = False) -> str:
    """Put a landmark down; a cylinder gives all landmarks a radius if they have none."""

    def change(draft: Draft) -> None:
        draft.set((*_LANDMARKS, name), [x, y])
        if cylinder and not draft.get((*_SIM, "landmark_radius_m")):
            draft.set((*_SIM, "landmark_radius_m"), CYLINDER_M)

    name = free_name("L", _names(scene, "landmarks"))
    scene.edit(change)
    return name


def add_wall(scene: Scene, wall: Sequence[float], *, nlos: bool = False) -> None:
    """Put a wall down that the laser sees, or one that ranges are too long through, too."""

    def change(draft: Draft) -> None:
        if not nlos:
            draft.set((*_WALLS, len(draft.get(_WALLS) or [])), list(wall))
            return
        faults = draft.get(_FAULTS) or []
        there = next((i for i, fault in enumerate(faults) if fault["kind"] == "nlos"), None)
        if there is None:
            draft.set((*_FAULTS, len(faults)), {**NLOS, "walls": [list(wall)]})
        else:
            draft.set((*_FAULTS, there, "walls", len(faults[there]["walls"])), list(wall))

    if tuple(wall[:2]) == tuple(wall[2:]):
        raise RefusedError(
            [Problem((), "a wall needs two different ends; drag from one to the other")]
        )
    scene.edit(change)


def draw_path(scene: Scene, points: Sequence[Sequence[float]], *, closed: bool = False) -> None:
    """Let the robot drive through points, at the speed of the path before."""
    kept = [list(point) for k, point in enumerate(points) if k == 0 or point != points[k - 1]]
    if closed and len(kept) > 1 and kept[0] == kept[-1]:
        kept.pop()

    def change(draft: Draft) -> None:
        before = draft.get((*_SIM, "path"))
        speeds = {k: before[k] for k in ("speed_mps", "turn_rate_radps") if before.get(k)}
        path = {"shape": "points", **speeds, "points_m": kept}
        draft.set((*_SIM, "path"), {**path, "closed": True} if closed else path)

    scene.edit(change)


def move(scene: Scene, what: Key, x: float, y: float) -> None:
    """Move what was dragged to a place; an anchor keeps its height.

    `what` is as `world_of` names it: ``("anchor", name)``, ``("landmark", name)``, ``("wall",
    index, end)``, ``("nlos", fault, index, end)``, ``("point", index)`` of the path, or
    ``("center",)`` of it.
    """

    def change(draft: Draft) -> None:
        key = key_of(what)
        if what[0] == "anchor":
            draft.set(key, [x, y, draft.get(key)[2]])
        elif what[0] in ("wall", "nlos"):
            wall, end = list(draft.get(key)), int(what[-1])
            wall[2 * end : 2 * end + 2] = [x, y]
            draft.set(key, wall)
        else:
            draft.set(key, [x, y])

    scene.edit(change)


def remove(scene: Scene, what: Key) -> None:
    """Take something away; with the last of its kind what needs one is switched off."""

    def change(draft: Draft) -> None:
        key = key_of(what)
        draft.remove(key)
        if what[0] == "anchor":
            _without_anchor(draft, str(what[1]))
        if what[0] == "landmark" and not draft.get(_LANDMARKS):
            draft.set((*_SIM, "landmark_sightings"), None)
        if what[0] == "nlos" and not draft.get(key[:-1]):
            draft.remove(key[:-2])

    scene.edit(change)


def _without_anchor(draft: Draft, name: str) -> None:
    faults = draft.get(_FAULTS) or []
    left = [fault for fault in faults if fault.get("anchor") != name]
    if not draft.get(_ANCHORS):
        draft.set((*_SIM, "ranges"), None)
        left = [f for f in left if not _of_ranges(f)]
    if left != faults:
        draft.set(_FAULTS, left)


def _of_ranges(fault: dict[str, Any]) -> bool:
    kind = fault["kind"]
    return kind in ("nlos", "bias") or (
        kind in ("outliers", "dropouts") and fault.get("source", "ranges") == "ranges"
    ) or (kind == "latency" and fault.get("source") == "ranges")  # fmt: skip


def key_of(what: Key) -> Key:
    """Return where a thing that can be dragged stands in the document."""
    kind, *rest = what
    heads: dict[str, Key] = {
        "anchor": _ANCHORS,
        "landmark": _LANDMARKS,
        "wall": _WALLS,
        "nlos": _FAULTS,
        "point": (*_SIM, "path", "points_m"),
        "center": (*_SIM, "path", "center_m"),
    }
    if kind == "nlos":
        return (*_FAULTS, rest[0], "walls", rest[1])
    return (*heads[str(kind)], *rest[:1])


def rename(scene: Scene, what: Key, name: str) -> None:
    """Give an anchor or a landmark another name, wherever it is named.

    Raises RefusedError if the name is taken or empty.
    """
    group = key_of(what)[:-1]
    old = str(what[1])

    def change(draft: Draft) -> None:
        named = draft.get(group)
        if name in named:
            raise RefusedError(
                [Problem(key_of(what), f"there is another {what[0]} named {name!r}")]
            )
        draft.set(group, {name if k == old else k: at for k, at in named.items()})
        faults = draft.get(_FAULTS) or []
        if what[0] == "anchor" and any(fault.get("anchor") == old for fault in faults):
            draft.set(_FAULTS, [{**fault, "anchor": name} if fault.get("anchor") == old else fault
                                for fault in faults])  # fmt: skip
        known = draft.get(("anchors",)) or {}
        if what[0] == "anchor" and old in known:
            draft.set(("anchors",), {name if k == old else k: v for k, v in known.items()})

    if name != old:
        scene.edit(change)


def use_map(scene: Scene, file: str, size_m: tuple[float, float]) -> None:
    """Let the laser see the map of a file; the robot roams it where its path does not fit in."""

    def change(draft: Draft) -> None:
        draft.set((*_SIM, "map"), {"file": file})
        draft.set((*_SIM, "room_m"), list(size_m))

    def roaming(draft: Draft) -> None:
        change(draft)
        draft.set((*_SIM, "path"), {"shape": "roam"})

    simulation = scene.config.simulation
    if simulation is not None and isinstance(simulation.path, Points | Roam):
        scene.edit(change)
    else:
        scene.edit(roaming)


def nlos_walls(scene: Scene) -> list[tuple[int, int, tuple[float, float, float, float]]]:
    """Return (fault, index, wall) of each wall that ranges are too long through."""
    simulation = scene.config.simulation
    faults = [] if simulation is None else simulation.faults
    return [(k, i, wall) for k, fault in enumerate(faults) if isinstance(fault, Nlos)
            for i, wall in enumerate(fault.walls)]  # fmt: skip


def free_name(letter: str, taken: Iterable[str]) -> str:
    """Return the letter with the number after the highest that is taken.

    Examples
    --------
    >>> free_name("A", ["A1", "A7", "door"])
    'A8'
    """
    numbers = [int(m[1]) for name in taken if (m := re.fullmatch(rf"{letter}(\d+)", name))]
    return f"{letter}{max(numbers, default=0) + 1}"


def _names(scene: Scene, group: str) -> list[str]:
    simulation = scene.config.simulation
    if simulation is None:
        raise RefusedError(
            [Problem((), "this scene replays a log; make a new one to draw a world")]
        )
    return list(getattr(simulation, group))
