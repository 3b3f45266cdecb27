# SPDX-License-Identifier: Apache-2.0
"""Checks of the altimeter of a body that flies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from locfuse.check.context import Context
from locfuse.check.finding import Finding, error, warning
from locfuse.types import NANOSECONDS, FloatArray

FAST_MPS = 20.0  # of a climb over a second, half of the time
AROUND = 10  # altitudes on either side of a step
_FILE = "altitudes.csv"


def implausible_altitudes(context: Context) -> Iterator[Finding]:
    """Report an altimeter that is stuck, in another unit, off by a constant, or that steps."""
    table, truth = context.used("altitudes"), context.truth
    if table is None or context.models.kind != "air" or len(table["stamp_ns"]) < 2 * AROUND:
        return
    stamp, first = np.unique(table["stamp_ns"], return_index=True)
    t, height = (stamp - stamp[0]) / NANOSECONDS, table["height_m"][first]
    if np.ptp(height) == 0.0:
        yield warning(f"all {len(height)} altitudes are {height[0]:.4g} m", _FILE,
                      "is the altimeter stuck?")  # fmt: skip
        return
    later = np.minimum(np.searchsorted(t, t + 1.0), len(t) - 1)
    fast = float(np.median(np.abs(height[later] - height) / np.maximum(t[later] - t, 1.0)))
    if fast > FAST_MPS:
        yield error(f"altitudes change by {fast:.3g} m in a second: millimetres?", _FILE,
                    "write metres")  # fmt: skip
        return
    if truth is not None and truth.height is not None:
        up = context.models.air.altitude.altimeter_up_m
        reference = np.interp(t, (truth.stamp_ns - stamp[0]) / NANOSECONDS, truth.height)
        off, spread = _middle(height - up - reference)
        if abs(off) > max(0.3, 3.0 * spread):
            yield warning(f"altitudes are {off:+.3g} m off the reference at the median", _FILE,
                          "subtract that, heights are over z = 0; or set "
                          "estimator.air.altitude.altimeter_up_m")  # fmt: skip
    moved = np.diff(height)
    for row in np.flatnonzero(np.abs(moved) > 8.0 * _middle(moved)[1] + 0.1):
        before, after = height[: row + 1][-AROUND:], height[row + 1 :][:AROUND]
        step = float(np.median(after) - np.median(before))
        if len(after) == len(before) and abs(step) > 0.5 * abs(moved[row]):
            yield warning(f"altitudes step by {moved[row]:+.3g} m after {t[row]:.4g} s and stay "
                          "there", _FILE, "was a pressure sensor set anew, or is the ground uneven?"
                          )  # fmt: skip
            return


def _middle(values: FloatArray) -> tuple[float, float]:
    """Return median and sigma, by the median deviation from it."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))
