# SPDX-License-Identifier: Apache-2.0
"""A recording for rerun, read back by rerun's own reader.

The package is 170 MB and no part of the extra ``test``: without it these tests are skipped.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.config.load import parse_config
from locfuse.report.palette import ELLIPSE_SIGMAS
from locfuse.report.rerun_export import check_rerun, write_rerun
from locfuse.run.run import run
from locfuse.types import ConfigError, RunResult
from support_runs import locfuse

needs_rerun = pytest.mark.skipif(
    importlib.util.find_spec("rerun") is None,
    reason="no rerun-sdk, which is too large for every test run; pip install 'locfuse[rerun]'",
)


@pytest.fixture(scope="module")
def result() -> RunResult:
    config = {
        "name": "hallway",
        "simulation": {
            "room_m": [12, 8], "map": {"generate": "hallways", "seed": 2},
            "path": {"shape": "roam", "speed_mps": 0.5}, "duration_s": 6,
            "laser": {"range_max_m": 5}, "poses": None,
            "anchors": {"a b/1": [0, 0, 2], "A2": [12, 0, 2], "A3": [12, 8, 2]},
            "faults": [{"kind": "nlos", "walls": [[2, 0.5, 2, 4]], "extra_m": 2.0}],
        },
        "start": "truth",
        "mcl": {"poses_hz": 2},
    }  # fmt: skip
    return run(parse_config(config), seed=3)


@pytest.fixture(scope="module")
def recorded(result: RunResult, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return by entity the rows that have a time, and below "static" those that have none."""
    if importlib.util.find_spec("rerun") is None:
        pytest.skip("no rerun-sdk")
    from rerun.chunk import RrdReader

    path = write_rerun(result, tmp_path_factory.mktemp("rerun") / "out.rrd")
    found: dict[str, Any] = {"static": {}}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        columns = {
            name.partition(":")[2] or name: (
                batch.column(name).cast("int64") if name == "time" else batch.column(name)
            ).to_pylist()
            for name in batch.schema.names
            if "RowId" not in name
        }
        if chunk.is_static:
            found["static"].setdefault(chunk.entity_path, {}).update(columns)
            continue
        assert chunk.entity_path not in found, "the test expects each entity in one chunk"
        found[chunk.entity_path] = columns
    return found


@needs_rerun
def test_estimate_and_ellipse_are_those_of_the_run(
    recorded: dict[str, Any], result: RunResult
) -> None:
    estimate = result.estimate
    rows = recorded["/world/estimate"]
    assert rows["time"] == (estimate.stamp_ns - estimate.stamp_ns[0]).tolist()  # nanoseconds
    at = np.array(rows["positions"])[:, 0, :2]
    assert at == pytest.approx(estimate.position, abs=1e-5)
    assert estimate.covariance is not None
    ellipse = recorded["/world/estimate/ellipse"]
    for k in (0, len(at) // 2, len(at) - 1):
        half, (_, _, s, c) = ellipse["half_sizes"][k][0], ellipse["quaternions"][k][0]
        turn = np.array([[c * c - s * s, -2 * s * c], [2 * s * c, c * c - s * s]])
        P = turn @ np.diag(np.square(half[:2])) @ turn.T / ELLIPSE_SIGMAS**2
        assert pytest.approx(estimate.covariance[k, :2, :2], rel=1e-3, abs=1e-9) == P


@needs_rerun
def test_the_world_stands_still_and_has_names(recorded: dict[str, Any], result: RunResult) -> None:
    anchors = recorded["static"]["/world/anchors"]
    assert anchors["labels"][0] == ["a b/1", "A2", "A3"]
    assert np.array(anchors["positions"][0])[1].tolist() == [12.0, 0.0, 2.0]
    drawn, grid = recorded["static"]["/world/map"], result.log.grid
    assert grid is not None
    assert bytes(drawn["data"][0][0]) == grid.cells[::-1].tobytes()
    assert drawn["cell_size"][0][0] == pytest.approx(grid.resolution_m)


@needs_rerun
def test_ranges_are_flat_circles_and_rejected_ones_are_orange(
    recorded: dict[str, Any], result: RunResult
) -> None:
    table = result.log["ranges"]
    rows = recorded["/world/ranges/A2"]
    of = table["anchor"] == "A2"
    half = np.array(rows["half_sizes"])[:, 0, 0]
    height = 2.0 - result.log.tags["tag"][2]
    assert half == pytest.approx(np.sqrt(table["range_m"][of] ** 2 - height**2), abs=1e-4)
    outcomes = result.outcomes
    of_first = (outcomes.source == "ranges") & (outcomes.anchor == "a b/1")
    gated = outcomes.verdict[of_first] == "gated"
    (entity,) = [name for name in recorded if name.startswith("/world/ranges/a")]
    colours = np.array(recorded[entity]["colors"])[:, 0]
    assert gated.any()
    assert np.array_equal(colours == 0xD55E00FF, gated)
    assert "colors" not in recorded["static"][entity]  # which would hide them


@needs_rerun
def test_scans_lie_on_the_walls_and_particles_around_the_robot(
    recorded: dict[str, Any], result: RunResult
) -> None:
    grid = result.log.grid
    assert grid is not None
    walls = grid.to_world(np.argwhere(grid.cells == 100)[:, ::-1].astype(np.float64) + 0.5)
    scan = np.array(recorded["/world/scan"]["positions"][20])[:, :2]
    far = np.linalg.norm(scan[:, None] - walls[None], axis=2).min(axis=1)
    assert np.median(far) < 0.1
    clouds = recorded["/world/particles"]["positions"]
    assert [len(cloud) for cloud in clouds] == [len(frame.particles) for frame in result.frames]


@needs_rerun
def test_curves_and_words_are_those_of_the_run(recorded: dict[str, Any], result: RunResult) -> None:
    outcomes = result.outcomes
    nis = np.array(recorded["/nis/ranges_1"]["scalars"])[:, 0]
    assert nis.tolist() == outcomes.nis[outcomes.source == "ranges"].tolist()
    assert result.health is not None
    within = np.array(recorded["/health/within"]["scalars"])[:, 0]
    assert within.tolist() == result.health.within.tolist()
    words = [text[0] for text in recorded["/messages/turned_down"]["text"]]
    assert len(words) == np.sum(outcomes.verdict == "gated")
    assert any(text.startswith("ranges a b/1: nis ") for text in words)
    assert "/error/x" in recorded


@needs_rerun
def test_the_command_line_writes_it(tmp_path: Path) -> None:
    config = tmp_path / "c.yaml"
    config.write_text("simulation: {duration_s: 2}\n")
    out = tmp_path / "deep" / "out.rrd"
    done = locfuse("run", config, "--out", tmp_path / "out", "--rerun", out)
    assert done.status == 0, done
    assert f"rerun: {out}" in done.out.replace("\n", "")
    assert out.stat().st_size > 10_000


def test_without_the_package_one_sentence_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ConfigError, match=r"--rerun needs the package rerun-sdk: pip install "
                                          r"'locfuse\[rerun\]'"):  # fmt: skip
        check_rerun(Path("out.rrd"))


def test_another_ending_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"out.mcap: a rerun recording needs a name that ends"):
        check_rerun(Path("out.mcap"))
