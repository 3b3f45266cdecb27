# SPDX-License-Identifier: Apache-2.0
"""Output of the commands on a terminal, and checks of the paths they write to.

Names, titles and paths come from files of anyone: whatever is printed is text, and no command to
the terminal.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from locfuse.types import ConfigError


def visible(text: str) -> str:
    r"""Return a text on one line, with control and other invisible characters escaped.

    Examples
    --------
    >>> print(visible("A\x1b[2J"))
    A\x1b[2J
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class _Terminal(Console):
    """A console whose texts, also those in tables, are `visible` and have no markup."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(visible(text), **options)


# A file or a pipe does not cut lines: wide enough for the widest table.
console = _Terminal(width=None if sys.stdout.isatty() else 140, markup=False, emoji=False)


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on standard error; yield a function of (done, total) that moves it."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def share_progress() -> Iterator[Callable[[float], None]]:
    """Show a progress bar; yield a function of the share that is done, 0 to 1."""
    parts = 1000
    with progress("parts") as moved:
        yield lambda share: moved(round(share * parts), parts)


@contextmanager
def progress_of_parts() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar; yield a function of a part's name and its share that is done."""
    columns = (TextColumn("{task.description:10}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda part, share: bar.update(task, description=part, completed=share)


def check_file(file: Path, option: str) -> None:
    """Raise ConfigError before the work if the file cannot be created."""
    if file.is_dir():
        raise ConfigError(f"{option} {file}: is a folder; expected a file")
    check_folder(file.parent, option)


def check_folder(out: Path, option: str = "--out") -> None:
    """Raise ConfigError before the work if the folder cannot be created."""
    nearest_there = next(p for p in (out, *out.absolute().parents) if p.exists())
    if not nearest_there.is_dir():
        raise ConfigError(f"{option} {out}: {nearest_there} is not a folder")
    if not os.access(nearest_there, os.W_OK):
        raise ConfigError(f"{option} {out}: {nearest_there} is not writable")
