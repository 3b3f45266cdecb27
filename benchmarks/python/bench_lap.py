# SPDX-License-Identifier: Apache-2.0
"""A lap of a floor scrubber through an office, replayed: particles, and UWB that may switch."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import locfuse as lf
from papers.celan2017.experiments import SETUPS, Setup, marked_start, messages
from papers.celan2017.world import Lap, lap

SEED = 0


@pytest.fixture(scope="module")
def of() -> Lap:
    return lap(SEED)


def replay(of: Lap, setup: Setup, given: list[tuple[bool, Any]]) -> lf.PoseEstimate:
    estimator = setup.make(of, marked_start(of, SEED), SEED)
    for _, message in given:
        estimator.on(message)
    return estimator.estimate()


@pytest.mark.parametrize("name", ["lidar", "covered_switch"])
def test_lap(benchmark: Any, of: Lap, name: str) -> None:
    setup = SETUPS[name]
    given = list(messages(of, setup))
    last = benchmark.pedantic(replay, (of, setup, given), rounds=3)
    benchmark.extra_info["seconds_driven"] = of.duration_s
    x, y, _ = of.drive.pose_at(of.duration_s)[0]
    assert np.hypot(last.pose.x - x, last.pose.y - y) < 0.2
