# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments, repeated: claim, the paper's figure, ours over seeds, required, met."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from locfuse.types import ConfigError, nearest
from papers.celan2017 import celan_claims
from papers.celan2017 import draw_pictures as draw_celan
from papers.claims import Claim, Progress
from papers.configs import example_configs
from papers.consistency import consistency_claims
from papers.ekim2020 import draw_pictures as draw_starts
from papers.ekim2020.room import draw_room, ekim2020_claims
from papers.gadau2022 import draw_pictures as draw_gadau
from papers.gadau2022 import gadau_claims
from papers.recordings.cylinders import draw_pictures as draw_drives
from papers.recordings.landmarks import landmark_claims
from papers.recordings.maps import map_claims
from papers.recordings.uwb_3d import air_claims
from papers.recordings.uwb_outliers import draw_pictures as draw_outliers
from papers.recordings.uwb_outliers import outlier_claims
from papers.recordings.victoria_park import draw_pictures as draw_trees
from papers.trust import draw_pictures as draw_trust
from papers.trust import trust_claims
from papers.wells import draw_pictures as draw_wells
from papers.wells import wells_claims
from papers.wells.cylinder_detector import cylinder_claims
from papers.zhang import draw_pictures as draw_zhang
from papers.zhang import zhang_claims


def reproduce(paper: str, seeds: int, progress: Progress | None = None) -> list[Claim]:
    """Repeat a paper's experiments.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.
    seeds : int
        Runs per simulated experiment: seeds 0 to seeds - 1.
    progress : callable, optional
        Told (runs done, runs in all).

    Raises
    ------
    ConfigError
        If the paper is not known.
    """
    if paper not in PAPERS:
        raise ConfigError(f"no paper {paper!r}; {nearest(paper, PAPERS)}")
    return PAPERS[paper](seeds, progress or (lambda done, total: None))


def draw(paper: str, seeds: int, folder: Path) -> list[Path]:
    """Draw the pictures of a paper that `reproduce` knows into a folder; return their paths."""
    if paper == "zhang":
        return draw_zhang(folder, seeds)
    if paper == "wells":
        return draw_wells(folder, seeds)
    if paper == "gadau2022":
        return draw_gadau(folder, seeds)
    if paper == "celan2017":
        return draw_celan(folder, seeds)
    if paper == "trust":
        return draw_trust(folder, seeds)
    configs = example_configs()
    if paper == "landmarks" and configs is not None:
        return [*draw_drives(configs, folder), *draw_trees(configs, folder)]
    if paper == "outliers" and configs is not None:
        return draw_outliers(configs, folder)
    return [draw_room(folder), *draw_starts(configs, folder)] if paper == "ekim2020" else []


PAPERS: dict[str, Callable[[int, Progress], list[Claim]]] = {
    "ekim2020": ekim2020_claims,
    "zhang": zhang_claims,
    "maps": lambda seeds, progress: map_claims(example_configs(), seeds, progress),
    "wells": wells_claims,
    "gadau2022": gadau_claims,
    "celan2017": lambda seeds, progress: celan_claims(seeds, progress, example_configs()),
    "landmarks": lambda seeds, progress: landmark_claims(example_configs(), seeds, progress),
    "cylinders": cylinder_claims,
    "consistency": consistency_claims,
    "air": lambda seeds, progress: air_claims(example_configs(), progress),
    "trust": trust_claims,
    "outliers": lambda seeds, progress: outlier_claims(example_configs(), seeds, progress),
}
