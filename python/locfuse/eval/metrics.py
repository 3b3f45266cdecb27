# SPDX-License-Identifier: Apache-2.0
"""What ``metrics.json`` says of a run."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from locfuse.eval.consistency import share_in_band
from locfuse.eval.errors import LONGEST_GAP_S, errors_against
from locfuse.types import Outcomes, Trajectory


def metrics(
    estimate: Trajectory,
    truth: Trajectory | None,
    outcomes: Outcomes,
    duration_s: float,
    wall_s: float,
) -> dict[str, Any]:
    """Sum up a run in numbers.

    `estimate` has heading and covariance; truth is interpolated to its stamps, and nothing is
    aligned. `duration_s` is that of the log, `wall_s` what the filter took.

    The result is ready for JSON. Errors are None without truth. ``nees_in_band`` is the share of
    stamps whose NEES lies inside the two-sided 95 % band, ``nis_mean`` is over fused messages,
    ``rejected`` counts gated ranges by anchor.
    """
    sources = sorted(set(outcomes.source.tolist()))
    return {
        **_accuracy(estimate, truth),
        "nis_mean": {source: _nis_mean(outcomes, source) for source in sources
                     if np.any(outcomes.dof[outcomes.source == source] > 0)},
        "counts": {source: _counts(outcomes, source) for source in sources},
        "rejected": _rejected(outcomes),
        "duration_s": duration_s,
        "messages": len(outcomes),
        "messages_per_second": len(outcomes) / wall_s if wall_s > 0.0 else None,
    }  # fmt: skip


def _accuracy(estimate: Trajectory, truth: Trajectory | None) -> dict[str, Any]:
    keys = ("position_rmse_m", "position_p95_m", "position_max_m", "heading_rmse_deg",
            "nees_mean", "nees_dof", "nees_in_band")  # fmt: skip
    values: dict[str, Any] = dict.fromkeys(keys)
    if truth is None or len(truth) == 0:
        return {**values, "truth": "The log has no truth, so errors are unknown."}
    errors = errors_against(estimate, truth)
    if len(errors) == 0:
        return {**values, "truth": "Truth and estimate do not overlap in time."}
    distance = np.hypot(*errors.position.T)
    values["position_rmse_m"] = math.sqrt(float(np.mean(distance**2)))
    values["position_p95_m"] = float(np.percentile(distance, 95))
    values["position_max_m"] = float(distance.max())
    if errors.heading is not None:
        rms = math.sqrt(float(np.mean(errors.heading**2)))
        values["heading_rmse_deg"] = math.degrees(rms)
    if errors.nees is not None:
        values["nees_mean"] = float(np.mean(errors.nees))
        values["nees_dof"] = errors.dof
        values["nees_in_band"] = share_in_band(errors.nees, errors.dof)
    if errors.height is not None:
        values["height_rmse_m"] = math.sqrt(float(np.mean(errors.height**2)))
    if errors.rotation is not None:
        for name, angle in zip(("roll", "pitch"), errors.rotation.T[:2], strict=True):
            values[f"{name}_rmse_deg"] = math.degrees(math.sqrt(float(np.mean(angle**2))))
    values["truth"] = (
        f"Compared at {len(errors)} of {len(estimate)} stamps of the estimate; truth was "
        f"interpolated over gaps of up to {LONGEST_GAP_S:g} s and nothing was aligned."
    )
    return values


def _nis_mean(outcomes: Outcomes, source: str) -> float | None:
    fused = (outcomes.source == source) & (outcomes.verdict == "fused") & (outcomes.dof > 0)
    return float(np.mean(outcomes.nis[fused])) if np.any(fused) else None


def _counts(outcomes: Outcomes, source: str) -> dict[str, int]:
    verdicts, counts = np.unique(outcomes.verdict[outcomes.source == source], return_counts=True)
    return dict(zip(verdicts.tolist(), counts.tolist(), strict=True))


def _rejected(outcomes: Outcomes) -> dict[str, dict[str, Any]]:
    rejected = {}
    for anchor in sorted(set(outcomes.anchor[outcomes.source == "ranges"].tolist())):
        of_anchor = (outcomes.source == "ranges") & (outcomes.anchor == anchor)
        gated = int(np.count_nonzero(of_anchor & (outcomes.verdict == "gated")))
        share = gated / int(np.count_nonzero(of_anchor))
        rejected[anchor] = {"count": gated, "share": share}
    return rejected
