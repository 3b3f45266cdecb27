# SPDX-License-Identifier: Apache-2.0
"""Which estimators a scene can be run with, each a configuration of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from locfuse.config.schema import LEFT_OUT, USABLE, Kind, RunConfig
from locfuse.run.tracker import TRIANGLE
from locfuse.studio.document import Data, Draft, RefusedError, checked

_OF_SEVERAL_HEIGHTS_M = 1.0  # by which anchors differ that give a height
_EKF = tuple(source for source in USABLE if source != "odometry")


@dataclass(frozen=True)
class Choice:
    """An estimator to choose.

    `key` is the name of its folder, `what` a sentence on what it does; `change` makes a scene's
    draft the configuration that it is run with.
    """

    key: str
    name: str
    what: str
    change: Callable[[Draft], None]


def _set_kind(draft: Draft, kind: Kind) -> None:
    """Change the kind of the EKF, and leave out what belongs to others."""
    if draft.get(("estimator", "kind")) == kind:
        return
    for key in LEFT_OUT[kind]:
        draft.remove(("estimator", key))
    draft.set(("estimator", "kind"), kind)


def _uses(*sources: str) -> Callable[[Draft], None]:
    def change(draft: Draft) -> None:
        _set_kind(draft, "pose")
        draft.set(("use",), ["odometry", *sources])
        draft.set(("mcl",), None)
        if "landmark_sightings" not in sources:
            draft.set(("cylinders",), None)

    return change


def _maps(draft: Draft) -> None:
    _set_kind(draft, "landmark_slam")
    draft.set(("use",), list(USABLE))
    draft.set(("mcl",), None)
    draft.set(("estimator", "landmark_slam", "use_map"), False)


def _of_kind(kind: Kind) -> Callable[[Draft], None]:
    def change(draft: Draft) -> None:
        _set_kind(draft, kind)
        draft.set(("use",), list(USABLE))
        draft.set(("mcl",), None)
        draft.set(("cylinders",), None)

    return change


def _particles(draft: Draft) -> None:
    _set_kind(draft, "pose")
    draft.set(("mcl",), {**(draft.get(("mcl",)) or {}), "poses_hz": None, "switch": None})


def _particles_and_ekf(draft: Draft) -> None:
    _set_kind(draft, "pose")
    poses_hz = (draft.get(("mcl",)) or {}).get("poses_hz") or 2.0
    draft.set(("mcl",), {**(draft.get(("mcl",)) or {}), "poses_hz": poses_hz, "switch": None})
    if "poses" not in draft.get(("use",)):
        draft.set(("use",), [*draft.get(("use",)), "poses"])


CHOICES = (
    Choice("as_set", "as set", "What the scene's own blocks say.", lambda draft: None),
    Choice("odometry", "odometry alone", "Dead reckoning: what the wheels say.", _uses()),
    Choice("odometry_uwb", "odometry + UWB", "Pose EKF of odometry and ranges.", _uses("ranges")),
    Choice("odometry_poses", "odometry + poses",
           "Pose EKF of odometry and the poses of another localizer.", _uses("poses")),
    Choice("odometry_positions", "odometry + positions",
           "Pose EKF of odometry and position fixes.", _uses("positions")),
    Choice("odometry_landmarks", "odometry + landmarks",
           "Pose EKF of odometry and sightings of landmarks.", _uses("landmark_sightings")),
    Choice("all", "all sources", "Pose EKF of everything but scans.", _uses(*_EKF)),
    Choice("tag_triangle", "three tags",
           "Positions and velocities of three tags: odometry, ranges and positions of tags.",
           _of_kind("tag_triangle")),
    Choice("air", "in the air", "Position, heading and height of a body that flies.",
           _of_kind("air")),
    Choice("landmark_slam", "mapping",
           "Landmarks are mapped while it localizes on them; none is known before.",
           _maps),
    Choice("mcl", "particles", "Monte Carlo localization: scans on the map, and the rest.",
           _particles),
    Choice("mcl_ekf", "particles + EKF", "Poses of the particles go into the pose EKF.",
           _particles_and_ekf),
)  # fmt: skip


def choices(data: Data, config: RunConfig) -> list[Choice]:
    """Return the estimators that a scene has the sensors for; of a log nobody knows before."""
    return [choice for choice in CHOICES if _can(choice, data, config)]


def _can(choice: Choice, data: Data, config: RunConfig) -> bool:
    simulation = config.simulation
    try:
        with_choice = checked(variant(choice, data, config))
    except RefusedError:
        return False
    if simulation is None or choice.key == "as_set":
        return True
    if with_choice.mcl is not None and not simulation.scanners:
        return False
    if choice.key.startswith("mcl"):
        return True
    simulated = {source for source in USABLE if getattr(simulation, source) is not None}
    if with_choice.cylinders is not None:
        simulated.add("landmark_sightings")
    if choice.key == "tag_triangle":
        of_tags = simulation.positions is not None and simulation.positions.tags
        return len(simulation.tags) == TRIANGLE and ("ranges" in simulated or bool(of_tags))
    if choice.key == "landmark_slam":
        return "landmark_sightings" in simulated
    if choice.key == "air":
        heights = [place[2] for place in simulation.anchors.values()]
        return "ranges" in simulated and max(heights) - min(heights) > _OF_SEVERAL_HEIGHTS_M
    used = [source for source in with_choice.use if source in simulated]
    wanted = list(with_choice.use) if choice.key != "all" else used
    return set(wanted) <= set(used) and (choice.key != "all" or len(used) > 2)


def variant(choice: Choice, data: Data, config: RunConfig) -> Data:
    """Return the document that a choice makes of a scene."""
    draft = Draft(data, config)
    choice.change(draft)
    return draft.data
