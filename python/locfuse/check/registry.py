# SPDX-License-Identifier: Apache-2.0
"""The list of checks, and one call for all of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

from locfuse.check import rules_air as air
from locfuse.check import rules_anchors as anchors
from locfuse.check import rules_config as config_of
from locfuse.check import rules_headings as headings
from locfuse.check import rules_imu as imu
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
from locfuse.run.odometry import as_recorded, with_odometry
from locfuse.run.run import load_log
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


def _rules_of(module: ModuleType) -> Iterator[Rule]:
    """Yield the checks of a module in its order: its public functions that yield findings."""
    for name, rule in vars(module).items():
        yields = getattr(rule, "__annotations__", {}).get("return") == "Iterator[Finding]"
        if yields and not name.startswith("_"):
            yield rule


MODULES = (log_of, config_of, switch, anchors, tags, landmarks, ranges, motion, imu, headings, air)
RULES: tuple[Rule, ...] = tuple(rule for module in MODULES for rule in _rules_of(module))


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
        log = with_odometry(with_cylinders(log, config), config, gyro=False)
        log = as_recorded(log, config.history_s)
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
