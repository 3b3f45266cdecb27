# SPDX-License-Identifier: Apache-2.0
"""What the best linear filter would make of a series, were it told the truth beforehand."""

from __future__ import annotations

import numpy as np

from locfuse.types import FloatArray


def best_causal(found: FloatArray, truth: FloatArray, taps: int) -> float:
    """Return the least RMSE of any weighing of a value with those before it.

    Weights sum up to one, so that a constant stays one; they and an offset are fitted to the truth
    of the very series, which no filter can know: whatever is linear and looks no further back is
    not better.

    Parameters
    ----------
    found, truth : float64 arrays, shape (n,)
        Angles unwrapped.
    taps : int
        How many values before, at least 1 and far below n.
    """
    now = found[taps:]
    before = np.column_stack([found[taps - k : len(found) - k] - now for k in range(1, taps + 1)])
    H = np.column_stack([before, np.ones(len(now))])
    wanted = truth[taps:] - now
    weights = np.linalg.lstsq(H, wanted, rcond=None)[0]
    return float(np.sqrt(np.mean((wanted - H @ weights) ** 2)))
