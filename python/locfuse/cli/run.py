# SPDX-License-Identifier: Apache-2.0
"""``locfuse run``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.inputs import ConfigFile, LogPath, Seed, read_log, with_log
from locfuse.cli.terminal import check_file, check_folder, console, progress
from locfuse.config.load import load_config
from locfuse.eval.trust import sentence, was_lost
from locfuse.io.recording import check_other
from locfuse.io.rosbag.bags import check_bag, write_bag
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.report.rerun_export import check_rerun, write_rerun
from locfuse.report.results import write_results
from locfuse.run.run import run as run_config
from locfuse.types import RunResult


def run(
    config: ConfigFile,
    log: LogPath = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/run"),
    seed: Seed = None,
    film: Annotated[
        Path | None, typer.Option(help="Also write an animated GIF of the particles (mcl).")
    ] = None,
    bag: Annotated[
        Path | None, typer.Option(help="Also write log and results as a .bag or .mcap.")
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(help="Also write a .rrd for the rerun viewer.")
    ] = None,
    fail_if_lost: Annotated[
        bool, typer.Option("--fail-if-lost", help="Exit with status 3 if it was ever lost.")
    ] = False,
) -> None:
    """Localize along a log or a simulated drive and write a report."""
    parsed = load_config(config)
    recorded = None if log is None else read_log(log, parsed, config.parent)
    if log is not None:
        parsed = with_log(parsed, log, config.parent)
    check_folder(out)
    if bag is not None:
        check_bag(bag)
        if isinstance(parsed.log, str):
            check_other(config.parent / parsed.log, bag)
        check_file(bag, "--bag")
    if film is not None:
        from locfuse.report.plot import check_film  # needs matplotlib

        check_film(parsed, film)
    if rerun is not None:
        check_rerun(rerun)
        check_file(rerun, "--rerun")
    with progress("messages") as moved:
        result = run_config(parsed, recorded, base=config.parent, seed=seed, progress=moved)
    report = write_results(result, out)
    _print_metrics(result)
    console.print(f"report: {report}", soft_wrap=True)
    if not has_matplotlib():
        console.print(NO_PICTURES, soft_wrap=True)
    if film is not None:
        from locfuse.report.plot import write_film

        console.print(f"film: {write_film(result, film)}", soft_wrap=True)
    if bag is not None:
        with progress("messages") as moved:
            write_bag(result, bag, parsed.ros, moved)
        console.print(f"bag: {bag}", soft_wrap=True)
    if rerun is not None:
        console.print(f"rerun: {write_rerun(result, rerun)}", soft_wrap=True)
    if result.health is None or not len(result.health):
        return
    console.print(f"health: {sentence(result.health)}", soft_wrap=True)
    watched = result.watched
    if watched is not None and len(watched):
        console.print(f"watched poses: {sentence(watched)}", soft_wrap=True)
    if result.health.state[-1] != "ok" or was_lost(result.health):
        console.print(f"locfuse check {config} looks for what is wrong", soft_wrap=True)
    lost = was_lost(result.health) or (watched is not None and was_lost(watched))
    if fail_if_lost and lost:
        raise typer.Exit(3)


def _print_metrics(result: RunResult) -> None:
    metrics = result.metrics
    for key, value in {**metrics, **(metrics["mcl"] or {})}.items():
        if isinstance(value, float | int):
            console.print(f"{key:22} {value:.6g}")
    for name, error in (metrics["calibration"] or {}).items():
        note = "" if error["observed"] else ", not observable: its sigma hardly fell"
        console.print(f"{name:22} {error['value']:.4g} +- {error['sigma']:.2g}{note}",
                      highlight=False)  # fmt: skip
    for source, verdicts in metrics["counts"].items():
        counts = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.items())
        console.print(f"{source:22} {counts}", highlight=False)
    console.print(metrics["truth"], soft_wrap=True)
