# SPDX-License-Identifier: Apache-2.0
"""``locfuse check``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from locfuse.check import SEVERITIES, Finding
from locfuse.check import check as check_config
from locfuse.cli.inputs import ConfigFile, LogPath, with_log
from locfuse.cli.terminal import check_folder, console, visible
from locfuse.config.load import load_config
from locfuse.report.pictures import NO_PICTURES, has_matplotlib

_COLOURS = {"error": "red", "warning": "yellow", "note": "dim"}


def check(
    config: ConfigFile,
    log: LogPath = None,
    out: Annotated[Path, typer.Option(help="Folder for the picture.")] = Path("out/check"),
) -> None:
    """Report problems of a configuration and its log before a run."""
    parsed = load_config(config)
    base = config.parent
    if log is not None:
        parsed = with_log(parsed, log, base)
        base = Path()
    check_folder(out)
    result = check_config(parsed, base=base)
    for finding in result.findings:
        _print_finding(finding)
    counts = {s: sum(f.severity == s for f in result.findings) for s in SEVERITIES}
    console.print(", ".join(f"{n} {kind}{'s' * (n != 1)}" for kind, n in counts.items()))
    if result.layout is not None:
        console.print(result.layout.sentence(), soft_wrap=True, highlight=False)
        if has_matplotlib():
            from locfuse.report.plot import plot_layout, save

            out.mkdir(parents=True, exist_ok=True)
            save(plot_layout(result.layout), out / "layout.png")
            console.print(f"picture: {out / 'layout.png'}", soft_wrap=True)
        else:
            console.print(NO_PICTURES, soft_wrap=True)
    if result.failed:
        raise typer.Exit(1)


def _print_finding(finding: Finding) -> None:
    severity = f"{finding.severity:8}", _COLOURS[finding.severity]
    text = visible(f" {finding.what} [{finding.where}]")
    console.print(Text.assemble(severity, text), soft_wrap=True, highlight=False)
    if finding.advice:
        console.print(f"{'':8} -> {finding.advice}", soft_wrap=True, highlight=False)
