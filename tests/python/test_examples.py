# SPDX-License-Identifier: Apache-2.0
"""The numbered examples run from an empty folder and print what they are about."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot

from support_runs import ROOT

EXAMPLES = sorted((ROOT / "examples" / "python").glob("[0-9]_*.py"))
OFF = re.compile(r"([\d.]+) m off")


def printed(name: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    (path,) = [path for path in EXAMPLES if path.stem == name]
    runpy.run_path(str(path))
    return capsys.readouterr().out.splitlines()


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_there_is_a_test_of_each() -> None:
    here = Path(__file__).read_text(encoding="utf-8")
    assert len(EXAMPLES) == 6
    assert [path.stem for path in EXAMPLES if f'"{path.stem}"' not in here] == []


@pytest.mark.parametrize("name", ["1_uwb_and_wheels", "2_laser_on_a_map"])
def test_a_start_from_nothing(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(name, capsys)
    found = OFF.search(lines[-1])
    assert found is not None
    assert float(found[1]) < 0.15
    assert "OK" in lines[-1]


def test_a_map_of_posts(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed("3_landmarks", capsys)
    assert len(lines) == 5
    assert max(float(found[1]) for found in map(OFF.search, lines) if found) < 0.2


def test_the_offset_of_a_compass(capsys: pytest.CaptureFixture[str]) -> None:
    heading, offset = printed("4_gps_and_compass", capsys)
    off, sigma = (float(number) for number in re.findall(r"[\d.]+(?= deg)", heading))
    assert off < 3.0 * sigma
    found = re.fullmatch(r"heading offset (\d+) deg, sigma (\d+) deg", offset)
    assert found is not None
    assert abs(float(found[1]) - 100.0) < 3.0 * float(found[2])


def test_late_messages(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed("5_late_messages", capsys)[-1] == "the same: True"


def test_the_notebook_runs(capsys: pytest.CaptureFixture[str]) -> None:
    book = json.loads((ROOT / "examples/notebooks/monte_carlo.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in book["cells"] if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") for cell in book["cells"])
    pyplot.switch_backend("agg")
    namespace: dict[str, Any] = {"__name__": "notebook"}
    for cell in cells:
        exec(compile(cell, "monte_carlo.ipynb", "exec"), namespace)
    pyplot.close("all")
    nees = [float(found) for found in re.findall(r"NEES ([\d.]+)", capsys.readouterr().out)]
    assert 2.6 < nees[0] < 3.4  # of all drives
    assert nees[1] > 2.0 * nees[2] > 3.0 * nees[3]  # too sure, right, too cautious


def test_runs_are_compared(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed("6_from_a_log", capsys)
    gaussian, one_sided = (float(re.findall(r"([\d.]+) m RMSE", line)[0]) for line in lines[:2])
    assert one_sided < gaussian
    assert Path(lines[-1].removeprefix("report: ")).is_file()
