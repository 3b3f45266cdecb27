# SPDX-License-Identifier: Apache-2.0
"""Sentences on what `tune` has found that are no key of a configuration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from locfuse.tune.held_out import HeldOut, Outliers
from locfuse.tune.quantity import Quantity

_RARE = 0.01  # a share of outliers that is not worth a sentence
_WRONG = 1.5  # a NIS so far off that sigmas in messages are wrong
_SECTIONS = {"ranges": "range", "positions": "position", "landmark_sightings": "landmark",
             "headings": "heading", "altitudes": "altitude"}  # fmt: skip


def findings(
    spacing_s: float,
    margin: float,
    quantities: Sequence[Quantity],
    outliers: Sequence[Outliers],
    held_out: Sequence[HeldOut],
) -> Iterator[str]:
    """Yield what a user should know."""
    if spacing_s > 0.0:
        yield (f"errors of one anchor or landmark stay alike for about {spacing_s:g} s; only "
               "measurements so far apart were compared")  # fmt: skip
    for one in outliers:
        if one.share >= _RARE:
            side = f", {one.too_long:.0%} of them too long" if one.source == "ranges" else ""
            yield f"{one.share:.1%} of {one.count} {one.source} are outliers{side}"
    if margin > 1.0:
        yield (f"what was held out fits worse than what was used, so the sigmas below are "
               f"{margin:.2f} times those found")  # fmt: skip
    keys = " ".join(q.key for q in quantities if q.is_sigma)
    for fit in held_out:
        section = _SECTIONS.get(fit.source)
        off = max(fit.after.nis, 1.0 / max(fit.after.nis, 1e-9))
        if section is not None and f"{section}." not in keys and off > _WRONG:
            much = "small" if fit.after.nis > 1.0 else "large"
            yield (f"{fit.source} bring sigmas of their own, about {off**0.5:.1f} times too {much}")
