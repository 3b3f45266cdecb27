# SPDX-License-Identifier: Apache-2.0
"""Tags of a scrubber and the switch: what is wrong with them in a log is named by the check."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import yaml

from locfuse.check import CheckResult, check
from locfuse.config.load import parse_config
from locfuse.run.run import load_log
from locfuse.types import NANOSECONDS, Columns, Log
from support_runs import CONFIGS

TAG_RULES = ("tags_in_one_place", "tags_inconsistent_with_fixes",
             "tags_inconsistent_with_ranges", "frozen_fixes",
             "silent_tags")  # fmt: skip
EIGHT = {"shape": "eight", "center_m": [40.45, 3.5], "radius_m": 1.4, "speed_mps": 0.31}
SWAPS = [
    {"front": "left", "left": "front"},
    {"left": "right", "right": "left"},
    {"front": "left", "left": "right", "right": "front"},
]
FRONT, LEFT, RIGHT = (0.5, 0.0, 1.0), (-0.4, 0.3, 1.0), (-0.4, -0.3, 1.0)


@cache
def _recorded(seed: int) -> tuple[dict[str, Any], Log]:
    """Return the ready scrubber with an RTLS in place of ranges, 40 s of an eight, and its log."""
    data = yaml.safe_load((CONFIGS / "scrubber.yaml").read_text())
    data["simulation"] |= {"duration_s": 40, "faults": [], "path": EIGHT, "ranges": None}
    tags = list(data["simulation"]["tags"])
    data["simulation"]["positions"] = {"rate_hz": 1, "sigma_xy_m": 0.12, "tags": tags}
    return data, load_log(parse_config(data), None, seed)


@cache
def _ranged(seed: int) -> tuple[dict[str, Any], Log]:
    """Return the same with the ranges of its tags, none of them behind a wall."""
    data = yaml.safe_load((CONFIGS / "scrubber.yaml").read_text())
    data["simulation"] |= {"duration_s": 40, "faults": [], "path": EIGHT}
    return data, load_log(parse_config(data), None, seed)


def checked_ranges(
    edit: Callable[[Columns], Columns] = dict, *, seed: int = 1, faults: Any = (), **settings: Any
) -> CheckResult:
    """Check the log of ranges; `edit` spoils them."""
    data, log = _ranged(seed)
    if faults:
        data = copy.deepcopy(data)
        data["simulation"]["faults"] = list(faults)
        log = load_log(parse_config(data), None, seed)
    config = {key: data[key] for key in ("start", "estimator")}
    table = edit({key: column.copy() for key, column in log["ranges"].items()})
    return check(parse_config(config),
                 replace(log, tables={**log.tables, "ranges": table}, **settings))  # fmt: skip


def checked(
    edit: Callable[[Columns], Columns] = dict, *, seed: int = 1, mcl: Any = None, **settings: Any
) -> CheckResult:
    """Check that log; `edit` spoils its positions, `settings` its log.yaml."""
    data, log = _recorded(seed)
    config = {key: data[key] for key in ("start", "estimator")}
    if mcl is not None:
        config["mcl"] = mcl
    table = edit({key: column.copy() for key, column in log["positions"].items()})
    return check(parse_config(copy.deepcopy(config)),
                 replace(log, tables={**log.tables, "positions": table}, **settings))  # fmt: skip


def said(result: CheckResult, *rules: str) -> list[str]:
    return [f"{f.severity}: {f.what}" for f in result.findings
            if f.rule in rules and f.severity != "note"]  # fmt: skip


def rows(table: Columns, chosen: Any) -> Columns:
    return {key: column[chosen] for key, column in table.items()}


def renamed(**names: str) -> Callable[[Columns], Columns]:
    def edit(table: Columns) -> Columns:
        now = [names.get(name, name) for name in table["tag"].tolist()]
        return {**table, "tag": np.array(now)}

    return edit


def stuck(*tags: str) -> Callable[[Columns], Columns]:
    """From 10 s on the position is what it was."""

    def edit(table: Columns) -> Columns:
        table = {**table, "x_m": table["x_m"].copy(), "y_m": table["y_m"].copy()}
        for tag in tags:
            mine = np.flatnonzero(table["tag"] == tag)
            late = mine[table["stamp_ns"][mine] > 10 * NANOSECONDS]
            for key in ("x_m", "y_m"):
                table[key][late] = table[key][late[0]]
        return table

    return edit


@pytest.mark.parametrize("seed", range(4))
def test_healthy_tags_give_no_alarm(seed: int) -> None:
    result = checked(seed=seed)
    assert [f.what for f in result.findings if f.severity != "note"] == []


@pytest.mark.parametrize("names", SWAPS)
def test_swapped_ids_are_named(names: dict[str, str]) -> None:
    [found] = said(checked(renamed(**names)), *TAG_RULES)
    assert found.startswith("error: ids of tags front, left, right are swapped")
    for tag, called in names.items():
        assert f"{called} is {tag}" in found


@pytest.mark.parametrize("names", SWAPS)
def test_swapped_ids_of_tags_that_only_range_are_named(names: dict[str, str]) -> None:
    [found] = said(checked_ranges(renamed(**names)), *TAG_RULES)
    assert found.startswith("error: ids of tags front, left, right are swapped")
    assert found.endswith("(ranges.csv)")
    for tag, called in names.items():
        assert f"{called} is {tag}" in found


@pytest.mark.parametrize("seed", range(2))
def test_healthy_ranges_swap_no_tags(seed: int) -> None:
    behind = {"kind": "nlos", "walls": [[37.0, 1.2, 43.9, 1.2]], "extra_m": 0.4, "sigma_m": 0.3}
    biased = {"kind": "bias", "offset_m": 0.3}
    for faults in ([], [behind], [biased]):
        assert said(checked_ranges(seed=seed, faults=faults), *TAG_RULES) == []


def test_tags_that_range_one_after_the_other_are_named_too() -> None:
    """Each tag has stamps of its own: its places are interpolated."""

    def in_turn(table: Columns) -> Columns:
        later = np.array([{"front": 0, "left": 1, "right": 2}[name] for name in table["tag"]])
        return {**renamed(left="right", right="left")(table),
                "stamp_ns": table["stamp_ns"] + later * NANOSECONDS // 50}  # fmt: skip

    [found] = said(checked_ranges(in_turn), *TAG_RULES)
    assert "left is right" in found


def test_two_tags_that_range_or_two_anchors_show_no_swap() -> None:
    swapped = renamed(left="right", right="left")
    two_tags = checked_ranges(lambda table: rows(swapped(table), table["tag"] != "front"))
    assert not said(two_tags, "tags_inconsistent_with_ranges")
    pair = ("A1", "A2")
    two_anchors = checked_ranges(lambda table: rows(swapped(table),
                                                    np.isin(table["anchor"], pair)))  # fmt: skip
    assert not said(two_anchors, "tags_inconsistent_with_ranges")


def test_ids_of_an_equilateral_triangle_are_swapped_in_one_of_three_ways() -> None:
    at = [[np.cos(turn), np.sin(turn), 1.0] for turn in np.deg2rad([0.0, 120.0, 240.0])]
    names = ["front", "left", "right"]
    data = copy.deepcopy(_recorded(1)[0])
    data["simulation"]["tags"] = dict(zip(names, at, strict=True))
    log = load_log(parse_config(data), None, 1)
    table = renamed(left="right", right="left")(log["positions"])
    config = parse_config({"start": "truth", "estimator": data["estimator"]})
    [found] = said(check(config, replace(log, tables={**log.tables, "positions": table})),
                   *TAG_RULES)  # fmt: skip
    assert "are swapped" in found
    assert "which of them is unknown" in found


@pytest.mark.parametrize(
    ("tags", "what"),
    [
        ({"front": FRONT, "left": FRONT, "right": RIGHT}, "front and left are 0 m apart in body"),
        ({"front": FRONT, "left": (0.05, 0.0, 1.0), "right": (-0.4, 0.0, 1.0)},
         "tags front, left, right are in one line on the body"),
    ],
)  # fmt: skip
def test_tags_without_a_triangle_are_named(tags: dict[str, Any], what: str) -> None:
    assert any(what in one for one in said(checked(tags=tags), "tags_in_one_place"))


def test_a_tag_measured_in_the_wrong_place_is_seen_by_the_distances_of_fixes() -> None:
    moved = {"front": (1.1, 0.0, 1.0), "left": LEFT, "right": RIGHT}
    found = said(checked(tags=moved), "tags_inconsistent_with_fixes")
    assert {one.split(" are ")[0] for one in found} == {"error: tags front and left",
                                                        "error: tags front and right"}  # fmt: skip


def test_a_frozen_position_is_named_with_when_and_how_far_the_wheels_went() -> None:
    [found] = said(checked(stuck("left")), *TAG_RULES)
    assert "the position of tag left is frozen: 30 fixes from 11 s to 40 s" in found
    assert len(said(checked(stuck("front", "left", "right")), *TAG_RULES)) == 3


def test_one_antenna_without_a_name_freezes_too() -> None:
    def alone(table: Columns) -> Columns:
        only = rows(stuck("front")(table), table["tag"] == "front")
        return {key: column for key, column in only.items() if key != "tag"}

    [found] = said(checked(alone), "frozen_fixes")
    assert "the position is frozen" in found


def test_standing_still_is_not_frozen() -> None:
    """A quantised RTLS at rest reports the same again and again."""
    _, log = _recorded(1)
    still = {key: column.copy() for key, column in log["odometry"].items()}
    for key in ("dx_m", "dy_m", "dheading_rad"):
        still[key][:] = 0.0
    log = replace(log, tables={**log.tables, "odometry": still,
                               "positions": stuck("left")(dict(log["positions"]))})  # fmt: skip
    config = parse_config({"start": "truth"})
    assert not said(check(config, log), "frozen_fixes")


@pytest.mark.parametrize(
    ("begin_s", "end_s", "duration"), [(10, 99, "to the end"), (10, 25, "for 15")]
)
def test_a_tag_that_dies_is_named_with_when(begin_s: float, end_s: float, duration: str) -> None:
    def dies(table: Columns) -> Columns:
        at = table["stamp_ns"] / NANOSECONDS
        return rows(table, (table["tag"] != "right") | (at <= begin_s) | (at >= end_s))

    [found] = said(checked(dies), *TAG_RULES)
    assert "warning: tag right is silent from 10 s" in found
    assert duration in found


def test_a_place_without_radio_is_no_dead_tag() -> None:
    def away(table: Columns) -> Columns:
        at = table["stamp_ns"] / NANOSECONDS
        return rows(table, (at <= 10.0) | (at >= 30.0))

    assert not said(checked(away), "silent_tags")


def test_fixes_of_named_tags_have_lever_arms_and_give_the_heading() -> None:
    """They once were taken for fixes of one antenna that nobody has measured."""
    text = " ".join(f.what for f in checked().findings)
    assert "nobody said otherwise" not in text
    assert "heading is unobservable" not in text
    named = rows(dict(_recorded(1)[1]["positions"]), _recorded(1)[1]["positions"]["tag"] == "left")
    text = " ".join(f.what for f in checked(lambda table: named).findings)
    assert "heading is unobservable standing still" in text, "one tag does not give it"


def test_the_start_is_compared_with_the_tag_that_was_located() -> None:
    """A start that is right was once taken for one that is off by the lever arm."""
    far = {"front": (1.5, 0.0, 1.0), "left": (0.6, 0.3, 1.0), "right": (0.6, -0.3, 1.0)}
    data = copy.deepcopy(_recorded(1)[0])
    data["simulation"]["tags"] = far
    log = load_log(parse_config(data), None, 1)
    truth = log["truth"]
    start = [float(truth["x_m"][0]), float(truth["y_m"][0]),
             float(np.rad2deg(truth["heading_rad"][0]))]  # fmt: skip
    tables = {stem: table for stem, table in log.tables.items() if stem != "truth"}
    config = parse_config({"start": start, "estimator": data["estimator"]})
    result = check(config, replace(log, tables=tables))
    assert not said(result, "start_against_the_first_metres", "heading_against_the_course")


@pytest.mark.parametrize(
    ("switch", "severity", "what"),
    [
        ({"uwb_age_s": 0.2}, "error", "UWB is received every 1 s"),
        ({"uwb_sigma_m": 0.001}, "error", "all of UWB together leaves"),
        ({"uwb_sigma_m": 0.02}, "warning", "driving UWB's filter states"),
        ({"uwb_nis": 0.01}, "error", "it would never be of use"),
        ({"uwb_nis": 0.5}, "warning", "correct UWB is rejected"),
        ({"uwb_nis": 10.0}, "error", "it would always be of use"),
        ({"doubt_s": 1e4}, "error", "the log has 40 s"),
        ({"elsewhere_m": 0.001}, "error", "take over all the time"),
        ({"elsewhere_rad": 0.001}, "error", "take over all the time"),
        ({"elsewhere_m": 60.0}, "error", "they will never be in doubt"),
        ({"elsewhere_rad": 3.2}, "error", "they will never be in doubt"),
        ({"sigma_unsure_rad": 2.0}, "error", "they will never be in doubt"),
        ({}, "", ""),
    ],
)
def test_a_threshold_of_the_switch_that_never_or_always_acts_is_refused(
    switch: dict[str, float], severity: str, what: str
) -> None:
    found = said(checked(mcl={"switch": switch}), "ineffective_switch")
    assert [one.split(":")[0] for one in found] == ([severity] if severity else [])
    assert all(what in one for one in found)
