# SPDX-License-Identifier: Apache-2.0
"""Which further drive would improve what was found."""

from __future__ import annotations

from collections.abc import Iterator

from locfuse.commission.result import Commissioned

_DRIVES = (
    ("heading_per_sqrt_rad", "turn_scale", "turn on the spot, several times to both sides"),
    ("heading_per_sqrt_m", "lateral_per_sqrt_m", "drive straight ways of several metres"),
    ("longitudinal_per_sqrt_m", "distance_scale", "drive straight ways of several metres"),
    ("latency_s", "latency_s", "start and stop often"),
    ("antenna_forward_m", "antenna_left_m", "turn on the spot, several times to both sides"),
)


def advice_of(result: Commissioned) -> Iterator[str]:
    """Yield a sentence for each drive that would help."""
    if result.survey is not None and result.survey.advice:
        yield result.survey.advice
    if result.map is not None and not any(loop.kept for loop in result.map.loops):
        yield "end the drive where it began, so that the map is checked by what is seen again"
    if result.tuned is None:
        return
    unseen = [one.quantity.key for one in result.tuned.quantities if one.word == "not observed"]
    drives: dict[str, list[str]] = {}
    for *endings, drive in _DRIVES:
        keys = [key for key in unseen if key.endswith(tuple(endings))]
        drives.setdefault(drive, []).extend(keys)
    for drive, keys in drives.items():
        if keys:
            yield f"{drive}: this drive does not show {', '.join(dict.fromkeys(keys))}"
