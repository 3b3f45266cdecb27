# SPDX-License-Identifier: Apache-2.0
"""The list of checks, and one call for all of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from locfuse.check import rules_anchors as anchors
from locfuse.check import rules_config as config_of
from locfuse.check import rules_landmarks as landmarks
from locfuse.check import rules_log as log_of
from locfuse.check import rules_motion as motion
from locfuse.check import rules_ranges as ranges
from locfuse.check import rules_switch as switch
from locfuse.check import rules_tags as tags
from locfuse.check.context import Context
from locfuse.check.finding import SEVERITIES, Finding, error
from locfuse.check.layout import Layout, layout_of
from locfuse.config.schema import RunConfig
from locfuse.run.cylinders import with_cylinders
from locfuse.run.run import load_log
from locfuse.types import ConfigError, Log, LogError

Rule: TypeAlias = Callable[[Context], Iterator[Finding]]

RULES: tuple[Rule, ...] = (
    log_of.what_a_run_would_refuse,
    log_of.sources_without_messages,
    log_of.messages_without_use,
    log_of.names_that_do_not_match,
    log_of.rates_and_gaps,
    log_of.messages_too_late,
    log_of.rows_told_twice,
    log_of.coordinates_of_a_projection,
    log_of.angles_in_degrees,
    log_of.maps_that_help_nobody,
    config_of.gates_that_cannot_bind,
    config_of.sigmas_that_say_nothing,
    config_of.sigma_of_the_config_is_not_used,
    config_of.anchors_named_in_vain,
    config_of.lever_arms_that_are_zero,
    config_of.start_that_cannot_be_meant,
    switch.switch_that_never_or_always_acts,
    anchors.anchors_in_one_place,
    anchors.anchors_in_one_line,
    anchors.anchors_in_one_plane,
    anchors.tags_on_the_floor,
    anchors.states_that_nothing_tells,
    anchors.geometry_where_the_robot_is,
    anchors.floors_that_do_not_hold_the_start,
    tags.tags_in_one_place,
    tags.tags_that_do_not_fit_their_fixes,
    tags.tags_that_do_not_fit_their_ranges,
    tags.fixes_that_are_frozen,
    tags.tags_that_fall_silent,
    landmarks.landmarks_in_one_place,
    landmarks.landmark_names_that_do_not_match,
    landmarks.states_that_few_landmarks_leave_open,
    landmarks.landmarks_that_look_alike,
    landmarks.cylinders_that_are_hardly_found,
    landmarks.radii_that_do_not_match,
    ranges.units_of_ranges,
    ranges.ranges_that_cannot_be,
    ranges.anchors_swapped,
    ranges.ranges_with_a_common_error,
    ranges.anchors_with_an_error_of_their_own,
    ranges.outliers_by_anchor,
    ranges.sigma_against_the_scatter,
    ranges.height_that_the_ranges_want,
    ranges.frame_of_the_truth,
    ranges.clock_of_the_ranges,
    ranges.precision_to_expect,
    motion.sense_of_turns,
    motion.scale_of_the_odometry,
    motion.heading_against_the_course,
    motion.clock_of_the_odometry,
    motion.start_against_the_first_metres,
)


@dataclass(frozen=True)
class CheckResult:
    """What a check found.

    Attributes
    ----------
    findings : list of Finding
        Errors first, then warnings, then notes.
    layout : Layout or None
        Dilution of precision over the floor; None without ranges and anchors.
    """

    findings: list[Finding]
    layout: Layout | None

    @property
    def failed(self) -> bool:
        """Whether an error was found."""
        return any(finding.severity == "error" for finding in self.findings)


def check(config: RunConfig, log: Log | None = None, *, base: Path | None = None) -> CheckResult:
    """Say what is wrong with a configuration and its log before anything is run.

    Parameters
    ----------
    config : RunConfig
    log : Log, optional
        Instead of what the configuration names.
    base : Path, optional
        Folder that the configuration's paths are relative to.

    Returns
    -------
    CheckResult
        A log that cannot be read is a finding too.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> config = parse_config({"simulation": {"duration_s": 20}, "use": ["ranges"]})
    >>> [f.what.split(":")[0] for f in check(config).findings if f.severity == "warning"]
    ['heading is unobservable']
    """
    try:
        log = load_log(config, base, config.seed) if log is None else log
        log = with_cylinders(log, config)
    except LogError as problem:
        return CheckResult([_unreadable(problem, "log")], None)
    except ConfigError as problem:
        return CheckResult([_unreadable(problem, "config")], None)
    context = Context(config, log)
    found = [replace(finding, rule=rule.__name__) for rule in RULES for finding in rule(context)]
    if log.origin == "bag":
        found = [_of_bag(finding) for finding in found]
    found.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    return CheckResult(found, layout_of(context))


def _of_bag(finding: Finding) -> Finding:
    """Return a finding that speaks of tables by their names: a bag has no files of them."""
    what, where, advice = (re.sub(r"\b(\w+)\.csv\b", r"\1", text)
                           for text in (finding.what, finding.where, finding.advice))  # fmt: skip
    return replace(finding, what=what, where=where, advice=advice)


def _unreadable(problem: ValueError, where: str) -> Finding:
    return replace(error(str(problem), where, "nothing else was checked"), rule="log_that_is_there")
