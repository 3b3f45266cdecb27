# SPDX-License-Identifier: Apache-2.0
"""How soon and how rightly an estimator calls its pose certain."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse.eval.errors import errors_against
from locfuse.types import NANOSECONDS, Trajectory, rows_of

WRONG_M = 0.5  # an error beyond is another place, not an inaccurate one


def readiness(
    estimate: Trajectory, ready: NDArray[np.bool_], begin_ns: int, truth: Trajectory | None
) -> dict[str, Any]:
    """Sum up when an estimator was ready, in numbers.

    `ready` (n,) marks rows of `estimate`. ``ready_share`` is of all estimates; ``ready_s`` from
    `begin_ns`, the start, to the first that is ready, None without; ``ready_and_wrong_share`` of
    the ready ones that are more than 0.5 m off, None where none can be compared.
    """
    certain = rows_of(estimate, ready)
    wrong = None
    if truth is not None and len(truth) and len(certain):
        errors = errors_against(certain, truth)
        if len(errors):
            wrong = float(np.mean(np.hypot(*errors.position.T) > WRONG_M))
    first_s = float(certain.stamp_ns[0] - begin_ns) / NANOSECONDS if len(certain) else None
    return {
        "ready_share": float(np.mean(ready)) if len(ready) else 0.0,
        "ready_s": first_s,
        "ready_and_wrong_share": wrong,
    }
