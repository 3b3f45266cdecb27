# SPDX-License-Identifier: Apache-2.0
"""``locfuse convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.terminal import console, progress
from locfuse.config.load import load_config
from locfuse.io.recording import convert_recording


def convert(
    kind: Annotated[
        str,
        typer.Argument(help="Type of SOURCE: log, bag, or a data set of results/recordings.md."),
    ],
    source: Annotated[
        Path, typer.Argument(help="Log folder, bag, or folder of the recording as published.")
    ],
    out: Annotated[
        Path, typer.Argument(help="Log folder or folders; of a log or bag also a .bag or .mcap.")
    ],
    config: Annotated[
        Path | None, typer.Option(help="YAML file whose section 'ros' gives topics and frames.")
    ] = None,
) -> None:
    """Convert between bags, log folders and published recordings."""
    ros = None if config is None else load_config(config).ros
    base = None if config is None else config.parent
    with progress("done") as moved:
        written = convert_recording(kind, source, out, ros, base, moved)
    for path in written:
        console.print(str(path), soft_wrap=True)
