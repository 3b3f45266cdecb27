# SPDX-License-Identifier: Apache-2.0
"""Log folders written by hand, recordings, and the command line, for the tests of whole runs."""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from locfuse.cli.app import main
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import Dataset, RunConfig
from locfuse.types import Log

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = ROOT / "examples" / "configs"
EXAMPLES = sorted(path.name for path in CONFIGS.glob("*.yaml"))
DATA = ROOT.parent / "shared" / "data"
MRPT = Path("/usr/share/mrpt/datasets")

# A robot that drives 0.2 m/s to the east through (3, 2), heard by three anchors at the height of
# its tag. Distances: 3-4-5 and its like, so that every number can be checked by head.
GOOD: Mapping[str, str] = {
    "odometry.csv": (
        "stamp_s,dx_m,dy_m,dheading_rad\n"
        "0.0,0,0,0\n0.1,0.02,0,0\n0.2,0.02,0,0\n0.3,0.02,0,0\n0.4,0.02,0,0\n0.5,0.02,0,0\n"
    ),
    "ranges.csv": (
        "stamp_s,tag,anchor,range_m,sigma_m\n"
        "0.0,tag,south,5.0,0.1\n0.0,tag,north,5.0,0.1\n0.0,tag,east,5.0,0.1\n"
        "0.5,tag,south,5.081,0.1\n0.5,tag,north,5.064,0.1\n0.5,tag,east,4.9,0.1\n"
    ),
    "anchors.csv": "anchor,x_m,y_m,z_m\nsouth,0,-2,1\nnorth,0,6,1\neast,8,2,1\n",
    "truth.csv": "stamp_s,x_m,y_m,heading_rad\n0.0,3,2,0\n0.5,3.1,2,0\n",
    "log.yaml": "tags: {tag: [0, 0, 1]}\ndescription: by hand\n",
}


def write_folder(folder: Path, files: Mapping[str, str | None] | None = None) -> Path:
    """Write `GOOD` with some files replaced, or left out (None)."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in {**GOOD, **(files or {})}.items():
        if text is not None:
            (folder / name).write_text(text, encoding="utf-8")
    return folder


def recording(name: str) -> Path:
    """Return the folder of a published recording, or skip the test that wants it."""
    if not (DATA / name).is_dir():
        pytest.skip(f"the recording {name} is absent: no folder {DATA / name}")
    return DATA / name


def require_recording_of(example: str) -> None:
    """Skip the test unless the recording of a ready configuration is there."""
    if example == "mrpt_office.yaml":
        if not (MRPT / "uwb_ro-localization_demo.rawlog").is_file():
            pytest.skip("the Debian package mrpt-common is not installed")
    elif example.startswith("ros_"):
        pytest.skip(f"{example} names no log: it is for a robot's own")
    elif isinstance(log := load_config(CONFIGS / example).log, Dataset):
        recording(Path(log.path).name)


def changed(log: Log, table: str, **columns: Any) -> Log:
    """Return a log with other columns of a table."""
    return replace(log, tables={**log.tables, table: {**log[table], **columns}})


def room(**changes: Any) -> RunConfig:
    """Return the room of ekim2020 for 10 s, with other keys."""
    return parse_config({"simulation": {"duration_s": 10.0}, **changes})


@dataclass(frozen=True)
class Said:
    """What a command left behind."""

    status: int
    out: str
    err: str

    def sentence(self) -> str:
        """Return the one line that a refusal must be, without the name of the program."""
        assert self.status == 1, f"exit status {self.status}: {self.out}{self.err}"
        lines = [line for line in self.err.splitlines() if line.strip()]
        assert len(lines) == 1, f"expected one sentence on stderr, got {self.err!r}"
        assert lines[0].startswith("locfuse: ")
        return lines[0].removeprefix("locfuse: ")


def locfuse(*arguments: object) -> Said:
    """Run the command line in this process; what would be a traceback is raised."""
    out, err = StringIO(), StringIO()
    before, sys.argv = sys.argv, ["locfuse", *map(str, arguments)]
    status: object = 0
    try:
        with redirect_stdout(out), redirect_stderr(err):
            main()
    except SystemExit as end:
        status = end.code
    finally:
        sys.argv = before
    return Said(status if isinstance(status, int) else 0, out.getvalue(), err.getvalue())


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file as the standard library reads them."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
