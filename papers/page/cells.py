# SPDX-License-Identifier: Apache-2.0
"""Rows as text, for every table of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

HEAD = ("claim", "paper", "ours", "required", "met", "note")
OURS = "Ours: what no claim of the paper asks for"


def cells_of(row: Mapping[str, Any]) -> list[str]:
    """Return a claim as text: with its unit, paper's figure, ours, required, met, note."""
    unit = "" if row["unit"] == "1" else f" [{row['unit']}]"
    paper = "-" if row["paper"] is None else f"{row['paper']:g}"
    met = {True: "yes" if row["required"] != "-" else "-", False: "NO", None: "-"}[row["met"]]
    return [row["claim"] + unit, paper, figure_of(row), row["required"], met, row["note"]]


def figure_of(row: Mapping[str, Any]) -> str:
    """Return our figure with its spread, three digits each."""
    median, low, high = row["ours_median"], row["ours_low"], row["ours_high"]
    if median is None:
        return "skipped"
    if math.isclose(low, high):
        return f"{median:.3g}"
    return f"{median:.3g} [{low:.3g}..{high:.3g}]"
