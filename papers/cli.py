# SPDX-License-Identifier: Apache-2.0
"""``locfuse reproduce``: repeat one paper or all five, print what came out, write their page."""

from __future__ import annotations

import json
from pathlib import Path

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from locfuse.cli.terminal import check_file, check_folder, console, progress
from locfuse.types import ConfigError, nearest
from papers.claims import Row
from papers.page import (
    FIVE,
    HEAD,
    OURS,
    PAGE,
    Paper,
    Repeated,
    cells_of,
    differences,
    judge,
    read_rows,
    repeat_all,
    seeds_of,
    stages,
    write_page,
)
from papers.reproduce import PAPERS

SEEDS = 100  # of all but the five papers
ALL = Path("out/papers")  # where the page of all goes


def reproduce_command(
    paper: str,
    seeds: int | None,
    json_file: Path | None,
    pictures: Path | None,
    quick: bool,
    out: Path | None,
    compare: Path | None,
) -> None:
    """Run a paper's experiments and compare: claim, paper's figure, ours, required, met."""
    if paper not in (*PAPERS, "all"):
        raise ConfigError(f"no paper {paper!r}; {nearest(paper, [*PAPERS, 'all'])}")
    if paper not in (*FIVE, "all"):
        for given, option in ((quick, "--quick"), (out, "--out"), (compare, "--compare")):
            if given:
                raise ConfigError(f"{option} is of the five papers, and {paper} is none of them")
    if paper == "all" and out is None:
        out = ALL
    if pictures is not None and out is not None:
        raise ConfigError(f"--pictures {pictures}: they are in --out {out} already; give one")
    before = None if compare is None else _before(compare, paper)
    for folder, option in ((out, "--out"), (pictures, "--pictures")):
        if folder is not None:
            check_folder(folder, option)
    if json_file is not None:
        check_file(json_file, "--json")
    wanted = seeds_of(quick, seeds)
    if paper == "all":
        assert out is not None
        repeated = _all(out, wanted, quick)
    else:
        repeated = [_one(paper, wanted.get(paper, seeds or SEEDS), pictures, out, quick)]
    if json_file is not None:
        rows = [row for one in repeated for row in one.claims]
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if out is not None:
        console.print(f"page: {out / PAGE}", soft_wrap=True)
    if before is not None:
        found = differences(before, repeated)
        for sentence in found:
            console.print(sentence, soft_wrap=True)
        console.print(f"{len(found)} rows differ from {compare}", soft_wrap=True)
        raise typer.Exit(1 if found else 0)
    if any(one.error or any(row["met"] is False for row in one.claims) for one in repeated):
        raise typer.Exit(1)


def _before(file: Path, paper: str) -> list[Repeated]:
    """Return what came out another time of the papers that are asked for."""
    found = [one for one in read_rows(file) if paper in (one.paper, "all")]
    if not found:
        raise ConfigError(f"{file}: has no rows of {paper}")
    return found


def _all(out: Path, seeds: dict[str, int], quick: bool) -> list[Repeated]:
    """Repeat the five papers; print one line each, and what they missed."""
    with progress("papers") as moved:
        repeated = repeat_all(out, seeds, quick, moved)
    for one in repeated:
        required = [row for row in one.claims if row["required"] != "-"]
        missed = [row["claim"] for row in required if row["met"] is False]
        console.print(
            f"{one.paper:12} {one.error or f'{len(required) - len(missed)} of {len(required)} met'}"
            f", {one.seeds} seeds, {one.seconds:.0f} s")  # fmt: skip
        for claim in missed:
            console.print(f"{'':12} missed: {claim}", soft_wrap=True)
    return repeated


def _one(paper: str, seeds: int, pictures: Path | None, out: Path | None, quick: bool) -> Repeated:
    """Repeat one; print its rows and write what is asked for."""
    folder = pictures if out is None else out / paper
    with progress("runs") as moved:
        *_, one = stages(paper, seeds, folder, moved)
    console.print(_table(one))
    for row in one.claims:
        if row["met"] is None:
            console.print(f"{row['claim']}: skipped: {row['note']}", soft_wrap=True)
    if out is not None:
        write_page([one], out, quick)
    if folder is not None:
        for name in one.pictures:
            console.print(f"picture: {folder / name}", soft_wrap=True)
    return one


def _table(one: Repeated) -> Table:
    title = f"{one.paper}: ours is the median (of NEES the mean) [5 %..95 %] over {one.seeds} seeds"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column("claim")  # on a narrow screen the words break, not the figures
    for heading in HEAD[1:-1]:
        table.add_column(heading, justify="right", no_wrap=True)
    judged, own = judge(FIVE.get(one.paper, Paper(one.paper, "", "", 0, 0)), one.claims)
    for of in judged:
        said = of.statement
        text = f"{of.heading} ({said.where}): {said.reports}."
        colour = {True: "green", False: "red", None: "dim"}[of.so]
        remark = f": {said.remark}" if said.remark else ""
        verdict = of.verdict, colour
        table.add_row(Text.assemble((text, "bold"), " ", verdict, (remark, "dim")))
        for row in of.rows:
            _add(table, row)
        table.add_section()
    if judged and own:
        table.add_row(Text(OURS, "bold"))
    for row in own:
        _add(table, row)
    return table


def _add(table: Table, row: Row) -> None:
    claim, *cells, note = cells_of(row)
    table.add_row(Text.assemble(f"{claim} ", (note, "dim")) if note else claim, *cells)
