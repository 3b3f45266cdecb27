# SPDX-License-Identifier: Apache-2.0
"""celan2017: a floor scrubber on a lap of an office floor, its LiDAR covered, and UWB."""

from __future__ import annotations

from pathlib import Path

from papers.celan2017.comparison import laps, setup_claims, speed_claim, switch_claims
from papers.celan2017.eight import eight_claims
from papers.celan2017.pictures import draw_pictures
from papers.celan2017.runs import SETUPS
from papers.celan2017.trolley import trolley_claims
from papers.claims import Claim, Progress

__all__ = ["celan_claims", "draw_pictures"]


def celan_claims(seeds: int, progress: Progress, configs: Path | None = None) -> list[Claim]:
    """Return all rows: Table II, its laps, Table III, and a recorded trolley with three tags.

    Parameters
    ----------
    seeds : int
        Laps, and rides.
    progress : callable
        Told (laps done, laps in all).
    configs : Path, optional
        Folder of the ready configurations: recordings lie beside the project.
    """
    runs = laps(seeds, progress)
    claims = [claim for name in SETUPS for claim in setup_claims(name, runs[name])]
    return [*claims, *switch_claims(runs), speed_claim(runs["lidar"]), *eight_claims(seeds),
            *trolley_claims(configs)]  # fmt: skip
