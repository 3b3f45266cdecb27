# SPDX-License-Identifier: Apache-2.0
"""All five papers at once: their experiments in processes side by side, and one page of it all."""

from __future__ import annotations

import json
import math
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from html import escape
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from locfuse import __version__
from locfuse.claims import INTERVAL
from locfuse.page import page, picture, table
from locfuse.reproduce import draw, reproduce
from locfuse.types import ConfigError

PAGE, ROWS = "papers.html", "papers.json"
UNSTABLE_UNITS = ("ms", "us", "s/s")  # of the machine, not of the method
RATES = ("1/h",)  # of what is rare: a few hours hold none or one
EXACT = 0.05  # of a figure that no seed changes, by which processors and libraries may move it


@dataclass(frozen=True)
class Paper:
    """A paper whose experiments are repeated.

    Attributes
    ----------
    key : str
        Of `reproduce.PAPERS`.
    title, what : str
    seeds, quick_seeds : int
        Runs per simulated experiment.
    """

    key: str
    title: str
    what: str
    seeds: int
    quick_seeds: int


PAPERS_IN_ORDER = (
    Paper("ekim2020", "P. Oguz Ekim, 2020: Localization and initialization algorithms based on "
          "UWB, LiDAR and odometry",
          "A robot that is switched on anywhere finds itself by ranges and "
          "one scan, then an EKF fuses odometry, ranges and the poses of another localizer.",
          100, 12),
    Paper("wells", "J. Wells and others: Laser based EKF localization on TurtleBot",
          "An EKF on cylinders that a laser sees; the paper trusts the heading of its odometry.",
          20, 5),
    Paper("celan2017", "V. Celan, I. Stancic and J. Music, 2017: Ultra wideband assisted "
          "localization of semi-autonomous floor scrubber", "Three UWB tags on one body, and a "
          "switch that rescues a lost laser localizer.", 20, 3),
    Paper("gadau2022", "A. Gadau and others, 2022: Aerial localization using the extended Kalman "
          "filter", "Ranges and bearings to landmarks, recognition, GPS, kidnapping; the authors' "
          "filter diverges where ours has to converge.", 100, 12),
    Paper("zhang", "Zhang Hong and others: A fusion localization algorithm combining MCL with EKF",
          "Monte Carlo localization whose particles are refined by an EKF.", 60, 12),
)  # fmt: skip


@dataclass(frozen=True)
class Repeated:
    """What came out of one paper.

    Attributes
    ----------
    paper : str
    seeds : int
    seconds : float
        That experiments and pictures took.
    claims : list of dict
        `Claim.row` of each, in the paper's order.
    pictures : list of str
        File names beside the page.
    error : str
        Why there are no claims; empty if there are.
    """

    paper: str
    seeds: int
    seconds: float
    claims: list[dict[str, Any]]
    pictures: list[str]
    error: str = ""


def repeat(key: str, seeds: int, folder: Path) -> Repeated:
    """Repeat one paper and draw its pictures into a folder; an error is part of what came out."""
    began = time.monotonic()
    claims: list[dict[str, Any]] = []
    pictures: list[str] = []
    error = ""
    try:
        claims = [claim.row() for claim in reproduce(key, seeds)]
        folder.mkdir(parents=True, exist_ok=True)
        pictures = [file.name for file in draw(key, min(seeds, 12), folder)]
    except Exception as problem:  # of one paper, which the others must not suffer from
        error = f"{type(problem).__name__}: {problem}"
    return Repeated(key, seeds, time.monotonic() - began, claims, pictures, error)


def repeat_all(
    folder: Path,
    quick: bool = False,
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
    workers: int = 2,
) -> list[Repeated]:
    """Repeat every paper and write ``papers.html`` and ``papers.json`` into a folder.

    Parameters
    ----------
    folder : Path
        Made if absent; pictures go into a folder for each paper.
    quick : bool
        Fewer seeds.
    progress : callable, optional
        Told (papers done, papers in all).
    executor : Executor, optional
        That runs them; a pool of `workers` processes otherwise.

    Returns
    -------
    list of Repeated
        In the order of `PAPERS_IN_ORDER`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if executor is None:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            return repeat_all(folder, quick, progress, pool)
    seeds = {p.key: p.quick_seeds if quick else p.seeds for p in PAPERS_IN_ORDER}
    # The longest first, so that no worker waits for it in the end.
    by_length = sorted(PAPERS_IN_ORDER, key=lambda p: p.key != "celan2017")
    futures = [executor.submit(repeat, p.key, seeds[p.key], folder / p.key) for p in by_length]
    found = {}
    for done, future in enumerate(as_completed(futures), start=1):
        one = future.result()
        found[one.paper] = one
        if progress is not None:
            progress(done, len(futures))
    repeated = [found[p.key] for p in PAPERS_IN_ORDER]
    write_rows(repeated, folder / ROWS, quick)
    (folder / PAGE).write_text(page_of(repeated, folder), encoding="utf-8")
    return repeated


def write_rows(repeated: Sequence[Repeated], file: Path, quick: bool) -> None:
    """Write what came out as JSON."""
    told = {
        "version": __version__,
        "quick": quick,
        "papers": [
            {"paper": one.paper, "seeds": one.seeds, "seconds": round(one.seconds, 1),
             "error": one.error, "claims": one.claims, "pictures": one.pictures}
            for one in repeated
        ],
    }  # fmt: skip
    file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def read_rows(file: Path) -> list[Repeated]:
    """Read what `write_rows` wrote.

    Raises
    ------
    ConfigError
        If the file is something else.
    """
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
        return [Repeated(**one) for one in told["papers"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{file}: expected what `locfuse reproduce all` writes as {ROWS} "
                          f"({error})") from error  # fmt: skip


def differences(before: Sequence[Repeated], now: Sequence[Repeated]) -> list[str]:
    """Return what is not as it was: one sentence for each row.

    That is a figure outside of its spread, a requirement that was met and is missed, a row that was
    not there before or is not there any more, and a paper that failed. The median of now has to lie
    in the spread over seeds of before, or the other way round; a figure that no seed changes may
    move by a twentieth. A mean NEES and what is rare have to be met again if they were. Figures of
    speed are of the machine. A share of few seeds says as much as its interval: what it requires is
    compared where there are as many seeds.
    """
    seeds = {one.paper: one.seeds for one in before}
    failed = {one.paper for one in now if one.error}
    was = {row["id"]: row for one in before if one.paper not in failed for row in one.claims}
    found = [f"{one.paper}: {one.error}" for one in now if one.error]
    for one in now:
        for row in one.claims:
            old = was.pop(row["id"], None)
            if old is None:
                found.append(f"{row['id']}: was not there; it is {figure_of(row)}")
            elif said := _difference(old, row, one.seeds == seeds.get(one.paper)):
                found.append(f"{row['id']}: {said}")
    return found + [f"{id}: not there any more" for id in was]


def _difference(was: Mapping[str, Any], row: Mapping[str, Any], as_many_seeds: bool) -> str:
    """Return what is not as it was, empty if nothing is."""
    comparable = not _of_speed(was) and (as_many_seeds or not row["note"].endswith(INTERVAL))
    if comparable and was["met"] is not False and row["met"] is False:
        return f"required {row['required']}, is missed: {figure_of(row)}, was {figure_of(was)}"
    return "" if _agree(was, row) else f"was {figure_of(was)}, is {figure_of(row)}"


def _of_speed(row: Mapping[str, Any]) -> bool:
    return row["unit"] in UNSTABLE_UNITS or row["id"].endswith("_speed")


def _agree(was: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    if was["id"].endswith("_nees") or was["unit"] in RATES:
        return bool(row["met"]) or not was["met"]  # what is required goes by the number of seeds
    if _of_speed(was) or was["ours_median"] is None or row["ours_median"] is None:
        return True
    return _inside(row["ours_median"], was) or _inside(was["ours_median"], row)


def _inside(value: float, row: Mapping[str, Any]) -> bool:
    slack = EXACT * max(abs(row["ours_median"]), 1e-12)
    return bool(row["ours_low"] - slack <= value <= row["ours_high"] + slack)


# The page -----------------------------------------------------------------------------------------


def page_of(repeated: Sequence[Repeated], folder: Path) -> str:
    """Return one page of HTML: each paper's claims, pictures, command and time."""
    rows = [row for one in repeated for row in one.claims]
    met = sum(row["met"] is True and row["required"] != "-" for row in rows)
    missed = sum(row["met"] is False for row in rows)
    skipped = sum(row["met"] is None for row in rows)
    failed = sum(bool(one.error) for one in repeated)
    state = "bad" if missed or failed else "good"
    parts = [
        "<h1>Five papers, repeated</h1>",
        f'<p class="quiet">locfuse {escape(__version__)}. Ours is the median over seeds, in '
        "brackets 5 % and 95 % of them; of NEES the mean.</p>",
        f'<p class="{state}">{met} requirements met, {missed} missed, {skipped} skipped'
        + (f", {failed} papers failed" if failed else "")
        + ".</p>",
    ]
    for paper, one in zip(PAPERS_IN_ORDER, repeated, strict=True):
        parts += _section(paper, one, folder / paper.key)
    return page("Five papers, repeated", "\n".join(parts))


def _section(paper: Paper, one: Repeated, folder: Path) -> list[str]:
    command = shlex.join(["locfuse", "reproduce", paper.key, "--seeds", str(one.seeds)])
    parts = [
        f'<h2 id="{paper.key}">{escape(paper.title)}</h2>',
        f"<p>{escape(paper.what)}</p>",
        f'<p class="quiet"><code>{escape(command)}</code>, {one.seconds:.0f} s with its '
        "pictures.</p>",
    ]
    if one.error:
        return [*parts, f'<p class="bad">It failed: {escape(one.error)}</p>']
    missed = [row["claim"] for row in one.claims if row["met"] is False]
    parts += [f'<p class="bad">Missed: {escape(claim)}</p>' for claim in missed]
    head = ["claim", "paper", "ours", "required", "met"]
    parts.append(table(paper.key, head, [cells_of(row) for row in one.claims]))
    notes = sorted({f"{row['claim']}: {row['note']}" for row in one.claims if row["met"] is None})
    parts += [f'<p class="quiet">Skipped: {escape(note)}</p>' for note in notes]
    for name in one.pictures:
        file = folder / name
        if file.suffix == ".png":
            parts.append(picture(f"{paper.key}-{file.stem}", file.stem.replace("_", " "), "", file))
    return parts


def cells_of(row: Mapping[str, Any]) -> list[str]:
    """Return a claim as text: with its unit, paper's figure, ours, required, met."""
    unit = "" if row["unit"] == "1" else f" [{row['unit']}]"
    paper = "-" if row["paper"] is None else f"{row['paper']:g}"
    met = {True: "yes" if row["required"] != "-" else "-", False: "NO", None: "-"}[row["met"]]
    return [row["claim"] + unit, paper, figure_of(row), row["required"], met]


def figure_of(row: Mapping[str, Any]) -> str:
    """Return our figure with its spread, three digits each."""
    median, low, high = row["ours_median"], row["ours_low"], row["ours_high"]
    if median is None:
        return "skipped"
    if math.isclose(low, high):
        return f"{median:.3g}"
    return f"{median:.3g} [{low:.3g}..{high:.3g}]"
