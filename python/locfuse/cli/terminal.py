# SPDX-License-Identifier: Apache-2.0
"""What commands say on a terminal, and what they ask of folders first."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from locfuse.types import ConfigError

# Where lines are not cut by a screen they are long enough for the widest table.
console = Console(width=None if sys.stdout.isatty() else 140)


@contextmanager
def progress(what: str) -> Iterator[tuple[Progress, TaskID]]:
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield bar, bar.add_task(what, total=None)


def onto(bar: Progress, task: TaskID) -> Callable[[int, int], None]:
    return lambda done, total: bar.update(task, completed=done, total=total)


def check_file(file: Path, option: str) -> None:
    """Refuse a file that cannot be made, before the work and not after it."""
    if file.is_dir():
        raise ConfigError(f"{option} {file}: is a folder; expected a file")
    check_folder(file.parent, option)


def check_folder(out: Path, option: str = "--out") -> None:
    """Refuse a folder that cannot be made, before the work and not after it."""
    nearest_there = next(p for p in (out, *out.absolute().parents) if p.exists())
    if not nearest_there.is_dir():
        raise ConfigError(f"{option} {out}: {nearest_there} is no folder")
    if not os.access(nearest_there, os.W_OK):
        raise ConfigError(f"{option} {out}: {nearest_there} must not be written")
