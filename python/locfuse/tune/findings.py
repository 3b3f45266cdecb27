# SPDX-License-Identifier: Apache-2.0
"""Sentences on what `tune` has found that are no key of a configuration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from locfuse.tune.drive import Driven
from locfuse.tune.held_out import HeldOut, Outliers
from locfuse.tune.judge import Judged

_RARE = 0.01  # a share of outliers that is not worth a sentence
_WORSE = 1.3
_ROUGH = 0.3  # of the wheels [m/√m], [rad/√m] and [rad/√rad]
_ASTRAY = 0.2  # share of what is held out that does not fit
_WRONG = 1.5  # a NIS so far off that sigmas in messages are wrong
_SECTIONS = {"ranges": "range", "positions": "position", "landmark_sightings": "landmark",
             "headings": "heading", "altitudes": "altitude"}  # fmt: skip


def findings(
    spacing_s: float,
    margin: float,
    answers: Sequence[Judged],
    outliers: Sequence[Outliers],
    held_out: Sequence[HeldOut],
) -> Iterator[str]:
    """Yield what a user should know of the recordings."""
    if spacing_s > 0.0:
        yield (f"errors of one anchor or landmark are correlated over about {spacing_s:g} s; only "
               "measurements so far apart were compared")  # fmt: skip
    for one in outliers:
        if one.share >= _RARE:
            side = f", {one.too_long:.0%} of them too long" if one.source == "ranges" else ""
            yield f"{one.share:.1%} of {one.count} {one.source} are outliers{side}"
    if margin > 1.0:
        yield (f"what was held out fits worse than what was used, so the sigmas below are "
               f"{margin:.2f} times those found")  # fmt: skip
    rough = [a.quantity.key for a in answers if a.word == "found" and a.value > _ROUGH
             and a.quantity.key.startswith("estimator.odometry.sigma_")]  # fmt: skip
    if rough or any(fit.after.outliers > _ASTRAY for fit in held_out):
        what = f"a noise of wheels is large ({', '.join(rough)})" if rough else (
            "many measurements do not fit")  # fmt: skip
        yield (f"{what}: is a unit, a direction of turns or a place of an anchor wrong? "
               "locfuse check may know")  # fmt: skip
    keys = " ".join(a.quantity.key for a in answers if a.quantity.is_sigma)
    for fit in held_out:
        section = _SECTIONS.get(fit.source)
        off = max(fit.after.nis, 1.0 / max(fit.after.nis, 1e-9))
        if section is not None and f"{section}." not in keys and off > _WRONG:
            much = "small" if fit.after.nis > 1.0 else "large"
            yield (f"{fit.source} bring sigmas of their own, about {off**0.5:.1f} times too {much}")


def comparisons(driven: Sequence[tuple[Driven, Driven]]) -> Iterator[str]:
    """Yield how the recordings are driven, before and after."""
    for index, (before, after) in enumerate(driven):
        which = f" on log {index + 1}" if len(driven) > 1 else ""
        if np.isfinite(after.position_rmse_m):
            yield (f"position RMSE{which}: {before.position_rmse_m:.3f} m before, "
                   f"{after.position_rmse_m:.3f} m after")  # fmt: skip
        if after.restarts > before.restarts:
            yield (f"with these the estimator is lost more often{which}: {after.restarts} times, "
                   f"{before.restarts} before; do not use them")  # fmt: skip
        elif after.position_rmse_m > _WORSE * before.position_rmse_m:
            yield f"the position is worse{which}; do not use them"
