# SPDX-License-Identifier: Apache-2.0
"""A sweep on a Dask cluster: a real scheduler and two worker processes, one of which is killed."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import support_dask
from locfuse.sweep import run_trials
from locfuse.sweep.workers import dask_cluster
from locfuse.types import ConfigError
from support_sweep import VARY, assert_same, short_room


def inside() -> list[str]:
    """Return the words that start a command where nothing but loopback is."""
    words = support_dask.namespace()
    if words is None:
        pytest.skip("no network namespace can be made here: needs unshare, ip, and the right to")
    return words


def test_a_cluster_that_loses_a_worker_gives_the_table_of_this_machine(tmp_path: Path) -> None:
    command = [*inside(), sys.executable, str(support_dask.__file__), str(tmp_path)]
    said = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert said.returncode == 0, said.stderr
    result = json.loads(said.stdout)
    trials = support_dask.TRIALS
    assert result["threads"] == 2
    assert result["alive"] == [False, True]
    assert (result["trials"], result["failed"]) == (trials, 0)
    assert 0 < result["killed_at"][0] < trials
    with ThreadPoolExecutor(1) as pool:
        again = run_trials(short_room(), trials, VARY, executor=pool, out=tmp_path / "out")
        expected = run_trials(short_room(), trials, VARY, executor=pool)
    assert_same(again, expected)


def test_a_scheduler_that_does_not_answer_is_one_sentence(tmp_path: Path) -> None:
    config = tmp_path / "room.yaml"
    config.write_text("simulation: {duration_s: 2}\n")
    impatient = (
        "import locfuse.sweep.workers as w, locfuse.cli.app as c; w.PATIENCE_S = 0.5; c.main()"
    )
    command = [*inside(), sys.executable, "-c", impatient, "sweep", str(config), "--trials", "2",
               "--dask", support_dask.ADDRESS, "--out", str(tmp_path / "out")]  # fmt: skip
    said = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert said.returncode == 1
    assert said.stderr.startswith(f"locfuse: no Dask scheduler answers at {support_dask.ADDRESS}")
    assert said.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_distributed_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match=r"pip install 'locfuse\[cluster\]'"):
        dask_cluster("tcp://127.0.0.1:8786").__enter__()
