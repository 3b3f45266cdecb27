# SPDX-License-Identifier: Apache-2.0
"""Picture of what outliers cost: two estimates' errors over time, and what the gate did."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from locfuse.plot.style import (
    ESTIMATE,
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
    whole_m: FloatArray,
    clean_m: FloatArray,
    range_s: FloatArray,
    off_m: FloatArray,
    gated: NDArray[np.bool_],
    outlier_m: float,
) -> Figure:
    """Draw how far two estimates are from truth, and below how far each range is.

    Parameters
    ----------
    name : str
        Of the recording.
    error_s : float64 array, shape (n,)
        When, in seconds from the beginning.
    whole_m, clean_m : float64 array, shape (n,)
        Distance from truth, by all ranges and without the outliers.
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
    for error, color, width, label in (
        (whole_m, REJECTED, 1.6, "by all ranges"),
        (clean_m, ESTIMATE, 1.0, "without the outliers"),
    ):
        handles += above.plot(error_s, error, color=color, lw=width, label=label)
    above.set_ylabel("distance from truth [m]")
    rms = [float(np.sqrt(np.mean(error**2))) for error in (whole_m, clean_m)]
    title(above, f"{name}: RMSE {rms[0]:.3g} m, without outliers {rms[1]:.3g} m")
    wrong = np.abs(off_m) > outlier_m
    for shown, marker, color, label in (
        (~gated, ".", MUTED, "range that was fused"),
        (gated, ".", REJECTED, "range that was gated"),
        (wrong & ~gated, "x", TRUTH, "outlier that was fused"),
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
    title(below, f"{int(wrong.sum())} outliers, {int((wrong & ~gated).sum())} of them fused; "
                 f"{int((gated & ~wrong).sum())} others gated")  # fmt: skip
    time_axis(below, error_s)
    legend(figure, handles)
    return figure
