# SPDX-License-Identifier: Apache-2.0
"""WALKTHROUGHS.md is the way that a range takes from its file to its outcome."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import locfuse
from locfuse.config.load import parse_config
from locfuse.io.log_folder import read_log, write_log
from locfuse.io.result_tables import write_columns
from locfuse.run.run import run
from locfuse.types import Log, Outcomes, RunResult
from support_runs import ROOT

PACKAGE = Path(locfuse.__file__).parent
THE_RANGE = 7.125  # of all, one alone
MAX_FILES = 8


def holds_it(value: Any, depth: int = 0) -> bool:
    """Return whether a value is or holds the range, or the outcomes that one of them is of."""
    if isinstance(value, np.ndarray):
        return bool(THE_RANGE in value) if value.dtype == np.float64 else False
    if isinstance(value, dict | list) and depth < 2:
        parts = value.values() if isinstance(value, dict) else value
        return any(holds_it(part, depth + 1) for part in parts)
    return isinstance(value, Outcomes | RunResult)


class Walk:
    """Notes the files of our package whose functions pass the range on, in order."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self._is_looking = False

    def look(self, frame: FrameType, event: str, value: Any) -> None:
        file = Path(frame.f_code.co_filename)
        if self._is_looking or PACKAGE not in file.parents or event not in ("call", "return"):
            return
        self._is_looking = True
        if event == "call":  # of a function that passes nothing on: it writes the outcomes
            value = frame.f_locals.get("table") if file.name == "result_tables.py" else None
        name = str(file.relative_to(PACKAGE))
        if holds_it(value) and (not self.files or self.files[-1] != name):
            self.files.append(name)
        self._is_looking = False


def walk_of_a_range(folder: Path) -> list[str]:
    """Return the files that one range of a log passes through, as they pass it on."""
    stamp = np.arange(60) * 10**8
    ranges = {"stamp_ns": stamp, "tag": np.full(60, "tag"), "anchor": np.tile(["a", "b", "c"], 20),
              "range_m": np.full(60, 5.0)}  # fmt: skip
    ranges["range_m"][40] = THE_RANGE
    anchors = {"anchor": np.array(["a", "b", "c"]), "x_m": np.array([0.0, 6.0, 3.0]),
               "y_m": np.array([0.0, 0.0, 8.0]), "z_m": np.zeros(3)}  # fmt: skip
    write_log(Log({"ranges": ranges, "anchors": anchors}, tags={"tag": (0.0, 0.0, 0.0)}),
              folder / "log")  # fmt: skip
    config = parse_config({"start": [3, 4, 0], "use": ["ranges"]})
    walk = Walk()
    before = sys.getprofile()
    sys.setprofile(walk.look)
    try:
        result = run(config, read_log(folder / "log"))
        write_columns(folder / "outcomes.csv", result.outcomes)
    finally:
        sys.setprofile(before)
    assert result.outcomes.verdict[40] in ("fused", "gated")
    return walk.files


def test_a_range_takes_the_way_that_the_page_describes(tmp_path: Path) -> None:
    files = walk_of_a_range(tmp_path)
    page = (ROOT / "WALKTHROUGHS.md").read_text(encoding="utf-8")
    section = page.split("## From a file to an outcome", 1)[1].split("\n## ", 1)[0]
    steps = re.findall(r"^\d\. `python/locfuse/([\w/]+\.py)`", section, re.MULTILINE)
    assert list(dict.fromkeys(files)) == steps
    assert len(steps) <= MAX_FILES
    # No step back, but to the class that holds the tables.
    onward = [file for file in files if file != "types.py"]
    assert onward == list(dict.fromkeys(onward))
