# SPDX-License-Identifier: Apache-2.0
"""Pictures of one run: path, errors, NIS and the verdict on every message; and of a layout.

Each function takes a `RunResult`, `plot_layout` a `Layout`, and returns a free-standing matplotlib
`Figure`; nothing touches pyplot or the process-wide settings. Long runs are thinned to what a
picture can show, and never so that an extreme error or a rejected stretch disappears.
"""

from __future__ import annotations

from locfuse.report.plot.errors import BAND_SIGMAS, plot_errors
from locfuse.report.plot.film import check_film, write_film
from locfuse.report.plot.health import plot_health
from locfuse.report.plot.layout import plot_layout
from locfuse.report.plot.nis import plot_nis
from locfuse.report.plot.outcomes import plot_outcomes
from locfuse.report.plot.path import ELLIPSE_SIGMAS, plot_path
from locfuse.report.plot.start import plot_start
from locfuse.report.plot.style import save
from locfuse.report.plot.sweep import draw_sweep
from locfuse.report.plot.text import VERDICT_LABELS, count, percent, start_ns

__all__ = [
    "BAND_SIGMAS",
    "ELLIPSE_SIGMAS",
    "VERDICT_LABELS",
    "check_film",
    "count",
    "draw_sweep",
    "percent",
    "plot_errors",
    "plot_health",
    "plot_layout",
    "plot_nis",
    "plot_outcomes",
    "plot_path",
    "plot_start",
    "save",
    "start_ns",
    "write_film",
]
