# SPDX-License-Identifier: Apache-2.0
"""Commands without a home, in a language of ASCII, in folders and with names that are no text."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCENE = """
name: "{long}"
simulation:
  duration_s: 2
  anchors: {{"süd \u202e{long}": [0, 0, 2], B: [10, 0, 2], C: [0, 10, 2]}}
"""


def call(folder: bytes, *command: str | bytes) -> subprocess.CompletedProcess[bytes]:
    """Call locfuse in a folder, with nothing in its environment but the plainest language."""
    plain = {"LANG": "C", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    return subprocess.run([sys.executable, "-m", "locfuse", *command], cwd=folder, env=plain,
                          capture_output=True, check=False)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> bytes:
    """Return a folder whose name is no UTF-8, with a configuration of very long names."""
    folder = os.fsencode(tmp_path) + b"/\xe9t\xe9 \n x"
    os.mkdir(folder)
    with open(folder + b"/c.yaml", "w", encoding="utf-8") as file:
        file.write(SCENE.format(long="n" * 200))
    return folder


def test_results_are_written_where_no_name_is_text(folder: bytes) -> None:
    done = call(folder, "run", "c.yaml", "--out", b"o\xff")
    assert done.returncode == 0, done.stderr
    assert b"report: o" in done.stdout
    assert os.path.getsize(folder + b"/o\xff/report.html") > 10_000
    capsule = call(folder, "capsule", "c.yaml", "--out", b"\xffc.zip")
    assert capsule.returncode == 0, capsule.stderr
    assert sorted(os.listdir(folder)) == [b"c.yaml", b"o\xff", b"\xffc.zip"]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("run", b"\xff.yaml"), b"cannot be read (No such file or directory)"),
        (("run", "c.yaml", "--out", "x" * 300), b"x: File name too long"),
        (("run", "c.yaml", "--out", "c.yaml"), b"c.yaml"),
        (("convert", "log", b"\xff", b"\xfe"), b"no such folder"),
    ],
)
def test_an_error_is_one_sentence_in_any_language(
    folder: bytes, command: tuple[str | bytes, ...], said: bytes
) -> None:
    done = call(folder, *command)
    assert done.returncode == 1
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith(b"locfuse: ")
    assert said in lines[0]
    assert os.listdir(folder) == [b"c.yaml"]
