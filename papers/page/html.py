# SPDX-License-Identifier: Apache-2.0
"""The page: what each paper reports, in its order, what comes out here, and pictures of it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path

from locfuse import __version__
from locfuse.report.html_page import page, png_address, table
from papers.claims import Judged, Paper, Row, judge
from papers.page.cells import HEAD, OURS, cells_of
from papers.page.repeated import FIVE, PAPERS_IN_ORDER, Repeated

PAGE = "papers.html"
_KINDS = {True: "good", False: "bad", None: "quiet"}


def page_of(repeated: Sequence[Repeated], folder: Path) -> str:
    """Return one page of HTML: each paper's claims, pictures, command and time.

    Parameters
    ----------
    repeated : sequence of Repeated
        One paper or all.
    folder : Path
        Where each has a folder of its pictures.
    """
    all_ = len(repeated) == len(PAPERS_IN_ORDER)
    title = "Five papers, repeated" if all_ else FIVE[repeated[0].paper].title
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="quiet">locfuse {escape(__version__)}. Under each claim of a paper, in its '
        "order: what it reports in our words, whether that is so here, and our figures about it: "
        "the median over seeds, in brackets 5 % and 95 % of them; of NEES the mean. Last, what we "
        "asked beyond the paper. <b>Required</b> is what we ask of ourselves.</p>",
        *_state(repeated),
    ]
    if all_:
        parts.append(_overview(repeated))
    for one in repeated:
        parts += _section(FIVE[one.paper], one, folder / one.paper)
    return page(title, "\n".join(parts))


def _state(repeated: Sequence[Repeated]) -> list[str]:
    rows = [row for one in repeated for row in one.claims]
    met = sum(row["met"] is True and row["required"] != "-" for row in rows)
    missed = sum(row["met"] is False for row in rows)
    skipped = sum(row["met"] is None for row in rows)
    failed = sum(bool(one.error) for one in repeated)
    kind = "bad" if missed or failed else "good"
    return [
        f'<p class="{kind}">{met} requirements met, {missed} missed, {skipped} skipped'
        + (f", {failed} papers failed" if failed else "")
        + ".</p>"
    ]


def _overview(repeated: Sequence[Repeated]) -> str:
    head = ("paper", "its claims so here", "not so", "not run", "required: met", "missed", "time")
    rows = []
    for one in repeated:
        judged, _ = judge(FIVE[one.paper], one.claims)
        asked = [row["met"] for row in one.claims if row["required"] != "-"]
        rows.append([one.paper, *(str([t.so for t in judged].count(so)) for so in _KINDS),
                     str(asked.count(True)), str(asked.count(False)),
                     f"{one.seconds:.0f} s"])  # fmt: skip
    overview = table("overview", head, rows)
    for one in repeated:
        link = f'<a href="#{one.paper}">{one.paper}</a>'
        overview = overview.replace(f"<td>{one.paper}</td>", f"<td>{link}</td>")
    return overview


def _section(paper: Paper, one: Repeated, folder: Path) -> list[str]:
    command = shlex.join(["locfuse", "reproduce", paper.key, "--seeds", str(one.seeds)])
    parts = [
        f'<h2 id="{paper.key}">{escape(paper.title)}</h2>',
        f"<p>{escape(paper.what)}</p>",
        f'<p class="quiet"><code>{escape(command)}</code>, {one.seconds:.0f} s with its '
        "pictures.</p>",
    ]
    if one.error:
        parts.append(f'<p class="bad">It failed: {escape(one.error)}</p>')
        if not one.claims:
            return parts
    for row in one.claims:
        if row["met"] is False:
            parts.append(f'<p class="bad">Missed: {escape(row["claim"])}</p>')
    judged, own = judge(paper, one.claims)
    shown = [Path(name).stem for name in one.pictures if name.endswith(".png")]
    return [*parts, _table(paper, judged, own, shown), *_figures(paper, judged, shown, folder)]


def _table(paper: Paper, judged: Sequence[Judged], own: Sequence[Row], shown: Sequence[str]) -> str:
    lines = ["<tr>" + "".join(f"<th>{cell}</th>" for cell in HEAD) + "</tr>"]
    for one in judged:
        lines += [_claim(paper.key, one, shown), *map(_line, one.rows)]
    if own:
        lines.append(f'<tr class="claim"><td colspan="{len(HEAD)}"><div><b>{escape(OURS)}</b>'
                     "</div></td></tr>")  # fmt: skip
        lines += map(_line, own)
    body = "\n".join(lines)
    return f'<div class="wide"><table class="rows" id="{paper.key}-table">\n{body}\n</table></div>'


def _claim(key: str, judged: Judged, shown: Sequence[str]) -> str:
    of = judged.statement
    link = f' <a href="#{key}-{of.picture}">picture</a>' if of.picture in shown else ""
    remark = f'<span class="quiet">: {escape(of.remark)}</span>' if of.remark else ""
    return (
        f'<tr class="claim" id="{key}-{judged.number}"><td colspan="{len(HEAD)}"><div>'
        f'<b>{escape(judged.heading)}</b> <span class="quiet">({escape(of.where)})</span>: '
        f"{escape(of.reports)}. "
        f'<span class="{_KINDS[judged.so]}">{judged.verdict}</span>{remark}{link}</div></td></tr>'
    )


def _line(row: Row) -> str:
    cells = [escape(cell) for cell in cells_of(row)]
    kind = ' class="bad"' if row["met"] is False else ""
    return f"<tr{kind}>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _figures(
    paper: Paper, judged: Sequence[Judged], shown: Sequence[str], folder: Path
) -> list[str]:
    """Return the pictures, each with what is seen and links to the claims that it shows."""
    parts = []
    for stem in shown:
        links = [f'<a href="#{paper.key}-{one.number}">{escape(one.heading)}</a>'
                 for one in judged if one.statement.picture == stem]  # fmt: skip
        caption = escape(paper.captions.get(stem, ""))
        shows = f" Claims: {', '.join(links)}." if links else ""
        address = png_address((folder / f"{stem}.png").read_bytes())
        parts.append(
            f'<figure id="{paper.key}-{stem}"><div class="wide"><img alt="{caption}" '
            f'src="{address}"></div>'
            f"<figcaption><p>{caption}{shows}</p></figcaption></figure>"
        )
    return parts
