# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run, of the layout of anchors and of a sweep; needs matplotlib.

Each function takes a `RunResult`, `plot_layout` a `Layout`, `plot_map` a `MapResult`, `plot_survey`
a `SurveyResult`, `plot_tune` a `TuneResult`, and returns a free-standing matplotlib
`Figure`; nothing touches pyplot or process-wide settings. Long runs are decimated to what a
picture can show, and never so that an extreme error or a stretch of rejections disappears.
"""

from __future__ import annotations

# ruff: noqa: E402
from locfuse.report.pictures import require_matplotlib

require_matplotlib()

from locfuse.report.plot.errors import plot_errors, plot_height
from locfuse.report.plot.film import check_film, write_film
from locfuse.report.plot.health import plot_health, plot_watched
from locfuse.report.plot.layout import plot_layout
from locfuse.report.plot.mapping import plot_map
from locfuse.report.plot.nis import plot_nis
from locfuse.report.plot.outcomes import plot_outcomes
from locfuse.report.plot.path import plot_path
from locfuse.report.plot.start import plot_start
from locfuse.report.plot.style import save
from locfuse.report.plot.survey import plot_survey
from locfuse.report.plot.sweep import draw_sweep
from locfuse.report.plot.tune import plot_tune

__all__ = [
    "check_film",
    "draw_sweep",
    "plot_errors",
    "plot_health",
    "plot_height",
    "plot_layout",
    "plot_map",
    "plot_nis",
    "plot_outcomes",
    "plot_path",
    "plot_start",
    "plot_survey",
    "plot_tune",
    "plot_watched",
    "save",
    "write_film",
]
