# SPDX-License-Identifier: Apache-2.0
"""Picture of landmarks that were mapped, the path among them, and positions it was not told."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from locfuse.report.palette import ELLIPSE_SIGMAS
from locfuse.report.plot.style import ANCHOR, ESTIMATE, MUTED, dress, legend, new_figure
from locfuse.types import FloatArray, Trajectory


def plot_landmarks(
    estimate: Trajectory,
    landmarks: FloatArray,
    covariance: FloatArray,
    beside: FloatArray,
    label: str,
) -> Figure:
    """Return the map in world.

    Parameters
    ----------
    estimate : Trajectory
    landmarks : float64 array, shape (m, 2)
    covariance : float64 array, shape (m, 2, 2)
        Of the landmarks.
    beside : float64 array, shape (n, 2)
        Positions to compare the path with.
    label : str
        What they are.
    """
    figure = new_figure(9.0)
    axes = figure.subplots()
    dress(axes)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    (other,) = axes.plot(*beside.T, ".", color=MUTED, ms=2, label=label)
    (path,) = axes.plot(*estimate.position.T, "-", color=ESTIMATE, lw=1.2, label="estimate")
    for centre, spread in zip(landmarks, covariance, strict=True):
        variance, axis = np.linalg.eigh(spread)
        width, height = 2.0 * ELLIPSE_SIGMAS * np.sqrt(np.maximum(variance, 0.0))
        angle = float(np.rad2deg(np.arctan2(axis[1, 0], axis[0, 0])))
        axes.add_patch(
            Ellipse(centre, width, height, angle=angle, fill=False, color=ANCHOR, lw=0.6)
        )
    axes.plot(*landmarks.T, "o", color=ANCHOR, ms=3)
    mark = Line2D([], [], color=ANCHOR, marker="o", ms=3, ls="none",
                  label=f"landmarks, ellipses of {ELLIPSE_SIGMAS:g} sigma")  # fmt: skip
    legend(figure, [path, other, mark])
    return figure
