# SPDX-License-Identifier: Apache-2.0
"""Pictures of the rows about starts."""

from __future__ import annotations

from pathlib import Path

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.run.run import run
from locfuse.types import LogError
from papers.ekim2020.gazebo import heading_errors
from papers.ekim2020.runs import bad_starts
from papers.ekim2020.simulated import noise_sweep


def draw_pictures(configs: Path | None, folder: Path) -> list[Path]:
    """Write the pictures of the rows that can be run, as PNG files; return their paths.

    ``start_bound.png``: solvers against the Cramer-Rao bound; ``start_searches.png``: the paper's
    heading search and ours; ``start_bad.png``: what a wrong heading costs; ``start_ambiguous.png``:
    a room that looks the same from four sides.
    """
    from locfuse.report import plot  # matplotlib loads slowly; rows need none
    from papers.ekim2020 import plots

    folder.mkdir(parents=True, exist_ok=True)
    figures = {"start_bound": plots.plot_bound(*noise_sweep()),
               "start_ambiguous": plot.plot_start(run(square_room(), seed=1))}  # fmt: skip
    if configs is not None:
        try:
            errors = heading_errors(configs)
            figures["start_searches"] = plots.plot_searches(errors.ten_degrees, errors.ours)
            figures["start_bad"] = plots.plot_bad_starts(*bad_starts(configs))
        except LogError:  # absent recordings are told by the rows
            pass
    paths = []
    for name, figure in figures.items():
        assert figure is not None
        paths.append(folder / f"{name}.png")
        plot.save(figure, paths[-1])
    return paths


def square_room() -> RunConfig:
    """Return a robot in the middle of a square room: its scan fits four headings."""
    return parse_config(
        {
            "name": "square room",
            "simulation": {
                "path": {"shape": "eight"},
                "duration_s": 20.0,
                "poses": None,
                "laser": {"range_max_m": 12.0},
                "map": {},
            },
            "start": "auto",
            "estimator": {"range": {"sigma_m": 0.02, "sigma_relative": 0.015}},
        }
    )
