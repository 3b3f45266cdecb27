# SPDX-License-Identifier: Apache-2.0
"""Pictures over time of the errors, and of the height, with the bands the estimator claims."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from locfuse.eval.errors import errors_against
from locfuse.report.decimation import keep_extremes, stride
from locfuse.report.palette import BAND_SIGMAS
from locfuse.report.plot import style
from locfuse.report.text import percent, seconds, start_ns
from locfuse.types import FloatArray, RunResult, rows_of


def plot_errors(result: RunResult) -> Figure | None:
    """Draw the errors of x, y and heading over time with the 3-sigma bands the estimator claims.

    One axes per component, heading in degrees and only if truth has one. The lines are broken where
    truth has gaps. None without truth or where truth and estimate do not overlap in time.
    """
    if result.truth is None or len(result.truth) == 0:
        return None
    errors = errors_against(result.estimate, result.truth)
    if len(errors) == 0:
        return None
    components = [("x", "m", errors.position[:, 0]), ("y", "m", errors.position[:, 1])]
    scales = [1.0, 1.0, float(np.degrees(1.0))]
    if errors.heading is not None:
        components.append(("heading", "deg", np.degrees(errors.heading)))
    figure, column = style.panels(len(components), 2.1)
    time_s = seconds(errors.stamp_ns, start_ns(result))
    piece = np.cumsum(np.diff(errors.row, prepend=errors.row[0]) > 1, dtype=np.intp)
    for k, (axes, (name, unit, error)) in enumerate(zip(column, components, strict=True)):
        bound = None if errors.sigma is None else BAND_SIGMAS * scales[k] * errors.sigma[:, k]
        _draw(axes, time_s, error, bound, piece)
        style.title(axes, _summary(name, unit, error, bound))
        axes.set_ylabel(f"{name} error [{unit}]")
    style.time_axis(column[-1], time_s)
    figure.align_ylabels(column)
    handles: list[style.Handle] = [
        Line2D([], [], color=style.ESTIMATE, lw=1.0, label="estimate minus truth")
    ]
    if errors.sigma is not None:
        label = f"±{BAND_SIGMAS:g} sigma claimed by the estimator"
        handles.append(Patch(facecolor=style.ESTIMATE_PALE, label=label))
    style.legend(figure, handles)
    return figure


def _draw(
    axes: Axes,
    time_s: FloatArray,
    error: FloatArray,
    bound: FloatArray | None,
    piece: NDArray[np.intp],
) -> None:
    rows = keep_extremes(error, style.MAX_POINTS)
    breaks = np.flatnonzero(np.diff(piece[rows])) + 1
    at_s = np.insert(time_s[rows], breaks, np.nan)
    axes.axhline(0.0, color=style.MUTED, lw=0.8, zorder=1)
    axes.plot(at_s, np.insert(error[rows], breaks, np.nan), color=style.ESTIMATE, lw=1.0)
    top = float(np.max(np.abs(error)))
    if bound is not None:
        edge = np.insert(bound[rows], breaks, np.nan)
        axes.fill_between(at_s, -edge, edge, color=style.ESTIMATE_PALE, linewidth=0, zorder=0)
        # An unknown start may claim kilometres: the band may leave the picture, the error not.
        top = max(top, float(np.quantile(bound, 0.95)))
    top = 1.12 * max(top, 1e-6)
    axes.set_ylim(-top, top)


def _summary(name: str, unit: str, error: FloatArray, bound: FloatArray | None) -> str:
    rms, largest = float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error)))
    text = f"{name}: RMS {rms:.3g} {unit}, largest {largest:.3g} {unit}"
    if bound is not None:
        text += f", outside the band {percent(float(np.mean(np.abs(error) > bound)))}"
    return text


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
