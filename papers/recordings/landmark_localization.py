# SPDX-License-Identifier: Apache-2.0
"""Localization on landmarks, simulated and recorded: rows for results/accuracy.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.build import build_estimator_config
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against
from locfuse.run.messages import landmarks_of, to_messages, trajectory_of, truth_of
from locfuse.run.run import run
from locfuse.run.start import start_of
from locfuse.types import Log, LogError, Trajectory
from papers.claims import Claim, Progress, absent, claim_of, claims_of, consistent
from papers.recorded import load_recording
from papers.recordings.cylinder_localization import cylinder_parts
from papers.recordings.landmark_mapping import instants_of
from papers.recordings.victoria_park import tree_parts
from papers.scores import rms

# A laser: its noise is what the publishers state. The robot is known to travel askew; lasers are
# mounted within a centimetre or two of the drawing, and report late.
TUBES = {
    "landmark": {"sigma_range_m": 0.030, "sigma_bearing_rad": 0.026},
    "calibration": {"sigma_direction_rad": 0.1, "sigma_sensor_m": 0.02, "sigma_delay_s": 0.1},
}
# A camera that reads barcodes: residuals of 0.08 to 0.13 m and 0.006 to 0.011 rad are stated, which
# depend on the distance; twice that at 3 m. Their tails are long, 1 to 4 % beyond half a metre: a
# tight gate would take a filter that is wrong for right.
CAMERA = {
    "landmark": {
        "sigma_range_m": 0.1,
        "sigma_range_relative": 0.05,
        "sigma_bearing_rad": 0.02,
        "gate": 0.99999,
    }
}
# Dataset, folder, run, sections of its estimator, required position RMSE [m].
RECORDINGS: dict[str, tuple[str, str, str | None, dict[str, Any], float]] = {
    "tubes": ("utias_tubes", "utias-tubes", None, TUBES, 0.035),
    "MRCLAM robot 1": ("mrclam6", "mrclam6", "robot1", CAMERA, 0.20),
    "MRCLAM robot 3": ("mrclam6", "mrclam6", "robot3", CAMERA, 0.20),
    "MRCLAM robot 5": ("mrclam6", "mrclam6", "robot5", CAMERA, 0.20),
}
APART_S = 10.0  # errors of these recordings, so far apart, have nothing to do with each other
# Small robots that turn on the spot, whose odometers measure distance well and turns badly: by dead
# reckoning the headings of MRCLAM's end 136, 94 and 61 degrees off after turning 46, 64 and 93 rad.
WHEELS = {
    "sigma_longitudinal_per_sqrt_m": 0.05,
    "sigma_lateral_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_m": 0.1,
    "sigma_heading_per_sqrt_rad": 0.2,
}
POSTS = {"NE": [9, 9], "NW": [1, 9], "SW": [1, 1], "SE": [9, 2]}


def landmark_claims(seeds: int, progress: Progress, configs: Path | None) -> list[Claim]:
    """Return all rows.

    Parameters
    ----------
    configs : Path or None
        Folder of the ready configurations: recordings lie beside the project.
    seeds : int
        Runs of the simulated rows.
    progress : callable
        Receives (parts done, parts in all).
    """
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(lambda names=names: _simulated(names, seeds) for names in ("named", "unnamed")),
        *([] if configs is None
          else (lambda name=name: _recorded(configs, name) for name in RECORDINGS)),
        *([] if configs is None else [*cylinder_parts(configs), *tree_parts(configs)]),
    ]  # fmt: skip
    return claims_of(parts, progress)


def _simulated(names: str, seeds: int) -> Iterator[Claim]:
    """Drive a minute on a circle among four posts."""
    rmse, nees = [], []
    for seed in range(seeds):
        result = run(
            parse_config(
                {
                    "simulation": {
                        "ranges": None,
                        "poses": None,
                        "landmarks": POSTS,
                        "landmark_sightings": {"landmarks": names},
                        "odometry": {"sigma_lateral_per_sqrt_m": 0.01},
                    },
                    "estimator": {
                        "odometry": {
                            "sigma_longitudinal_per_sqrt_m": 0.03,
                            "sigma_lateral_per_sqrt_m": 0.01,
                            "sigma_heading_per_sqrt_rad": 0.03,
                        },
                        "correlation_s": 0,  # simulated errors are independent
                        "landmark": {"sigma_range_m": 0.05, "sigma_bearing_rad": np.deg2rad(1.0)},
                    },
                    "seed": seed,
                }
            )
        )
        assert result.truth is not None
        errors = errors_against(result.estimate, result.truth)
        assert errors.nees is not None
        rmse.append(100.0 * result.metrics["position_rmse_m"])
        nees.append(float(errors.nees[-1]))
    key, what = f"landmarks_{names}", f"four posts, {names}: "
    yield claim_of(key, f"{what}position RMSE", "cm", None, np.array(rmse), "-", lambda v: True)
    yield consistent(key, what, nees, band(3, seeds))


def recorded(configs: Path, name: str) -> tuple[RunConfig, Log]:
    """Return a configuration for one of `RECORDINGS`, and its log.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    dataset, folder, of_dataset, sections, _ = RECORDINGS[name]
    estimator = {"odometry": WHEELS, **sections}
    config, log = load_recording(configs, dataset, folder, of_dataset, estimator=estimator)
    return config, _without_sigmas(log)


def _without_sigmas(log: Log) -> Log:
    """Return the log with sightings whose noise is that of the estimator's configuration."""
    table = log["landmark_sightings"]
    plain = {key: table[key] for key in table if not key.startswith("sigma_")}
    return replace(log, tables={**log.tables, "landmark_sightings": plain})


def mapped(configs: Path, name: str) -> tuple[RunConfig, Log]:
    """Return the same for one that maps: it knows the names of landmarks, and no place."""
    dataset, folder, of_dataset, sections, _ = RECORDINGS[name]
    estimator = {
        "kind": "landmark_slam",
        "landmark_slam": {"use_map": False},
        "odometry": WHEELS,
        "landmark": sections["landmark"],
    }
    config, log = load_recording(configs, dataset, folder, of_dataset, estimator=estimator)
    return config, _without_sigmas(log)


def without_names(log: Log) -> Log:
    """Return the log with sightings that do not say of which landmark they are."""
    table = log["landmark_sightings"]
    unnamed = {**table, "landmark": np.full(len(table["stamp_ns"]), "")}
    return replace(log, tables={**log.tables, "landmark_sightings": unnamed})


def localize_jointly(config: RunConfig, log: Log) -> Trajectory:
    """Localize with the sightings of each stamp put together with landmarks jointly."""
    messages = to_messages(log, config)
    start = start_of(config, truth_of(log), messages)
    ekf = _core.PoseEkf(
        build_estimator_config(config.estimator),
        _core.World(landmarks=landmarks_of(log, messages)),
        start,
    )
    poses: dict[int, _core.PoseEstimate] = {}  # the last one of each stamp
    for instant in instants_of(log):
        for velocity in instant.driven:
            ekf.on(velocity)
            if velocity.stamp >= start.stamp:
                poses[velocity.stamp] = ekf.estimate(velocity.stamp)
        if instant.stamp >= start.stamp:
            ekf.on_joint(instant.seen)
            poses[instant.stamp] = ekf.estimate(instant.stamp)
    return trajectory_of(list(poses.values()))


def localize_from_nothing(config: RunConfig, log: Log) -> tuple[Trajectory, float]:
    """Localize without a start and without names.

    Returns
    -------
    Trajectory, float
        At the stamps at which it was not lost; the share of those at which it was.
    """
    recovering = _core.RecoveringEkfConfig()
    recovering.start.estimator = build_estimator_config(config.estimator)
    ekf = _core.RecoveringEkf(
        recovering, _core.World(landmarks=landmarks_of(log, to_messages(log, config)))
    )
    poses: dict[int, _core.PoseEstimate] = {}  # the last one of each stamp
    lost = []
    for instant in instants_of(log):
        for velocity in instant.driven:
            ekf.on(velocity)
        ekf.on_joint(instant.seen)
        lost.append(ekf.is_lost)
        if not ekf.is_lost:
            now = ekf.state().hypotheses[0].estimate
            poses[now.stamp] = now
    return trajectory_of([poses[stamp] for stamp in sorted(poses)]), float(np.mean(lost))


def _recorded(configs: Path, name: str) -> Iterator[Claim]:
    limit = RECORDINGS[name][4]
    key, what = f"landmarks_{name.replace(' ', '_').lower()}", f"{name} (real): "
    try:
        config, log = recorded(configs, name)
    except LogError as error:
        yield absent(key, f"{what}position RMSE", str(error), f"<= {limit:g}")
        return
    truth = truth_of(log)
    assert truth is not None
    figures = run(config, log).metrics
    while_mapping = run(*mapped(configs, name)).metrics
    rmse = float(figures["position_rmse_m"])
    unnamed_log = without_names(log)
    errors = errors_against(localize_jointly(config, unnamed_log), truth)
    unnamed = rms(errors.position)
    found, lost = localize_from_nothing(config, unnamed_log)
    off = np.hypot(*errors_against(found, truth).position.T)
    for row, part, unit, value, required, met in (
        ("", "position RMSE", "m", rmse, f"<= {limit:g}", rmse <= limit),
        ("_heading", "heading RMSE", "deg", float(figures["heading_rmse_deg"]), "-", True),
        ("_mapped", "position RMSE while mapping", "m",
         float(while_mapping["position_rmse_m"]), "-", True),
        ("_mapped_heading", "heading RMSE while mapping", "deg",
         float(while_mapping["heading_rmse_deg"]), "-", True),
        ("_unnamed", "position RMSE without names", "m", unnamed, f"<= {1.1 * limit:.3g}",
         unnamed <= 1.1 * limit),
        ("_nothing", "from nothing, without names: position RMSE", "m",
         rms(off), "-", True),
        ("_lost", "from nothing, without names: lost", "%", 100.0 * lost, "-", True),
        ("_wrong", "from nothing, without names: over 1 m off", "%",
         100.0 * float(np.mean(off > 1.0)), "-", True),
    ):  # fmt: skip
        yield Claim(key + row, what + part, unit, None, value, value, value, required, met)
    nees = float(figures["nees_mean"])
    low, high = band(3, int(figures["duration_s"] / APART_S))
    asked = name == "tubes"
    yield Claim(f"{key}_nees", f"{what}NEES of 3", "1", None, nees, nees, nees,
                f"{low:.2f}..{high:.2f}" if asked else "-",
                low <= nees <= high if asked else True)  # fmt: skip
