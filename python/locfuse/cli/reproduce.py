# SPDX-License-Identifier: Apache-2.0
"""``locfuse reproduce``: the experiments of `papers`, which only a checkout has."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Annotated

import typer

from locfuse.report.pictures import require_matplotlib
from locfuse.types import ConfigError

app = typer.Typer(add_completion=False)


@app.command()
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
    root = checkout()
    if root is None:
        raise ConfigError(
            "locfuse reproduce needs a checkout of locfuse, as its experiments are not installed; "
            "call it inside one"
        )
    require_matplotlib()  # which the modules of the papers import
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    command = importlib.import_module("papers.cli").reproduce_command
    command(paper, seeds, json_file, pictures, quick, out, compare)


def checkout() -> Path | None:
    """Return the checkout around the working folder or this file; None if there is none."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / "papers" / "reproduce.py").is_file():
            return folder
    return None
