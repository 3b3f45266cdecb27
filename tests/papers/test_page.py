# SPDX-License-Identifier: Apache-2.0
"""All papers at once: the page, the JSON, and that what differs is found."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from locfuse.cli.app import app
from locfuse.types import ConfigError
from papers import page as papers
from papers.claims import share
from papers.gadau2022.experiments import NEES_ROWS
from papers.page import (
    FIVE,
    PAPERS_IN_ORDER,
    Paper,
    Repeated,
    Statement,
    differences,
    judge,
    page_of,
    read_rows,
    repeat,
    repeat_all,
    seeds_of,
    write_rows,
)

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

    monkeypatch.setattr("papers.page.runs.repeat", fails)
    steps: list[tuple[int, int]] = []
    with ThreadPoolExecutor(2) as pool:
        found = repeat_all(tmp_path, seeds_of(True), True, lambda *step: steps.append(step), pool)
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


def test_what_is_missed_or_skipped_is_shown(tmp_path: Path) -> None:
    rows = [a_row(), a_row(id="b", claim="b", met=False, ours_median=2.9),
            a_row(id="c", claim="c", met=None, ours_median=None, note="no recording")]  # fmt: skip
    page = page_of([repeated(*rows)] + [replace(repeated(), paper=p.key)
                                         for p in PAPERS_IN_ORDER[1:]], tmp_path)  # fmt: skip
    assert "1 requirements met, 1 missed, 1 skipped" in page
    assert "<td>NO</td>" in page
    assert '<p class="bad">Missed: b</p>' in page
    assert "<td>no recording</td>" in page


def a_paper(*statements: Statement, **captions: str) -> Paper:
    return Paper("ekim2020", "a title", "what", 5, 2, statements, captions)


def a_statement(*rows: str, picture: str = "") -> Statement:
    return Statement("Table 1", "the <room>", "3 cm", rows, lambda *v: max(v) <= 2.0, picture)


def test_a_statement_is_so_by_its_rows_alone() -> None:
    rows = [a_row(id="a"), a_row(id="b", ours_median=2.5), a_row(id="c", ours_median=None)]
    paper = a_paper(*(a_statement(*ids) for ids in (("a",), ("b", "a"), ("c",), ("a", "gone"))))
    judged, own = judge(paper, [*rows, a_row(id="d")])
    assert [one.so for one in judged] == [True, False, None, None]
    assert [one.verdict for one in judged] == ["so here", "NOT so here", "not run", "not run"]
    assert [[row["id"] for row in one.rows] for one in judged] == [["a"], ["b", "a"], ["c"], ["a"]]
    assert [row["id"] for row in own] == ["d"]


def test_the_page_has_what_a_paper_reports_above_our_figures_and_its_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paper = a_paper(a_statement("room", picture="seen"), seen="A <room> and a path.")
    monkeypatch.setitem(FIVE, "ekim2020", paper)
    (tmp_path / "ekim2020").mkdir()
    (tmp_path / "ekim2020" / "seen.png").write_bytes(b"a picture")
    rows = [a_row(note="5 of 5"), a_row(id="own", claim="our own row", note="why <it> is so")]
    page = page_of([repeated(*rows, pictures=["seen.png"])], tmp_path)
    claim, of_it, ours, own = (page.index(text) for text in (
        "<b>1. The &lt;room&gt;</b>", "a room: RMSE", papers.OURS, "our own row"))  # fmt: skip
    assert claim < of_it < ours < own
    assert '(Table 1)</span>: 3 cm. <span class="good">so here</span>' in page
    assert "<td>5 of 5</td>" in page  # notes of rows that were met, too
    assert "<td>why &lt;it&gt; is so</td>" in page
    assert "<figcaption><p>A &lt;room&gt; and a path." in page
    links = re.findall(r'href="#([^"]+)"', page)
    assert links == ["ekim2020-seen", "ekim2020-1"]
    assert all(f'id="{link}"' in page for link in links)


def test_every_statement_has_rows_that_were_run_and_every_picture_says_what_is_seen() -> None:
    committed = {one.paper: one for one in read_rows(ROOT / "results/papers.json")}
    for paper in PAPERS_IN_ORDER:
        assert len(paper.statements) >= 8
        ids = {row["id"] for row in committed[paper.key].claims}
        for statement in paper.statements:
            assert statement.rows
            assert set(statement.rows) <= ids, statement
            assert statement.where
            assert statement.reports
            assert statement.picture in {"", *paper.captions}, statement
        drawn = {Path(name).stem for name in committed[paper.key].pictures}
        assert drawn == set(paper.captions), paper.key
        judged, _ = judge(paper, committed[paper.key].claims)
        assert all(one.so is not None for one in judged), paper.key


def test_statements_can_come_out_either_way() -> None:
    """Each can come out either way: medians turned into their inverses change half of them."""
    for one in read_rows(ROOT / "results/papers.json"):
        paper = FIVE[one.paper]
        other = [{**row, "ours_median": 1.0 / (row["ours_median"] or 1e-3)} for row in one.claims
                 if row["ours_median"] is not None]  # fmt: skip
        was, now = ([judged.so for judged in judge(paper, rows)[0]] for rows in (one.claims, other))
        assert sum(a != b for a, b in zip(was, now, strict=True)) > len(was) / 2, one.paper


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
    monkeypatch.setattr("papers.cli.repeat_all", lambda *_: missed)
    command = ["reproduce", "all", "--out", str(tmp_path), "--compare", str(tmp_path / "rows.json")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 1
    assert "room: required <= 2.6, is missed" in result.output
    assert "1 rows differ" in result.output
    monkeypatch.setattr("papers.cli.repeat_all", lambda *_: [repeated(a_row())])
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
    check = [sys.executable, str(ROOT / "scripts/paper_tables.py"), "--check"]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


# The command ------------------------------------------------------------------------------------


def fake_stages(paper: str, seeds: int, folder: Path | None, progress: Any) -> Any:
    """Stand for `stages`: rows without pictures, then with one."""
    one = replace(repeated(a_row()), paper=paper, seeds=seeds)
    yield one
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "room_paths.png").write_bytes(b"a picture")
        yield replace(one, pictures=["room_paths.png"])


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("papers.cli.stages", fake_stages)


def said(*command: Any) -> str:
    """Return what is printed, or the sentence of the error."""
    result = CliRunner().invoke(app, ["reproduce", *map(str, command)])
    return str(result.exception) if isinstance(result.exception, ConfigError) else result.output


def test_one_paper_has_its_page_too_and_is_compared(stages: None, tmp_path: Path) -> None:
    out, rows = tmp_path / "out", tmp_path / "rows.json"
    assert "over 100 seeds" in said("ekim2020", "--out", out, "--json", rows)
    assert json.loads(rows.read_text()) == [a_row()]
    assert (out / "ekim2020" / "room_paths.png").is_file()
    page = (out / papers.PAGE).read_text()
    assert page.count("<h2") == 1
    assert "data:image/png;base64," in page
    (before,) = read_rows(out / papers.ROWS)
    assert (before.paper, before.seeds) == ("ekim2020", 100)
    write_rows([replace(before, paper="wells", claims=[]), before], rows, quick=False)
    assert "over 12 seeds" in said("ekim2020", "--quick")
    assert "0 rows differ" in said("ekim2020", "--compare", rows)
    write_rows([repeated(a_row(id="gone"))], rows, quick=False)
    assert "gone: not there any more" in said("ekim2020", "--compare", rows)
    assert said("wells", "--compare", rows) == f"{rows}: has no rows of wells"


def test_all_take_the_seeds_that_are_asked_and_leave_their_rows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[Any] = []

    def repeat_them(out: Path, seeds: dict[str, int], quick: bool, progress: Any) -> list[Repeated]:
        asked.append((out, seeds, quick))
        return [repeated(a_row())]

    monkeypatch.setattr("papers.cli.repeat_all", repeat_them)
    rows = tmp_path / "new" / "rows.json"
    said("all", "--seeds", 7, "--out", tmp_path, "--json", rows)
    assert asked == [(tmp_path, dict.fromkeys(FIVE, 7), False)]
    assert json.loads(rows.read_text()) == [a_row()]
    said("all", "--quick", "--out", tmp_path)
    assert asked[-1] == (tmp_path, {p.key: p.quick_seeds for p in PAPERS_IN_ORDER}, True)
    said("all", "--out", tmp_path)
    assert asked[-1] == (tmp_path, {p.key: p.seeds for p in PAPERS_IN_ORDER}, False)


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (("all", "--pictures", "x"), "--pictures x: they are in --out out/papers already"),
        (("wells", "--pictures", "x", "--out", "y"), "they are in --out y already; give one"),
        (("all", "--quick", "--seeds", 7), "--seeds 7 and --quick say both how many seeds"),
        (("maps", "--quick"), "--quick is of the five papers, and maps is none of them"),
        (("maps", "--out", "x"), "--out is of the five papers"),
        (("maps", "--compare", "x"), "--compare is of the five papers"),
        (("wells", "--compare", "absent.json"), "absent.json: cannot be read (No such file"),
        (("wells", "--json", "."), "--json .: is a folder; expected a file"),
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_is_run(
    command: tuple[Any, ...], sentence: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("papers.cli.stages", None)
    monkeypatch.setattr("papers.cli.repeat_all", None)
    assert sentence in said(*command)
    assert list(tmp_path.iterdir()) == []


def test_the_command_shows_what_a_paper_reports(stages: None) -> None:
    (one,) = (p for p in PAPERS_IN_ORDER if p.key == "ekim2020")
    shown = " ".join(said("ekim2020").split())
    assert one.statements[3].about[1:] in shown
    assert "not run" in shown  # the row that stands for all is not a row of any statement


def test_the_band_of_gadaus_nees_is_that_of_all_rows_that_have_one() -> None:
    judged = next(
        one for one in read_rows(ROOT / "results" / "papers.json") if one.paper == "gadau2022"
    )
    rows = [row for row in judged.claims if row["id"].endswith("_nees") and row["required"] != "-"]
    assert len(rows) == NEES_ROWS
