# SPDX-License-Identifier: Apache-2.0
"""Runs that start as ekim2020: SR-LS on one set of ranges, then 36 headings of one scan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.check import check
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.live import LiveRun
from locfuse.report.plot import plot_start
from locfuse.report.results import write_results
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.types import ConfigError, GridMap, Log, LogError, Start, wrap_angle
from support_live import arrivals, assert_same, live_of, world_of
from support_runs import CONFIGS

WALLS = [[2.0, 0.0, 2.0, 3.0], [10.0, 7.0, 7.5, 7.0], [0.0, 6.0, 1.5, 6.0]]
HALL: dict[str, Any] = {
    "path": {"shape": "eight"},
    "duration_s": 10.0,
    "poses": None,
    "laser": {"range_max_m": 12.0},
    "map": {"walls": WALLS},
}


def config_of(start: Any = "srls_headings", **more: Any) -> RunConfig:
    noise = {"range": {"sigma_m": 0.0, "sigma_relative": 0.015}}
    return parse_config({"simulation": HALL, "start": start, "estimator": noise, **more})


def errors_of(start: Start, log: Log) -> tuple[float, float]:
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    row = int(np.searchsorted(truth.stamp_ns, start.stamp_ns))
    away = float(np.hypot(*(start.pose[:2] - truth.position[row])))
    return away, abs(float(wrap_angle(start.pose[2] - truth.heading[row])))


@pytest.mark.parametrize("seed", range(5))
def test_it_starts_from_ranges_and_a_scan_at_a_multiple_of_ten_degrees(seed: int) -> None:
    result = run(config_of(), seed=seed)
    assert result.start is not None
    away, turned = errors_of(result.start, result.log)
    assert away < 0.6
    assert turned < np.deg2rad(12.0)
    steps = np.rad2deg(result.start.pose[2]) / 10.0
    assert abs(steps - round(steps)) < 1e-9
    sigma = np.sqrt(np.diag(result.start.covariance))
    assert np.deg2rad(10.0 / np.sqrt(12.0)) < sigma[2] < 0.087
    assert result.start.sums_m is not None
    best = int(np.argmin(result.start.sums_m))
    assert wrap_angle(np.deg2rad(10.0 * best) - result.start.pose[2]) == pytest.approx(0.0)
    assert result.metrics["position_rmse_m"] < 0.15


@pytest.mark.parametrize("walls", [[], WALLS], ids=["square", "walls"])
def test_auto_is_the_better_start_in_the_room_of_the_paper(walls: Any) -> None:
    """The table of docs/start.md: `pytest -s` prints it."""
    made = load_config(CONFIGS / "ekim_room.yaml").model_dump(exclude_unset=True)
    laser = {"laser": {"range_max_m": 12.0}, "map": {"walls": walls}}
    made["simulation"] |= {"duration_s": 20.0, "poses": None, **laser}
    errors = {}
    for start in ("auto", "srls_headings"):
        config = parse_config({**made, "use": ["odometry", "ranges"], "start": start})
        rows = []
        for seed in range(1, 21):
            result = run(config, seed=seed)
            assert result.start is not None
            rows.append((*errors_of(result.start, result.log), result.start.seconds))
        errors[start] = np.array(rows)
        away, turned, seconds = errors[start].T
        wrong = (away > 1.0) | (turned > np.deg2rad(15.0))
        print(f"{start}: wrong {wrong.sum()}, position {np.median(away):.3f}, {away.max():.3f} m, "
              f"heading {np.rad2deg(np.median(turned)):.2f}, {np.rad2deg(turned.max()):.2f} deg, "
              f"after {np.median(seconds):.1f}, {seconds.max():.1f} s")  # fmt: skip
        assert not wrong.any()
        assert seconds.max() <= 2.0
    better = np.median(errors["auto"], axis=0) < np.median(errors["srls_headings"], axis=0)
    assert better.all()


@pytest.mark.parametrize("kind", ["pose", "tag_triangle", "landmark_slam"])
def test_a_live_run_starts_at_the_same_pose_to_the_bit(kind: str) -> None:
    more: dict[str, Any] = {}
    if kind == "tag_triangle":
        tags = {"a": [0.3, 0.0, 0.5], "b": [-0.2, 0.3, 0.5], "c": [-0.2, -0.3, 0.5]}
        more = {"simulation": {**HALL, "tags": tags}}
    config = config_of(**more)
    estimator = config.estimator.model_copy(update={"kind": kind})
    config = config.model_copy(update={"estimator": estimator})
    if kind == "landmark_slam":
        posts = {"P": [3.0, 3.0], "Q": [7.0, 3.0]}
        assert config.simulation is not None
        simulation = {**HALL, "landmarks": posts, "landmark_sightings": {}}
        config = parse_config({**config.model_dump(exclude_unset=True), "simulation": simulation,
                               "estimator": {"kind": kind}})  # fmt: skip
    assert_same(config, load_log(config, None, 2))


def test_a_wrong_map_is_one_sentence_in_runs_and_live() -> None:
    config = config_of()
    log = load_log(config, None, 2)
    cells = np.zeros((600, 600), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    wrong = replace(log, grid=GridMap(cells, 0.05, (-10.0, -10.0, 0.0)))
    with pytest.raises(
        LogError,
        match=r"start is 'srls_headings', but .* no heading fits the map: "
        r"at the best of 36 .* is it the map of this place\?",
    ):
        run(config, wrong)
    live, poses = live_of(config, wrong)
    assert not poses
    assert "is it the map of this place?" in live.health().reason


@pytest.mark.parametrize(
    ("lacks", "how"),
    [
        ("ranges", "add simulation.ranges"),
        ("scans", "add simulation.laser"),
        ("map", "add simulation.map"),
    ],
)
def test_what_a_log_lacks_is_one_sentence_in_runs_and_checks(lacks: str, how: str) -> None:
    config = config_of()
    log = load_log(config, None, 2)
    poor = replace(log, tables={k: v for k, v in log.tables.items() if k != lacks})
    if lacks == "map":
        poor = replace(log, map=None, grid=None)
    sentence = f"the log has no {lacks}; {how}, or set start: auto"
    with pytest.raises(LogError, match=sentence):
        run(config, poor)
    assert any(sentence in finding.what for finding in check(config, poor).findings)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"mcl": {}}, "mcl finds its start by particles"),
        ({"use": ["odometry", "poses"]}, "needs ranges, which use leaves out"),
        ({"estimator": {"kind": "air"}}, "start is 'srls_headings', which finds no height"),
        ({"start": "srls"}, "expected 'truth', 'auto', 'srls_headings' or"),
    ],
)
def test_what_cannot_be_searched_so_is_refused(more: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        parse_config({"simulation": HALL, "start": "srls_headings", **more})


def test_a_live_run_waits_for_a_map_and_says_so() -> None:
    config = config_of()
    log = load_log(config, None, 2)
    live = LiveRun(config, replace(log, tables=world_of(log), map=None, grid=None))
    for source, row in list(arrivals(log))[:50]:
        live.on(source, row)
    assert live.pose() is None
    assert live.health().reason == "no map to compare a scan with"


def test_the_picture_shows_the_sums_and_the_heading_that_was_chosen(tmp_path: Path) -> None:
    result = run(config_of(), seed=1)
    assert result.start is not None
    figure = plot_start(result)
    assert figure is not None
    left, right = figure.axes
    chosen = round(np.rad2deg(result.start.pose[2]))
    assert left.get_title(loc="left") == f"best of 36 headings: {chosen} deg"
    assert len(left.patches) == 36
    assert right.get_title(loc="left").startswith("ready after")
    write_results(result, tmp_path)
    assert (tmp_path / "start.png").stat().st_size > 10_000
