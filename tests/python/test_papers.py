# SPDX-License-Identifier: Apache-2.0
"""All papers at once: the page, the JSON, and that what differs is found."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from locfuse import papers
from locfuse.claims import share
from locfuse.cli import app
from locfuse.papers import (
    PAPERS_IN_ORDER,
    Repeated,
    differences,
    page_of,
    read_rows,
    repeat,
    repeat_all,
    write_rows,
)
from locfuse.types import ConfigError

ROOT = Path(__file__).resolve().parent.parent.parent


def a_row(**changes: Any) -> dict[str, Any]:
    row = {"id": "room", "claim": "a room: RMSE", "unit": "cm", "paper": 3.0, "ours_median": 2.0,
           "ours_low": 1.8, "ours_high": 2.2, "required": "<= 2.6", "met": True,
           "note": ""}  # fmt: skip
    return {**row, **changes}


def repeated(*rows: dict[str, Any], **changes: Any) -> Repeated:
    return replace(Repeated("ekim2020", 5, 1.0, list(rows), []), **changes)


@pytest.fixture(scope="module")
def wells(tmp_path_factory: pytest.TempPathFactory) -> tuple[Repeated, Path]:
    folder = tmp_path_factory.mktemp("wells")
    return repeat("wells", 2, folder), folder


def test_a_paper_is_repeated_with_its_pictures(wells: tuple[Repeated, Path]) -> None:
    one, folder = wells
    assert not one.error
    assert one.seconds > 0.0
    assert {"wells", "wells_heading", "wells_nees"} <= {row["id"] for row in one.claims}
    assert one.pictures
    assert all((folder / name).stat().st_size > 10_000 for name in one.pictures)


def test_a_paper_that_fails_is_shown_and_the_others_stand(
    wells: tuple[Repeated, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fails(key: str, seeds: int, folder: Path) -> Repeated:
        if key == "wells":
            folder.mkdir()
            for name in wells[0].pictures:
                (folder / name).write_bytes((wells[1] / name).read_bytes())
            return wells[0]
        return Repeated(key, seeds, 0.0, [], [], error="LogError: <no such folder>")

    monkeypatch.setattr(papers, "repeat", fails)
    steps: list[tuple[int, int]] = []
    with ThreadPoolExecutor(2) as pool:
        found = repeat_all(tmp_path, True, lambda *step: steps.append(step), pool)
    assert [one.paper for one in found] == [paper.key for paper in PAPERS_IN_ORDER]
    assert steps[-1] == (5, 5)
    page = (tmp_path / papers.PAGE).read_text()
    assert page.count("It failed: LogError: &lt;no such folder&gt;") == 4
    assert "4 papers failed" in page
    assert "clean odometry: position RMSE [cm]" in page
    assert page.count("data:image/png;base64,") == len(wells[0].pictures)
    assert "http" not in page.replace("http-equiv", "")
    assert read_rows(tmp_path / papers.ROWS) == [
        replace(one, seconds=round(one.seconds, 1)) for one in found
    ]


def test_an_exception_of_a_paper_is_what_came_out_of_it(tmp_path: Path) -> None:
    one = repeat("nobody", 2, tmp_path)
    assert "no paper 'nobody'" in one.error
    assert one.claims == []


def test_what_is_missed_or_skipped_is_told(tmp_path: Path) -> None:
    rows = [a_row(), a_row(id="b", claim="b", met=False, ours_median=2.9),
            a_row(id="c", claim="c", met=None, ours_median=None, note="no recording")]  # fmt: skip
    page = page_of([repeated(*rows)] + [replace(repeated(), paper=p.key)
                                         for p in PAPERS_IN_ORDER[1:]], tmp_path)  # fmt: skip
    assert "1 requirements met, 1 missed, 1 skipped" in page
    assert "<td>NO</td>" in page
    assert '<p class="bad">Missed: b</p>' in page
    assert "Skipped: c: no recording" in page


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({}, False),
        ({"ours_median": 2.15, "ours_low": 2.1, "ours_high": 2.3}, False),
        ({"ours_median": 2.6, "ours_low": 2.5, "ours_high": 2.7}, True),
        ({"ours_median": 2.6, "ours_low": 1.9, "ours_high": 2.7}, False),
        ({"unit": "ms", "ours_median": 50.0, "ours_low": 50.0, "ours_high": 50.0}, True),
        ({"ours_median": None, "met": None}, False),
        ({"id": "other"}, True),
    ],
)
def test_a_figure_outside_of_its_spread_is_found(changes: dict[str, Any], differs: bool) -> None:
    found = differences([repeated(a_row())], [repeated(a_row(**changes))])
    assert bool(found) == differs


def test_a_requirement_that_is_missed_inside_of_its_spread_is_found() -> None:
    missed = a_row(ours_median=2.15, met=False)
    (said,) = differences([repeated(a_row())], [repeated(missed)])
    assert said == "room: required <= 2.6, is missed: 2.15 [1.8..2.2], was 2 [1.8..2.2]"
    assert not differences([repeated(missed)], [repeated(missed)])  # known, not new
    assert differences([repeated(a_row(met=None, ours_median=None))], [repeated(missed)])
    slow = a_row(id="lap_speed", met=False)
    assert not differences([repeated({**slow, "met": True})], [repeated(slow)])


def test_a_share_of_few_seeds_may_miss_what_its_interval_allows() -> None:
    was = share("found", "found", 100, 100, 0.99).row()
    few = share("found", "found", 11, 12, 0.99).row()
    worse = share("found", "found", 6, 12, 0.99).row()
    assert few["met"] is False
    assert not differences([repeated(was, seeds=100)], [repeated(few, seeds=12)])
    assert differences([repeated(was, seeds=12)], [repeated(few, seeds=12)])
    assert differences([repeated(was, seeds=100)], [repeated(worse, seeds=12)])


def test_rows_that_are_new_or_gone_are_found() -> None:
    other = a_row(id="other", ours_median=1.9)
    both = [repeated(a_row(), other)]
    assert differences([repeated(a_row())], both) == ["other: was not there; it is 1.9 [1.8..2.2]"]
    assert differences(both, [repeated(a_row())]) == ["other: not there any more"]
    assert differences(both, [repeated(error="LogError: no")]) == ["ekim2020: LogError: no"]


def test_compare_fails_where_a_requirement_is_missed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write_rows([repeated(a_row())], tmp_path / "rows.json", quick=True)
    missed = [repeated(a_row(ours_median=2.15, met=False))]
    monkeypatch.setattr(papers, "repeat_all", lambda *_: missed)
    command = ["reproduce", "all", "--out", str(tmp_path), "--compare", str(tmp_path / "rows.json")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 1
    assert "room: required <= 2.6, is missed" in result.output
    assert "1 rows differ" in result.output
    monkeypatch.setattr(papers, "repeat_all", lambda *_: [repeated(a_row())])
    assert CliRunner().invoke(app, command).exit_code == 0


def test_speed_is_of_the_machine_and_the_mean_of_nees_has_a_band() -> None:
    speed = a_row(unit="ms", ours_low=2.0, ours_high=2.0)
    assert not differences([repeated(speed)], [repeated({**speed, "ours_median": 9.0})])
    ratio = {**speed, "id": "lap_speed", "unit": "1"}
    assert not differences([repeated(ratio)], [repeated({**ratio, "ours_median": 9.0})])
    nees = a_row(id="a_nees", required="0.9..6.3", ours_low=2.0, ours_high=2.0)
    far = {**nees, "ours_median": 4.0, "ours_low": 4.0, "ours_high": 4.0}
    assert not differences([repeated(nees)], [repeated(far)])
    assert differences([repeated(nees)], [repeated({**far, "met": False})])
    assert differences([repeated(a_row())], [repeated(a_row(), error="ValueError: no")])


def test_rows_of_another_file_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    write_rows([repeated(a_row())], file, quick=True)
    assert json.loads(file.read_text())["quick"] is True
    file.write_text("[]")
    with pytest.raises(ConfigError, match=r"rows\.json: expected what `locfuse reproduce all`"):
        read_rows(file)
    result = CliRunner().invoke(app, ["reproduce", "all", "--compare", str(file)])
    assert isinstance(result.exception, ConfigError)


def test_tables_are_those_of_the_committed_figures() -> None:
    check = [sys.executable, str(ROOT / "scripts/papers.py"), "--check"]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
