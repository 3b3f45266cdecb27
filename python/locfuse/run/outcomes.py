# SPDX-License-Identifier: Apache-2.0
"""Outcome of each message of a run, with a reason where it was not fused."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.schema import RunConfig, ignored_by
from locfuse.run.mcl import Localization, columns_of
from locfuse.run.messages import Messages
from locfuse.types import Columns, Log, Outcomes, StampArray

VERDICTS = np.array([verdict.name.lower() for verdict in _core.Verdict])
REASONS = np.array([reason.name.lower() for reason in _core.Reason])
# Sentences for reasons of the core; those of one source alone stand behind a slash.
SENTENCES = {
    "unlikely": "nis {nis:.4g} > {limit:.4g}",
    "unlikely/landmark_sightings": "fits no landmark",
    "source_excluded": "left out: anchor {anchor} is likely wrong as a whole",
    "source_excluded/positions": "left out: the receiver is likely wrong as a whole",
    "ambiguous": "ambiguous: too near a landmark for a new one",
    "beyond_limits": "farther from the origin than limits.distance_m",
    "beyond_limits/imu": "turns faster than limits.turn_rate_radps, or begins with a force that is "
                         "no gravity; expected m/s^2, gravity included",
    "beyond_limits/odometry": "faster than limits.speed_mps or limits.turn_rate_radps",
    "beyond_limits/ranges": "longer than limits.range_m",
    "beyond_limits/landmark_sightings": "longer than limits.range_m",
    "frozen": "frozen: the same again, while the robot moved",
    "frozen/positions": "tag_conditioner: frozen, while the tag moved more than {limit:.3g} m",
    "jumped": "tag_conditioner: jumped {residual:.3g} m from the last fix, "
              "more than {limit:.3g} m",
    "jumped/imu": "leaps alone, by more than 100 m/s^2 or 10 rad/s",
    "before_estimate": "before the start",
    "too_late": "older than the history of {history}",
    "too_far_ahead": "stamped long after all before it; waits for another that agrees",
    "switched_off": "source disabled",
    "not_started": "the start is still searched for",
    "waits": "kept until ranges tell several places in space apart",
    "not_used": "the estimator does not fuse {source}",
    "not_used/imu": "measures no force: is there an accelerometer?",
    "not_used/altitudes": "the estimator has no height",
    "unknown_anchor": "unknown anchor {anchor}",
    "unknown_tag": "unknown tag {tag}",
    "unknown_landmark": "unknown landmark {anchor}",
    "unnamed": "names no landmark",
    "unnamed/positions": "names no tag, and tag_triangle fuses positions of tags",
    "no_direction": "tag on the anchor: no direction",
    "no_direction/headings": "a course at rest, or without odometry, says no heading",
    "no_direction/odometry": "the tags do not say which way the body points",
    "no_direction/landmark_sightings": "landmark {anchor} at the sensor: no direction",
    "no_sigma": "has no usable sigma; set estimator.{kind}.sigma_m",
    "no_duration": "a motion without duration has no velocity",
    "incomplete": "not mapped: range or bearing is missing",
    "map_full": "not mapped: there are max_landmarks",
    "no_news": "no news: hardly moved",
    "no_returns": "no returns",
    "covered": "something covers the laser",
    "numerical": "leaves no finite result",
    "replaced": "made again after a late message",
    "watched": "judged by the estimate, not fused",
}  # fmt: skip


def outcomes_of(messages: Messages, record: _core.RunLog, log: Log, config: RunConfig) -> Outcomes:
    """Return what became of the messages of an EKF."""
    columns = columns_of(record)
    reason = _sentences(messages, columns, log, config, record.dropped_messages)
    for row in np.flatnonzero(record.interventions):
        reason[row] = f"variances put back into their bounds: {record.interventions[row]}"
    return _outcomes(messages, columns, reason)


def outcomes_of_mcl(localization: Localization, log: Log, config: RunConfig) -> Outcomes:
    """Return what became of messages and scans of an `Mcl`, in order of arrival."""
    messages, columns = localization.messages, localization.outcomes
    outcomes = _outcomes(messages, columns, _sentences(messages, columns, log, config))
    return with_scans(outcomes, localization, log, config)


def _outcomes(messages: Messages, columns: Columns, reason: NDArray[np.object_]) -> Outcomes:
    """Return what became of messages; of a motion that was made again the last one counts."""
    kept = columns["reason"] != _core.Reason.REPLACED
    return Outcomes(
        stamp_ns=messages.stamp_ns[kept],
        source=messages.source[kept],
        tag=messages.tag[kept],
        anchor=messages.anchor[kept],
        verdict=VERDICTS[columns["verdict"][kept]],
        reason=reason[kept].astype(str),
        **{name: columns[name][kept] for name in ("nis", "dof", "log_likelihood", "residual")},
    )


def _sentences(
    messages: Messages, columns: Columns, log: Log, config: RunConfig, dropped: int = 0
) -> NDArray[np.object_]:
    """Return why messages were not fused."""
    sentence = np.full(len(messages.source), "", dtype=object)
    sentence[columns["verdict"] == _core.Verdict.IGNORED] = "used for the start"
    unused = ignored_by(config.estimator) if config.mcl is None else {}
    for row in np.flatnonzero(columns["reason"]):
        source = str(messages.source[row])
        reason = REASONS[columns["reason"][row]]
        if reason in ("not_used", "unnamed") and source in unused:
            sentence[row] = unused[source]
            continue
        sentence[row] = _sentence_of(
            reason, config, dropped, source=source, anchor=messages.anchor[row],
            tag=messages.tag[row], nis=columns["nis"][row], limit=columns["limit"][row],
            residual=columns["residual"][row],
        )  # fmt: skip
    if "slipped" in log.tables.get("odometry", {}):
        is_fused = columns["verdict"] == _core.Verdict.FUSED
        driven = np.flatnonzero((messages.source == "odometry") & is_fused)
        slips = driven[log["odometry"]["slipped"][messages.row[driven]]]
        sentence[slips] = "wheels slip, by the gyro: its turn counts, and the way less"
    return sentence


def _sentence_of(
    reason: str, config: RunConfig, dropped: int, *, source: str, nis: float, **of_message: Any
) -> str:
    of_source = f"{reason}/{source}"
    if reason == "unlikely" and not np.isnan(nis):
        of_source = reason
    history = f"{config.history_s:g} s"
    history += f" or {config.history_messages} messages" if dropped else ""
    sentence = SENTENCES.get(of_source, SENTENCES[reason])
    return sentence.format(
        source=source, kind=source[:-1], history=history, nis=nis, **of_message
    ).replace("landmark  ", "landmark ").rstrip()  # fmt: skip


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
    stamp, columns = log["scans"]["stamp_ns"], localization.scan_outcomes
    nothing = np.nan
    reason = np.array(
        [_sentence_of(REASONS[code], config, 0, source="scans", anchor="", tag="", nis=nothing,
                      limit=nothing, residual=nothing) if code else ""
         for code in columns["reason"]], dtype=object)  # fmt: skip
    empty = np.full(len(stamp), "")
    return _with(outcomes, _bare(stamp, np.full(len(stamp), "scans"), empty, empty,
                                 VERDICTS[columns["verdict"]], reason))  # fmt: skip


def _with(outcomes: Outcomes, others: Outcomes) -> Outcomes:
    """Return outcomes with rows of others, each after all up to its stamp."""
    received = np.maximum.accumulate(outcomes.stamp_ns)
    order = np.argsort(np.concatenate([received, others.stamp_ns]), kind="stable")
    columns = {field.name: [getattr(part, field.name) for part in (outcomes, others)]
               for field in fields(Outcomes)}  # fmt: skip
    return Outcomes(**{name: np.concatenate(parts)[order] for name, parts in columns.items()})


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
