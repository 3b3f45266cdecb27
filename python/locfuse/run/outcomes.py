# SPDX-License-Identifier: Apache-2.0
"""Outcome of each message of a run, with a reason where it was not fused."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.schema import RunConfig, ignored_by
from locfuse.run.mcl import Localization
from locfuse.run.messages import Messages
from locfuse.types import Log, Outcomes, StampArray

# What a message of a source can exceed.
IMPLAUSIBLE = {
    "odometry": "faster than limits.speed_mps or limits.turn_rate_radps",
    "ranges": "longer than limits.range_m",
    "landmark_sightings": "longer than limits.range_m",
    **dict.fromkeys(("positions", "poses", "altitudes"),
                    "farther from the origin than limits.distance_m"),
}  # fmt: skip
VERDICTS = np.array([verdict.name.lower() for verdict in _core.Verdict])


def outcomes_of(
    messages: Messages,
    record: _core.RunLog,
    log: Log,
    config: RunConfig,
    start_ns: int,
    used_until: int | None = None,
) -> Outcomes:
    """Return the verdicts of an EKF that started at `start_ns`.

    What takes effect up to `used_until` [ns] was used to find the start.
    """
    verdict = VERDICTS[record.verdict]
    nis, dof = record.nis, record.dof
    of_tags = config.estimator.filter == "tag_triangle"
    reason = _reasons(messages, verdict, log, is_of_tags=of_tags)
    for row in np.flatnonzero(verdict == "gated"):
        limit = record.limit[row]
        if nis[row] > limit:
            reason[row] = f"nis {nis[row]:.4g} > {limit:.4g}"
        elif messages.source[row] == "ranges":
            reason[row] = f"left out: anchor {messages.anchor[row]} is likely wrong as a whole"
        else:
            reason[row] = "ambiguous: too near a landmark for a new one"
    _explain_conditioning(reason, verdict, record)
    late = _explain_stale(reason, verdict, messages.stamp_ns, start_ns, config)
    if record.dropped_messages:
        reason[late] += f" or {config.history_messages} messages"
    used = (
        np.zeros(len(reason), bool) if used_until is None else messages.effective_ns <= used_until
    )
    reason[(verdict == "ignored") & ~used] = "source disabled"
    for source, why in ignored_by(config.estimator).items():
        unused = np.isin(verdict, ("ignored", "not_modelled"))
        reason[unused & (messages.source == source)] = why
    for row in np.flatnonzero(record.interventions):
        reason[row] = f"variances put back into their bounds: {record.interventions[row]}"
    return Outcomes(
        stamp_ns=messages.stamp_ns,
        source=messages.source,
        tag=messages.tag,
        anchor=messages.anchor,
        verdict=verdict,
        nis=nis,
        dof=dof,
        log_likelihood=record.log_likelihood,
        residual=record.residual,
        reason=reason.astype(str),
    )


def outcomes_of_mcl(localization: Localization, log: Log, config: RunConfig) -> Outcomes:
    """Return the verdicts of an `Mcl` on messages and scans, in order of arrival."""
    messages = localization.messages
    verdict = VERDICTS[localization.verdict]
    reason = _reasons(messages, verdict, log)
    _explain_conditioning(reason, verdict, localization)
    _explain_stale(reason, verdict, messages.stamp_ns, localization.begin_ns, config)
    outcomes = _bare(messages.stamp_ns, messages.source, messages.tag, messages.anchor, verdict,
                     reason)  # fmt: skip
    return with_scans(outcomes, localization, log, config)


def _explain_stale(
    reason: NDArray[np.object_],
    verdict: NDArray[np.str_],
    stamp_ns: StampArray,
    begin_ns: int,
    config: RunConfig,
) -> NDArray[np.bool_]:
    """Write why messages are stale; return which of them came too late."""
    stale, early = verdict == "stale", stamp_ns < begin_ns
    late: NDArray[np.bool_] = stale & ~early
    reason[stale & early] = "before the start"
    reason[late] = f"older than the history of {config.history_s:g} s"
    return late


def _explain_conditioning(
    reason: NDArray[np.object_], verdict: NDArray[np.str_], record: _core.RunLog | Localization
) -> None:
    for row in np.flatnonzero((verdict == "implausible") & (record.limit > 0.0)):
        off = record.residual[row]
        what = (
            f"jumped {off:.3g} m from the last fix," if off > 0.0 else "frozen, while the tag moved"
        )
        reason[row] = f"tag_conditioner: {what} more than {record.limit[row]:.3g} m"


def with_switches(outcomes: Outcomes, localization: Localization) -> Outcomes:
    """Return outcomes with a row for each time that UWB took over from scans."""
    count = len(localization.injections)
    empty = np.full(count, "")
    reason = [
        f"{one.reason.name.lower()}: covariance before {_upper(one.before)}, after "
        f"{_upper(one.after)}"
        for one in localization.injections
    ]
    stamps = np.array([one.stamp for one in localization.injections], dtype=np.int64)
    switches = _bare(stamps, np.full(count, "switch"), empty, empty, np.full(count, "fused"),
                     np.array(reason, dtype=object))  # fmt: skip
    return _with(outcomes, switches)


def _upper(estimate: _core.PoseEstimate) -> str:
    """Return the upper triangle of a covariance of (x, y, heading), row by row."""
    numbers = " ".join(f"{value:.3g}" for value in estimate.covariance[np.triu_indices(3)])
    return f"[{numbers}]"


def with_scans(
    outcomes: Outcomes, localization: Localization, log: Log, config: RunConfig
) -> Outcomes:
    """Return outcomes with a row for each scan, which comes after all messages up to its stamp."""
    stamp = log["scans"]["stamp_ns"]
    verdict = VERDICTS[localization.scan_verdict]
    reason = np.full(len(stamp), "", dtype=object)
    reason[verdict == "not_modelled"] = "no news: hardly moved, or no returns"
    _explain_stale(reason, verdict, stamp, localization.begin_ns, config)
    empty = np.full(len(stamp), "")
    return _with(outcomes, _bare(stamp, np.full(len(stamp), "scans"), empty, empty, verdict,
                                 reason))  # fmt: skip


def _with(outcomes: Outcomes, others: Outcomes) -> Outcomes:
    """Return outcomes with rows of others, each after all up to its stamp."""
    received = np.maximum.accumulate(outcomes.stamp_ns)
    order = np.argsort(np.concatenate([received, others.stamp_ns]), kind="stable")
    columns = {field.name: [getattr(part, field.name) for part in (outcomes, others)]
               for field in fields(Outcomes)}  # fmt: skip
    return Outcomes(**{name: np.concatenate(parts)[order] for name, parts in columns.items()})


def _reasons(
    messages: Messages, verdict: NDArray[np.str_], log: Log, *, is_of_tags: bool = False
) -> NDArray[np.object_]:
    """Return the reasons that hardly depend on the estimator."""
    reason = np.full(len(verdict), "", dtype=object)
    placed = set(log["anchors"]["anchor"].tolist()) if "anchors" in log else set()
    for row in np.flatnonzero(verdict == "not_modelled"):
        if messages.source[row] == "landmark_sightings":
            reason[row] = _why_nothing_is_seen(str(messages.anchor[row]), log)
        elif messages.source[row] == "positions" and messages.tag[row] not in ("", *log.tags):
            reason[row] = f"unknown tag {messages.tag[row]}"
        elif messages.source[row] == "positions" and is_of_tags and messages.tag[row] == "":
            reason[row] = "names no tag, and tag_triangle fuses positions of tags"
        elif messages.source[row] == "altitudes":
            reason[row] = "the estimator has no height"
        elif messages.source[row] == "odometry":
            reason[row] = "a motion without duration has no velocity"
        elif messages.source[row] in ("positions", "poses"):
            kind = str(messages.source[row])[:-1]
            reason[row] = f"has no usable sigma; set estimator.{kind}.sigma_m"
        elif messages.anchor[row] not in placed:
            reason[row] = f"unknown anchor {messages.anchor[row]}"
        elif messages.tag[row] not in log.tags:
            reason[row] = f"unknown tag {messages.tag[row]}"
        else:
            reason[row] = "tag on the anchor: no direction"
    for row in np.flatnonzero(verdict == "implausible"):
        reason[row] = IMPLAUSIBLE[str(messages.source[row])]
    if "slipped" in log.tables.get("odometry", {}):
        driven = np.flatnonzero(messages.source == "odometry")
        slips = driven[log["odometry"]["slipped"][messages.row[driven]]]
        reason[slips] = "wheels slip, by the gyro: its turn counts, and the way less"
    reason[verdict == "ignored"] = "used for the start"
    return reason


def _why_nothing_is_seen(landmark: str, log: Log) -> str:
    """Return why a sighting of a landmark, or one without a name, fits no model."""
    if "landmarks" not in log:
        return "not mapped: range or bearing is missing, or there are max_landmarks"
    if landmark and landmark not in log["landmarks"]["landmark"]:
        return f"unknown landmark {landmark}"
    return f"landmark {landmark}".strip() + " at the sensor: no direction"


def _bare(
    stamp_ns: StampArray,
    source: NDArray[np.str_],
    tag: NDArray[np.str_],
    anchor: NDArray[np.str_],
    verdict: NDArray[np.str_],
    reason: NDArray[np.object_],
) -> Outcomes:
    """Return outcomes where nothing was compared with a prediction."""
    nothing = np.full(len(stamp_ns), np.nan)
    return Outcomes(
        stamp_ns=stamp_ns,
        source=source,
        tag=tag,
        anchor=anchor,
        verdict=verdict,
        nis=nothing,
        dof=np.zeros(len(stamp_ns), np.int64),
        log_likelihood=nothing,
        residual=nothing,
        reason=reason.astype(str),
    )
