# SPDX-License-Identifier: Apache-2.0
"""What a check says: how bad, what, where, what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Severity: TypeAlias = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """One thing that a check found.

    `severity` ``error``: the run fails or is wrong; ``warning``: it is probably worse than it need
    be; ``note``: worth knowing, no fault. `what` is one sentence with the numbers, `where` a key of
    the configuration or a file of the log, `advice` what to do, empty for notes that ask for
    nothing, `rule` the name of the check, as in docs/check.md.
    """

    severity: Severity
    what: str
    where: str
    advice: str = ""
    rule: str = ""


def error(what: str, where: str, advice: str) -> Finding:
    """Return a finding with which the run fails or is wrong."""
    return Finding("error", what, where, advice)


def warning(what: str, where: str, advice: str) -> Finding:
    """Return a finding with which the run is probably worse than it need be."""
    return Finding("warning", what, where, advice)


def note(what: str, where: str, advice: str = "") -> Finding:
    """Return a finding that is no fault."""
    return Finding("note", what, where, advice)
