# SPDX-License-Identifier: Apache-2.0
"""`locfuse run` on ready configurations has the figures of `locfuse reproduce`, to the digit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from locfuse.types import NANOSECONDS, Trajectory, rows_of
from papers.celan2017.claims import READY as CELAN
from papers.gadau2022.claims import READY as GADAU
from papers.recorded import FIGURES, ready_claims
from papers.recordings import victoria_park
from papers.recordings.landmark_mapping import map_landmarks
from papers.recordings.uwb_3d import READY as AIR
from papers.scores import rms
from support_runs import CONFIGS, locfuse, recording, require_recording_of
from support_runs import rows_of as table_of


@pytest.mark.parametrize("file", [*CELAN, *GADAU, *AIR])
def test_reproduce_prints_what_run_writes(file: str, tmp_path: Path) -> None:
    require_recording_of(file)
    said = locfuse("run", CONFIGS / file, "--out", tmp_path / "out")
    assert said.status == 0, said.err
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text(encoding="utf-8"))
    rows = {row.id: row.ours_median for row in ready_claims(CONFIGS, file)}
    key = f"ready_{Path(file).stem}"
    expected = {f"{key}_{name}": metrics.get(name) for name in FIGURES}
    assert rows == {name: value for name, value in expected.items() if value is not None}
    assert f"{key}_position_rmse_m" in rows


def test_a_ready_configuration_without_its_recording_is_a_row_that_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b" / "configs"
    folder.mkdir(parents=True)
    text = (CONFIGS / "rcv_drone.yaml").read_text(encoding="utf-8")
    (folder / "rcv_drone.yaml").write_text(text, encoding="utf-8")
    (row,) = ready_claims(folder, "rcv_drone.yaml")
    assert row.met is None
    assert "no such folder" in row.note
    (row,) = ready_claims(None, "rcv_drone.yaml")
    assert row.note == "no examples/configs/rcv_drone.yaml here"


def test_victoria_park_is_that_of_run(tmp_path: Path) -> None:
    """The error to GPS from estimate.csv is the row of `reproduce`, the map that of landmarks.csv.

    Both are what a filter makes of the messages that is fed by hand: to the bit.
    """
    recording("victoria-park")
    said = locfuse("run", CONFIGS / "victoria_park.yaml", "--out", tmp_path / "out")
    assert said.status == 0, said.err
    mapped = victoria_park.mapped_by(CONFIGS, "trees")
    rows = table_of(tmp_path / "out" / "estimate.csv")
    columns = {name: np.array([float(row[name]) for row in rows])
               for name in ("stamp_s", "x_m", "y_m", "heading_rad")}  # fmt: skip
    stamp = np.round(columns["stamp_s"] * NANOSECONDS).astype(np.int64)
    written = Trajectory(stamp, np.column_stack([columns["x_m"], columns["y_m"]]),
                         columns["heading_rad"])  # fmt: skip
    seen = np.isin(stamp, mapped.log["landmark_sightings"]["stamp_ns"])
    off = victoria_park.off_gps(mapped.log, rows_of(written, seen))
    parts = dict(zip(victoria_park.CHAINS, victoria_park.tree_parts(CONFIGS), strict=True))
    claims = {row.id: row.ours_median for row in parts["trees"]()}
    assert rms(off) == claims["victoria_park_trees"]
    assert off[-1] == claims["victoria_park_trees_end"]
    trees = table_of(tmp_path / "out" / "landmarks.csv")
    assert len(trees) == claims["victoria_park_trees_mapped"]
    by_hand = map_landmarks(mapped.log, victoria_park.truck(),
                            victoria_park.start_of(mapped.log))  # fmt: skip
    assert by_hand.position.tolist() == mapped.mapping.position.tolist()
    same = np.isin(by_hand.estimate.stamp_ns, mapped.mapping.estimate.stamp_ns)
    assert np.sum(~same) <= 1  # an instant of which every sighting was rejected
    assert by_hand.estimate.position[same].tolist() == mapped.mapping.estimate.position.tolist()
