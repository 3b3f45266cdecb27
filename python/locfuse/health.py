# SPDX-License-Identifier: Apache-2.0
"""How far a run's estimate may be trusted, in words and figures."""

from __future__ import annotations

from typing import Any

import numpy as np

from locfuse import _core
from locfuse.config.schema import RunConfig
from locfuse.messages import Messages
from locfuse.types import Health

STATES = np.array([state.name.lower() for state in _core.HealthState])


def health_of(record: _core.RunLog, messages: Messages, config: RunConfig) -> Health:
    """Return the health of a replayed `RecoveringEkf`."""
    words = {
        _core.HealthClue.NONE: "",
        _core.HealthClue.NO_ESTIMATE: "not started yet",
        _core.HealthClue.SEVERAL_PLACES: "several poses fit",
        _core.HealthClue.MEASUREMENTS: "measurements of several sources speak against the pose",
        _core.HealthClue.SILENCE: "nothing but odometry was fused for "
                                  f"{config.health.aiding_lost_s:g} s or longer",
        _core.HealthClue.SOURCE_IS_WRONG: "{} is likely wrong as a whole",
        _core.HealthClue.SOURCE_IS_SILENT: "no {} any more",
        _core.HealthClue.NOISE_IS_LARGER: "innovations are larger than their sigmas",
        _core.HealthClue.POSITION_IS_VAGUE: "the position error is below "
                                            f"{config.health.limit_m:g} m by even chance at most",
    }  # fmt: skip
    clues = list(_core.HealthClue)
    reason = [
        words[clues[clue]].format(_name(source, messages))
        for clue, source in zip(record.health_clue.tolist(), record.health_source, strict=True)
    ]
    return Health(
        stamp_ns=record.health_stamp_ns,
        state=STATES[record.health_state],
        within=record.within,
        wrong=record.wrong,
        protection=record.protection,
        reason=np.array(reason, dtype=np.str_),
    )


def health_metrics(health: Health, record: _core.RunLog) -> dict[str, Any]:
    """Return what ``metrics.json`` says of health."""
    states, counts = np.unique(health.state, return_counts=True)
    return {
        "share": dict(zip(states.tolist(), (counts / max(len(health), 1)).tolist(), strict=True)),
        "alarms": record.alarms,
        "restarts": record.restarts,
        "protection_available": float(np.mean(np.isfinite(health.protection[:, 0])))
        if len(health)
        else None,
    }


def _name(source: _core.NamedSource | None, messages: Messages) -> str:
    """Return how people call a source."""
    if source is None:
        return ""
    kind, name = source.kind, source.name
    if kind is _core.Source.RANGES:
        return f"anchor {messages.anchor_names[name]}" if name is not None else "range"
    if kind is _core.Source.LANDMARK_SIGHTINGS and name is not None:
        return f"landmark {messages.landmark_names[name]}"
    if kind is _core.Source.POSITIONS and name is not None:
        return f"position of tag {messages.tag_names[name]}"
    return {
        _core.Source.LANDMARK_SIGHTINGS: "landmark sighting",
        _core.Source.POSITIONS: "position",
        _core.Source.POSES: "pose",
    }[kind]
