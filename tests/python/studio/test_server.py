# SPDX-License-Identifier: Apache-2.0
"""The command refuses what would be unsafe or in vain, in one sentence, before it serves."""

from __future__ import annotations

import fcntl
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from support_runs import locfuse


@pytest.fixture
def taken() -> Iterator[int]:
    """Return a port that somebody else listens at."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--token", "short"), "at least 8"),
        (("absent.yaml",), "cannot be read"),
        (("--host", "203.0.113.7", "--token", "a long secret"), "cannot be served there"),
    ],
    ids=lambda v: " ".join(v) if isinstance(v, tuple) else "",
)
def test_what_cannot_be_served_is_refused(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    said = locfuse("studio", *arguments, "--folder", tmp_path / "studio")

    assert said.status == 1
    assert message in said.err
    assert said.err.count("\n") == 1


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return a folder in which somebody has drawn something, and a configuration beside it."""
    (tmp_path / "other.yaml").write_text("simulation: {duration_s: 3}\n")
    (tmp_path / "studio").mkdir()
    (tmp_path / "studio/scene.yaml").write_text("name: of hours\nsimulation: {}\n")
    return tmp_path / "studio"


def test_a_port_that_is_taken_is_refused_and_the_scene_stays(kept: Path, taken: int) -> None:
    other = kept.parent / "other.yaml"
    said = locfuse("studio", other, "--folder", kept, "--port", str(taken))

    assert said.status == 1
    assert f"--port {taken}: cannot be served there" in said.err
    assert (kept / "scene.yaml").read_text() == "name: of hours\nsimulation: {}\n"
    assert list(kept.glob("unsaved-*")) == []


def test_a_folder_in_use_is_refused_and_the_scene_stays(kept: Path) -> None:
    with (kept / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        said = locfuse("studio", kept.parent / "other.yaml", "--folder", kept, "--port", "1")

    assert said.status == 1
    assert "another studio is using it" in said.err
    assert (kept / "scene.yaml").read_text() == "name: of hours\nsimulation: {}\n"


def test_a_lock_that_is_a_link_is_not_emptied(kept: Path) -> None:
    (kept / ".lock").symlink_to(kept.parent / "other.yaml")

    said = locfuse("studio", "--folder", kept, "--port", "1")

    assert said.status == 1
    assert "its .lock cannot be opened" in said.err
    assert (kept.parent / "other.yaml").read_text() == "simulation: {duration_s: 3}\n"


def test_a_configuration_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("simulation: {duration_s: -1}\n")

    said = locfuse("studio", tmp_path / "bad.yaml", "--folder", tmp_path / "studio")

    assert said.status == 1
    assert "greater than 0" in said.err
