# SPDX-License-Identifier: Apache-2.0
"""Key figures of runs side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any


@dataclass(frozen=True)
class Figure:
    """A row of the table: key of the metrics, name, unit, and whether the least is the best."""

    key: str
    name: str
    unit: str
    digits: int
    least_is_best: bool = False


FIGURES = (
    Figure("position_rmse_m", "position RMSE", "m", 4, True),
    Figure("position_p95_m", "95th percentile", "m", 4, True),
    Figure("position_max_m", "largest error", "m", 4, True),
    Figure("heading_rmse_deg", "heading RMSE", "deg", 3, True),
    Figure("nees_mean", "mean NEES", "", 3),
    Figure("nees_in_band", "NEES inside its band", "%", 1),
    Figure("fused", "messages fused", "%", 1),
    Figure("restarts", "restarts", "", 0),
    Figure("computing", "computing", "s", 2),
)  # fmt: skip


def compared(names: Sequence[str], metrics: Sequence[Mapping[str, Any]]) -> str:
    """Return a table of HTML: a row for each figure, a column for each run.

    `metrics` are as of ``metrics.json``.
    """
    lines = ["<tr><th></th>" + "".join(f"<th>{escape(name)}</th>" for name in names) + "</tr>"]
    for figure in FIGURES:
        values = [value_of(figure, of) for of in metrics]
        known = [value for value in values if value is not None]
        if not known:
            continue
        best = min(known) if figure.least_is_best and len(known) > 1 else None
        cells = "".join(_cell(figure, value, best) for value in values)
        unit = f" [{figure.unit}]" if figure.unit else ""
        lines.append(
            f'<tr data-figure="{figure.key}"><td>{escape(figure.name)}{unit}</td>{cells}</tr>'
        )
    return f'<div class="st-scroll"><table class="st-table">{"".join(lines)}</table></div>'


def value_of(figure: Figure, metrics: Mapping[str, Any]) -> float | None:
    """Return a figure of a run in the unit it is shown in; None if the run has none."""
    if figure.key == "fused":
        counts = metrics.get("counts") or {}
        total = sum(sum(verdicts.values()) for verdicts in counts.values())
        fused = sum(verdicts.get("fused", 0) for verdicts in counts.values())
        return 100.0 * fused / total if total else None
    if figure.key == "computing":
        rate = metrics.get("messages_per_second")
        return metrics["messages"] / rate if rate else None
    if figure.key == "restarts":
        value = (metrics.get("health") or {}).get("restarts")
    else:
        value = metrics.get(figure.key)
    if value is None:
        return None
    return float(value) * (100.0 if figure.unit == "%" else 1.0)


def _cell(figure: Figure, value: float | None, best: float | None) -> str:
    if value is None:
        return "<td>-</td>"
    kind = ' class="st-best"' if value == best else ""
    return f'<td{kind} data-value="{value!r}">{value:.{figure.digits}f}</td>'
