# SPDX-License-Identifier: Apache-2.0
"""The folder of a run: every file, its columns, and that numbers read back as they were."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import load_config
from locfuse.io.geodesy import to_plane
from locfuse.io.tum import read_tum
from locfuse.report.pictures import has_matplotlib, require_matplotlib
from locfuse.report.results import write_results
from locfuse.run.run import run
from locfuse.types import ConfigError, RunResult, Trajectory
from support_results import make_result
from support_runs import room, rows_of, write_folder

FILES = {"config.yaml", "estimate.tum", "truth.tum", "estimate.csv", "outcomes.csv",
         "metrics.json", "report.html"}  # fmt: skip
KEYS = {"position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg", "nees_mean",
        "nees_in_band", "nis_mean", "counts", "duration_s", "messages_per_second"}  # fmt: skip


@pytest.fixture(scope="module")
def result() -> RunResult:
    return run(room(estimator={"range": {"gate": 0.9, "sigma_m": 0.1}}), seed=4)


@pytest.fixture(scope="module")
def folder(result: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("results") / "made" / "here"
    assert write_results(result, path) == path / "report.html"
    return path


def metrics_in(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    return found


def test_everything_is_there(folder: Path) -> None:
    names = {path.name for path in folder.iterdir()}
    assert names >= FILES
    assert {Path(name).suffix for name in names - FILES} == {".csv", ".png"}
    assert all((folder / name).stat().st_size > 0 for name in names)


def test_metrics_hold_what_was_promised(result: RunResult, folder: Path) -> None:
    found = metrics_in(folder)
    assert set(found) >= KEYS
    assert found["position_rmse_m"] == result.metrics["position_rmse_m"]
    assert set(found["nis_mean"]) == {"ranges", "poses"}
    assert found["duration_s"] == 10.0
    assert sum(found["counts"]["ranges"].values()) == len(result.log["ranges"]["range_m"])
    assert found["counts"]["ranges"]["gated"] > 0


def test_there_is_one_row_of_outcomes_for_each_message(result: RunResult, folder: Path) -> None:
    rows = rows_of(folder / "outcomes.csv")
    assert len(rows) == len(result.outcomes)
    assert len(rows) == sum(
        len(result.log[stem]["stamp_ns"]) for stem in ("odometry", "ranges", "poses")
    )
    for row, source, verdict, nis, stamp, anchor, reason in zip(
        rows, result.outcomes.source, result.outcomes.verdict, result.outcomes.nis,
        result.outcomes.stamp_ns, result.outcomes.anchor, result.outcomes.reason, strict=True,
    ):  # fmt: skip
        assert (row["source"], row["verdict"], row["anchor"]) == (source, verdict, anchor)
        assert row["reason"] == reason
        assert round(float(row["stamp_s"]) * 1e9) == stamp
        assert row["nis"] == ("" if np.isnan(nis) else repr(float(nis)))
        assert (row["reason"] == "") == (verdict == "fused")


def test_the_covariance_reads_back_bit_for_bit(result: RunResult, folder: Path) -> None:
    rows = rows_of(folder / "estimate.csv")
    names, estimate = ("x", "y", "heading"), result.estimate
    assert estimate.covariance is not None
    assert estimate.heading is not None
    found = np.empty((len(rows), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            values = [float(row[f"cov_{names[i]}_{names[j]}"]) for row in rows]
            found[:, i, j] = found[:, j, i] = values
    np.testing.assert_array_equal(found, estimate.covariance)
    assert [float(row["x_m"]) for row in rows] == estimate.position[:, 0].tolist()
    assert [float(row["y_m"]) for row in rows] == estimate.position[:, 1].tolist()
    assert [float(row["heading_rad"]) for row in rows] == estimate.heading.tolist()
    assert [row["stamp_s"] for row in rows[:2]] == ["0.000000000", "0.033333333"]
    assert (np.linalg.eigvalsh(found) > 0.0).all()


def test_poses_are_on_the_earth_where_the_map_is(result: RunResult, tmp_path: Path) -> None:
    origin = (48.137, 11.575, 30.0)
    position = result.estimate.position.copy()
    position[-1] = [1e8, 0.0]  # beyond the Earth
    away = replace(result, log=replace(result.log, gps_origin=origin),
                   estimate=replace(result.estimate, position=position))  # fmt: skip
    write_results(away, tmp_path)
    *rows, last = rows_of(tmp_path / "estimate.csv")
    places = [(float(row["latitude_deg"]), float(row["longitude_deg"])) for row in rows]
    found = [to_plane(latitude, longitude, 0.0, origin) for latitude, longitude in places]
    np.testing.assert_allclose(found, position[:-1], atol=1e-6)
    assert (last["latitude_deg"], last["longitude_deg"]) == ("", "")
    assert places[0] == pytest.approx((48.137, 11.575), abs=1e-3)


def test_poses_are_not_on_the_earth_where_nobody_knows_it(folder: Path) -> None:
    assert not any("deg" in name for name in rows_of(folder / "estimate.csv")[0])


def test_each_pose_has_the_state_of_health_at_its_stamp(result: RunResult, folder: Path) -> None:
    assert result.health is not None
    states = dict(zip(result.health.stamp_ns.tolist(), result.health.state.tolist(), strict=True))
    found = [row["state"] for row in rows_of(folder / "estimate.csv")]
    stamps = result.estimate.stamp_ns.tolist()
    assert {s: state for s, state in zip(stamps, found, strict=True) if s in states} == {
        s: states[s] for s in stamps if s in states
    }
    first = (folder / "estimate.tum").read_text().splitlines()[0]
    assert re.fullmatch(r"# ok .* of the time; at the end .*", first)


def test_the_trajectories_are_at_the_same_stamps(result: RunResult, folder: Path) -> None:
    estimate, truth = read_tum(folder / "estimate.tum"), read_tum(folder / "truth.tum")
    np.testing.assert_array_equal(estimate.stamp_ns, result.estimate.stamp_ns)
    np.testing.assert_array_equal(truth.stamp_ns, estimate.stamp_ns)
    distance = np.hypot(*(estimate.position - truth.position).T)
    rmse = float(np.sqrt(np.mean(distance**2)))
    assert rmse == pytest.approx(metrics_in(folder)["position_rmse_m"], abs=1e-15)


def test_a_truth_on_other_stamps_is_interpolated(tmp_path: Path) -> None:
    made = make_result(n=50, error=(0.0, 0.0, 0.0))
    truth = Trajectory(
        made.estimate.stamp_ns[[5, 6, 44]] + np.array([0, 50_000_000, 0]),
        np.array([[0.0, 0.0], [1.5, 3.0], [9.0, 9.0]]),
    )
    write_results(replace(made, truth=truth), tmp_path)
    found = read_tum(tmp_path / "truth.tum")
    np.testing.assert_array_equal(found.stamp_ns, made.estimate.stamp_ns[[5, 6, 44]])
    expected = np.array([[0.0, 0.0], [1.0, 2.0], [9.0, 9.0]])
    np.testing.assert_allclose(found.position, expected, atol=1e-12)


def test_the_effective_config_gives_the_same_run_again(result: RunResult, folder: Path) -> None:
    again = run(load_config(folder / "config.yaml"), seed=4)
    np.testing.assert_array_equal(again.estimate.position, result.estimate.position)
    np.testing.assert_array_equal(again.outcomes.nis, result.outcomes.nis)


def test_the_same_log_and_seed_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    config = load_config(folder / "config.yaml")
    write_results(run(config, seed=4), tmp_path)
    for name in ("estimate.csv", "outcomes.csv", "estimate.tum", "truth.tum", "config.yaml"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_log_without_truth_leaves_nulls_and_no_truth(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", {"truth.csv": None})
    config = room(start=[3.0, 2.0, 0.0]).model_copy(update={"simulation": None, "log": str(log)})
    out = tmp_path / "out"
    out.mkdir()
    (out / "truth.tum").write_text("of another run\n")

    write_results(run(config), out)

    found = metrics_in(out)
    for key in ("position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg",
                "nees_mean", "nees_in_band"):  # fmt: skip
        assert found[key] is None
    assert found["counts"]["ranges"]["fused"] == 6
    assert not (out / "truth.tum").exists()
    assert (out / "report.html").is_file()


def test_pictures_without_matplotlib_are_an_import_error_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not has_matplotlib()
    with pytest.raises(ImportError, match=r"pip install 'locfuse\[plots\]'") as caught:
        require_matplotlib()
    assert isinstance(caught.value, ConfigError)
