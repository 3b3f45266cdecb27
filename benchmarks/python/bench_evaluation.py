# SPDX-License-Identifier: Apache-2.0
"""Read, associate, align and score two trajectories of 100,000 poses, beside the evo program."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from locfuse.eval.ape import ape
from locfuse.io.tum import read_tum, write_tum
from locfuse.types import FloatArray, Trajectory

POSES = 100_000


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the paths of an estimate and of the truth: 10 Hz, white errors of 5 cm per axis."""
    folder = tmp_path_factory.mktemp("tum")
    rng = np.random.default_rng(1)
    stamp_ns = 1_700_000_000_000_000_000 + 100_000_000 * np.arange(POSES, dtype=np.int64)
    turn = 0.002 * np.arange(POSES)
    truth: FloatArray = np.column_stack([40.0 * np.cos(turn), 25.0 * np.sin(turn)])
    heading = np.mod(turn, 2.0 * np.pi) - np.pi
    estimate = truth + 0.05 * rng.standard_normal(truth.shape)
    write_tum(folder / "truth.tum", Trajectory(stamp_ns, truth, heading))
    write_tum(folder / "estimate.tum", Trajectory(stamp_ns, estimate, heading))
    return folder / "estimate.tum", folder / "truth.tum"


def test_evaluation(benchmark: Any, files: tuple[Path, Path]) -> None:
    result = benchmark(lambda: ape(read_tum(files[0]), read_tum(files[1]), "se2"))
    assert result.matched == POSES
    benchmark.extra_info["rmse_m"] = result.rmse


def test_evaluation_program(benchmark: Any, files: tuple[Path, Path]) -> None:
    command = [sys.executable, "-m", "locfuse", "evaluate", *map(str, files), "--align", "se2"]
    text = benchmark.pedantic(_output, (command,), rounds=5)
    benchmark.extra_info["rmse_m"] = float(re.search(r"rmse_m\s+(\S+)", text)[1])  # type: ignore[index]


def test_evo_program(benchmark: Any, files: tuple[Path, Path]) -> None:
    command = [_evo(), "tum", str(files[1]), str(files[0]), "--align", "--no_warnings"]
    text = benchmark.pedantic(_output, (command,), rounds=3)
    benchmark.extra_info["rmse_m"] = float(re.search(r"rmse\s+(\S+)", text)[1])  # type: ignore[index]


def test_evo_start(benchmark: Any) -> None:
    """What evo needs to start and stop, so that it can be left out of the comparison."""
    benchmark.pedantic(_output, ([_evo(), "tum", "--help"],), rounds=3)


def _evo() -> str:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    program = shutil.which("evo_ape", path=path)
    if program is None:
        pytest.skip("evo is not installed")
    return program


def _output(command: list[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout
