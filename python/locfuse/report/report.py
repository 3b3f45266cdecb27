# SPDX-License-Identifier: Apache-2.0
"""One self-contained page about a run: a player, key figures, pictures, tables, configuration."""

from __future__ import annotations

import math
import re
from html import escape
from pathlib import Path

import numpy as np
import yaml
from pydantic_core import to_jsonable_python

from locfuse import _core
from locfuse.eval import verdicts
from locfuse.report.html_page import page, picture, table
from locfuse.report.palette import BAND_SIGMAS, ELLIPSE_SIGMAS
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.report.player import MAX_BYTES, pack, player_css, player_html, player_script
from locfuse.report.summary_cards import cards, counts_of
from locfuse.report.text import VERDICT_LABELS, count, percent, start_ns
from locfuse.types import NANOSECONDS, RunResult

__all__ = ["write_report"]

_MAX_STRETCHES = 8
_MAX_PAGE_BYTES = 8_000_000  # so that it can be sent by mail
_PAGE_BYTES = 20_000  # of the head of the page and of the HTML around the player's data

_CAPTIONS = {
    "path": (
        "Path",
        "The estimated path with {sigmas:g}-sigma ellipses of its position{truth}: truth should "
        "run inside the ellipses, and an orange anchor had at least {notable:.0f} % of its ranges "
        "rejected.",
    ),
    "start": (
        "Start",
        "How the pose was found from nothing: every hypothesis when there were most, with its "
        "probability, and the one that remained.",
    ),
    "errors": (
        "Errors",
        "Estimate minus truth against the {band:g}-sigma band the estimator claims: a consistent "
        "filter leaves the band in about 0.3 % of the stamps, and a band far wider than the error "
        "is too cautious.",
    ),
    "height": ("Height", "Height over z = 0 of the world against its {band:g}-sigma band."),
    "health": (
        "Health",
        "How far the estimate could be trusted, as the filter judged: the background is the "
        "state, and health.csv has the reasons.",
    ),
    "watched": (
        "Watched poses",
        "How far the poses of the other localizer could be trusted, as the estimate without them "
        "judged: the background is the state, and watched.csv has the reasons.",
    ),
    "nis": (
        "Innovations",
        "Normalised innovation squared (NIS) of each message that was compared with a prediction: "
        "95 % should lie inside the band; a cloud above it means too small sigmas or a wrong "
        "model, below it too large sigmas.",
    ),
    "outcomes": (
        "Rejected messages",
        "Each row is one anchor, landmark or source and time runs to the right: pale where "
        "messages arrived, strong where the filter rejected them, full height where it rejected "
        "all of them.",
    ),
}


PICTURES = tuple(f"{name}.png" for name in _CAPTIONS)


def write_report(result: RunResult, out_dir: Path) -> Path:
    """Write the pictures of a run and one page that replays it and works without a network.

    The folder is created if missing. ``report.html`` is written and, with matplotlib, ``path.png``,
    ``nis.png``, ``outcomes.png``, where the run has them also ``errors.png`` (needs truth),
    ``start.png``, ``height.png``, ``health.png`` and ``watched.png``. Returns ``report.html`` with
    player and pictures inside it, smaller than 8 MB: the player decimates the rows of a long run.
    Raises ValueError if the estimate is empty, OSError if the folder cannot be written.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    files = _draw(result, out_dir)
    pictures: list[str] = []
    for name, file in files.items():
        if file is not None:
            pictures.append(_picture(name, file, result))
        elif name not in ("start", "health", "height", "watched"):  # most runs have none
            pictures.append(_missing(name, result))
    if not files:
        pictures.append(f'<p class="quiet">{escape(NO_PICTURES)}</p>')

    title = str(result.config.get("name") or "Localization run")
    heading = _heading(title, result)
    tables = _counts_table(result), _rejected_table(result), _switches_table(result)
    below = "\n".join([cards(result), *pictures, *tables, _configuration(result)])
    body = "\n".join([heading, _player(result, len((heading + below).encode("utf-8"))), below])
    file = out_dir / "report.html"
    file.write_text(page(title, body, player_script()), encoding="utf-8")
    return file


def _draw(result: RunResult, out_dir: Path) -> dict[str, Path | None]:
    """Write the pictures and return their files; none where the run has nothing to draw.

    Pictures of an earlier run are removed. Empty without matplotlib.
    """
    for name in _CAPTIONS:
        (out_dir / f"{name}.png").unlink(missing_ok=True)
    if not has_matplotlib():
        return {}
    from locfuse.report import plot

    files: dict[str, Path | None] = {}
    for name, draw in (
        ("path", plot.plot_path),
        ("start", plot.plot_start),
        ("outcomes", plot.plot_outcomes),
        ("errors", plot.plot_errors),
        ("height", plot.plot_height),
        ("health", plot.plot_health),
        ("watched", plot.plot_watched),
        ("nis", plot.plot_nis),
    ):
        figure = draw(result)
        files[name] = None if figure is None else out_dir / f"{name}.png"
        if figure is not None:
            plot.save(figure, out_dir / f"{name}.png")
    return files


def _player(result: RunResult, others_bytes: int) -> str:
    """Return the player with as much of the run as the page has room for."""
    others_bytes += len((player_script() + player_css()).encode("utf-8")) + _PAGE_BYTES
    packed = pack(result, max_bytes=min(MAX_BYTES, _MAX_PAGE_BYTES - others_bytes))
    return player_html([packed])


def _heading(title: str, result: RunResult) -> str:
    description = str(result.config.get("description") or result.log.description)
    truth = str(result.metrics.get("truth") or "")
    if result.truth is None:
        truth = "This run has no truth, so there are no errors and no NEES to show."
    lines = [f"<h1>{escape(title)}</h1>"]
    if description:
        lines.append(f"<p>{escape(description)}</p>")
    if truth:
        lines.append(f'<p class="quiet">{escape(truth)}</p>')
    return "\n".join(lines)


def _picture(name: str, file: Path, result: RunResult) -> str:
    heading, caption = _CAPTIONS[name]
    caption = caption.format(
        sigmas=ELLIPSE_SIGMAS,
        band=BAND_SIGMAS,
        notable=100 * verdicts.SUSPECT_SHARE,
        truth="" if result.truth is None else " against truth",
    )
    return picture(name, heading, caption, file)


def _missing(name: str, result: RunResult) -> str:
    heading, _ = _CAPTIONS[name]
    why = (
        "This run has no truth, so the errors are unknown."
        if result.truth is None
        else "Truth and estimate do not overlap in time, so the errors are unknown."
    )
    return f'<h2 id="{name}">{heading}</h2>\n<p>{why}</p>'


def _counts_table(result: RunResult) -> str:
    counts = counts_of(result)
    present = [v for v in VERDICT_LABELS if any(row.get(v) for row in counts.values())]
    present += sorted({v for row in counts.values() for v in row if v not in VERDICT_LABELS})
    nis = result.metrics.get("nis_mean") or {}
    head = ["source", *(v.replace("_", " ") for v in present), "total", "mean NIS", "expected NIS"]
    rows = [
        [
            source,
            *(count(counted.get(v, 0)) for v in present),
            count(sum(counted.values())),
            "-" if nis.get(source) is None else f"{float(nis[source]):.3g}",
            _expected_nis(result, source),
        ]
        for source, counted in sorted(counts.items(), key=lambda of: verdicts.source_rank(of[0]))
    ]
    meaning = "; ".join(
        f"{v.replace('_', ' ')}: {VERDICT_LABELS[v]}"
        for v in present
        if VERDICT_LABELS.get(v, v) != v.replace("_", " ")
    )
    lines = ['<h2 id="counts">Verdicts on the messages</h2>']
    if meaning:
        lines.append(f'<p class="quiet">{escape(meaning)}.</p>')
    return "\n".join([*lines, table("counts", head, rows)])


def _expected_nis(result: RunResult, source: str) -> str:
    """Return the mean number of innovation rows, which the mean NIS of a good filter equals."""
    outcomes = result.outcomes
    compared = (outcomes.source == source) & np.isfinite(outcomes.nis) & (outcomes.dof > 0)
    return f"{float(outcomes.dof[compared].mean()):.3g}" if compared.any() else "-"


def _rejected_table(result: RunResult) -> str:
    heading = '<h2 id="rejected">Rejected by source</h2>\n'
    rows = [row for row in verdicts.message_rows(result.outcomes) if row.rejected]
    if not rows:
        return heading + "<p>No message was rejected by the gate.</p>"
    rows.sort(key=lambda row: -row.rejected_share)
    origin = start_ns(result)
    cells = [
        [
            row.label,
            f"{count(row.rejected)} of {count(len(row.stamp_ns))} ({percent(row.rejected_share)})",
            _stretches(row, origin),
        ]
        for row in rows
    ]
    head = ["anchor or source", "rejected", "when, and how many in a row"]
    return heading + table("rejected", head, cells)


def _switches_table(result: RunResult) -> str:
    """Return when UWB took over from scans, why, and from how wide a belief; nothing if never."""
    rows = np.flatnonzero(result.outcomes.source == "switch")
    if len(rows) == 0:
        return ""
    cells = []
    for row in rows.tolist():
        after_s = (int(result.outcomes.stamp_ns[row]) - start_ns(result)) / NANOSECONDS
        why, covariances = str(result.outcomes.reason[row]).split(":", 1)
        before, after = (_sigmas(text) for text in re.findall(r"\[(.*?)\]", covariances))
        cells.append([f"{after_s:.1f} s", why, before, after])
    head = ["when", "why", "sigma of the particles before", "sigma by UWB, after"]
    return '<h2 id="switches">When UWB took over</h2>\n' + table("switches", head, cells)


def _sigmas(upper: str) -> str:
    """Return standard deviations, from the upper triangle of a covariance of (x, y, heading)."""
    P = np.zeros((3, 3))
    P[np.triu_indices(3)] = P.T[np.triu_indices(3)] = [float(word) for word in upper.split()]
    of = _core.PoseEstimate(0, _core.Pose2(), P)
    return f"{of.sigma_position:.2f} m, {math.degrees(of.sigma_heading):.1f} deg"


def _stretches(row: verdicts.MessageRow, origin_ns: int) -> str:
    """Return the longest stretches of rejections, in order of time."""
    stretches = verdicts.rejected_stretches(row)
    longest = sorted(stretches, key=lambda stretch: -stretch.messages)[:_MAX_STRETCHES]
    texts = []
    for stretch in sorted(longest, key=lambda stretch: stretch.first_ns):
        first = (stretch.first_ns - origin_ns) / NANOSECONDS
        last = (stretch.last_ns - origin_ns) / NANOSECONDS
        when = f"{first:.1f}" if stretch.messages == 1 else f"{first:.1f} to {last:.1f}"
        text = f"{when} s ({count(stretch.messages)})"
        texts.append(text.replace(" ", "\N{NO-BREAK SPACE}"))
    left = len(stretches) - len(longest)
    return ", ".join(texts) + (f" and {count(left)} shorter ones" if left else "")


def _configuration(result: RunResult) -> str:
    # Arrays have lists; other things of Python their texts.
    plain = to_jsonable_python(
        dict(result.config), fallback=lambda value: getattr(value, "tolist", value.__str__)()
    )
    text = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return f"<details><summary>Effective configuration</summary><pre>{escape(text)}</pre></details>"
