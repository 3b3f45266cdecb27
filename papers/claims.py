# SPDX-License-Identifier: Apache-2.0
"""Rows of a comparison with a paper, and the statements of the paper that they check."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

Progress = Callable[[int, int], None]
INTERVAL = "[95 % interval]"  # how a share's note ends


@dataclass(frozen=True)
class Claim:
    """One row of the comparison; `met` is None where it could not be run, and `note` says why."""

    id: str
    claim: str
    unit: str
    paper: float | None
    ours_median: float | None
    ours_low: float | None
    ours_high: float | None
    required: str
    met: bool | None
    note: str = ""

    def row(self) -> dict[str, Any]:
        """Return the row as JSON-ready values."""
        return asdict(self)


def claim_of(
    id: str, claim: str, unit: str, paper: float | None, values: Iterable[float],
    required: str, met: Callable[[float], bool], note: str = "",
) -> Claim:  # fmt: skip
    low, median, high = (float(v) for v in np.quantile(list(values), [0.05, 0.5, 0.95]))
    return Claim(id, claim, unit, paper, median, low, high, required, met(median), note)


def claims_of(parts: Sequence[Callable[[], Iterable[Claim]]], progress: Progress) -> list[Claim]:
    """Return the rows of all parts, reporting (parts done, parts in all)."""
    claims: list[Claim] = []
    for done, part in enumerate(parts):
        progress(done, len(parts))
        claims += part()
    progress(len(parts), len(parts))
    return claims


def share(
    id: str, claim: str, part: int, of: int, required: float | None, at_most: bool = False
) -> Claim:
    """Return a row about how often something happens, in percent, with its 95 % interval."""
    p = part / of
    half = 1.96 * np.sqrt(max(p * (1.0 - p), 1.0 / of) / of)
    met, limit = True, "-"
    if required is not None:
        met = bool(p <= required if at_most else p >= required)  # counts may be numpy's
        limit = f"{'<=' if at_most else '>='} {100.0 * required:g}"
    return Claim(id, claim, "%", None, 100.0 * p, 100.0 * max(p - half, 0.0),
                 100.0 * min(p + half, 1.0), limit, met,
                 f"{part} of {of}; {INTERVAL}")  # fmt: skip


def consistent(
    id: str, what: str, nees: Iterable[float], limits: tuple[float, float], required: bool = True
) -> Claim:
    """Return a row about a mean NEES that lies between two limits, if it must."""
    mean, (low, high) = float(np.mean(list(nees))), limits
    return Claim(f"{id}_nees", f"{what}NEES at the end, mean over seeds", "1", None, mean, mean,
                 mean, f"{low:.2f}..{high:.2f}" if required else "-",
                 low <= mean <= high or not required)  # fmt: skip


def absent(id: str, claim: str, why: str, required: str = "-") -> Claim:
    """Return a row that could not be run."""
    return Claim(id, claim, "m", None, None, None, None, required, None, why)


Row = Mapping[str, Any]  # as `Claim.row`


@dataclass(frozen=True)
class Statement:
    """Something that a paper claims and that can be checked.

    Attributes
    ----------
    where : str
        In the paper.
    about : str
    reports : str
        What the paper says, in our words.
    rows : tuple of str
        Ids of our rows about it.
    holds : callable
        Judged our medians in the order of `rows`; says whether it is so here.
    picture : str
        The stem of the picture that shows it; empty if none does.
    remark : str
        What else there is to say.
    """

    where: str
    about: str
    reports: str
    rows: tuple[str, ...]
    holds: Callable[..., bool]
    picture: str = ""
    remark: str = ""


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
    statements : tuple of Statement
        In the paper's order.
    captions : mapping of the stem of a picture to what is seen
    """

    key: str
    title: str
    what: str
    seeds: int
    quick_seeds: int
    statements: tuple[Statement, ...] = ()
    captions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Judged:
    """A statement with our rows about it.

    Attributes
    ----------
    number : int
        From 1 on, in the paper's order.
    statement : Statement
    rows : list of mappings
        Those that there are.
    so : bool or None
        Whether it is so here; None if a row is missing or was skipped.
    """

    number: int
    statement: Statement
    rows: list[Row]
    so: bool | None

    @property
    def heading(self) -> str:
        """What it is about, numbered."""
        about = self.statement.about
        return f"{self.number}. {about[0].upper()}{about[1:]}"

    @property
    def verdict(self) -> str:
        """The same in words."""
        return {True: "so here", False: "NOT so here", None: "not run"}[self.so]


def judge(paper: Paper, rows: Sequence[Row]) -> tuple[list[Judged], list[Row]]:
    """Return the statements of a paper with our rows, and the rows that no statement asks for."""
    by_id = {row["id"]: row for row in rows}
    judged = []
    for number, statement in enumerate(paper.statements, start=1):
        found = [by_id[id] for id in statement.rows if id in by_id]
        medians = [row["ours_median"] for row in found]
        complete = len(found) == len(statement.rows) and None not in medians
        so = bool(statement.holds(*medians)) if complete else None
        judged.append(Judged(number, statement, found, so))
    asked = {id for statement in paper.statements for id in statement.rows}
    return judged, [row for row in rows if row["id"] not in asked]
