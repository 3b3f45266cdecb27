# SPDX-License-Identifier: Apache-2.0
"""The table of all experiments: for each key its rows and its figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from locfuse.types import ConfigError, nearest
from papers.celan2017 import celan_claims
from papers.celan2017 import draw_figures as draw_celan
from papers.claims import Claim, Progress
from papers.consistency import consistency_claims
from papers.consistency.pose_sources import pose_source_claims
from papers.consistency.recordings import recorded_claims
from papers.ekim2020 import draw_figures as draw_ekim
from papers.ekim2020 import ekim2020_claims
from papers.gadau2022 import draw_figures as draw_gadau
from papers.gadau2022 import gadau_claims
from papers.health import draw_figures as draw_health
from papers.health import health_claims, watch_claims
from papers.recorded import example_configs
from papers.recordings import (
    air_claims,
    draw_drives,
    draw_outliers,
    draw_trees,
    landmark_claims,
    map_claims,
    outlier_claims,
)
from papers.wells import cylinder_claims, wells_claims
from papers.wells import draw_figures as draw_wells
from papers.zhang import draw_figures as draw_zhang
from papers.zhang import zhang_claims


@dataclass(frozen=True)
class Experiment:
    """What `locfuse reproduce KEY` runs.

    Attributes
    ----------
    claims : callable
        Takes seeds, progress and the folder of ready configurations; returns the rows.
    figures : callable
        Takes a folder, seeds and the folder of ready configurations; writes figures, returns
        their paths.
    """

    claims: Callable[[int, Progress, Path | None], list[Claim]]
    figures: Callable[[Path, int, Path | None], list[Path]] = lambda folder, seeds, configs: []


PAPERS: dict[str, Experiment] = {
    "ekim2020": Experiment(
        ekim2020_claims, lambda folder, seeds, configs: draw_ekim(folder, configs)
    ),
    "zhang": Experiment(
        lambda seeds, progress, configs: zhang_claims(seeds, progress),
        lambda folder, seeds, configs: draw_zhang(folder, seeds),
    ),
    "maps": Experiment(map_claims),
    "wells": Experiment(
        lambda seeds, progress, configs: wells_claims(seeds, progress),
        lambda folder, seeds, configs: draw_wells(folder),
    ),
    "gadau2022": Experiment(
        gadau_claims, lambda folder, seeds, configs: draw_gadau(folder)
    ),
    "celan2017": Experiment(celan_claims, lambda folder, seeds, configs: draw_celan(folder)),
    "landmarks": Experiment(
        landmark_claims,
        lambda folder, seeds, configs: [
            *draw_drives(folder, configs), *draw_trees(folder, configs)
        ],
    ),
    "cylinders": Experiment(lambda seeds, progress, configs: cylinder_claims(seeds, progress)),
    "consistency": Experiment(lambda seeds, progress, configs: consistency_claims(seeds, progress)),
    "poses": Experiment(lambda seeds, progress, configs: pose_source_claims(seeds, progress)),
    "honesty": Experiment(lambda seeds, progress, configs: recorded_claims(progress, configs)),
    "air": Experiment(lambda seeds, progress, configs: air_claims(progress, configs)),
    "trust": Experiment(
        lambda seeds, progress, configs: health_claims(seeds, progress),
        lambda folder, seeds, configs: draw_health(folder, seeds),
    ),
    "watch": Experiment(lambda seeds, progress, configs: watch_claims(seeds, progress, configs)),
    "outliers": Experiment(
        outlier_claims, lambda folder, seeds, configs: draw_outliers(folder, configs)
    ),
}  # fmt: skip


def reproduce(paper: str, seeds: int, progress: Progress | None = None) -> list[Claim]:
    """Repeat a paper's experiments.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.
    seeds : int
        Runs per simulated experiment: seeds 0 to seeds - 1.
    progress : callable, optional
        Receives (runs done, runs in all).

    Raises
    ------
    ConfigError
        If the paper is not known.
    """
    if paper not in PAPERS:
        raise ConfigError(f"no paper {paper!r}; {nearest(paper, PAPERS)}")
    return PAPERS[paper].claims(seeds, progress or (lambda done, total: None), example_configs())


def draw(paper: str, seeds: int, folder: Path) -> list[Path]:
    """Draw the figures of a paper that `reproduce` knows into a folder; return their paths."""
    return PAPERS[paper].figures(folder, seeds, example_configs())
