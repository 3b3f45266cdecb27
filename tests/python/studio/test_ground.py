# SPDX-License-Identifier: Apache-2.0
"""Map and way of the newest scene alone are computed, beside the server and not in it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.studio.ground import Grounds
from locfuse.studio.view import ground_of


@pytest.fixture
def grounds() -> Iterator[Grounds]:
    made = Grounds()
    yield made
    made.close()


def scene(duration_s: float) -> RunConfig:
    return parse_config({"simulation": {"duration_s": duration_s}})


def large(side_m: float) -> RunConfig:
    """Return a scene whose map and way take minutes."""
    return parse_config({"simulation": {"room_m": [side_m, side_m], "map": {"generate": "rooms"},
                                        "path": {"shape": "roam"}, "duration_s": 20}})  # fmt: skip


def test_it_answers_what_the_process_itself_would(grounds: Grounds, tmp_path: Path) -> None:
    assert grounds.of(scene(5), tmp_path) == ground_of(scene(5), tmp_path)


def test_what_is_wrong_is_a_message(grounds: Grounds, tmp_path: Path) -> None:
    absent = parse_config(
        {"simulation": {"map": {"file": "absent.yaml"}, "path": {"shape": "roam"}}}
    )

    found = grounds.of(absent, tmp_path)

    assert found is not None
    assert "absent.yaml" in found["message"]


def test_a_newer_scene_ends_what_is_computed_and_drops_what_waits(
    grounds: Grounds, tmp_path: Path
) -> None:
    grounds.begin()
    answers: dict[float, Any] = {}

    def ask(side_m: float) -> None:
        answers[side_m] = grounds.of(large(side_m), tmp_path)

    askers = [threading.Thread(target=ask, args=(side_m,)) for side_m in (200.0, 210.0, 220.0)]
    for asker in askers:
        asker.start()
        time.sleep(0.2)
    began = time.monotonic()

    found = grounds.of(scene(5), tmp_path)

    assert found == ground_of(scene(5), tmp_path)
    for asker in askers:
        asker.join(20)
    assert answers == dict.fromkeys((200.0, 210.0, 220.0))
    assert time.monotonic() - began < 30.0


def test_who_asks_the_same_waits_for_the_same(grounds: Grounds, tmp_path: Path) -> None:
    found: list[Any] = []
    askers = [
        threading.Thread(target=lambda: found.append(grounds.of(scene(6), tmp_path)))
        for _ in range(4)
    ]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join(60)

    assert found == [ground_of(scene(6), tmp_path)] * 4


def test_a_killed_process_is_reported_and_replaced(grounds: Grounds, tmp_path: Path) -> None:
    grounds.begin()
    found: list[Any] = []
    asker = threading.Thread(target=lambda: found.append(grounds.of(large(200.0), tmp_path)))
    asker.start()
    time.sleep(0.5)
    grounds.close()
    asker.join(20)

    assert "is there memory enough" in found[0]["message"]
    assert grounds.of(scene(5), tmp_path) == ground_of(scene(5), tmp_path)
