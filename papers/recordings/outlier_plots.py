# SPDX-License-Identifier: Apache-2.0
"""Picture of what outliers cost: errors of estimates over time, and what a gate did."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from locfuse.report.plot.style import (
    ESTIMATE,
    ESTIMATE_PALE,
    MUTED,
    REJECTED,
    TRUTH,
    Handle,
    dress,
    legend,
    new_figure,
    time_axis,
    title,
)
from locfuse.types import FloatArray

_TICKS = (-100.0, -10.0, -1.0, 0.0, 1.0, 10.0, 100.0)


def plot_outliers(
    name: str,
    error_s: FloatArray,
    errors_m: Mapping[str, FloatArray],
    range_s: FloatArray,
    off_m: FloatArray,
    gated: NDArray[np.bool_],
    outlier_m: float,
) -> Figure:
    """Draw how far three estimates are from truth, and below how far each range is off.

    Parameters
    ----------
    name : str
        Of the recording.
    error_s : float64 array, shape (n,)
        When, in seconds from the beginning.
    errors_m : mapping of estimate to float64 array, shape (n,)
        Distance from truth [m]: behind a gate, robust, robust without the outliers.
    range_s, off_m : float64 array, shape (ranges,)
        When, and how wrong a range is; NaN where that is not known.
    gated : bool array, shape (ranges,)
        Which did not pass the gate.
    outlier_m : float
        What is further off is an outlier.
    """
    figure = new_figure(5.6)
    above, below = figure.subplots(2, 1, sharex=True)
    for axes in (above, below):
        dress(axes)
    handles: list[Handle] = []
    looks = ((REJECTED, 1.0, 2), (ESTIMATE, 1.0, 3), (ESTIMATE_PALE, 4.0, 1))
    for (label, error), (color, width, order) in zip(errors_m.items(), looks, strict=True):
        handles += above.plot(error_s, error, color=color, lw=width, zorder=order, label=label)
    above.set_ylabel("distance from truth [m]")
    rmse = (f"{label} {np.sqrt(np.mean(error**2)):.3g} m" for label, error in errors_m.items())
    title(above, f"{name}: RMSE {'; '.join(rmse)}")
    wrong = np.abs(off_m) > outlier_m
    for shown, marker, color, label in (
        (~gated, ".", MUTED, "range, fused"),
        (gated, ".", REJECTED, "range, gated"),
        (wrong & ~gated, "x", TRUTH, "outlier, fused"),
    ):
        size = 3 if marker == "." else 6
        handles += below.plot(
            range_s[shown], off_m[shown], marker, ms=size, color=color, label=label
        )
    for side in (-outlier_m, outlier_m):
        below.axhline(side, color=TRUTH, lw=0.8, ls="--")
    furthest = max(2.0 * outlier_m, 1.3 * float(np.nanmax(np.abs(off_m))))
    below.set_yscale("symlog", linthresh=2.0 * outlier_m)
    below.set_ylim(-furthest, furthest)
    below.set_yticks([tick for tick in _TICKS if abs(tick) <= furthest])
    below.yaxis.set_major_formatter("{x:g}")
    below.set_ylabel("range off its median [m]")
    through, rejected = int((wrong & ~gated).sum()), int((gated & ~wrong).sum())
    title(below, f"{int(wrong.sum())} outliers, the gate lets {through} through; it rejects "
                 f"{rejected} others")  # fmt: skip
    time_axis(below, error_s)
    legend(figure, handles)
    return figure
