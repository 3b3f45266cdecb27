# SPDX-License-Identifier: Apache-2.0
"""``locfuse replay``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from locfuse import __version__
from locfuse.cli.terminal import console, progress
from locfuse.core import compiler
from locfuse.run.capsule import machine, read_capsule, replay_capsule


def replay(
    file: Annotated[Path, typer.Argument(help="Capsule, as written by `locfuse capsule`.")],
) -> None:
    """Run a capsule again and compare the results bit for bit."""
    packed = read_capsule(file)
    with progress("messages") as moved:
        differences = replay_capsule(packed, moved)
    made = packed.about
    say = partial(console.print, soft_wrap=True, highlight=False)
    say(f"made by locfuse {made['version']} ({made['compiler']}) on {made['machine']}")
    say(f"run by locfuse {__version__} ({compiler()}) on {machine()}")
    for d in differences:
        when = f" ({d.stamp_s} s)" if d.stamp_s else ""
        say(f"{d.file}: {d.lines} lines differ, the first is line {d.line}{when}")
        for column, was in d.was.items():
            say(f"  {column}: was {was or 'nothing'}, is {d.found[column] or 'nothing'}")
    if differences and made["machine"] != machine():
        say("the last bits may depend on processor and C library")
    if differences:
        raise typer.Exit(1)
    say(f"the same bit for bit: {', '.join(packed.result)}")
