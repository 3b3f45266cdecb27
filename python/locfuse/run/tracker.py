# SPDX-License-Identifier: Apache-2.0
"""The EKF of a run, of whichever kind, and what it maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_recovering_config
from locfuse.config.schema import RunConfig
from locfuse.run.messages import (
    Messages,
    known_landmarks,
    landmark_sight,
    landmarks_of,
    radios_of,
    truth_of,
)
from locfuse.run.missing_inputs import how_to_add
from locfuse.run.start import matcher_of, start_from_nothing, start_height, start_of
from locfuse.types import Log, LogError, MappedLandmarks, Start

TRIANGLE = 3


@dataclass(frozen=True)
class Started:
    """An EKF at its start.

    Messages up to `used_until` were used to find the start; None if it was given.
    """

    filter: _core.RecoveringEkf
    stamp_ns: int
    used_until: int | None
    found: Start | None


def recovering_ekf(
    config: RunConfig,
    world: Log,
    landmark_names: list[str],
    anchors: _core.AnchorMap,
    tags: Sequence[_core.Tag],
    *,
    matches_scans: bool = True,
    start_height: float | None = None,
) -> _core.RecoveringEkf:
    """Return the EKF that a configuration asks for, in a world; it has not started.

    Ids of landmarks are their places in `landmark_names`; `start_height` [m] overrides that of the
    configuration. Raises LogError where the world does not
    have what the kind needs.
    """
    kind = config.estimator.kind
    if kind == "tag_triangle" and len(tags) != TRIANGLE:
        raise LogError(f"estimator.kind 'tag_triangle' needs {TRIANGLE} tags, the log places "
                       f"{list(world.tags)}; {how_to_add(world, 'tags')}")  # fmt: skip
    known: list[_core.KnownLandmark] = []
    if kind == "landmark_slam" and config.estimator.landmark_slam.use_map:
        known = known_landmarks(world, landmark_names)
    settings = build_recovering_config(config, known)
    if start_height is not None:
        settings.start_height = start_height
    try:
        return _core.RecoveringEkf(settings, _core.World(
            anchors, list(tags), landmark_sight(world, landmark_names),
            matcher=matcher_of(world) if matches_scans else None))  # fmt: skip
    except ValueError as error:
        if kind != "tag_triangle":
            raise
        raise LogError(f"estimator.kind 'tag_triangle': {error}") from error


def started_ekf(
    config: RunConfig, log: Log, messages: Messages, start: _core.PoseEstimate | None
) -> Started:
    """Return the EKF at a given start, or at the one that the configuration asks for."""
    anchors, tags = radios_of(log, messages, config)
    landmarks = landmarks_of(log, messages)
    truth, height = truth_of(log), None
    if start is None and config.start == "truth" and config.estimator.kind == "air":
        height = start_height(truth, messages)
    recovering = recovering_ekf(config, log, messages.landmark_names, anchors, tags,
                                start_height=height)  # fmt: skip
    used_until, found = None, None
    if start is None and config.searches_start:
        initializer, used_until, found = start_from_nothing(
            config, log, messages.log, messages.begin_ns, anchors, tags, landmarks
        )
        recovering.start_from(initializer)
    else:
        recovering.start_at(start_of(config, truth, messages) if start is None else start)
    return Started(recovering, recovering.current().stamp, used_until, found)


def mapping_metrics(
    config: RunConfig, log: Log, landmarks: MappedLandmarks | None
) -> dict[str, Any]:
    """Return the entry ``mapping`` of ``metrics.json``; none of an EKF that does not map.

    Errors of mapped landmarks are those against the log's landmarks of the same names.
    """
    if landmarks is None:
        return {}
    figures: dict[str, Any] = {"landmarks": len(landmarks), "rmse_m": None, "nees_mean": None}
    if "landmarks" in log and not config.estimator.landmark_slam.use_map:
        table = log["landmarks"]
        places = dict(zip(table["landmark"].tolist(), zip(table["x_m"], table["y_m"], strict=True),
                          strict=True))  # fmt: skip
        rows = [row for row, name in enumerate(landmarks.name.tolist()) if name in places]
        if rows:
            true = np.array([places[name] for name in landmarks.name[rows].tolist()])
            off = landmarks.position[rows] - true
            solved = np.linalg.solve(landmarks.covariance[rows], off[:, :, None])[:, :, 0]
            figures["rmse_m"] = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
            figures["nees_mean"] = float(np.mean(np.sum(off * solved, axis=1)))
    return {"mapping": figures}


def mapped_landmarks(
    config: RunConfig, landmarks: Sequence[_core.LandmarkEstimate], names: Sequence[str]
) -> MappedLandmarks | None:
    """Return the confirmed landmarks of an EKF that maps, None of one that does not.

    `names` are in order of id.
    """
    if config.estimator.kind != "landmark_slam":
        return None
    found = [landmark for landmark in landmarks if landmark.confirmed]
    unnamed = (name for name in map("new{}".format, count(1)) if name not in names)
    return MappedLandmarks(
        name=np.array([names[one.id] if one.id >= 0 else next(unnamed) for one in found],
                      dtype=np.str_),
        position=np.array([one.position for one in found], np.float64).reshape(-1, 2),
        covariance=np.array([one.covariance for one in found], np.float64).reshape(-1, 2, 2),
        sightings=np.array([one.sightings for one in found], np.int64),
    )  # fmt: skip
