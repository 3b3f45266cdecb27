# SPDX-License-Identifier: Apache-2.0
"""How often a run that computes is looked at."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from locfuse.studio import work


@pytest.mark.parametrize(("took_s", "between_s"), [(0.02, 1.0), (0.5, 4.5)])
def test_looks_at_a_run_take_a_tenth_of_its_time_and_come_once_a_second_at_most(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, took_s: float, between_s: float
) -> None:
    now = 100.0
    looks: list[float] = []

    def write(result: Any, folder: Path, name: str, *, whole: bool) -> None:
        nonlocal now
        if not whole:
            looks.append(now)
            now += took_s

    def run(config: Any, *, watch: Callable[[Any], None], **_: Any) -> Any:
        nonlocal now
        while now < 160.0:
            now += 0.01
            watch(lambda: None)
        return SimpleNamespace(metrics={})

    monkeypatch.setattr(time, "perf_counter", lambda: now)
    monkeypatch.setattr(work, "load_config", lambda path: None)
    monkeypatch.setattr(work, "_write_play", write)
    monkeypatch.setattr(work, "run", run)
    receiver, said = Pipe(duplex=False)

    work._shown(3, tmp_path, "name", said)

    gaps = [b - a - took_s for a, b in pairwise(looks)]
    assert len(looks) > 10
    assert min(gaps) >= between_s - 1e-6
    assert max(gaps) <= between_s + 0.02
    messages = []
    while receiver.poll():
        messages.append(receiver.recv()[:2])
    assert messages.count((3, "grown")) == len(looks)
    assert messages[-1] == (3, "shown")
