# SPDX-License-Identifier: Apache-2.0
"""Damaged bags, capsules and logs are read or refused, and nothing else; `scripts` tries more."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from locfuse.types import LogError
from mutate_archives import GOOD, outcome, try_out


@pytest.mark.parametrize("seed", [1, 2])
def test_a_few_hundred_mutated_archives_are_read_or_refused(
    seed: int, capfd: pytest.CaptureFixture[str]
) -> None:
    found = try_out(160, seed)
    assert {what.split(": ")[1] for what in found} == set(GOOD), capfd.readouterr().err


def _endless() -> None:
    while True:
        pass


@pytest.mark.parametrize(
    ("work", "how"),
    [
        (lambda: None, "read"),
        (lambda: _refuse("odd"), "refused"),
        (lambda: _refuse("odd\nand odd"), "broken"),
        (lambda: 1 // 0, "broken"),
        (lambda: bytes(2 << 30), "broken"),
        (lambda: Path("..", "outside").touch(), "broken"),
        (lambda: subprocess.run(["true"], check=True), "broken"),
        (os.abort, "SIGABRT"),
        (_endless, "SIGKILL"),
    ],
)
def test_what_breaks_is_noticed(
    work: Callable[[], None], how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mutate_archives.MAX_SECONDS", 1)
    monkeypatch.chdir(tmp_path)
    assert outcome(work, tmp_path) == how


def _refuse(text: str) -> None:
    raise LogError(text)
