# SPDX-License-Identifier: Apache-2.0
"""Figures of wells: drives among cylinders, the truth, and the estimate of each method."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from locfuse.report.plot.style import (
    ANCHOR,
    ESTIMATE,
    GRID,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    title,
)
from locfuse.types import FloatArray
from papers.figures import save_figures
from papers.wells.experiments import drive_both
from papers.wells.world import CYLINDERS, RADIUS_M


def draw_figures(folder: Path) -> list[Path]:
    """Draw the paths of the first drives, as Figs. 3 and 4 of the paper, and worse odometry."""
    return save_figures(
        ((name, _drive(slip)) for name, slip in (("wells_clean", False), ("wells_spoilt", True))),
        folder,
    )


def _drive(slip: bool) -> Figure:
    drive = drive_both(0, slip=slip)
    found = {"laser alone": drive.laser, "the paper's": drive.paper[:, :2],
             "ours": drive.ours[:, :2]}  # fmt: skip
    return plot_paths(CYLINDERS, RADIUS_M, drive.truth, found)


_LOOKS = (
    {"marker": ".", "ls": "", "ms": 3, "color": ANCHOR},
    {"lw": 1.2, "color": REJECTED},
    {"lw": 1.2, "color": ESTIMATE},
)
_CLOSE_M = 0.5  # half the side of the second panel


def plot_paths(
    cylinders: FloatArray, radius_m: float, truth: FloatArray, found: Mapping[str, FloatArray]
) -> Figure:
    """Draw the whole drive, and beside it a metre of it around the middle.

    Parameters
    ----------
    cylinders : float64 array, shape (m, 2)
    radius_m : float
    truth : float64 array, shape (n, 3)
    found : mapping of method to positions, float64 array, shape (n, 2)
        At most three, the best one last; NaN where there is none.
    """
    figure = new_figure(5.6)
    whole, close = figure.subplots(1, 2)
    middle = truth[len(truth) // 2, :2]
    handles: list[Handle] = []
    for axes in (whole, close):
        dress(axes)
        for at in cylinders:
            axes.add_patch(Circle((at[0], at[1]), radius_m, facecolor=GRID, edgecolor=MUTED))
        handles = axes.plot(truth[:, 0], truth[:, 1], color=TRUTH, lw=2.4, alpha=0.35,
                            label="truth")  # fmt: skip
        for (name, position), look in zip(found.items(), _LOOKS, strict=False):
            handles += axes.plot(position[:, 0], position[:, 1], label=name, **look)
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
    reach = 1.1 * float(np.abs(truth[:, :2]).max())
    whole.set(xlim=(-reach, reach), ylim=(-reach, reach))
    close.set(xlim=middle[0] + np.array([-1, 1]) * _CLOSE_M,
              ylim=middle[1] + np.array([-1, 1]) * _CLOSE_M)  # fmt: skip
    title(whole, "the drive")
    title(close, "one metre of it")
    legend(figure, handles)
    return figure
