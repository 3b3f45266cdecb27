# SPDX-License-Identifier: Apache-2.0
"""One page on a robot that was set up: its world, what was learnt, how sure, what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from locfuse.commission.result import Commissioned, write_commissioned
from locfuse.report.html_page import page, picture, table
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.report.results import write_results
from locfuse.report.summary_cards import cards
from locfuse.report.text import count, percent

_SIGNS = {"error": "error", "warning": "warning"}


def write_setup(result: Commissioned, folder: Path) -> list[Path]:
    """Write all of a robot that was set up: `write_commissioned`, the last drive, and a page.

    Beside ``robot.yaml`` and ``world`` the folder then has ``report.html``, with matplotlib
    pictures, and in ``drive`` what `write_results` writes of the recording. Returns the files that
    people open. Raises ConfigError as `write_commissioned`.
    """
    files = write_commissioned(result, folder)
    if result.drive is not None:
        files.append(write_results(result.drive, folder / "drive"))
    report = folder / "report.html"
    title = "Robot set up by one drive"
    report.write_text(page(title, "\n".join(_body(title, result, folder))), encoding="utf-8")
    return [*files, report]


def _body(title: str, result: Commissioned, folder: Path) -> Iterator[str]:
    yield f"<h1>{escape(title)}</h1>"
    if result.drive is not None:
        yield ('<p class="quiet">How the recording is driven with what was found; '
               '<a href="drive/report.html">all of it</a>.</p>')  # fmt: skip
        yield cards(result.drive)
    yield from _sentences("missing", "What could not be made", result.missing)
    yield from _sentences("advice", "What a further drive would improve", result.advice)
    doubts = [*(result.survey.findings if result.survey else ()),
              *(result.map.findings if result.map else ()),
              *(result.tuned.findings if result.tuned else ())]  # fmt: skip
    yield from _sentences("findings", "What was noticed", doubts)
    yield from _pictures(result, folder)
    yield from _anchors(result)
    yield from _learnt(result)
    yield from _held_out(result)
    found = [f for f in result.checks if f.severity in _SIGNS]
    if found:
        yield '<h2 id="check">What <code>locfuse check</code> says</h2>'
        yield table("check", ["", "what", "where", "what to do"],
                    [[f.severity, f.what, f.where, f.advice] for f in found])  # fmt: skip
    yield '<h2 id="configuration">Configuration</h2>'
    yield f'<div class="wide"><pre>{escape(result.yaml)}</pre></div>'


def _sentences(name: str, heading: str, sentences: Sequence[str]) -> Iterator[str]:
    if sentences:
        items = "\n".join(f"<li>{escape(s[:1].upper() + s[1:])}</li>" for s in sentences)
        yield f'<h2 id="{name}">{heading}</h2>\n<ul>\n{items}\n</ul>'


def _pictures(result: Commissioned, folder: Path) -> Iterator[str]:
    if not has_matplotlib():
        yield f'<p class="quiet">{escape(NO_PICTURES)}</p>'
        return
    from locfuse.report import plot

    if result.survey is not None:
        grid = result.map.grid if result.map is not None else result.world.grid
        plot.save(plot.plot_survey(result.survey, grid), folder / "survey.png")
        yield picture("survey", "Anchors and landmarks", "Ellipses are of three sigma; a star is "
                      "where a further drive would help.", folder / "survey.png")  # fmt: skip
    if result.map is not None:
        plot.save(plot.plot_map(result.map), folder / "map.png")
        yield picture("map", "Map", "Black is a wall, white was seen through; thin lines join "
                      "places where the same was seen again.", folder / "map.png")  # fmt: skip
    if result.tuned is not None:
        plot.save(plot.plot_tune(result.tuned), folder / "tune.png")
        yield picture("tune", "Noise and calibration", "Bars are 95 % intervals; what the drive "
                      "does not show is grey and stays.", folder / "tune.png")  # fmt: skip


def _anchors(result: Commissioned) -> Iterator[str]:
    if result.survey is None or not result.survey.anchors:
        return
    rows = []
    for a in result.survey.anchors:
        placed = a.word != "not placed"
        rows.append([
            a.name, *(f"{v:.2f}" if placed else "-" for v in a.position),
            f"{a.sigma_m:.2f}" if placed else "-",
            f"{a.offset_m:.2f} ± {a.sigma_offset_m:.2f}" if placed else "-",
            f"{a.scale:.3f} ± {a.sigma_scale:.3f}" if placed else "-",
            count(a.ranges), percent(a.rejected / max(a.ranges, 1)), a.word,
        ])  # fmt: skip
    yield '<h2 id="anchors">Anchors by this drive</h2>'
    yield '<p class="quiet">Metres; a place that anchors.csv had stays unless it is refuted.</p>'
    yield table("anchors", ["anchor", "x", "y", "z", "sigma", "offset", "scale", "ranges",
                            "rejected", "place"], rows)  # fmt: skip


def _learnt(result: Commissioned) -> Iterator[str]:
    if result.tuned is None:
        return
    rows = [[one.quantity.key, f"{one.quantity.now:.4g}",
             f"{one.value:.4g}" if one.changes else "", f"{one.low:.4g}", f"{one.high:.4g}",
             one.quantity.unit, one.word] for one in result.tuned.quantities]  # fmt: skip
    yield '<h2 id="learnt">What was learnt</h2>'
    yield table("learnt", ["key", "before", "now", "from", "to", "unit", ""], rows)


def _held_out(result: Commissioned) -> Iterator[str]:
    if result.tuned is None or not result.tuned.held_out:
        return
    rows = [[one.source, count(one.count), f"{one.before.nis:.2f}", f"{one.after.nis:.2f}",
             percent(one.before.outliers), percent(one.after.outliers)]
            for one in result.tuned.held_out]  # fmt: skip
    yield '<h2 id="held-out">Held out</h2>'
    yield ('<p class="quiet">Each half of the drive predicted with what the other half says: a '
           "mean NIS of 1 is right.</p>")  # fmt: skip
    yield table("held-out", ["source", "messages", "NIS before", "NIS now", "outliers before",
                             "outliers now"], rows)  # fmt: skip
