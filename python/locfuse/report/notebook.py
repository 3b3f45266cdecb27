# SPDX-License-Identifier: Apache-2.0
"""What a notebook shows of the values of `locfuse.types`: figures and a picture."""

from __future__ import annotations

import io
from dataclasses import fields
from html import escape

import numpy as np

from locfuse.report.html_page import png_address
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.report.summary_cards import cards
from locfuse.types import Log, Outcomes, RunResult, Trajectory

_STYLE = (
    "<style>.locfuse .cards {display: flex; flex-wrap: wrap; gap: 0.5em}"
    " .locfuse .card {border: 1px solid #8888; border-radius: 4px; padding: 0.4em; max-width: 16em}"
    " .locfuse .card b, .locfuse .card span {display: block}"
    " .locfuse .good {color: #009e73} .locfuse .bad {color: #d55e00}</style>"
)


def html(value: object) -> str:
    """Return HTML: of a run its key figures and path, of a trajectory or outcomes a picture.

    Of anything else, and beside the picture, what `repr` says; without matplotlib how to get it.
    """
    if isinstance(value, RunResult):
        return f'<div class="locfuse">{_STYLE}{cards(value)}{_picture(value)}</div>'
    return f'<div class="locfuse"><code>{escape(repr(value))}</code>{_picture(value)}</div>'


def _picture(value: object) -> str:
    run = _run_of(value)
    if run is None:
        return ""
    if not has_matplotlib():
        return f"<p>{escape(NO_PICTURES)}</p>"
    from locfuse.report.plot import plot_outcomes, plot_path

    data = io.BytesIO()
    (plot_path if len(run.estimate) else plot_outcomes)(run).savefig(data, dpi=80)
    return f'<br><img alt="" src="{png_address(data.getvalue())}">'


def _is_drawable(track: Trajectory) -> bool:
    numbers = (track.position, track.covariance)
    return len(track) > 0 and all(n is None or bool(np.isfinite(n).all()) for n in numbers)


def _run_of(value: object) -> RunResult | None:
    """Return a run to draw, with nothing else in it where the value is a part of one."""
    if isinstance(value, RunResult) and _is_drawable(value.estimate):
        return value
    if isinstance(value, Trajectory) and _is_drawable(value):
        nothing = Outcomes(*(np.empty(0, "U1") for _ in fields(Outcomes)))
        return RunResult({}, Log({}), value, None, nothing, {})
    if isinstance(value, Outcomes) and len(value):
        nowhere = Trajectory(np.empty(0, np.int64), np.empty((0, 2)))
        return RunResult({}, Log({}), nowhere, None, value, {})
    return None
