# SPDX-License-Identifier: Apache-2.0
"""``locfuse demo``."""

from __future__ import annotations

import sys
import webbrowser
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.terminal import check_folder, console, progress
from locfuse.config.load import load_config
from locfuse.eval.trust import sentence
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.report.results import write_results
from locfuse.run.run import run


def demo(
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/demo"),
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Do not open the report in the browser.")
    ] = False,
) -> None:
    """Simulate a robot, localize it, and open its report."""
    check_folder(out)
    out.mkdir(parents=True, exist_ok=True)
    config = out / "robot.yaml"
    config.write_text(files("locfuse.cli").joinpath("demo.yaml").read_text("utf-8"), "utf-8")
    with progress("messages") as moved:
        result = run(load_config(config), base=out, progress=moved)
    report = write_results(result, out)
    assert result.start is not None
    assert result.health is not None
    metrics = result.metrics
    lines = (
        f"a robot drove {metrics['duration_s']:.0f} s through rooms, with a laser, wheels and UWB; "
        "nobody said where it began",
        f"found after {result.start.seconds:.1f} s; position RMSE "
        f"{100.0 * metrics['position_rmse_m']:.1f} cm, heading {metrics['heading_rmse_deg']:.1f} "
        "degrees",
        f"health: {sentence(result.health)}",
        f"report: {report}",
        f"configuration: {config}; change it, then locfuse run {config}",
    )
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False)
    if not has_matplotlib():
        console.print(NO_PICTURES, soft_wrap=True)
    if not no_open and sys.stdout.isatty():
        webbrowser.open(report.resolve().as_uri())
