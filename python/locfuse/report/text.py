# SPDX-License-Identifier: Apache-2.0
"""Numbers, names and times as text, the same in pictures and tables."""

from __future__ import annotations

from locfuse.types import NANOSECONDS, FloatArray, RunResult, StampArray

VERDICT_LABELS = {
    "fused": "fused",
    "gated": "rejected by the gate",
    "not_modelled": "not modelled",
    "ignored": "ignored",
    "stale": "before the start or too late",
    "implausible": "beyond the limits",
}


def start_ns(result: RunResult) -> int:
    """Return the stamp that pictures and tables call 0 s: the first message or estimate.

    In nanoseconds. Raises ValueError if the run has neither estimates nor messages.
    """
    firsts = [int(s.min()) for s in (result.estimate.stamp_ns, result.outcomes.stamp_ns) if len(s)]
    if not firsts:
        raise ValueError("the run has no estimate and no message; expected at least one")
    return min(firsts)


def seconds(stamp_ns: StampArray, origin_ns: int) -> FloatArray:
    """Return seconds since `origin_ns`; subtracts first, as stamps in ns exceed a double."""
    return (stamp_ns - origin_ns) / float(NANOSECONDS)


def percent(share: float) -> str:
    """Return a share as percent; never rounds to 0 or 100 % what is not."""
    if 0.0 < share < 0.001:
        return "<0.1 %"
    if 0.999 < share < 1.0:
        return ">99.9 %"
    return f"{100.0 * share:.1f} %"


def count(n: int) -> str:
    """Return a number with thousands separators."""
    return f"{int(n):,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def short(name: str) -> str:
    """Return a name, cut to the length that fits beside a marker."""
    return name if len(name) <= 24 else name[:23] + "…"
