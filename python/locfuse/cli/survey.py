# SPDX-License-Identifier: Apache-2.0
"""``locfuse survey``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
import yaml
from rich import box
from rich.table import Table

from locfuse.cli.inputs import ConfigFile, LogPath, with_log
from locfuse.cli.terminal import check_folder, console, share_progress, visible
from locfuse.config.load import load_config
from locfuse.report.pictures import NO_PICTURES, has_matplotlib
from locfuse.run.survey import survey as survey_anchors
from locfuse.run.survey_result import SurveyResult, read_measured, write_survey, yaml_of


def survey(
    config: ConfigFile,
    log: LogPath = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/survey"),
    measured: Annotated[
        Path | None, typer.Option(help="CSV file as anchors.csv, of what is known by hand.")
    ] = None,
    height: Annotated[
        float | None, typer.Option(help="Height of all other anchors in metres.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option(help="A1,A2: A1 is the origin, A2 on the positive x axis.")
    ] = None,
    sigma_tag: Annotated[
        float, typer.Option(help="How well places of tags on the robot are known, in metres.")
    ] = 0.0,
) -> None:
    """Find where anchors and landmarks are, by a drive among them."""
    parsed = load_config(config)
    base = config.parent
    if log is not None:
        parsed = with_log(parsed, log, base)
        base = Path()
    check_folder(out)
    if height is not None and not math.isfinite(height):
        raise ValueError(f"--height is {height:g}, expected metres")
    axes = None
    if frame is not None:
        names = [name.strip() for name in frame.split(",")]
        if len(names) != 2:
            raise ValueError(f"--frame is {frame!r}, expected two anchors, as in A1,A2")
        axes = names[0], names[1]
    table = None if measured is None else read_measured(measured)
    with share_progress() as progress:
        result = survey_anchors(
            parsed, base=base, measured=table, height_m=height, frame=axes, sigma_tag_m=sigma_tag,
            progress=progress,
        )  # fmt: skip
    _print(result)
    for path in write_survey(result, out):
        console.print(f"written: {path}", soft_wrap=True)
    if has_matplotlib():
        from locfuse.report.plot import plot_survey, save

        save(plot_survey(result), out / "survey.png")
        console.print(f"picture: {out / 'survey.png'}", soft_wrap=True)
    else:
        console.print(NO_PICTURES, soft_wrap=True)


def _print(result: SurveyResult) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False,
                  caption="metres; sigma: along the axis in the plane known least")  # fmt: skip
    for heading in ("anchor", *"xyz", "sigma", "offset", "ranges", "rejected", "place"):
        is_text = heading in ("anchor", "place")
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=True)
    for a in result.anchors:
        if a.word == "not placed":
            table.add_row(visible(a.name), *["-"] * 5, str(a.ranges), str(a.rejected), a.word)
            continue
        numbers = (*a.position, a.sigma_m)
        table.add_row(visible(a.name), *(f"{v:.3f}" for v in numbers),
                      f"{a.offset_m:.2f} ± {a.sigma_offset_m:.2f}", str(a.ranges),
                      str(a.rejected), a.word)  # fmt: skip
        if a.other is not None:
            table.add_row("", *(f"{v:.3f}" for v in a.other), "", "", "", "", "or here")
    if result.anchors:
        console.print(table)
    for name, at, P, count in zip(
        result.landmarks.name.tolist(), result.landmarks.position.tolist(),
        result.landmarks.covariance, result.landmarks.sightings.tolist(), strict=True,
    ):  # fmt: skip
        sigma = float(P.trace()) ** 0.5
        console.print(f"landmark {visible(name)}: ({at[0]:.3f}, {at[1]:.3f}), sigma {sigma:.3f} m, "
                      f"{count} sightings", soft_wrap=True, highlight=False)  # fmt: skip
    for tag in result.tags:
        forward, left = tag.position.tolist()
        console.print(f"tag {visible(tag.name)}: {forward:.3f} m forward, {left:.3f} m left, sigma "
                      f"{tag.sigma_m:.3f} m", soft_wrap=True, highlight=False)  # fmt: skip
    said = [result.frame, *result.findings, *([result.advice] if result.advice else [])]
    for sentence in said:
        end = "" if sentence.endswith("?") else "."
        text = visible(sentence[:1].upper() + sentence[1:] + end)
        console.print(text, soft_wrap=True, highlight=False)
    offsets = yaml_of(result)
    if offsets:
        console.print("For the configuration:", highlight=False)
        text = yaml.safe_dump({"anchors": dict(offsets)}, default_flow_style=None)
        for line in text.splitlines():
            console.print(line, soft_wrap=True, highlight=False)
