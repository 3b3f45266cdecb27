# SPDX-License-Identifier: Apache-2.0
"""Health over a run is counted by state, and said."""

from __future__ import annotations

import numpy as np
import pytest

from locfuse.eval.trust import sentence, shares, was_lost
from locfuse.types import Health


def health_of(*states: str, reason: str = "") -> Health:
    n = len(states)
    reasons = np.array([""] * (n - 1) + [reason])
    return Health(np.arange(n), np.array(states), np.ones(n), np.zeros(n), np.ones((n, 3)), reasons)


def test_shares_are_of_the_states_that_occurred_best_first() -> None:
    health = health_of("lost", "ok", "ok", "dead_reckoning")
    assert list(shares(health).items()) == [("ok", 0.5), ("dead_reckoning", 0.25), ("lost", 0.25)]
    assert sum(shares(health).values()) == pytest.approx(1.0)
    assert was_lost(health)
    assert not was_lost(health_of("ok", "degraded"))


def test_the_state_at_the_end_is_said_with_its_reason() -> None:
    health = health_of("ok", "ok", "ok", "dead_reckoning", reason="nothing was fused")
    assert sentence(health) == ("ok 75 %, dead reckoning 25 % of the time; at the end dead "
                                "reckoning: nothing was fused")  # fmt: skip
    rare = health_of(*["ok"] * 5000, "lost", "ok")
    assert sentence(rare) == "ok 100 %, lost 0.1 % of the time; at the end ok"


def test_there_are_no_shares_of_a_run_without_a_row() -> None:
    nothing = np.zeros(0)
    words = np.zeros(0, dtype=np.str_)
    health = Health(nothing.astype(np.int64), words, nothing, nothing, np.zeros((0, 3)), words)
    assert shares(health) == {}
    assert not was_lost(health)
