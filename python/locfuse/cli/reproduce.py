# SPDX-License-Identifier: Apache-2.0
"""``locfuse reproduce``: the experiments of `papers`, which only a checkout has."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.io.recording import import_papers
from locfuse.report.pictures import require_matplotlib


def reproduce(
    paper: Annotated[str, typer.Argument(help="Paper or experiment, or all for the five papers.")],
    seeds: Annotated[
        int | None,
        typer.Option(help="Runs per simulated experiment; default: the paper's, else 100.", min=2),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the rows to this file.")
    ] = None,
    pictures: Annotated[
        Path | None, typer.Option(help="Also draw pictures into this folder.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few seeds; five papers only.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for page, rows and pictures; default of all: out/papers."),
    ] = None,
    compare: Annotated[
        Path | None, typer.Option(help="papers.json of another run; fail if it differs.")
    ] = None,
) -> None:
    """Run a paper's experiments and compare them with its claims."""
    require_matplotlib()  # which the modules of the papers import
    command = import_papers("cli", "'locfuse reproduce'").reproduce_command
    command(paper, seeds, json_file, pictures, quick, out, compare)
