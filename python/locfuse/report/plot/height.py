# SPDX-License-Identifier: Apache-2.0
"""Picture of the height over time, of a body that flies."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from locfuse.report.decimation import stride
from locfuse.report.palette import BAND_SIGMAS
from locfuse.report.plot import style
from locfuse.report.text import seconds, start_ns
from locfuse.types import RunResult, rows_of


def plot_height(result: RunResult) -> Figure | None:
    """Draw the height with its 3-sigma band, and that of truth if it has one.

    None for an estimate in the plane.
    """
    if result.estimate.height is None or len(result.estimate) == 0:
        return None
    estimate = rows_of(result.estimate, stride(len(result.estimate), style.MAX_POINTS))
    assert estimate.height is not None
    figure, (axes,) = style.panels(1, 3.0)
    time_s = seconds(estimate.stamp_ns, start_ns(result))
    handles: list[style.Handle] = [Line2D([], [], color=style.ESTIMATE, lw=1.0, label="estimate")]
    if estimate.height_variance is not None:
        band = BAND_SIGMAS * np.sqrt(estimate.height_variance)
        axes.fill_between(time_s, estimate.height - band, estimate.height + band,
                          color=style.ESTIMATE_PALE, lw=0.0)  # fmt: skip
        handles.append(Patch(facecolor=style.ESTIMATE_PALE, label=f"±{BAND_SIGMAS:g} sigma"))
    axes.plot(time_s, estimate.height, color=style.ESTIMATE, lw=1.0)
    truth = result.truth
    if truth is not None and truth.height is not None and len(truth):
        rows = rows_of(truth, stride(len(truth), style.MAX_POINTS))
        assert rows.height is not None
        axes.plot(seconds(rows.stamp_ns, start_ns(result)), rows.height, color=style.TRUTH, lw=1.0,
                  ls=style.DASHED)  # fmt: skip
        handles.append(Line2D([], [], color=style.TRUTH, lw=1.0, ls=style.DASHED, label="truth"))
    error = result.metrics.get("height_rmse_m")
    style.title(axes, "height over z = 0" + ("" if error is None else f": RMSE {error:.3g} m"))
    axes.set_ylabel("height [m]")
    style.time_axis(axes, time_s)
    style.legend(figure, handles)
    return figure
