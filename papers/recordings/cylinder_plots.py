# SPDX-License-Identifier: Apache-2.0
"""Picture of a drive among cylinders: where it went, and how far off a reference it was."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    REJECTED,
    TRUTH,
    dress,
    legend,
    new_figure,
    time_axis,
    title,
)
from locfuse.types import NANOSECONDS, FloatArray, StampArray

_COLOURS = (REJECTED, ESTIMATE)


def plot_drive(
    cylinders: FloatArray,
    reference: FloatArray,
    stamp_ns: StampArray,
    found: Mapping[str, FloatArray],
) -> Figure:
    """Draw the drive, and beside it distances from the reference over time.

    Parameters
    ----------
    cylinders : float64 array, shape (m, 2)
    reference : float64 array, shape (n, 2)
    stamp_ns : int64 array, shape (n,)
    found : mapping of method to positions, float64 array, shape (n, 2)
        At most two, the better one last.
    """
    figure = new_figure(4.8)
    way, off = figure.subplots(1, 2)
    dress(way)
    dress(off)
    time_s = (stamp_ns - stamp_ns[0]) / NANOSECONDS
    handles = way.plot(*cylinders.T, "o", color=ANCHOR, ms=5, label="cylinders")
    handles += way.plot(*reference.T, color=TRUTH, lw=3.0, alpha=0.3, label="reference")
    for (name, position), colour in zip(found.items(), _COLOURS, strict=False):
        handles += way.plot(*position.T, color=colour, lw=1.2, label=name)
        off.plot(time_s, 100.0 * np.hypot(*(position - reference).T), color=colour, lw=1.2)
    way.set_aspect("equal", adjustable="datalim")
    way.set(xlabel="x [m]", ylabel="y [m]")
    time_axis(off, time_s)
    off.set_ylabel("off the reference [cm]")
    off.set_ylim(bottom=0.0)
    title(way, "the drive")
    title(off, "how far off")
    legend(figure, handles)
    return figure
