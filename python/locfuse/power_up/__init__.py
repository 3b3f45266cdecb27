# SPDX-License-Identifier: Apache-2.0
"""ekim2020, sections 2.2 and 3.1: SR-LS, the heading search and what a start is worth."""

from __future__ import annotations

from pathlib import Path

from locfuse.claims import Claim, share
from locfuse.power_up.gazebo import HeadingErrors, gazebo_claims, heading_errors
from locfuse.power_up.office import office_claims
from locfuse.power_up.pictures import draw_pictures, square_room
from locfuse.power_up.runs import auto_claims, bad_starts
from locfuse.power_up.scans import PowerUps, power_ups, refined_errors
from locfuse.power_up.simulated import (
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
from locfuse.power_up.sites import epochs, site_claims

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
