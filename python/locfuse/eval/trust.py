# SPDX-License-Identifier: Apache-2.0
"""What health was over a run, in a sentence."""

from __future__ import annotations

import numpy as np

from locfuse.types import Health

STATES = ("ok", "degraded", "ambiguous", "dead_reckoning", "lost", "initializing")


def shares(health: Health) -> dict[str, float]:
    """Return the share of the time in each state that occurred, the best state first."""
    rows = max(len(health), 1)
    counted = {state: float(np.sum(health.state == state) / rows) for state in STATES}
    return {state: share for state, share in counted.items() if share > 0.0}


def was_lost(health: Health) -> bool:
    """Return whether the robot was ever lost."""
    return bool(np.any(health.state == "lost"))


def sentence(health: Health) -> str:
    """Return how long it was in which state, and the state at the end with its reason.

    Examples
    --------
    >>> states = np.array(["ok"] * 9 + ["lost"])
    >>> why = np.array([""] * 9 + ["no message for 6 s"])
    >>> sentence(Health(np.arange(10), states, np.ones(10), np.zeros(10), np.ones((10, 3)), why))
    'ok 90 %, lost 10 % of the time; at the end lost: no message for 6 s'
    """
    parts = ", ".join(f"{state.replace('_', ' ')} {max(100.0 * share, 0.1):.3g} %"
                      for state, share in shares(health).items())  # fmt: skip
    last, why = str(health.state[-1]).replace("_", " "), str(health.reason[-1])
    return f"{parts} of the time; at the end {last}{f': {why}' if why else ''}"
