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
from locfuse.run.scan_odometry import with_scan_odometry
from locfuse.types import ConfigError, Log, LogError

Rule: TypeAlias = Callable[[Context], Iterator[Finding]]

# Those that take the height of a tag for known: not of what flies.
PLANAR: tuple[Rule, ...] = (
    tags.tags_inconsistent_with_ranges,
    ranges.anchors_swapped,
    ranges.ranges_with_a_common_error,
    ranges.anchor_errors,
    ranges.outliers_by_anchor,
    ranges.sigma_against_the_scatter,
    ranges.tag_height_mismatch,
)
RULES: tuple[Rule, ...] = (
    log_of.run_errors,
    log_of.sources_without_messages,
    log_of.messages_without_use,
    log_of.unknown_names,
    log_of.rates_and_gaps,
    log_of.messages_too_late,
    log_of.units_of_stamps,
    log_of.duplicate_rows,
    log_of.coordinates_of_a_projection,
    log_of.angles_in_degrees,
    log_of.unused_maps,
    config_of.ineffective_gates,
    config_of.implausible_sigmas,
    config_of.unused_config_sigma,
    config_of.unknown_anchors,
    config_of.zero_lever_arms,
    config_of.implausible_start,
    switch.ineffective_switch,
    anchors.anchors_in_one_place,
    anchors.anchors_in_one_line,
    anchors.anchors_in_one_plane,
    anchors.tags_on_the_floor,
    anchors.unobservable_states,
    anchors.geometry_where_the_robot_is,
    anchors.start_outside_floors,
    tags.tags_in_one_place,
    tags.tags_inconsistent_with_fixes,
    tags.tags_inconsistent_with_ranges,
    tags.frozen_fixes,
    tags.silent_tags,
    landmarks.landmarks_in_one_place,
    landmarks.unknown_landmarks,
    landmarks.too_few_landmarks,
    landmarks.ambiguous_landmarks,
    landmarks.undetected_cylinders,
    landmarks.mismatched_radii,
    ranges.units_of_ranges,
    ranges.invalid_ranges,
    ranges.anchors_swapped,
    ranges.ranges_with_a_common_error,
    ranges.anchor_errors,
    ranges.outliers_by_anchor,
    ranges.sigma_against_the_scatter,
    ranges.tag_height_mismatch,
    ranges.frame_of_the_truth,
    ranges.clock_of_the_ranges,
    ranges.precision_to_expect,
    motion.turn_direction,
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
        log = with_scan_odometry(with_cylinders(log, config), config)
    except LogError as problem:
        return CheckResult([_unreadable(problem, "log")], None)
    except ConfigError as problem:
        return CheckResult([_unreadable(problem, "config")], None)
    context = Context(config, log)
    is_flying = config.estimator.kind == "air" and config.mcl is None
    rules = [rule for rule in RULES if not (is_flying and rule in PLANAR)]
    found = [replace(finding, rule=rule.__name__) for rule in rules for finding in rule(context)]
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
