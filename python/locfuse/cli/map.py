# SPDX-License-Identifier: Apache-2.0
"""``locfuse map``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.inputs import ConfigFile, LogPath, with_log
from locfuse.cli.terminal import check_folder, console, share_progress, visible
from locfuse.config.load import load_config
from locfuse.io.maps import read_map
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.run.mapping import MapResult, check_resolution, make_map, write_map_result


def map(
    config: ConfigFile,
    log: LogPath = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/map"),
    resolution: Annotated[float, typer.Option(help="Side of a cell in metres.")] = 0.05,
    onto: Annotated[
        Path | None, typer.Option(help="Yaml of a map that is continued, in its resolution.")
    ] = None,
) -> None:
    """Make a map of a drive with a laser."""
    parsed = load_config(config)
    base = config.parent
    if log is not None:
        parsed = with_log(parsed, log, base)
        base = Path()
    check_folder(out)
    check_resolution(resolution)
    old = None if onto is None else read_map(onto)
    with share_progress() as progress:
        result = make_map(parsed, base=base, resolution_m=resolution, onto=old, progress=progress)
    _print(result)
    for path in write_map_result(result, out):
        console.print(f"written: {path}", soft_wrap=True)
    if has_matplotlib():
        from locfuse.report.plot import plot_map, save

        save(plot_map(result), out / "map.png")
        console.print(f"picture: {out / 'map.png'}", soft_wrap=True)
    else:
        console.print(NO_PICTURES, soft_wrap=True)


def _print(result: MapResult) -> None:
    height, width = (side * result.grid.resolution_m for side in result.grid.cells.shape)
    again = sum(loop.kept and loop.from_ns is not None for loop in result.loops)
    console.print(f"map: {width:.1f} x {height:.1f} m of {result.keys} of {result.scans} scans, "
                  f"{result.length_m:.0f} m driven, {again} times at a place seen before",
                  soft_wrap=True, highlight=False)  # fmt: skip
    if result.appeared is not None and result.vanished is not None:
        area = result.grid.resolution_m**2
        console.print(f"changed: {result.appeared.sum() * area:.2f} m^2 of walls are new, "
                      f"{result.vanished.sum() * area:.2f} m^2 are gone",
                      soft_wrap=True, highlight=False)  # fmt: skip
    for sentence in result.findings:
        console.print(visible(sentence[:1].upper() + sentence[1:] + "."), soft_wrap=True,
                      highlight=False)  # fmt: skip
