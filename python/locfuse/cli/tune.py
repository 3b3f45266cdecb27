# SPDX-License-Identifier: Apache-2.0
"""``locfuse tune``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from locfuse.cli.inputs import ConfigFile, read_log, with_log
from locfuse.cli.terminal import check_folder, console, progress, visible
from locfuse.config.load import load_config
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.tune.judge import Judged
from locfuse.tune.result import TuneResult
from locfuse.tune.tune import tune as tune_by


def tune(
    config: ConfigFile,
    log: Annotated[
        list[Path] | None,
        typer.Option(help="Log folder or bag; give it again for each further recording."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/tune"),
) -> None:
    """Find noise, latencies and scales by recordings."""
    parsed = load_config(config)
    base = config.parent
    check_folder(out)
    logs = [read_log(one, parsed, base) for one in log or []]
    with progress("runs") as moved:
        result = tune_by(parsed, logs, base=base, progress=moved)
    _print(result)
    out.mkdir(parents=True, exist_ok=True)
    written = result.config if not log else with_log(result.config, log[0], base)
    path = out / "tuned.yaml"
    path.write_text(result.whole_yaml(written, base), encoding="utf-8")
    console.print(f"written: {path}", soft_wrap=True)
    if has_matplotlib():
        from locfuse.report.plot import plot_tune, save

        save(plot_tune(result), out / "tune.png")
        console.print(f"picture: {out / 'tune.png'}", soft_wrap=True)
    else:
        console.print(NO_PICTURES, soft_wrap=True)


def _print(result: TuneResult) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False,
                  caption="95 % intervals; not observed: stays as it is"
                  )  # fmt: skip
    for heading in ("key", "now", "found", "from", "to", "unit", ""):
        is_text = heading in ("key", "unit", "")
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=True)
    for one in result.quantities:
        table.add_row(*_row(one))
    console.print(table)
    for source in result.held_out:
        console.print(f"{source.source}, {source.count} held out: NIS {source.before.nis:.2f} -> "
                      f"{source.after.nis:.2f}, beyond its gate {source.before.outliers:.1%} -> "
                      f"{source.after.outliers:.1%}, log-likelihood {source.before.nats:.2f} -> "
                      f"{source.after.nats:.2f}", soft_wrap=True, highlight=False)  # fmt: skip
    for sentence in (*result.findings, *result.comparisons):
        console.print(visible(sentence[:1].upper() + sentence[1:] + "."), soft_wrap=True,
                      highlight=False)  # fmt: skip
    if not result.changes:
        console.print("The configuration stays as it is.", highlight=False)
        return
    console.print("For the configuration:", highlight=False)
    for line in result.yaml.splitlines():
        console.print(line, soft_wrap=True, highlight=False)


def _row(one: Judged) -> tuple[str, ...]:
    q = one.quantity
    interval = [f"{one.low:.4g}", f"{one.high:.4g}"]
    if one.word == "not observed" and q.is_sigma:
        interval = ["", ""]
    found = f"{one.value:.4g}" if one.word == "found" else ""
    return (q.key, f"{q.now:.4g}", found, *interval, q.unit, one.word)
