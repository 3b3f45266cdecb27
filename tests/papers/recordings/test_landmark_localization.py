# SPDX-License-Identifier: Apache-2.0
"""Rows of localization on landmarks: recordings within what is required, and bounds that bind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.config.schema import Calibration, RunConfig
from locfuse.eval.errors import errors_against
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError, Trajectory
from papers.recordings import landmark_localization
from support_runs import ROOT

CONFIGS = ROOT / "examples" / "configs"


def recording(name: str) -> tuple[RunConfig, Log, Trajectory]:
    """Return a recording with its truth, or skip where it is not there."""
    try:
        config, log = landmark_localization.recorded(CONFIGS, name)
    except LogError as error:
        pytest.skip(str(error))
    truth = truth_of(log)
    assert truth is not None
    return config, log, truth


def test_tubes_are_enough_with_and_without_names() -> None:
    config, log, truth = recording("tubes")
    named = run(config, log).metrics
    assert named["position_rmse_m"] <= 0.035
    assert named["counts"]["landmark_sightings"]["fused"] > 31_000
    unnamed = landmark_localization.without_names(log)
    assert set(unnamed["landmark_sightings"]["landmark"].tolist()) == {""}
    errors = errors_against(landmark_localization.localize_jointly(config, unnamed), truth)
    rmse = np.sqrt(np.mean(np.sum(errors.position**2, axis=1)))
    assert rmse <= 1.1 * named["position_rmse_m"]
    # It learnt that the robot travels 4.6 degrees askew, as its publishers' notes say.
    askew = named["calibration"]["direction"]
    assert abs(np.rad2deg(askew["value"]) + 4.6) < 3.0 * np.rad2deg(askew["sigma"]) < 1.0
    # Sightings counted from the body's origin instead of the laser, 0.22 m ahead, show.
    blind = run(config, replace(log, landmark_sensor=None)).metrics
    assert blind["position_rmse_m"] > 0.05
    # So does learning nothing, to who asks how far off it may be.
    plain = config.model_copy(
        update={"estimator": config.estimator.model_copy(update={"calibration": Calibration()})}
    )
    assert named["nees_mean"] < 3.7
    assert run(plain, log).metrics["nees_mean"] > 1.5 * named["nees_mean"]


@pytest.mark.parametrize("name", ["MRCLAM robot 1", "MRCLAM robot 3", "MRCLAM robot 5"])
def test_a_camera_is_enough_with_and_without_names(name: str) -> None:
    config, log, truth = recording(name)
    assert run(config, log).metrics["position_rmse_m"] <= 0.20
    unnamed = landmark_localization.without_names(log)
    errors = errors_against(landmark_localization.localize_jointly(config, unnamed), truth)
    assert np.sqrt(np.mean(np.sum(errors.position**2, axis=1))) <= 0.22
    # A landmark map that is shifted by half a metre breaks the bound.
    places = {**log["landmarks"], "x_m": log["landmarks"]["x_m"] + 0.5}
    moved = replace(log, tables={**log.tables, "landmarks": places})
    assert run(config, moved).metrics["position_rmse_m"] > 0.4


@pytest.mark.parametrize("name", ["tubes", "MRCLAM robot 3", "MRCLAM robot 5"])
def test_from_nothing_and_without_names_it_is_lost_or_right(name: str) -> None:
    config, log, truth = recording(name)
    found, lost = landmark_localization.localize_from_nothing(
        config, landmark_localization.without_names(log)
    )
    off = np.hypot(*errors_against(found, truth).position.T)
    assert lost < 0.3
    assert np.mean(off > 1.0) < 0.01


def test_posts_without_names_are_as_good_as_with_names() -> None:
    def rmse(names: str) -> float:
        scenario = {
            "ranges": None,
            "poses": None,
            "landmarks": landmark_localization.POSTS,
            "landmark_sightings": {"landmarks": names},
        }
        return float(run(parse_config({"simulation": scenario})).metrics["position_rmse_m"])

    assert rmse("named") == pytest.approx(rmse("unnamed"), rel=0.01)  # fused in another order
    assert rmse("named") < 0.03


def test_sightings_of_landmarks_without_a_place_are_refused_in_one_sentence() -> None:
    config = parse_config(
        {
            "simulation": {
                "landmarks": landmark_localization.POSTS,
                "landmark_sightings": {},
                "poses": None,
                "ranges": None,
            }
        }
    )
    log = load_log(config, None, 0)
    tables = {name: table for name, table in log.tables.items() if name != "landmarks"}
    with pytest.raises(LogError, match=r"but no landmarks; add simulation\.landmarks"):
        run(config, replace(log, tables=tables))


def test_a_landmark_at_the_sensor_is_not_called_unknown() -> None:
    posts = {"AT": [8.0, 5.0], "SE": [9.0, 1.0], "N": [5.0, 9.0]}
    config = parse_config(
        {
            "simulation": {
                "path": {"shape": "circle", "speed_mps": 0.0, "center_m": [5, 5], "radius_m": 3},
                "duration_s": 2,
                "poses": None,
                "landmarks": posts,
                "landmark_sightings": {"landmarks": "named"},
            },
            "use": ["odometry", "landmark_sightings"],
            "start": [8.0, 5.0, 90.0],
        }
    )
    log = load_log(config, None, 0)
    still = {name: np.zeros_like(column) if name.startswith("d") else column
             for name, column in log["odometry"].items()}  # fmt: skip
    seen = log["landmark_sightings"]
    ghost = np.where(seen["landmark"] == "N", "GHOST", seen["landmark"].astype("U8"))
    keep = np.flatnonzero(ghost != "SE")
    renamed = {name: column[keep] for name, column in {**seen, "landmark": ghost}.items()}
    tables = {**log.tables, "odometry": still, "landmark_sightings": renamed}
    outcomes = run(config, replace(log, tables=tables)).outcomes
    reasons = set(outcomes.reason[outcomes.verdict == "not_modelled"].tolist())
    assert reasons == {"landmark AT at the sensor: no direction", "unknown landmark GHOST"}
