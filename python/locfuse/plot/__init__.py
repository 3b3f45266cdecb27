# SPDX-License-Identifier: Apache-2.0
"""Pictures of one run: path, errors, NIS and the verdict on every message; and of a layout.

Each function takes a `RunResult`, `plot_layout` a `Layout`, and returns a free-standing matplotlib
`Figure`; nothing touches pyplot or the process-wide settings. Long runs are thinned to what a
picture can show, and never so that an extreme error or a rejected stretch disappears.
"""

from __future__ import annotations

from locfuse.plot.errors import BAND_SIGMAS, plot_errors
from locfuse.plot.film import check_film, write_film
from locfuse.plot.health import plot_health
from locfuse.plot.landmarks import plot_landmarks
from locfuse.plot.layout import plot_layout
from locfuse.plot.nis import plot_nis
from locfuse.plot.outcomes import plot_outcomes
from locfuse.plot.path import ELLIPSE_SIGMAS, plot_path
from locfuse.plot.power_up import plot_bad_starts, plot_bound, plot_searches
from locfuse.plot.start import plot_start
from locfuse.plot.style import save
from locfuse.plot.sweep import draw_sweep
from locfuse.plot.text import VERDICT_LABELS, count, percent, start_ns
from locfuse.plot.zhang import plot_convergence, plot_particles

__all__ = [
    "BAND_SIGMAS",
    "ELLIPSE_SIGMAS",
    "VERDICT_LABELS",
    "check_film",
    "count",
    "draw_sweep",
    "percent",
    "plot_bad_starts",
    "plot_bound",
    "plot_convergence",
    "plot_errors",
    "plot_health",
    "plot_landmarks",
    "plot_layout",
    "plot_nis",
    "plot_outcomes",
    "plot_particles",
    "plot_path",
    "plot_searches",
    "plot_start",
    "save",
    "start_ns",
    "write_film",
]
