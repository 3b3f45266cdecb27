# SPDX-License-Identifier: Apache-2.0
"""How far a run's estimate may be trusted, in words and figures."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.eval.trust import shares
from locfuse.run.messages import Messages
from locfuse.types import Health, Watched

STATES = np.array([state.name.lower() for state in _core.HealthState])


class Names(Protocol):
    """What anchors, tags and landmarks are called: in order of their ids."""

    @property
    def anchor_names(self) -> list[str]: ...
    @property
    def tag_names(self) -> list[str]: ...
    @property
    def landmark_names(self) -> list[str]: ...


def health_of(
    record: _core.RunLog | _core.LocalizeRun, messages: Messages, config: RunConfig
) -> Health:
    """Return the health of a replayed `RecoveringEkf`, or of an `Mcl`."""
    reasons = list(_core.HealthReason)
    reason = [
        reason_of(reasons[reason], source, messages, config)
        for reason, source in zip(record.health_reason.tolist(), record.health_source, strict=True)
    ]
    return Health(
        stamp_ns=record.health_stamp_ns,
        state=STATES[record.health_state],
        within=record.within,
        wrong=record.wrong,
        protection=record.protection,
        reason=np.array(reason, dtype=np.str_),
    )


def reason_of(
    reason: _core.HealthReason, source: _core.NamedSource | None, names: Names, config: RunConfig
) -> str:
    """Return why a health is as it is, as a sentence; empty where there is nothing to say."""
    sentence = _sentences(config.health.aiding_lost_s, config.health.limit_m)[reason]
    return sentence.format("" if source is None else name_of(source, names))


@cache
def _sentences(aiding_lost_s: float, limit_m: float) -> dict[_core.HealthReason, str]:
    return {
        _core.HealthReason.NONE: "",
        _core.HealthReason.NO_ESTIMATE: "not started yet",
        _core.HealthReason.SEVERAL_PLACES: "several poses fit",
        _core.HealthReason.MEASUREMENTS: "measurements of several sources speak against the pose",
        _core.HealthReason.SILENCE: f"nothing but odometry was fused for {aiding_lost_s:g} s or "
                                  "longer",
        _core.HealthReason.SOURCE_IS_WRONG: "{} is likely wrong as a whole",
        _core.HealthReason.SOURCE_IS_SILENT: "no {} any more",
        _core.HealthReason.NOISE_IS_LARGER: "innovations are larger than their sigmas",
        _core.HealthReason.POSITION_IS_VAGUE: f"the position error is below {limit_m:g} m by even "
                                            "chance at most",
        _core.HealthReason.SCANS_DO_NOT_FIT: "scans fit the map hardly better than from elsewhere",
        _core.HealthReason.LASER_IS_COVERED: "the laser sees something right before it",
    }  # fmt: skip


def watched_of(record: _core.RunLog | _core.LocalizeRun, config: RunConfig) -> Watched | None:
    """Return how far the poses that a run watches may be trusted; None where it watches none."""
    if not config.watch_poses:
        return None
    reports = record.watched
    reasons = watch_reasons(config.health.aiding_lost_s)
    return Watched(
        stamp_ns=np.array([one.stamp for one in reports], np.int64),
        state=np.array([one.state.name.lower() for one in reports], dtype=np.str_),
        within=np.array([one.within for one in reports], np.float64),
        wrong=np.array([one.wrong for one in reports], np.float64),
        protection=np.array([one.protection for one in reports], np.float64).reshape(-1, 3),
        reason=np.array([reasons[one.reason] for one in reports], dtype=np.str_),
        error=np.array([one.error for one in reports], np.float64).reshape(-1, 3),
    )


@cache
def watch_reasons(aiding_lost_s: float) -> dict[_core.WatchReason, str]:
    """Return why watched poses are as they are, as sentences; empty where all is well."""
    return {
        _core.WatchReason.NONE: "",
        _core.WatchReason.NO_ESTIMATE: "there is no estimate to judge poses by yet",
        _core.WatchReason.NO_POSE: "no pose that could be judged has been received yet",
        _core.WatchReason.FAR_OFF: "poses are too far from the estimate",
        _core.WatchReason.CONTRADICTED: "measurements speak against the place of poses and "
                                        "estimate",
        _core.WatchReason.JUMPED: "poses moved as odometry did not",
        _core.WatchReason.SIGMAS_TOO_SMALL: "poses are farther off than their sigmas say",
        _core.WatchReason.SILENT: f"no pose for {aiding_lost_s:g} s or longer, while the robot "
                                  "moved",
        _core.WatchReason.UNVERIFIED: "the estimate cannot judge poses: it is lost, too vague, or "
                                      "by odometry alone",
    }  # fmt: skip


def watched_metrics(watched: Watched | None) -> dict[str, Any] | None:
    """Return the entry ``watched`` of ``metrics.json``."""
    if watched is None or not len(watched):
        return None
    lost = np.concatenate([[False], watched.state == "lost"])
    return {"share": shares(watched), "alarms": int(np.sum(lost[1:] & ~lost[:-1]))}


def health_metrics(health: Health, alarms: int, restarts: int) -> dict[str, Any]:
    """Return the entry ``health`` of ``metrics.json``."""
    return {
        "share": shares(health),
        "alarms": alarms,
        "restarts": restarts,
        "protection_available": float(np.mean(np.isfinite(health.protection[:, 0])))
        if len(health)
        else None,
    }


def name_of(source: _core.NamedSource, names: Names) -> str:
    """Return how people call a source."""
    kind, name = source.kind, source.name
    if kind is _core.Source.RANGES:
        return f"anchor {names.anchor_names[name]}" if name is not None else "range"
    if kind is _core.Source.LANDMARK_SIGHTINGS and name is not None:
        return f"landmark {names.landmark_names[name]}"
    if kind is _core.Source.POSITIONS and name is not None:
        return f"position of tag {names.tag_names[name]}"
    return {
        _core.Source.LANDMARK_SIGHTINGS: "landmark sighting",
        _core.Source.POSITIONS: "position",
        _core.Source.POSES: "pose",
        _core.Source.SCANS: "scan",
        _core.Source.ALTITUDES: "altitude",
        _core.Source.HEADINGS: "course" if name else "heading",
    }[kind]
