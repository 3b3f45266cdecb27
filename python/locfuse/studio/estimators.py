# SPDX-License-Identifier: Apache-2.0
"""Which estimators a scene can be run with, each a configuration of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from locfuse.config.schema import SOURCES, RunConfig
from locfuse.studio.document import Data, Draft, RefusedError, checked

_EKF = tuple(source for source in SOURCES if source != "odometry")


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


def _uses(*sources: str) -> Callable[[Draft], None]:
    def change(draft: Draft) -> None:
        draft.set(("use",), ["odometry", *sources])
        draft.set(("mcl",), None)
        if "landmark_sightings" not in sources:
            draft.set(("cylinders",), None)

    return change


def _particles(draft: Draft) -> None:
    draft.set(("mcl",), {**(draft.get(("mcl",)) or {}), "poses_hz": None, "switch": None})


def _particles_and_ekf(draft: Draft) -> None:
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
    if with_choice.mcl is not None and simulation.laser is None:
        return False
    if choice.key.startswith("mcl"):
        return True
    simulated = {source for source in SOURCES if getattr(simulation, source) is not None}
    if with_choice.cylinders is not None:
        simulated.add("landmark_sightings")
    used = [source for source in with_choice.use if source in simulated]
    wanted = list(with_choice.use) if choice.key != "all" else used
    return set(wanted) <= set(used) and (choice.key != "all" or len(used) > 2)


def variant(choice: Choice, data: Data, config: RunConfig) -> Data:
    """Return the document that a choice makes of a scene."""
    draft = Draft(data, config)
    choice.change(draft)
    return draft.data
