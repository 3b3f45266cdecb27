# SPDX-License-Identifier: Apache-2.0
"""The evo program, an independent evaluation, finds the same error in the files of a run."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from locfuse.config.load import load_config
from locfuse.report.results import write_results
from locfuse.run.run import run
from support_runs import CONFIGS, require_recording_of


@pytest.fixture(scope="module")
def evo_ape() -> str:
    """Return the program; it is run, never imported."""
    found = shutil.which("evo_ape") or shutil.which("evo_ape", path=f"{sys.prefix}/bin")
    if found is None:
        pytest.skip("the program evo_ape is not installed (pip install evo)")
    return found


@pytest.mark.parametrize("name", ["ekim_room.yaml", "mrpt_office.yaml", "tuc_labyrinth.yaml"])
def test_evo_finds_the_position_rmse_of_metrics_json(
    evo_ape: str, tmp_path: Path, name: str
) -> None:
    require_recording_of(name)
    write_results(run(load_config(CONFIGS / name), base=CONFIGS), tmp_path)
    saved = tmp_path / "evo.zip"

    subprocess.run(
        [evo_ape, "tum", tmp_path / "truth.tum", tmp_path / "estimate.tum", "--no_warnings",
         "--save_results", saved],
        check=True, capture_output=True, cwd=tmp_path, timeout=120,
        env={**os.environ, "HOME": str(tmp_path)},
    )  # fmt: skip

    with zipfile.ZipFile(saved) as archive:
        theirs = json.loads(archive.read("stats.json"))
    ours = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    assert theirs["rmse"] == pytest.approx(ours["position_rmse_m"], abs=1e-6)
    assert theirs["max"] == pytest.approx(ours["position_max_m"], abs=1e-6)
    assert ours["position_rmse_m"] > 1e-3
