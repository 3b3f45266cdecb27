# SPDX-License-Identifier: Apache-2.0
"""``locfuse commission``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from locfuse.cli.inputs import with_log
from locfuse.cli.terminal import check_folder, console, progress_of_parts, visible
from locfuse.commission.commission import commission as set_up
from locfuse.commission.result import CONFIGURATION, Commissioned, check_new
from locfuse.config.base import given_keys
from locfuse.config.load import load_config
from locfuse.eval.trust import sentence
from locfuse.report.commission import write_setup
from locfuse.run.mapping import check_resolution


def commission(
    log: Annotated[Path, typer.Argument(help="Log folder or bag of a drive.")],
    out: Annotated[Path, typer.Option(help="Folder for the robot.")] = Path("my_robot"),
    config: Annotated[
        Path | None, typer.Option(help="YAML file of what is known: topics, tags, `start`.")
    ] = None,
    resolution: Annotated[float, typer.Option(help="Side of a map's cell in metres.")] = 0.05,
) -> None:
    """Set up a robot by one drive: map, anchors, noise, configuration."""
    check_new(out)
    check_folder(out)
    check_resolution(resolution)
    given = {} if config is None else given_keys(with_log(load_config(config), log, config.parent))
    with progress_of_parts() as progress:
        result = set_up(log, base=out, config=given, resolution_m=resolution, progress=progress)
    files = write_setup(result, out)
    _print(result)
    for path in files:
        console.print(f"written: {path}", soft_wrap=True)
    if result.drive is not None:
        _say(f"next: locfuse run {out / CONFIGURATION} --log ANOTHER_DRIVE")


def _print(result: Commissioned) -> None:
    if result.map is not None:
        height, width = (side * result.map.grid.resolution_m
                         for side in result.map.grid.cells.shape)  # fmt: skip
        _say(f"map: {width:.1f} x {height:.1f} m of {result.map.length_m:.0f} m driven")
    if result.survey is not None:
        words = [a.word for a in result.survey.anchors]
        found = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        _say(f"anchors: {found or 'none'}; {result.survey.frame}")
        if len(result.survey.landmarks):
            _say(f"landmarks: {len(result.survey.landmarks)}")
    if result.tuned is not None and result.is_tuned:
        changed = sum(one.changes for one in result.tuned.quantities)
        _say(f"noise and calibration: {changed} of {len(result.tuned.quantities)} found")
    if result.drive is not None and result.drive.health is not None and len(result.drive.health):
        _say(f"health of the same drive: {sentence(result.drive.health)}")
    for sentences in (result.missing, result.advice):
        for one in sentences:
            _say(one[:1].upper() + one[1:] + ".")


def _say(text: str) -> None:
    console.print(visible(text), soft_wrap=True, highlight=False)
