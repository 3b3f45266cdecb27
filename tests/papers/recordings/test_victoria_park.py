# SPDX-License-Identifier: Apache-2.0
"""Mapping landmarks along a log: a made one, and Victoria Park."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import locfuse as lf
from locfuse.types import NANOSECONDS, Log, LogError, wrap_angle
from papers.recordings import draw_trees, victoria_park
from papers.recordings.landmark_mapping import map_landmarks
from papers.reproduce import draw
from support_runs import CONFIGS, recording

TREES = np.array([[5.0, 2.0], [9.0, -3.0], [13.0, 2.5], [17.0, -2.0]])


def straight() -> Log:
    """Return a drive of 1 m/s along x among four trees, seen without noise."""
    stamps = np.arange(0, 10 * NANOSECONDS, NANOSECONDS // 10)
    rows = [(t, x, y) for t in stamps[::5] for x, y in TREES - [t / NANOSECONDS, 0.0]]
    stamp, x, y = (np.array(column) for column in zip(*rows, strict=True))
    seen = {"stamp_ns": stamp, "landmark": np.full(len(stamp), ""), "range_m": np.hypot(x, y),
            "bearing_rad": np.arctan2(y, x)}  # fmt: skip
    still = np.zeros(len(stamps))
    odometry = {"stamp_ns": stamps, "v_mps": still + 1.0, "omega_radps": still}
    return Log(tables={"odometry": odometry, "landmark_sightings": seen})


def start_at(x: float, y: float, heading: float) -> lf.PoseEstimate:
    sigmas = np.array([0.01, 0.01, np.deg2rad(0.1)])
    return lf.PoseEstimate(0, lf.Pose2(x, y, heading), np.diag(sigmas**2))


def test_every_tree_of_a_made_log_is_mapped_where_it_is() -> None:
    mapping = map_landmarks(straight(), lf.LandmarkEkfConfig(), start_at(0.0, 0.0, 0.0))
    order = np.argsort(mapping.position[:, 0])
    np.testing.assert_allclose(mapping.position[order], TREES, atol=1e-6)
    assert sorted(mapping.landmark.tolist()) == [-4, -3, -2, -1]
    assert (mapping.sightings == 20).all()
    assert set(mapping.verdict.tolist()) == {lf.Verdict.FUSED.value}
    np.testing.assert_allclose(mapping.estimate.position[-1], [9.5, 0.0], atol=1e-6)


def test_a_log_without_sightings_is_refused() -> None:
    with pytest.raises(LogError, match="needs landmark_sightings"):
        map_landmarks(Log(tables={}), lf.LandmarkEkfConfig(), start_at(0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def park() -> Log:
    recording("victoria-park")
    return victoria_park.load_park(CONFIGS, "trees")


def rms_to_gps(log: Log, config: lf.LandmarkEkfConfig) -> float:
    mapping = map_landmarks(log, config, victoria_park.start_of(log))
    off = victoria_park.off_gps(log, mapping.estimate)
    return float(np.sqrt(np.mean(off**2)))


@pytest.mark.parametrize(("chain", "rmse_m"), [("trees", 4.0), ("laser", 5.0)])
def test_victoria_park_is_mapped_to_6_m_of_gps_which_is_not_used(chain: str, rmse_m: float) -> None:
    recording("victoria-park")
    mapped = victoria_park.mapped_by(CONFIGS, chain)
    assert mapped.rmse_m < rmse_m < victoria_park.REQUIRED_M
    assert 100 < len(mapped.mapping.landmark) < 400
    assert (mapped.detect_s > 0.0) == (chain == "laser")
    parts = dict(zip(victoria_park.CHAINS, victoria_park.tree_parts(CONFIGS), strict=True))
    rows = {row.id: row for row in parts[chain]()}
    assert rows[f"victoria_park_{chain}"].ours_median == mapped.rmse_m
    assert rows[f"victoria_park_{chain}_factor"].met
    assert all(row.met for row in rows.values())


def test_maps_of_trees_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording("victoria-park")
    monkeypatch.chdir(CONFIGS.parent)
    paths = draw("landmarks", 1, tmp_path)[-2:]
    assert [path.name for path in paths] == ["victoria_park_trees.png", "victoria_park_laser.png"]
    assert all(path.stat().st_size > 50_000 for path in paths)


def test_a_park_that_is_absent_is_two_rows_that_say_so(tmp_path: Path) -> None:
    rows = [row for part in victoria_park.tree_parts(tmp_path / "a/b/c") for row in part()]
    assert [row.id for row in rows] == ["victoria_park_trees", "victoria_park_laser"]
    assert all(row.met is None for row in rows)
    assert rows[0].note == "no examples/configs/victoria_park.yaml here"
    assert "no such folder" in rows[1].note
    assert draw_trees(tmp_path / "out", tmp_path / "a/b/c") == []


def test_victoria_park_without_recognizing_trees_is_far_off(park: Log) -> None:
    config = victoria_park.truck()
    config.max_landmarks = 0
    assert rms_to_gps(park, config) > 60.0


def test_victoria_park_with_mirrored_bearings_is_far_off(park: Log) -> None:
    seen = park["landmark_sightings"]
    mirrored = {**seen, "bearing_rad": wrap_angle(-seen["bearing_rad"])}
    wrong = replace(park, tables={**park.tables, "landmark_sightings": mirrored})
    config = victoria_park.truck()
    config.max_landmarks = 200
    assert rms_to_gps(wrong, config) > 12.0
