# SPDX-License-Identifier: Apache-2.0
"""The best causal linear filter, where it is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from papers.celan2017.methods import best_causal


def test_white_noise_on_a_constant_averages_away() -> None:
    noise = 0.3 * np.random.default_rng(1).standard_normal(20_000)
    for taps in (1, 9):
        assert best_causal(2.0 + noise, np.full(len(noise), 2.0), taps) == pytest.approx(
            0.3 / np.sqrt(taps + 1), rel=0.03
        )


def test_correlated_noise_does_not_and_an_offset_costs_nothing() -> None:
    rng = np.random.default_rng(2)
    truth = np.cumsum(rng.standard_normal(20_000))
    assert best_causal(truth + 7.0, truth, 5) < 1e-9
    # Steps of truth and of noise have the same spectrum: no weights separate them.
    both = truth + np.cumsum(rng.standard_normal(len(truth)))
    assert best_causal(both, truth, 5) > 10.0
