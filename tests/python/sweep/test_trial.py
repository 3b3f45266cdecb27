# SPDX-License-Identifier: Apache-2.0
"""One trial: its row says what the run said, and what went wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import locfuse
from locfuse import _core
from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import run
from locfuse.sweep.runner import _work, plan
from locfuse.sweep.trial import INSTANTS, SCORES, Row, fault_ends_ns, row_of, run_batch, scores
from locfuse.types import ConfigError
from support_runs import ROOT, room, write_folder
from support_sweep import short_room


def row(config: RunConfig, trial: int = 0, **work: Any) -> Row:
    made = replace(_work(config, (), work.pop("base", None), None), **work)
    return row_of(made, plan(config, (), trial + 1)[trial])


def test_a_row_is_what_the_run_with_its_seed_says() -> None:
    config = short_room().model_copy(update={"seed": 5})
    found, result = row(config, trial=2), run(config, seed=7)
    assert (found["trial"], found["seed"], found["error"]) == (2, 7, None)
    for name in ("position_rmse_m", "position_max_m", "heading_rmse_deg", "nees_mean", "nees_dof"):
        assert found[name] == result.metrics[name] is not None
    assert found["nis_ranges"] == pytest.approx(result.metrics["nis_mean"]["ranges"])
    assert found["nis_poses"] == pytest.approx(result.metrics["nis_mean"]["poses"] / 3.0)
    assert found["health_ok"] == result.metrics["health"]["share"]["ok"]
    assert len(found["nees_at"]) == INSTANTS
    assert set(found) == {"trial", "seed", *SCORES, "nees_at", "error"}


def test_every_state_of_health_has_a_column() -> None:
    for state in _core.HealthState.__members__:
        assert f"health_{state.lower()}" in SCORES


def test_what_fails_is_a_row_with_its_error() -> None:
    config = room(simulation={"duration_s": 0.2, "poses": None}, start="auto")
    found = row(config)
    assert found["error"].startswith("LogError: start is 'auto', but")
    assert "\n" not in found["error"]
    assert found["position_rmse_m"] is None
    assert found["wall_s"] > 0.0


def test_what_fails_without_a_sentence_is_a_row_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(*args: object, **kwargs: object) -> None:
        raise KeyError("gone")

    monkeypatch.setattr("locfuse.sweep.trial.run", breaks)
    assert row(short_room())["error"] == "KeyError: 'gone'"


def test_a_recorded_log_is_read_once(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folder(tmp_path / "log")
    config = parse_config({"log": "log"})
    first = row(config, base=tmp_path)
    assert first["error"] is None
    assert first["position_rmse_m"] is not None
    monkeypatch.setattr("locfuse.sweep.trial.load_log", None)
    again = row(config, trial=1, base=tmp_path)
    assert again["error"] is None
    assert again["position_rmse_m"] == first["position_rmse_m"]  # nothing in it is drawn


def test_without_truth_there_are_no_errors(tmp_path: Any) -> None:
    write_folder(tmp_path / "log", {"truth.csv": None})
    config = parse_config({"log": "log", "start": [3, 2, 0]})
    found = row(config, base=tmp_path)
    assert found["error"] is None
    assert found["position_rmse_m"] is found["nll"] is found["nees_at"] is None
    assert found["nis_ranges"] is not None


def test_a_batch_gives_back_what_there_was_time_for() -> None:
    config = short_room()
    work, trials = _work(config, (), None, None), plan(config, (), 3)
    assert [found["trial"] for found in run_batch(work, trials, 0.0)] == [0]
    assert [found["trial"] for found in run_batch(work, trials, 60.0)] == [0, 1, 2]


def test_a_worker_of_another_version_refuses() -> None:
    work = replace(_work(short_room(), (), None, None), version="0.0.0")
    with pytest.raises(ConfigError, match=f"runs locfuse {locfuse.__version__}, but here it is"):
        run_batch(work, plan(short_room(), (), 1), 1.0)


def test_the_ends_of_faults_are_those_that_have_one() -> None:
    config = room(
        simulation={
            "faults": [
                {"kind": "dropouts", "source": "poses", "from_s": 2, "to_s": 5.5},
                {"kind": "outliers", "probability": 0.1, "magnitude_m": 1.0},
                {"kind": "wheel_slip", "from_s": 3, "to_s": 4, "translation_factor": 2},
            ]
        },
        switched_off=[{"source": "ranges", "from_s": 1, "until_s": 5.5},
                      {"source": "poses", "from_s": 30}],
    )  # fmt: skip
    assert fault_ends_ns(config) == [4_000_000_000, 5_500_000_000]


def test_time_to_recover_is_reported_after_a_fault_and_by_the_limit_asked_for() -> None:
    slip = {"kind": "wheel_slip", "from_s": 5, "to_s": 8, "translation_factor": 3.0}
    config = room(simulation={"duration_s": 20.0, "faults": [slip]}, use=["odometry", "ranges"])
    result = run(config, seed=1)
    wide, tight = scores(result, 5.0), scores(result, 0.001)
    assert (wide["recover_s"], wide["unrecovered"]) == (0.0, 0)
    assert (tight["recover_s"], tight["unrecovered"]) == (None, 1)
    assert scores(result)["unrecovered"] in (0, 1)
    assert "recover_s" not in scores(run(short_room()))


def test_particles_run_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def run_with(config: RunConfig, *args: object, **kwargs: object) -> None:
        seen.append(config.mcl.threads if config.mcl is not None else 0)
        raise ValueError("enough")

    monkeypatch.setattr("locfuse.sweep.trial.run", run_with)
    row(parse_config({"simulation": {"map": {}, "laser": {}}, "mcl": {"threads": 4}}))
    assert seen == [1]


def test_the_page_lists_every_column() -> None:
    page = (ROOT / "docs/sweep.md").read_text()
    for name in ("trial", "seed", "error", "nees_at", *SCORES):
        if not name.startswith(("health_", "nis_", "coverage_")):
            assert f"`{name}`" in page, name
    assert np.all([f"`{name}_" in page for name in ("health", "nis", "coverage")])
