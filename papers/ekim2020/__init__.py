# SPDX-License-Identifier: Apache-2.0
"""ekim2020, sections 2.2 and 3.1: SR-LS, the heading search and what a start is worth."""

from __future__ import annotations

from pathlib import Path

from papers.claims import Claim, share
from papers.ekim2020.gazebo import HeadingErrors, gazebo_claims, heading_errors
from papers.ekim2020.office import office_claims
from papers.ekim2020.pictures import draw_pictures, square_room
from papers.ekim2020.runs import auto_claims, bad_starts
from papers.ekim2020.scans import PowerUps, power_ups, refined_errors
from papers.ekim2020.simulated import (
    LAYOUTS,
    PUBLISHED_SRLS,
    SIGMA_M,
    TRIALS,
    Trials,
    noise_sweep,
    rmse_over_bound,
    simulated_claims,
    trials,
)
from papers.ekim2020.sites import epochs, site_claims

__all__ = [
    "LAYOUTS",
    "PUBLISHED_SRLS",
    "SIGMA_M",
    "TRIALS",
    "HeadingErrors",
    "PowerUps",
    "Trials",
    "bad_starts",
    "draw_pictures",
    "epochs",
    "heading_errors",
    "noise_sweep",
    "power_up_claims",
    "power_ups",
    "refined_errors",
    "rmse_over_bound",
    "share",
    "square_room",
    "trials",
]


def power_up_claims(configs: Path | None) -> list[Claim]:
    """Return the rows about a start from nothing; recordings need the ready configurations."""
    claims = list(simulated_claims())
    if configs is not None:
        for rows in (site_claims, gazebo_claims, office_claims, auto_claims):
            claims += rows(configs)
    return claims
