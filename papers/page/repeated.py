# SPDX-License-Identifier: Apache-2.0
"""What came out of repeated papers, and its file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from locfuse import __version__
from locfuse.types import ConfigError
from papers.celan2017.claims import PAPER as CELAN2017
from papers.ekim2020.claims import PAPER as EKIM2020
from papers.gadau2022.claims import PAPER as GADAU2022
from papers.wells.claims import PAPER as WELLS
from papers.zhang.claims import PAPER as ZHANG

ROWS = "papers.json"
PAPERS_IN_ORDER = (EKIM2020, WELLS, CELAN2017, GADAU2022, ZHANG)
FIVE = {paper.key: paper for paper in PAPERS_IN_ORDER}


@dataclass(frozen=True)
class Repeated:
    """What came out of one paper.

    Attributes
    ----------
    paper : str
    seeds : int
    seconds : float
        That experiments and pictures took.
    claims : list of dict
        `Claim.row` of each, in the paper's order.
    pictures : list of str
        File names beside the page.
    error : str
        Why there are no claims; empty if there are.
    """

    paper: str
    seeds: int
    seconds: float
    claims: list[dict[str, Any]]
    pictures: list[str]
    error: str = ""


def write_rows(repeated: Sequence[Repeated], file: Path, quick: bool) -> None:
    """Write what came out as JSON."""
    content = {
        "version": __version__,
        "quick": quick,
        "papers": [
            {"paper": one.paper, "seeds": one.seeds, "seconds": round(one.seconds, 1),
             "error": one.error, "claims": one.claims, "pictures": one.pictures}
            for one in repeated
        ],
    }  # fmt: skip
    file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_rows(file: Path) -> list[Repeated]:
    """Read what `write_rows` wrote.

    Raises
    ------
    ConfigError
        If the file cannot be read, or is something else.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        return [Repeated(**one) for one in content["papers"]]
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{file}: expected what `locfuse reproduce all` writes as {ROWS} "
                          f"({error})") from error  # fmt: skip
