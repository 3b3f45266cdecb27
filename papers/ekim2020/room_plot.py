# SPDX-License-Identifier: Apache-2.0
"""Picture of a drive that another localizer watches: its poses, ours, the truth."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from locfuse.report.plot.style import (
    ANCHOR,
    DASHED,
    ESTIMATE,
    INK,
    REJECTED,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.types import FloatArray


def plot_room(
    anchors: FloatArray, truth: FloatArray, poses: FloatArray, ours: FloatArray, close_up: str
) -> Figure:
    """Draw the floor of one drive, and 2 m of it.

    Parameters
    ----------
    anchors : float64 array, shape (m, 2)
    truth, poses, ours : float64 arrays, shape (n, 2), (k, 2), (n, 2)
        The other localizer's `poses`.
    close_up : str
        Title of the second panel.
    """
    figure = new_figure(5.6)
    whole, close = figure.subplots(1, 2)
    handles = []
    for axes in (whole, close):
        dress(axes)
        handles = axes.plot(*truth.T, color=INK, lw=1.2, ls=DASHED, label="truth", zorder=3)
        handles += axes.plot(*poses.T, "^", color=REJECTED, ms=4, label="pose source")
        handles += axes.plot(*ours.T, color=ESTIMATE, lw=1.5, label="EKF")
        handles += axes.plot(*anchors.T, "s", color=ANCHOR, ms=8, label="anchor")
        axes.set_aspect("equal")
        axes.set(xlabel="x [m]", ylabel="y [m]")
    middle = truth[len(truth) // 4]
    close.set(xlim=middle[0] + np.array([-1.0, 1.0]), ylim=middle[1] + np.array([-1.0, 1.0]))
    title(whole, "the drive")
    title(close, close_up)
    legend(figure, handles)
    return figure
