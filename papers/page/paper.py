# SPDX-License-Identifier: Apache-2.0
"""What a paper reports, statement by statement, and which of our rows tell whether it is so."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

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
        Told our medians in the order of `rows`; says whether it is so here.
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
class Told:
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


def tell(paper: Paper, rows: Sequence[Row]) -> tuple[list[Told], list[Row]]:
    """Return the statements of a paper with our rows, and the rows that no statement asks for."""
    by_id = {row["id"]: row for row in rows}
    told = []
    for number, statement in enumerate(paper.statements, start=1):
        found = [by_id[id] for id in statement.rows if id in by_id]
        medians = [row["ours_median"] for row in found]
        complete = len(found) == len(statement.rows) and None not in medians
        so = bool(statement.holds(*medians)) if complete else None
        told.append(Told(number, statement, found, so))
    asked = {id for statement in paper.statements for id in statement.rows}
    return told, [row for row in rows if row["id"] not in asked]
