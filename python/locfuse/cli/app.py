# SPDX-License-Identifier: Apache-2.0
"""The command line: parse, call one public function, print."""

from __future__ import annotations

import json
import logging
import math
import sys
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

import typer
import yaml
from rich import box
from rich.markup import escape
from rich.table import Table

from locfuse import NumericalError, __version__, compiler
from locfuse.check import SEVERITIES, Finding
from locfuse.check import check as check_config
from locfuse.cli.reproduce import reproduce_command
from locfuse.cli.terminal import check_file as _check_file
from locfuse.cli.terminal import check_folder as _check_folder
from locfuse.cli.terminal import console
from locfuse.cli.terminal import onto as _onto
from locfuse.cli.terminal import progress as _progress
from locfuse.config.load import load_config
from locfuse.config.schema import RunConfig
from locfuse.eval.ape import ape
from locfuse.io.datasets import CONVERTERS
from locfuse.io.recording import check_other, convert_recording, read_recording
from locfuse.io.rosbag.bags import check_bag, write_bag
from locfuse.io.tum import read_tum
from locfuse.run.position import (
    LOSSES,
    SOLVERS,
    Fix,
    in_one_plane,
    positions,
    read_epochs,
    write_fixes,
)
from locfuse.run.run import run as run_config
from locfuse.sweep import Trials, dask_cluster, run_trials, summarize
from locfuse.types import NANOSECONDS, ConfigError, Log

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False,
                  help="Localization for mobile robots.")  # fmt: skip
config_app = typer.Typer(no_args_is_help=True, help="Look at configurations.")
app.add_typer(config_app, name="config")
ROWS = 50  # epochs that a table shows


def main() -> None:
    """Run the command line; errors become one sentence and exit status 1."""
    notes = logging.StreamHandler(sys.stderr)
    notes.setFormatter(logging.Formatter("locfuse: %(message)s"))
    logging.getLogger("locfuse").addHandler(notes)
    try:
        app(prog_name="locfuse")
    except (ValueError, NumericalError, OSError, MemoryError) as error:
        print("locfuse:", *str(error).split(), file=sys.stderr)
        sys.exit(1)
    finally:
        logging.getLogger("locfuse").removeHandler(notes)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"locfuse {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it and stop.")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    config: Annotated[Path, typer.Argument(help="YAML file, see docs/configuration.md.")],
    log: Annotated[
        Path | None, typer.Option(help="Log folder or bag, instead of the config's.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/run"),
    seed: Annotated[
        int | None,
        typer.Option(help="Of simulation and particles, instead of the config's.", min=0),
    ] = None,
    film: Annotated[
        Path | None, typer.Option(help="Also write an animated GIF of the particles (mcl).")
    ] = None,
    bag: Annotated[
        Path | None, typer.Option(help="Also write log and result as a .bag or .mcap.")
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(help="Also write a .rrd for the viewer of rerun.")
    ] = None,
) -> None:
    """Localize along a log or a simulated drive; write estimate, outcomes, metrics and a report."""
    parsed = load_config(config)
    recorded = None if log is None else _read(log, parsed, config.parent)
    if log is not None:
        parsed = _with_log(parsed, log, config.parent)
    _check_folder(out)
    if bag is not None:
        check_bag(bag)
        if isinstance(parsed.log, str):
            check_other(config.parent / parsed.log, bag)
        _check_file(bag, "--bag")
    if film is not None:
        from locfuse.report.plot import check_film

        check_film(parsed, film)
    if rerun is not None:
        from locfuse.report.rerun import check_rerun

        check_rerun(rerun)
        _check_file(rerun, "--rerun")
    with _progress("messages") as (bar, task):
        result = run_config(
            parsed,
            recorded,
            base=config.parent,
            seed=seed,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    from locfuse.report.results import (
        write_results,  # pictures load slowly; other commands need none
    )

    report = write_results(result, out)
    for key, value in {**result.metrics, **(result.metrics["mcl"] or {})}.items():
        if isinstance(value, float | int | None):
            console.print(f"{key:22} {'-' if value is None else f'{value:.6g}'}")
    for name, learnt in (result.metrics["calibration"] or {}).items():
        doubt = "" if learnt["observed"] else ", not observable: its sigma hardly fell"
        console.print(f"{name:22} {learnt['value']:.4g} +- {learnt['sigma']:.2g}{doubt}",
                      highlight=False)  # fmt: skip
    for source, verdicts in result.metrics["counts"].items():
        counts = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.items())
        console.print(f"{source:22} {counts}", highlight=False)
    console.print(result.metrics["truth"], soft_wrap=True)
    console.print(f"report: {report}", soft_wrap=True)
    if film is not None:
        from locfuse.report.plot import write_film

        console.print(f"film: {write_film(result, film)}", soft_wrap=True)
    if bag is not None:
        with _progress("messages") as (bar, task):
            write_bag(result, bag, parsed.ros, _onto(bar, task))
        console.print(f"bag: {bag}", soft_wrap=True)
    if rerun is not None:
        from locfuse.report.rerun import write_rerun

        console.print(f"rerun: {write_rerun(result, rerun)}", soft_wrap=True)


def _read(log: Path, config: RunConfig, base: Path) -> Log:
    """Return a log folder or a bag that was named by hand."""
    with _progress("bytes") as (bar, task):
        return read_recording(log, config.ros, base, _onto(bar, task))


def _with_log(config: RunConfig, log: Path, base: Path) -> RunConfig:
    """Return a configuration with another log; what it names else stays where it was."""
    ros = config.ros
    if ros.world is not None:
        ros = ros.model_copy(update={"world": str((base / ros.world).resolve())})
    return config.model_copy(update={"log": str(log.resolve()), "simulation": None, "ros": ros})


@app.command()
def check(
    config: Annotated[Path, typer.Argument(help="YAML file, see docs/configuration.md.")],
    log: Annotated[
        Path | None, typer.Option(help="Log folder or bag, instead of the config's.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the picture.")] = Path("out/check"),
) -> None:
    """Say what is wrong with a configuration and its log before anything is run."""
    parsed = load_config(config)
    base = config.parent
    if log is not None:
        parsed = _with_log(parsed, log, base)
        base = Path()
    _check_folder(out)
    result = check_config(parsed, base=base)
    for finding in result.findings:
        _print_finding(finding)
    counts = {s: sum(f.severity == s for f in result.findings) for s in SEVERITIES}
    console.print(", ".join(f"{count} {kind}s" for kind, count in counts.items()))
    if result.layout is not None:
        from locfuse.report.plot import plot_layout, save  # loads slowly; other commands need none

        out.mkdir(parents=True, exist_ok=True)
        save(plot_layout(result.layout), out / "layout.png")
        console.print(result.layout.sentence(), soft_wrap=True, highlight=False)
        console.print(f"picture: {out / 'layout.png'}", soft_wrap=True)
    if result.failed:
        raise typer.Exit(1)


def _print_finding(finding: Finding) -> None:
    colour = {"error": "red", "warning": "yellow", "note": "dim"}[finding.severity]
    text = escape(f"{finding.what} [{finding.where}]")
    console.print(f"[{colour}]{finding.severity:8}[/] {text}", soft_wrap=True, highlight=False)
    if finding.advice:
        console.print(f"{'':8} -> {finding.advice}", soft_wrap=True, markup=False, highlight=False)


@app.command()
def capsule(
    config: Annotated[Path, typer.Argument(help="YAML file, see docs/configuration.md.")],
    log: Annotated[
        Path | None, typer.Option(help="Log folder or bag, instead of the config's.")
    ] = None,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("capsule.zip"),
    seed: Annotated[
        int | None,
        typer.Option(help="Of simulation and particles, instead of the config's.", min=0),
    ] = None,
) -> None:
    """Run, and pack what it takes to run again bit for bit into one file, as for a bug report."""
    from locfuse.run.capsule import make_capsule, write_capsule  # loads slowly, as pictures do

    parsed = load_config(config)
    recorded = None if log is None else _read(log, parsed, config.parent)
    _check_file(out, "--out")
    with _progress("messages") as (bar, task):
        made = make_capsule(
            parsed,
            recorded,
            base=config.parent,
            seed=seed,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_capsule(made, out)
    for name in made.result:
        console.print(f"{name:22} {made.result[name].count(chr(10))} lines", highlight=False)
    console.print(f"{'result':22} {made.about['result']}", highlight=False)
    console.print(f"capsule: {out} ({out.stat().st_size} bytes)", soft_wrap=True)


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="As `locfuse capsule` wrote it.")],
) -> None:
    """Run a capsule again: are estimates and outcomes the same bit for bit, and if not, where."""
    from locfuse.run.capsule import machine, read_capsule, replay_capsule

    packed = read_capsule(file)
    with _progress("messages") as (bar, task):
        differences = replay_capsule(
            packed, lambda done, total: bar.update(task, completed=done, total=total)
        )
    made = packed.about
    print(f"made by locfuse {made['version']} ({made['compiler']}) on {made['machine']}")
    print(f"run by locfuse {__version__} ({compiler()}) on {machine()}")
    for d in differences:
        when = f" ({d.stamp_s} s)" if d.stamp_s else ""
        print(f"{d.file}: {d.lines} lines differ, the first is line {d.line}{when}")
        for column, was in d.was.items():
            print(f"  {column}: was {was or 'nothing'}, is {d.found[column] or 'nothing'}")
    if differences and made["machine"] != machine():
        print("the last bits may depend on processor and C library")
    if differences:
        raise typer.Exit(1)
    print(f"the same bit for bit: {', '.join(packed.result)}")


@app.command("convert")
def convert_command(
    kind: Annotated[
        str, typer.Argument(help=f"What SOURCE is: log, bag, or one of: {', '.join(CONVERTERS)}.")
    ],
    source: Annotated[
        Path, typer.Argument(help="Log folder, bag, or folder of the recording as published.")
    ],
    out: Annotated[
        Path, typer.Argument(help="Log folder or folders; of a log or bag also a .bag or .mcap.")
    ],
    config: Annotated[
        Path | None, typer.Option(help="YAML file whose block 'ros' says what is where in a bag.")
    ] = None,
) -> None:
    """Turn a bag or a published recording into log folders, or a log into a bag."""
    ros = None if config is None else load_config(config).ros
    base = None if config is None else config.parent
    with _progress("done") as (bar, task):
        written = convert_recording(kind, source, out, ros, base, _onto(bar, task))
    for path in written:
        console.print(str(path), soft_wrap=True)


@app.command()
def evaluate(
    estimate: Annotated[Path, typer.Argument(help="TUM file.")],
    truth: Annotated[Path, typer.Argument(help="TUM file.")],
    align: Annotated[
        str, typer.Option(help="none, se2 (rigid) or sim2 (with scale): moves the estimate.")
    ] = "none",
    max_difference_s: Annotated[
        float, typer.Option(help="Stamps further apart are not matched.", min=0.0)
    ] = 0.01,
) -> None:
    """Compare two trajectories: absolute position error at matching stamps."""
    result = ape(read_tum(estimate), read_tum(truth), align, max_difference_s)
    for name in ("rmse", "mean", "median", "p95", "max"):
        console.print(f"{name + '_m':22} {getattr(result, name):.9g}")
    console.print(f"{'matched':22} {result.matched}")
    console.print(f"{'alignment':22} {result.alignment}")
    if result.alignment != "none":
        console.print(f"{'scale':22} {result.scale:.9g}")
        console.print(f"{'rotation_deg':22} {math.degrees(result.rotation):.9g}")
        console.print(
            f"{'translation_m':22} {result.translation[0]:.9g} {result.translation[1]:.9g}"
        )


@app.command()
def position(
    anchors: Annotated[Path, typer.Option(help="CSV file as in a log folder.")],
    ranges: Annotated[Path, typer.Option(help="CSV file as in a log folder.")],
    height: Annotated[
        float | None, typer.Option(help="Metres, of the tag; without it positions are in space.")
    ] = None,
    solver: Annotated[str, typer.Option(help=f"One of: {', '.join(SOLVERS)}.")] = "both",
    sigma: Annotated[
        float, typer.Option(help="Metres, of a range, where the file states none.")
    ] = 0.1,
    loss: Annotated[str, typer.Option(help=f"One of: {', '.join(LOSSES)}.")] = "none",
    epoch: Annotated[
        float, typer.Option(help="Seconds that ranges of an epoch may be apart.", min=0.0)
    ] = 0.0,
    out: Annotated[Path | None, typer.Option(help="CSV file for all there is to say.")] = None,
) -> None:
    """Locate a tag from ranges alone, each epoch by itself; say where two answers fit."""
    epochs = read_epochs(anchors, ranges, sigma, epoch)
    fixes = positions(epochs, height=height, solver=solver, loss=loss)
    console.print(_fixes_table(fixes))
    counts = Counter(fix.status for fix in fixes)
    console.print(", ".join(f"{status} {count}" for status, count in counts.items()) or "no range",
                  highlight=False)  # fmt: skip
    if height is None and in_one_plane(epochs):
        console.print("all anchors lie in one plane, on either side of which a position fits: "
                      "--height says which", soft_wrap=True)  # fmt: skip
    if out is not None:
        write_fixes(fixes, epochs.names, out)
        console.print(f"written: {out}", soft_wrap=True)


app.command("reproduce")(reproduce_command)


@app.command()
def sweep(
    config: Annotated[Path, typer.Argument(help="YAML file, see docs/configuration.md.")],
    trials: Annotated[int, typer.Option(help="Runs in all, each with its own seed.", min=1)] = 100,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="KEY=a,b,c or KEY=LOW..HIGH[:log|:N|:Nlog], see docs/sweep.md.", show_default=False
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes; default: one for each processor.", min=1)
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, whose workers run them.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/sweep"),
    recovered_m: Annotated[
        float | None,
        typer.Option(help="Metres: recovered from a fault below; default: inside its covariance."),
    ] = None,
) -> None:
    """Run a configuration many times with other seeds and values; go on where it was stopped."""
    parsed = load_config(config)
    values = _varied(vary or [])
    if dask is not None and workers is not None:
        raise ConfigError("--workers are processes here, --dask those of a cluster; give one")
    _check_folder(out)
    with ExitStack() as stack:
        executor = None
        if dask is not None:
            executor, workers = stack.enter_context(dask_cluster(dask))
        bar, task = stack.enter_context(_progress("trials"))
        found = run_trials(
            parsed, trials, values, executor=executor, workers=workers, base=config.parent, out=out,
            recovered_m=recovered_m,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    summary = summarize(found)
    (out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    _print_sweep(found, summary)
    from locfuse.report.plot import draw_sweep  # loads slowly; other commands need none

    for path in draw_sweep(found, out):
        console.print(f"picture: {path}", soft_wrap=True)
    console.print(f"table: {out / 'trials.parquet'}", soft_wrap=True)


def _varied(given: list[str]) -> dict[str, str]:
    """Return the text after the first ``=`` of each by what stands before it."""
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
        console.print(f"{count:6}  {error}", soft_wrap=True, markup=False, highlight=False)


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
    table = Table(title=f"{escape(key)}: medians", box=box.SIMPLE_HEAD, padding=(0, 1),
                  pad_edge=False)  # fmt: skip
    shown = ("position_rmse_m", "heading_rmse_deg", "nees_mean", "nll")
    table.add_column("value", no_wrap=True)
    for heading in ("trials", "failed", *shown):  # on a narrow screen intervals go below
        table.add_column(heading, justify="right")
    for row in rows:
        scores = [_with_interval(row["scores"].get(name), "median") for name in shown]
        failed = str(row["failed"]["count"])
        table.add_row(escape(row["value"]), str(row["trials"]), failed, *scores)
    return table


def _with_interval(of: dict[str, Any] | None, what: str) -> str:
    if of is None:
        return "-"
    low, high = of[f"{what}_low"], of[f"{what}_high"]
    interval = "" if low is None else escape(f" [{low:.3g}..{high:.3g}]")
    return f"{of[what]:.4g}{interval}"


@app.command()
def studio(
    config: Annotated[
        Path | None, typer.Argument(help="YAML file to begin with; it stays as it is.")
    ] = None,
    folder: Annotated[Path, typer.Option(help="Where scenes and runs are kept.")] = Path("studio"),
    host: Annotated[
        str, typer.Option(help="Address; any but this machine's own needs a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port.", min=1, max=65535)] = 8642,
    token: Annotated[
        str | None, typer.Option(help="What a browser must know.", envvar="LOCFUSE_STUDIO_TOKEN")
    ] = None,
) -> None:
    """Draw a world in the browser, run estimators in it, watch and compare them."""
    from locfuse.studio.server import serve  # loads slowly; other commands need none

    name = f"[{host}]" if ":" in host else host
    known = f"/?{urlencode({'token': token})}" if token else "/"

    def tell(notice: str) -> None:
        for line in (notice, f"http://{name}:{port}{known}"):
            if line:
                console.print(f"studio: {line}", soft_wrap=True, markup=False, highlight=False)

    serve(folder, config, host, port, token, tell)


@config_app.command("dump")
def config_dump(config: Annotated[Path, typer.Argument(help="YAML file.")]) -> None:
    """Print the effective configuration: every key with its value."""
    text = yaml.safe_dump(load_config(config).model_dump(mode="json"), sort_keys=False)
    print(text, end="")


def _fixes_table(fixes: list[Fix]) -> Table:
    """Return the first positions as a table: one row per position that fits."""
    d = max((fix.position.shape[1] for fix in fixes), default=2)
    title = f"first {ROWS} of {len(fixes)} epochs" if len(fixes) > ROWS else None
    table = Table(title=title, caption="stamp in s; the rest in m", box=box.SIMPLE_HEAD,
                  padding=(0, 1), collapse_padding=True, pad_edge=False)  # fmt: skip
    for heading in ("stamp", "tag", *"xyz"[:d], "sigma", "status", "agree", "rms", "culprit"):
        is_text = heading in ("tag", "status", "agree", "culprit")
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=True)
    agree = {True: "yes", False: "NO", None: "-"}
    for fix in fixes[:ROWS]:
        stamp = f"{fix.stamp_ns / NANOSECONDS:.3f}"
        said = (escape(fix.status), agree[fix.agree], _metres(fix.residual_rms),
                escape((fix.culprit or "-") + "?" * (fix.explained is False)))  # fmt: skip
        at = [*fix.position.tolist()] or [[math.nan] * d]
        table.add_row(stamp, escape(fix.tag), *map(_metres, at[0]), _metres(fix.sigma), *said)
        for other in at[1:]:
            table.add_row("", "or", *map(_metres, other))
    return table


def _metres(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"
