# SPDX-License-Identifier: Apache-2.0
"""What is not as it was another time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from papers.claims import INTERVAL
from papers.page.cells import figure_of
from papers.page.repeated import Repeated

UNSTABLE_UNITS = ("ms", "us", "s/s")  # of the machine, not of the method
RATES = ("1/h",)  # rare events: a few hours hold none or one
EXACT = 0.05  # of a figure that no seed changes, by which processors and libraries may move it


def differences(before: Sequence[Repeated], now: Sequence[Repeated]) -> list[str]:
    """Return what is not as it was: one sentence for each row.

    That is a figure outside of its spread, a requirement that was met and is missed, a row that was
    not there before or is not there any more, and a paper that failed. The median of now has to lie
    in the spread over seeds of before, or the other way round; a figure that no seed changes may
    move by a twentieth. A mean NEES and what is rare have to be met again if they were. Figures of
    speed are of the machine. A share of few seeds says as much as its interval: what it requires is
    compared where there are as many seeds.
    """
    seeds = {one.paper: one.seeds for one in before}
    failed = {one.paper for one in now if one.error}
    was = {row["id"]: row for one in before if one.paper not in failed for row in one.claims}
    found = [f"{one.paper}: {one.error}" for one in now if one.error]
    for one in now:
        for row in one.claims:
            old = was.pop(row["id"], None)
            if old is None:
                found.append(f"{row['id']}: was not there; it is {figure_of(row)}")
            elif said := _difference(old, row, one.seeds == seeds.get(one.paper)):
                found.append(f"{row['id']}: {said}")
    return found + [f"{id}: not there any more" for id in was]


def _difference(was: Mapping[str, Any], row: Mapping[str, Any], as_many_seeds: bool) -> str:
    """Return what is not as it was, empty if nothing is."""
    comparable = not _of_speed(was) and (as_many_seeds or not row["note"].endswith(INTERVAL))
    if comparable and was["met"] is not False and row["met"] is False:
        return f"required {row['required']}, is missed: {figure_of(row)}, was {figure_of(was)}"
    return "" if _agree(was, row) else f"was {figure_of(was)}, is {figure_of(row)}"


def _of_speed(row: Mapping[str, Any]) -> bool:
    return row["unit"] in UNSTABLE_UNITS or row["id"].endswith("_speed")


def _agree(was: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    if was["id"].endswith("_nees") or was["unit"] in RATES:
        return bool(row["met"]) or not was["met"]  # what is required goes by the number of seeds
    if _of_speed(was) or was["ours_median"] is None or row["ours_median"] is None:
        return True
    return _inside(row["ours_median"], was) or _inside(was["ours_median"], row)


def _inside(value: float, row: Mapping[str, Any]) -> bool:
    slack = EXACT * max(abs(row["ours_median"]), 1e-12)
    return bool(row["ours_low"] - slack <= value <= row["ours_high"] + slack)
