# SPDX-License-Identifier: Apache-2.0
"""Runs on a map: found without a prior or given, alone or as the poses of a pose EKF."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.eval.verdicts import message_rows
from locfuse.report.report import write_report
from locfuse.report.results import write_results
from locfuse.run.mcl import localize, with_poses_of
from locfuse.run.run import load_log, run
from locfuse.types import NANOSECONDS, Log, LogError
from support_runs import CONFIGS, locfuse

FLOOR: dict[str, Any] = {
    "room_m": [12, 9],
    "map": {"generate": "rooms", "seed": 2},
    "path": {"shape": "roam", "speed_mps": 0.5},
    "duration_s": 30.0,
    "laser": {"range_max_m": 8.0},
    "anchors": {"A1": [0, 0, 2], "A2": [12, 0, 2], "A3": [12, 9, 2], "A4": [0, 9, 2]},
    "poses": None,
}
NOISE = {"range": {"sigma_m": 0.0, "sigma_relative": 0.015}}
MCL = {"max_particles": 3000}


def config_of(**more: Any) -> RunConfig:
    given = {"simulation": FLOOR, "use": ["odometry"], "mcl": MCL, "estimator": NOISE}
    return parse_config({**given, **more})


SEARCH = config_of(
    simulation={**FLOOR, "duration_s": 60.0}, start="auto", mcl={**MCL, "max_particles": 10_000}
)


def without(log: Log, *stems: str) -> Log:
    return replace(log, tables={k: v for k, v in log.tables.items() if k not in stems})


@pytest.mark.parametrize("seed", range(3))
def test_a_body_with_a_given_start_keeps_to_centimetres(seed: int) -> None:
    result = run(config_of(), seed=seed)
    assert result.start is None
    assert result.metrics["start_s"] is None
    assert result.metrics["position_rmse_m"] < 0.06
    assert result.metrics["heading_rmse_deg"] < 1.5
    assert result.metrics["mcl"]["ready_share"] > 0.9
    assert result.metrics["mcl"]["ready_and_wrong_share"] == 0.0
    assert 0 < result.metrics["mcl"]["particles_median"] <= 3000


def test_particles_drawn_from_lines_are_sharper_on_an_exact_map() -> None:
    exact = {"sigma_map_m": 0.0, "sigma_map_rad": 0.0, "min_particles": 500, "max_particles": 500}

    def rmse(proposal: str) -> float:
        return float(np.mean([
            run(config_of(mcl={**MCL, **exact, "proposal": proposal}), seed=seed).metrics[
                "position_rmse_m"] for seed in range(3)]))  # fmt: skip

    assert rmse("line_ekf") < 0.6 * rmse("odometry")


@pytest.mark.parametrize("seed", range(3))
def test_a_body_that_is_switched_on_anywhere_is_found(seed: int) -> None:
    result = run(SEARCH, seed=seed)
    assert result.start is not None
    assert result.metrics["start_s"] == result.start.seconds
    assert 0.0 <= result.metrics["mcl"]["ready_s"] - result.start.seconds < 0.1
    assert 0 <= int(result.estimate.stamp_ns[0]) - result.start.stamp_ns < NANOSECONDS // 10
    assert result.metrics["mcl"]["ready_share"] < 1.0
    stamps = [stamp for stamp, _ in result.start.steps]
    assert stamps == sorted(stamps)
    assert stamps[-1] == result.start.stamp_ns
    assert max(len(poses) for _, poses in result.start.steps) > 1
    assert result.truth is not None
    late = errors_against(result.estimate, result.truth).position[-100:]
    assert np.median(np.hypot(*late.T)) < 0.06


def test_every_message_and_every_scan_has_a_row() -> None:
    result = run(config_of(use=["odometry", "ranges"]), seed=1)
    counts = result.metrics["counts"]
    log = result.log
    assert list(counts) == ["odometry", "ranges", "scans"]
    for source in counts:
        assert sum(counts[source].values()) == len(log[source]["stamp_ns"])
    assert counts["ranges"]["fused"] == len(log["ranges"]["stamp_ns"])
    assert counts["scans"]["fused"] > 50
    stamps, source = result.outcomes.stamp_ns, result.outcomes.source
    assert np.all(np.diff(stamps[source == "scans"]) > 0)
    for at in np.flatnonzero(source == "scans"):
        assert stamps[at] >= stamps[:at].max(initial=0)
    skipped = result.outcomes.verdict == "not_modelled"
    assert set(result.outcomes.reason[skipped & (source == "scans")]) <= {"no news: hardly moved"}


def test_a_source_that_use_leaves_out_changes_nothing() -> None:
    config = config_of()
    log = load_log(config, None, 3)
    ours, theirs = run(config, log), run(config, without(log, "ranges"))
    assert ours.estimate.position.tobytes() == theirs.estimate.position.tobytes()
    other = run(config_of(use=["odometry", "ranges"]), log)
    assert other.estimate.position.tobytes() != ours.estimate.position.tobytes()


def test_one_seed_makes_one_run_on_any_number_of_threads() -> None:
    log = load_log(config_of(), None, 3)
    runs = [run(config_of(mcl={**MCL, "threads": threads}, seed=seed), log)
            for threads, seed in ((1, 5), (2, 5), (1, 6))]  # fmt: skip
    assert runs[0].estimate.position.tobytes() == runs[1].estimate.position.tobytes()
    assert runs[0].estimate.position.tobytes() != runs[2].estimate.position.tobytes()


def test_no_truth_is_needed() -> None:
    log = load_log(SEARCH, None, 0)
    result = run(SEARCH, without(log, "truth"))
    assert result.truth is None
    assert result.metrics["mcl"]["ready_and_wrong_share"] is None
    assert result.metrics["mcl"]["ready_s"] > 0.0


# Poses for a pose EKF --------------------------------------------------------------------------


def test_poses_of_mcl_with_ranges_and_odometry_are_better_than_mcl_alone() -> None:
    both = load_config(CONFIGS / "hallways_mcl_uwb.yaml")
    mcl = both.mcl
    assert mcl is not None
    alone = both.model_copy(update={"use": ["odometry"],
                                    "mcl": mcl.model_copy(update={"poses_hz": None})})  # fmt: skip
    fused, single = [], []
    for seed in range(3):
        log = load_log(both, None, seed)
        result = run(both, log, seed=seed)
        assert set(result.metrics["counts"]) == {"odometry", "ranges", "poses", "scans"}
        assert result.metrics["mcl"]["ready_share"] > 0.9
        fused.append(result.metrics["position_rmse_m"])
        single.append(run(alone, log, seed=seed).metrics["position_rmse_m"])
    assert np.mean(fused) < 0.8 * np.mean(single)


def test_poses_come_at_the_rate_and_only_while_one_place_is_certain() -> None:
    config = config_of(start="auto", use=["odometry", "ranges", "poses"],
                       mcl={**MCL, "poses_hz": 1.0, "max_particles": 10_000},
                       simulation={**FLOOR, "duration_s": 60.0})  # fmt: skip
    log = load_log(config, None, 0)
    localization = localize(config, log)
    poses = with_poses_of(localization, log, 1.0)["poses"]
    ready = localization.estimate.stamp_ns[localization.ready]
    assert np.isin(poses["stamp_ns"], ready).all()
    assert int(poses["stamp_ns"][0]) == int(ready[0])
    steps = np.diff(poses["stamp_ns"]) / NANOSECONDS
    assert np.median(steps) == pytest.approx(1.0, abs=1e-6)
    assert (poses["sigma_xy_m"] >= 0.03).all()
    assert run(config, log).metrics["mcl"]["ready_s"] == pytest.approx(
        (int(ready[0]) - localization.begin_ns) / NANOSECONDS
    )


# What is refused -------------------------------------------------------------------------------


def test_a_log_without_a_map_or_without_scans_is_one_sentence() -> None:
    config = config_of()
    log = load_log(config, None, 0)
    recorded = config.model_copy(update={"simulation": None})
    with pytest.raises(LogError, match=r"needs a map, .*; add simulation\.map, or remove mcl"):
        run(config, replace(log, grid=None))
    with pytest.raises(LogError, match=r"needs scans, .*; add simulation\.laser, or remove mcl"):
        run(config, without(log, "scans"))
    log = replace(log, origin="folder")
    with pytest.raises(LogError, match=r"add 'map: FILE\.yaml' to log\.yaml"):
        run(recorded, replace(log, grid=None))
    with pytest.raises(LogError, match=r"add scans\.csv, and 'laser' to log\.yaml"):
        run(recorded, without(log, "scans"))
    with pytest.raises(LogError, match=r"record ros\.topics\.map, or add 'map: FILE\.yaml' to"):
        run(recorded, replace(log, grid=None, origin="bag"))


def test_a_log_that_ends_too_soon_is_reported() -> None:
    config = config_of(start="auto", simulation={**FLOOR, "duration_s": 1.0})
    with pytest.raises(LogError, match="the log ends before one place on the map is left"):
        run(config)


def test_a_check_says_what_the_run_would_and_nothing_that_does_not_concern_it() -> None:
    config = config_of()
    log = load_log(config, None, 0)
    assert not check(config, log).failed
    found = [finding.what for finding in check(config, replace(log, grid=None)).findings
            if finding.severity == "error"]  # fmt: skip
    assert any("mcl needs a map" in what for what in found)
    warned = {f.rule for f in check(config, log).findings if f.severity == "warning"}
    assert not warned & {"unobservable_states", "messages_too_late"}


@pytest.mark.parametrize("name", ["rooms_mcl.yaml", "hallways_mcl_uwb.yaml"])
def test_ready_configurations_run_and_leave_a_report(name: str, tmp_path: Path) -> None:
    config = load_config(CONFIGS / name)
    assert config.simulation is not None
    result = run(config)
    assert result.metrics["position_rmse_m"] < 0.06
    report = write_results(result, tmp_path).read_text()
    assert "time ready" in report
    assert check(config, result.log).failed is False


# Film ------------------------------------------------------------------------------------------


def test_a_film_needs_particles_and_the_name_of_a_gif(tmp_path: Path) -> None:
    room = CONFIGS / "ekim_room.yaml"
    assert "add 'mcl: {}'" in locfuse("run", room, "--film", tmp_path / "a.gif").sentence()
    rooms = CONFIGS / "rooms_mcl.yaml"
    said = locfuse("run", rooms, "--film", tmp_path / "a.mp4").sentence()
    assert said.endswith("a film is a GIF; give it a name that ends in .gif")


BLIND: dict[str, Any] = {**FLOOR, "duration_s": 60.0,
                         "laser": {"range_min_m": 0.0, "range_max_m": 0.4}}  # fmt: skip
WHEELS = {"odometry": {"sigma_xy_per_sqrt_s": 0.1}}


def test_uwb_rescues_particles_that_have_spread() -> None:
    shared = {"simulation": BLIND, "use": ["odometry", "ranges"],
              "estimator": {**NOISE, **WHEELS}}  # fmt: skip
    alone = run(config_of(simulation=BLIND, estimator={**NOISE, **WHEELS}), seed=1)
    tight = {"sigma_unsure_m": 0.3, "sigma_sure_m": 0.2, "uwb_sigma_m": 0.2, "doubt_s": 1.0}
    config = config_of(**shared, mcl={**MCL, "switch": tight})
    rescued = run(config, seed=1)

    assert rescued.metrics["position_p95_m"] < 0.5 < alone.metrics["position_p95_m"]
    switches = rescued.outcomes.source == "switch"
    assert rescued.metrics["mcl"]["switches"] == int(switches.sum()) > 3
    assert alone.metrics["mcl"]["switches"] == 0
    for reason in rescued.outcomes.reason[switches]:
        assert re.fullmatch(r"(uncertain|elsewhere): covariance before \[(\S+ ){5}\S+\], "
                            r"after \[(\S+ ){5}\S+\]", reason)  # fmt: skip
    received = rescued.outcomes.source == "ranges"
    assert np.mean(rescued.outcomes.verdict[received] == "fused") > 0.98


def test_a_laser_that_sees_walls_is_never_rescued() -> None:
    result = run(config_of(use=["odometry", "ranges"], mcl={**MCL, "switch": {}}), seed=2)
    assert result.metrics["mcl"]["switches"] == 0
    assert result.metrics["position_rmse_m"] < 0.06


def test_a_scrubber_in_the_dark_is_rescued_by_its_tags_where_it_hears_them(tmp_path: Path) -> None:
    config = load_config(CONFIGS / "scrubber.yaml")
    result = run(config, base=CONFIGS, seed=0)
    events = result.outcomes.stamp_ns[result.outcomes.source == "switch"] / NANOSECONDS
    ranges = result.outcomes.stamp_ns[result.outcomes.source == "ranges"] / NANOSECONDS
    received = np.histogram(ranges, np.arange(-0.5, 181.5))[0]  # in each second
    assert (received[95:103] == 0).all(), "the radios are out"
    assert (received[[74, 104]] == 15).all(), "in the room"
    assert received[30:50].min() < 9, "in the hallway, behind two walls"
    assert 1 <= len(events) <= 4
    assert np.all((events > 75.0) & (events < 126.0))
    assert not np.any((events > 97.6) & (events < 103.0)), "nothing to switch to"
    assert result.metrics["position_rmse_m"] < 0.25
    assert result.metrics["position_max_m"] < 1.0
    assert "switch" not in result.metrics["counts"]
    assert {row.source for row in message_rows(result.outcomes)} == {"odometry", "ranges",
                                                                     "scans"}  # fmt: skip
    page = write_report(result, tmp_path).read_text(encoding="utf-8")
    table = page.split('<table id="switches-table">')[1].split("</table>")[0]
    cell = r"<td>\d\.\d\d m, \d+\.\d deg</td>"
    listed = re.findall(rf"<td>(\S+) s</td><td>uncertain</td>{cell}{cell}", table)
    np.testing.assert_allclose([float(at) for at in listed], events, atol=0.051)
    text = config.model_dump(mode="json")
    text["mcl"]["switch"] = None
    text["use"] = ["odometry"]
    blind = run(parse_config(text), base=CONFIGS, seed=0)
    assert blind.metrics["position_rmse_m"] > 1.5 * result.metrics["position_rmse_m"]
    assert "switches-table" not in write_report(blind, tmp_path).read_text(encoding="utf-8")
