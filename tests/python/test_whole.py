# SPDX-License-Identifier: Apache-2.0
"""Results are whole or absent when the disk is full, a write fails, or the program is killed."""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from locfuse.config.load import parse_config
from locfuse.io.csv_table import write_table
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.whole import INCOMPLETE, whole_file, whole_folder
from locfuse.report.results import write_results
from locfuse.run.run import load_log, run
from locfuse.types import LogError
from support_runs import locfuse

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler for the faults")
@pytest.mark.parametrize("command", ["run", "map", "convert", "bag", "capsule", "sweep", "studio"])
def test_results_are_whole_or_absent_whatever_call_fails(command: str) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "scripts/faults.py", "--count", "6", command],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "6 faults" in done.stdout


def test_a_file_stays_as_it_was_on_an_error(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("old")

    def fail() -> None:
        with whole_file(file) as part:
            assert part.suffix == ".csv"
            part.write_text("new")
            raise ValueError

    with pytest.raises(ValueError, match=r"^$"):
        fail()
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_an_error_names_the_file_that_was_to_be_written(tmp_path: Path) -> None:
    def fill(path: Path) -> None:
        with whole_file(path) as part:
            part.write_text("new")
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match=r"No space left on device: '.*a\.csv'"):
        fill(tmp_path / "a.csv")
    with pytest.raises(FileNotFoundError, match=r"absent/a\.csv"):
        fill(tmp_path / "absent" / "a.csv")


def test_a_folder_is_swapped_and_owned_files_of_before_are_removed(tmp_path: Path) -> None:
    for name in ("both.txt", "owned.txt", "else.txt"):
        (tmp_path / name).write_text("old")
    (tmp_path / ".writing-0123").mkdir()  # of a program that was killed
    with whole_folder(tmp_path, ["both.txt", "owned.txt"]) as stage:
        (stage / "both.txt").write_text("new")
        assert (tmp_path / "both.txt").read_text() == "old"
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        "both.txt": "new", "else.txt": "old",
    }  # fmt: skip


def test_a_log_that_was_not_written_to_its_end_is_not_read(tmp_path: Path) -> None:
    config = parse_config({"simulation": {"duration_s": 1.0}})
    write_log(load_log(config, None, 0), tmp_path)
    read_log(tmp_path)
    (tmp_path / INCOMPLETE).touch()
    with pytest.raises(LogError, match="was not written to its end"):
        read_log(tmp_path)


def test_results_of_two_at_once_are_those_of_one(tmp_path: Path) -> None:
    results = [run(parse_config({"name": name, "seed": seed, "simulation": {"duration_s": 2.0}}))
               for name, seed in (("A", 1), ("B", 2))]  # fmt: skip
    expected = []
    for result in results:
        write_results(result, tmp_path / result.config["name"])
        expected.append((tmp_path / result.config["name"] / "estimate.csv").read_bytes())
    for _ in range(3):
        threads = [threading.Thread(target=write_results, args=(result, tmp_path / "out"))
                   for result in results]  # fmt: skip
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        which = expected.index((tmp_path / "out/estimate.csv").read_bytes())
        assert f"<title>{'AB'[which]}" in (tmp_path / "out/report.html").read_text()
        assert not (tmp_path / "out" / INCOMPLETE).exists()


def test_a_table_is_a_csv_whatever_names_are_in_it(tmp_path: Path) -> None:
    names = ["plain", "a,b", 'say "x"', "two\nlines", "=1+1", "\x1b[31m", "", "\r"]
    write_table(tmp_path / "t.csv", ["name", "a,b"], [names, ["1"] * len(names)])
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows == [["name", "a,b"], *([name, "1"] for name in names)]


def test_outcomes_of_anchors_with_odd_names_have_every_column(tmp_path: Path) -> None:
    odd = ['a,"b"', "two\nlines", "=cmd()", "D"]
    places = ([0, 0, 2], [8, 0, 2], [8, 6, 2], [0, 6, 2])
    config = tmp_path / "c.yaml"
    anchors = dict(zip(odd, places, strict=True))
    config.write_text(f"simulation: {{duration_s: 1, anchors: {anchors!r}}}\n".replace("\\n", " "))
    assert locfuse("run", config, "--out", tmp_path / "out").status == 0
    with (tmp_path / "out/outcomes.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert {len(row) for row in rows} == {10}
    assert any(row[3] == 'a,"b"' for row in rows)
