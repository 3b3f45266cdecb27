# SPDX-License-Identifier: Apache-2.0
"""The key figures at the head of a report."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from locfuse.eval.consistency import band
from locfuse.eval.readiness import WRONG_M
from locfuse.eval.trust import sentence, shares, was_lost
from locfuse.report.text import count, percent
from locfuse.types import Health, RunResult

_MIN_IN_BAND = 0.90  # share of stamps; below 95 %, as errors of neighbouring stamps correlate


def cards(result: RunResult) -> str:
    """Return the key figures of a run as HTML."""
    metrics = result.metrics
    counts = counts_of(result)
    total = sum(sum(verdicts.values()) for verdicts in counts.values())
    fused = sum(verdicts.get("fused", 0) for verdicts in counts.values())
    shown: list[str] = []
    for key, unit, text in (
        ("position_rmse_m", "m", "position RMSE"),
        ("position_p95_m", "m", "position error, 95th percentile"),
        ("position_max_m", "m", "largest position error"),
        ("heading_rmse_deg", "deg", "heading RMSE"),
        ("height_rmse_m", "m", "height RMSE"),
        ("roll_rmse_deg", "deg", "roll RMSE"),
        ("pitch_rmse_deg", "deg", "pitch RMSE"),
    ):
        if metrics.get(key) is not None:
            shown.append(_card(_number(metrics[key], unit), text))
    if metrics.get("nees_mean") is not None:
        shown.append(_nees_card(metrics))
    if result.health is not None and len(result.health):
        shown.append(_health_card(result.health, "of the time ok"))
    if result.watched is not None and len(result.watched):
        shown.append(_health_card(result.watched, "of the time watched poses were ok"))
    if metrics.get("mcl") is not None:
        shown += _mcl_cards(metrics["mcl"])
    if metrics.get("mapping") is not None:
        shown.append(_card(count(metrics["mapping"]["landmarks"]), "landmarks in the map"))
        if metrics["mapping"]["rmse_m"] is not None:
            shown.append(_card(_number(metrics["mapping"]["rmse_m"], "m"), "landmark RMSE"))
    share = f" ({percent(fused / total)})" if total else ""
    shown.append(_card(count(fused), f"messages fused of {count(total)}{share}"))
    if metrics.get("messages_per_second") is not None:
        rate = count(round(float(metrics["messages_per_second"])))
        shown.append(_card(rate, "messages per second of computing"))
    if metrics.get("duration_s") is not None:
        shown.append(_card(_number(metrics["duration_s"], "s"), "length of the recording"))
    return '<div class="cards">\n' + "\n".join(shown) + "\n</div>"


def _health_card(health: Health, text: str) -> str:
    share = shares(health).get("ok", 0.0)
    good = health.state[-1] == "ok" and not was_lost(health)
    word = "lost at times" if was_lost(health) else str(health.state[-1]).replace("_", " ")
    verdict = f'<span class="{"good" if good else "bad"}">{"ok" if good else word}</span>'
    return _card(percent(share), f"{text}; {sentence(health)}", verdict)


def _nees_card(metrics: Mapping[str, Any]) -> str:
    mean, dof = float(metrics["nees_mean"]), int(metrics["nees_dof"])
    share = float(metrics["nees_in_band"])
    low, high = band(dof)
    if low <= mean <= high and share >= _MIN_IN_BAND:
        verdict = '<span class="good">consistent</span>'
    elif mean > dof:
        verdict = '<span class="bad">over-confident</span>'
    else:
        verdict = '<span class="bad">too cautious</span>'
    text = (
        f"mean NEES, expected {dof}; {percent(share)} of stamps inside their 95 % band "
        f"{low:.2g} to {high:.2g}"
    )
    return _card(f"{mean:.3g}", text, verdict)


def _mcl_cards(mcl: Mapping[str, Any]) -> list[str]:
    until = "never" if mcl["ready_s"] is None else _number(mcl["ready_s"], "s")
    cards = [
        _card(percent(mcl["ready_share"]), "time ready: one place on the map is certain"),
        _card(until, "until it was ready"),
    ]
    wrong = mcl["ready_and_wrong_share"]
    if wrong is not None:
        verdict = '<span class="bad">wrong</span>' if wrong else '<span class="good">never</span>'
        text = f"of the time ready, more than {WRONG_M:g} m off"
        cards.append(_card(percent(wrong), text, verdict))
    cards.append(_card(count(round(mcl["particles_median"])), "particles (median)"))
    return cards


def _card(value: str, text: str, note: str = "") -> str:
    text = escape(text.replace(" %", "\N{NO-BREAK SPACE}%"))
    return f'<div class="card"><b>{escape(value)}</b><span>{text}</span>{note}</div>'


def counts_of(result: RunResult) -> Mapping[str, Mapping[str, int]]:
    """Return how many messages of each source had each verdict."""
    return result.metrics.get("counts") or {}


def _number(value: float, unit: str) -> str:
    """Return a figure with three significant digits, and no exponent in the usual range."""
    magnitude = abs(float(value))
    digits = 0 if magnitude >= 100 else 1 if magnitude >= 10 else 2 if magnitude >= 1 else 3
    return f"{float(value):.{digits}f} {unit}"
