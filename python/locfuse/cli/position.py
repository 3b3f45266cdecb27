# SPDX-License-Identifier: Apache-2.0
"""``locfuse position``."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.table import Table

from locfuse.cli.terminal import console
from locfuse.run.position import (
    LOSSES,
    MLS,
    SOLVERS,
    Fix,
    in_one_plane,
    positions,
    read_epochs,
    write_fixes,
)
from locfuse.types import NANOSECONDS

_ROWS = 50  # epochs that the table shows


def position(
    anchors: Annotated[Path, typer.Option(help="CSV file as in a log folder.")],
    ranges: Annotated[Path, typer.Option(help="CSV file as in a log folder.")],
    height: Annotated[
        float | None, typer.Option(help="Tag height in metres; default: positions in 3D.")
    ] = None,
    solver: Annotated[str, typer.Option(help=f"One of: {', '.join(SOLVERS)}.")] = "both",
    sigma: Annotated[
        float, typer.Option(help="Sigma of a range in metres, where the file has none.")
    ] = 0.1,
    loss: Annotated[str, typer.Option(help=f"One of: {', '.join(LOSSES)}.")] = "none",
    ml: Annotated[
        str, typer.Option(help=f"Maximum likelihood of --solver both: {', '.join(MLS)}.")
    ] = "newton",
    epoch: Annotated[
        float, typer.Option(help="Maximum duration of an epoch in seconds.", min=0.0)
    ] = 0.0,
    out: Annotated[Path | None, typer.Option(help="CSV file for all results.")] = None,
) -> None:
    """Locate tags from ranges alone, each epoch by itself."""
    epochs = read_epochs(anchors, ranges, sigma, epoch)
    fixes = positions(epochs, height=height, solver=solver, loss=loss, ml=ml)
    console.print(_fixes_table(fixes))
    counts = Counter(fix.status for fix in fixes)
    console.print(", ".join(f"{status} {count}" for status, count in counts.items()) or "no range",
                  highlight=False)  # fmt: skip
    apart = [(fix.ml_distance, fix.ml_sigmas) for fix in fixes if fix.ml_distance >= 0.0]
    if apart:
        console.print("Newton and Ceres end up to {:.2g} m apart, {:.2g} sigma".format(*max(apart)),
                      highlight=False)  # fmt: skip
    if height is None and in_one_plane(epochs):
        console.print("all anchors lie in one plane, and a position fits on either side of it: "
                      "use --height to select one", soft_wrap=True)  # fmt: skip
    if out is not None:
        write_fixes(fixes, epochs.names, out)
        console.print(f"written: {out}", soft_wrap=True)


def _fixes_table(fixes: list[Fix]) -> Table:
    """Return the first positions as a table: one row per position that fits."""
    d = max((fix.position.shape[1] for fix in fixes), default=2)
    title = f"first {_ROWS} of {len(fixes)} epochs" if len(fixes) > _ROWS else None
    table = Table(title=title, caption="stamp in s; the rest in m", box=box.SIMPLE_HEAD,
                  padding=(0, 1), collapse_padding=True, pad_edge=False)  # fmt: skip
    for heading in ("stamp", "tag", *"xyz"[:d], "sigma", "status", "agree", "rms", "culprit"):
        is_text = heading in ("tag", "status", "agree", "culprit")
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=True)
    agree = {True: "yes", False: "NO", None: "-"}
    for fix in fixes[:_ROWS]:
        stamp = f"{fix.stamp_ns / NANOSECONDS:.3f}"
        verdict = (fix.status, agree[fix.agree], _metres(fix.residual_rms),
                   (fix.culprit or "-") + "?" * (fix.explained is False))  # fmt: skip
        at = [*fix.position.tolist()] or [[math.nan] * d]
        table.add_row(stamp, fix.tag, *map(_metres, at[0]), _metres(fix.sigma), *verdict)
        for other in at[1:]:
            table.add_row("", "or", *map(_metres, other))
    return table


def _metres(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"
