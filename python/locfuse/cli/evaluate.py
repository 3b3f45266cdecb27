# SPDX-License-Identifier: Apache-2.0
"""``locfuse evaluate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.terminal import console
from locfuse.eval.ape import ape
from locfuse.io.tum import read_tum


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="TUM file.")],
    truth: Annotated[Path, typer.Argument(help="TUM file.")],
    align: Annotated[
        str, typer.Option(help="Alignment of the estimate: none, se2 (rigid) or sim2 (with scale).")
    ] = "none",
    max_difference_s: Annotated[
        float, typer.Option(help="Maximum time difference of matching stamps.", min=0.0)
    ] = 0.01,
) -> None:
    """Compare two trajectories: position error at matching stamps."""
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
