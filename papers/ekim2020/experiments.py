# SPDX-License-Identifier: Apache-2.0
"""Runs of ekim2020: solvers over noise, power-ups, starts that are right, wrong or unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.run.messages import truth_of
from locfuse.run.run import run
from locfuse.types import FloatArray, Log, RunResult, Trajectory
from papers.ekim2020.methods import (
    PowerUps,
    judged,
    power_up_states,
    rmse_over_bound,
    ten_degree_errors,
)
from papers.ekim2020.world import LAYOUTS, SIGMA_M, epochs, recording, tag_place, trials
from papers.recordings.reference_alignment import moved_truth
from papers.scores import rms


def noise_sweep() -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return noise levels [m] and, per solver and for the bound, RMSE [m] with five anchors."""
    levels = np.geomspace(0.01, 1.0, 9)
    anchors = LAYOUTS["2D, 5 anchors"]
    rmse: dict[str, list[float]] = {"bound": [], "ceres": [], "srwls": [], "srls": []}
    for seed, sigma in enumerate(levels, start=400):
        drawn = trials(anchors, float(sigma), seed, 4000)
        bound = float(np.sqrt(np.mean(np.trace(drawn.bound, axis1=1, axis2=2))))
        rmse["bound"].append(bound)
        for solver in ("ceres", "srwls", "srls"):
            rmse[solver].append(bound * rmse_over_bound(drawn, float(sigma), solver)[0])
    return levels, {name: np.array(values) for name, values in rmse.items()}


@dataclass(frozen=True)
class GazeboPowerUps:
    """Power-ups along the Gazebo runs.

    Attributes
    ----------
    config : RunConfig
        Of all of them.
    logs : list of Log
        Their truth is moved into the frame of the map.
    in_world, on_map : PowerUps
        The same states against the truth as published and as moved.
    """

    config: RunConfig
    logs: list[Log]
    in_world: PowerUps
    on_map: PowerUps


def gazebo_power_ups(configs: Path) -> GazeboPowerUps:
    """Power up at every scan of the Gazebo runs.

    Raises
    ------
    LogError
        If the recordings are not there.
    """
    logs, in_world, on_map = [], [], []
    for name in ("run3", "straight", "static"):
        config, log = recording(configs, "ieu_gazebo.yaml", name)
        states = power_up_states(log, config)
        logs.append(moved_truth(log))
        in_world.append(judged(states, log, 0.3, 10.0))
        on_map.append(judged(states, logs[-1], 0.3, 10.0))
    return GazeboPowerUps(config, logs, _joined(in_world), _joined(on_map))


def _joined(parts: Sequence[PowerUps]) -> PowerUps:
    columns = (np.concatenate([getattr(part, field.name) for part in parts])
               for field in fields(PowerUps))  # fmt: skip
    return PowerUps(*columns)


@dataclass(frozen=True)
class HeadingErrors:
    """Heading errors [rad] on every scan of the Gazebo runs, in the frame of their map.

    Of the paper's search in ten-degree steps at the position from the ranges, and of the pose found
    from nothing.
    """

    ten_degrees: FloatArray
    ours: FloatArray


def heading_errors(configs: Path) -> HeadingErrors:
    """Return the errors of both searches on every scan that has a truth.

    Raises
    ------
    LogError
        If the recordings are not there.
    """
    return heading_errors_of(gazebo_power_ups(configs))


def heading_errors_of(found: GazeboPowerUps) -> HeadingErrors:
    paper = np.concatenate([ten_degree_errors(log, found.config) for log in found.logs])
    return HeadingErrors(paper, found.on_map.heading_rad)


def bad_starts(configs: Path) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return heading errors of a start [deg] and the position errors at the end of run3 [m].

    As in Figs. 6 and 7 a robot starts with a wrong heading, believed to 2 degrees, and never
    relocalizes: by odometry alone, by the filter with ranges, and started from nothing.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    config, log = recording(configs, "ieu_gazebo.yaml", "run3")
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    x, y = truth.position[0].tolist()
    degrees = np.array([0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 90.0, 180.0])
    ends: dict[str, list[float]] = {"odometry": [], "filter": [], "auto": []}
    nothing = run(config.model_copy(update={"start": "auto"}), log)
    for off in degrees:
        start = (x, y, float(np.rad2deg(truth.heading[0])) + float(off))
        given = config.model_copy(update={"start": start, "when_lost": "go_on"})
        blind = given.model_copy(update={"use": ["odometry"]})
        ends["odometry"].append(_last_error(run(blind, log)))
        ends["filter"].append(_last_error(run(given, log)))
        ends["auto"].append(_last_error(nothing))
    return degrees, {name: np.array(values) for name, values in ends.items()}


def _last_error(result: RunResult) -> float:
    assert result.truth is not None
    return float(np.hypot(*errors_against(result.estimate, result.truth).position[-1]))


def final_rmse(result: RunResult) -> float:
    """Return the RMSE over the second half, when an exactly known start is forgotten."""
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    later = errors.stamp_ns >= (errors.stamp_ns[0] + errors.stamp_ns[-1]) // 2
    return rms(errors.position[later])


def planar_errors(log: Log, tag: str, loss: str, offsets: FloatArray | float = 0.0) -> FloatArray:
    anchors, ranges, height = epochs(log, tag)
    found = _core.locate_batch(anchors, ranges - offsets, SIGMA_M, height=height, loss=loss)
    placed = np.isfinite(found.position[:, 0])  # the last epochs of a site have few ranges
    errors: FloatArray = np.linalg.norm(found.position[placed] - tag_place(log, tag)[:2], axis=1)
    return errors


def body_errors(log: Log) -> FloatArray:
    """Return errors of the middle of the tags, each positioned alone."""
    found, true = [], []
    for tag in log.tags:
        anchors, ranges, height = epochs(log, tag)
        found.append(_core.locate_batch(anchors, ranges, SIGMA_M, height=height).position)
        true.append(tag_place(log, tag)[:2])
    rows = min(map(len, found))
    middle = np.mean([positions[:rows] for positions in found], axis=0)
    errors: FloatArray = np.linalg.norm(middle - np.mean(true, axis=0), axis=1)
    return errors[np.isfinite(errors)]


def range_residuals(log: Log, tag: str) -> FloatArray:
    anchors, ranges, _ = epochs(log, tag)
    distance = np.linalg.norm(anchors - tag_place(log, tag), axis=1)
    residuals: FloatArray = ranges - distance
    return residuals


def places_of(table: Any) -> FloatArray:
    return np.column_stack([table["x_m"], table["y_m"]]).astype(np.float64)


def pose_source_errors(log: Log, truth: Trajectory) -> FloatArray:
    poses = log["poses"]
    at = np.searchsorted(truth.stamp_ns, poses["stamp_ns"])
    errors: FloatArray = np.column_stack([poses["x_m"], poses["y_m"]]) - truth.position[at]
    return errors
