# SPDX-License-Identifier: Apache-2.0
"""``locfuse capsule``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.inputs import ConfigFile, LogPath, Seed, read_log
from locfuse.cli.terminal import check_file, console, progress
from locfuse.config.load import load_config
from locfuse.run.capsule import make_capsule, write_capsule


def capsule(
    config: ConfigFile,
    log: LogPath = None,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("capsule.zip"),
    seed: Seed = None,
) -> None:
    """Run, and pack all it takes to repeat the run into one file."""
    parsed = load_config(config)
    recorded = None if log is None else read_log(log, parsed, config.parent)
    check_file(out, "--out")
    with progress("messages") as moved:
        made = make_capsule(parsed, recorded, base=config.parent, seed=seed, progress=moved)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_capsule(made, out)
    for name, text in made.result.items():
        console.print(f"{name:22} {text.count(chr(10))} lines", highlight=False)
    console.print(f"{'result':22} {made.about['result']}", highlight=False)
    console.print(f"capsule: {out} ({out.stat().st_size} bytes)", soft_wrap=True)
