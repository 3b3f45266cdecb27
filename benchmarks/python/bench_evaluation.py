# SPDX-License-Identifier: Apache-2.0
"""Reading, association, alignment and scores of 100,000 poses, compared to the evo program."""

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
    """Return the paths of an estimate and of the truth."""
    return write_pair(tmp_path_factory.mktemp("tum"), POSES)


@pytest.fixture(scope="session")
def short_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the paths of three poses and their truth, which take hardly more than a start-up."""
    return write_pair(tmp_path_factory.mktemp("short"), 3)


def write_pair(folder: Path, poses: int) -> tuple[Path, Path]:
    """Write a 10 Hz truth and an estimate: rotated by 1 rad, 5 cm of noise, stamps off by 4 ms.

    In the plane, so that an alignment in space and one in the plane are the same.
    """
    rng = np.random.default_rng(7)
    stamp_ns = 1_600_000_000_000_000_000 + 100_000_000 * np.arange(poses, dtype=np.int64)
    s = 0.001 * np.arange(poses)
    truth: FloatArray = np.column_stack([20.0 * np.cos(s), 15.0 * np.sin(1.3 * s)])
    c, d = np.cos(1.0), np.sin(1.0)
    turned = truth @ np.array([[c, d], [-d, c]]) + [1.0, 2.0]
    estimate: FloatArray = turned + 0.05 * rng.standard_normal(truth.shape)
    heading = np.mod(s + np.pi, 2.0 * np.pi) - np.pi
    late_ns = rng.integers(-4_000_000, 4_000_000, poses)
    write_tum(folder / "truth.tum", Trajectory(stamp_ns, truth, heading))
    write_tum(folder / "estimate.tum", Trajectory(stamp_ns + late_ns, estimate, heading))
    return folder / "estimate.tum", folder / "truth.tum"


def test_evaluation(benchmark: Any, files: tuple[Path, Path]) -> None:
    result = benchmark(lambda: ape(read_tum(files[0]), read_tum(files[1]), "se2"))
    assert result.matched == POSES
    benchmark.extra_info["rmse_m"] = result.rmse


def test_evaluation_program(benchmark: Any, files: tuple[Path, Path]) -> None:
    text = benchmark.pedantic(_output, (_locfuse(files),), rounds=5)
    benchmark.extra_info["rmse_m"] = _number_after("rmse_m", text)


def test_evaluation_start(benchmark: Any, short_files: tuple[Path, Path]) -> None:
    benchmark.pedantic(_output, (_locfuse(short_files),), rounds=5)


def test_evo_program(benchmark: Any, files: tuple[Path, Path]) -> None:
    text = benchmark.pedantic(_output, (_evo(files),), rounds=5)
    rmse_m = benchmark.extra_info["rmse_m"] = _number_after("rmse", text)
    assert rmse_m == pytest.approx(
        ape(read_tum(files[0]), read_tum(files[1]), "se2").rmse, abs=1e-6
    )


def test_evo_start(benchmark: Any, short_files: tuple[Path, Path]) -> None:
    benchmark.pedantic(_output, (_evo(short_files),), rounds=5)


def _locfuse(files: tuple[Path, Path]) -> list[str]:
    return [sys.executable, "-m", "locfuse", "evaluate", *map(str, files), "--align", "se2"]


def _evo(files: tuple[Path, Path]) -> list[str]:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    program = shutil.which("evo_ape", path=path)
    if program is None:
        pytest.skip("evo is not installed")
    return [program, "tum", str(files[1]), str(files[0]), "--align", "--no_warnings"]


def _output(command: list[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _number_after(word: str, text: str) -> float:
    found = re.search(rf"\b{word}\s+(\S+)", text)
    assert found is not None, text
    return float(found[1])
