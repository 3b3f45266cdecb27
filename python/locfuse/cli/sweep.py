# SPDX-License-Identifier: Apache-2.0
"""``locfuse sweep``."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table

from locfuse.cli.inputs import ConfigFile
from locfuse.cli.terminal import check_folder, console, progress
from locfuse.config.load import load_config
from locfuse.io.whole import write_whole
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.sweep import Trials, dask_cluster, run_trials, summarize
from locfuse.types import ConfigError


def sweep(
    config: ConfigFile,
    trials: Annotated[
        int, typer.Option(help="Number of runs, each with its own seed.", min=1)
    ] = 100,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="KEY=a,b,c or KEY=LOW..HIGH[:log|:N|:Nlog], see docs/sweep.md.", show_default=False
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Number of processes; default: one per processor.", min=1)
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Run on the workers of the Dask scheduler at this address.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/sweep"),
    recovered_m: Annotated[
        float | None,
        typer.Option(
            help="Position error in metres below which a trial has recovered from a fault; "
            "default: inside its covariance."
        ),
    ] = None,
) -> None:
    """Run a configuration many times with other seeds and values.

    Finished trials in the folder are not repeated: the same command resumes a sweep.
    """
    parsed = load_config(config)
    values = _varied(vary or [])
    if dask is not None and workers is not None:
        raise ConfigError("--workers are processes here, --dask those of a cluster; give one")
    check_folder(out)
    with ExitStack() as stack:
        executor = None
        if dask is not None:
            executor, workers = stack.enter_context(dask_cluster(dask))
        moved = stack.enter_context(progress("trials"))
        found = run_trials(
            parsed, trials, values, executor=executor, workers=workers, base=config.parent, out=out,
            recovered_m=recovered_m, progress=moved,
        )  # fmt: skip
    summary = summarize(found)
    write_whole(out / "summary.json", json.dumps(summary, indent=1) + "\n")
    _print_sweep(found, summary)
    if has_matplotlib():
        from locfuse.report.plot import draw_sweep

        for path in draw_sweep(found, out):
            console.print(f"picture: {path}", soft_wrap=True)
    else:
        console.print(NO_PICTURES, soft_wrap=True)
    console.print(f"table: {out / 'trials.parquet'}", soft_wrap=True)


def _varied(given: list[str]) -> dict[str, str]:
    """Return the part of each option after its first ``=`` by the part before it."""
    values: dict[str, str] = {}
    for text in given:
        key, equals, rest = text.partition("=")
        if not equals:
            raise ConfigError(f"--vary {text}: expected KEY=LOW..HIGH or KEY=a,b,c")
        if key.strip() in values:
            raise ConfigError(f"--vary {text}: {key.strip()} is given twice")
        values[key.strip()] = rest
    return values


def _print_sweep(trials: Trials, summary: dict[str, Any]) -> None:
    console.print(_scores_table("scores over all trials", summary["scores"]))
    for axis in trials.axes:
        console.print(_key_table(axis.key, summary["by_key"][axis.key]))
    failed = summary["failed"]
    console.print(
        f"failed: {failed['count']} of {len(trials)}, 95 % interval {100 * failed['low']:.2g} to "
        f"{100 * failed['high']:.2g} %",
        highlight=False,
    )
    for error, count in failed["errors"].items():
        console.print(f"{count:6}  {error}", soft_wrap=True, highlight=False)


def _scores_table(title: str, scores: dict[str, Any]) -> Table:
    table = Table(title=title, caption="intervals are of 95 % confidence", box=box.SIMPLE_HEAD,
                  padding=(0, 1), pad_edge=False)  # fmt: skip
    table.add_column("score", no_wrap=True)
    for heading in ("median", "mean", "5 %..95 % of trials", "trials"):
        table.add_column(heading, justify="right")
    for name, of in scores.items():
        if of["min"] < of["max"] or name in ("position_rmse_m", "nees_mean"):
            table.add_row(name, _with_interval(of, "median"), _with_interval(of, "mean"),
                          f"{of['p05']:.4g}..{of['p95']:.4g}", str(of["n"]))  # fmt: skip
    return table


def _key_table(key: str, rows: list[dict[str, Any]]) -> Table:
    table = Table(title=f"{key}: medians", box=box.SIMPLE_HEAD, padding=(0, 1),
                  pad_edge=False)  # fmt: skip
    shown = ("position_rmse_m", "heading_rmse_deg", "nees_mean", "nll")
    table.add_column("value", no_wrap=True)
    for heading in ("trials", "failed", *shown):  # on a narrow screen intervals go below
        table.add_column(heading, justify="right")
    for row in rows:
        scores = [_with_interval(row["scores"].get(name), "median") for name in shown]
        failed = str(row["failed"]["count"])
        table.add_row(row["value"], str(row["trials"]), failed, *scores)
    return table


def _with_interval(of: dict[str, Any] | None, what: str) -> str:
    if of is None:
        return "-"
    low, high = of[f"{what}_low"], of[f"{what}_high"]
    interval = "" if low is None else f" [{low:.3g}..{high:.3g}]"
    return f"{of[what]:.4g}{interval}"
