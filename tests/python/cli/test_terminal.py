# SPDX-License-Identifier: Apache-2.0
"""What commands print is text: names from files neither steer the terminal nor have markup."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest
from rich.table import Table

from locfuse.cli.terminal import console, visible
from locfuse.config.load import parse_config
from locfuse.run.capsule import make_capsule, write_capsule
from support_runs import locfuse, write_folder

TITLE = "\x1b]0;owned\x07"  # sets the title of the window
NAME = f"[red]:bomb:{TITLE}\u202e\x9b2J"  # U+202E reverses what follows, U+009B is another ESC
SHOWN = "[red]:bomb:\\x1b]0;owned\\x07\\u202e\\x9b2J"


def test_a_text_is_shown_on_one_line_with_what_is_invisible() -> None:
    assert visible(NAME + "\n") == SHOWN + "\\n"
    assert visible("Bäume \\ 木 [1]") == "Bäume \\ 木 [1]"
    assert visible("\udc80") == "\\udc80"  # a name of a file that is no UTF-8


def test_the_console_prints_text_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(title=NAME, caption=NAME)
    table.add_column(NAME)
    table.add_row(NAME)
    console.print(table)
    console.print(NAME, soft_wrap=True)
    assert capsys.readouterr().out.count(SHOWN) == 5


def test_names_of_a_configuration_reach_the_terminal_as_text(tmp_path: Path) -> None:
    config = tmp_path / "run.yaml"
    escaped = json.dumps(NAME)[1:-1]
    config.write_text(f'log: "no{escaped}such"\n')
    said = locfuse("run", config, "--out", tmp_path / "out").sentence()
    assert f"no{SHOWN}such: no such folder" in said
    said_by_check = locfuse("check", config)
    assert f"no{SHOWN}such: no such folder" in said_by_check.out + said_by_check.err


def test_names_of_a_log_reach_the_terminal_as_text(tmp_path: Path) -> None:
    anchors = f"anchor,x_m,y_m,z_m\nsouth,0,-2,1\nnorth,0,6,1\neast,8,2,1\n{NAME},0,0,9\n"
    config = tmp_path / "run.yaml"
    config.write_text("log: log\nstart: truth\n")
    write_folder(tmp_path / "log", {"anchors.csv": anchors})
    said = locfuse("check", config, "--out", tmp_path / "out")
    assert SHOWN in said.out
    assert not set(NAME) - set(SHOWN) & set(said.out)


def test_a_table_of_positions_shows_names_as_text(tmp_path: Path) -> None:
    name = "[red]\x1b[2J"
    rows = "".join(f"0,{name},{anchor},5,0.1\n" for anchor in ("south", "north", "east"))
    log = write_folder(tmp_path, {"ranges.csv": f"stamp_s,tag,anchor,range_m,sigma_m\n{rows}"})
    said = locfuse("position", "--anchors", log / "anchors.csv", "--ranges", log / "ranges.csv",
                   "--height", 1)  # fmt: skip
    assert "[red]\\x1b[2J" in said.out


def test_a_capsule_cannot_forge_what_replay_says(tmp_path: Path) -> None:
    path = tmp_path / "c.zip"
    write_capsule(make_capsule(parse_config({"simulation": {"duration_s": 1}})), path)
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name).decode() for name in archive.namelist()}
    files["capsule.json"] = files["capsule.json"].replace(
        '"version": "', '"version": "\\u001b]0;owned\\u0007\\nthe same bit for bit [green]'
    )
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    said = locfuse("replay", path)
    assert said.out.startswith(r"made by locfuse \x1b]0;owned\x07\nthe same bit for bit [green]")
    assert "\x1b" not in said.out


def test_what_is_logged_is_one_line_of_text(tmp_path: Path) -> None:
    code = ("import logging, sys; from locfuse.cli import app; "
            "app.app = lambda **_: logging.getLogger('locfuse.x').warning('a\\x1b[2J\\nb'); "
            "app.main()")  # fmt: skip
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stderr == "locfuse: a\\x1b[2J b\n"


def test_an_error_without_words_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("locfuse.cli.app.app", full)
    assert locfuse("run").sentence() == "out of memory"


def test_a_command_that_is_ended_leaves_no_temporary_file(tmp_path: Path) -> None:
    code = ("import tempfile, time; from pathlib import Path; from locfuse.cli import app\n"
            "def work(**_):\n"
            "    with tempfile.TemporaryDirectory() as folder:\n"
            "        Path(folder, 'unpacked').touch()\n"
            "        time.sleep(60)\n"
            "app.app = work; app.main()")  # fmt: skip
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", code], env=environment) as running:
        while not list(tmp_path.glob("*/unpacked")):
            assert running.poll() is None
            time.sleep(0.01)
        running.send_signal(signal.SIGTERM)
        assert running.wait(30) == 128 + signal.SIGTERM
    assert not list(tmp_path.iterdir())
