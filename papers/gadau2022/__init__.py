# SPDX-License-Identifier: Apache-2.0
"""gadau2022: an EKF on landmarks by range and bearing; where the authors' filter failed, and why.

Their microsimulator sees every landmark exactly where it is; their second one has 151 rays that end
on discs and walls. Kidnapping, which theirs does not survive, is in `locfuse.gadau.kidnapping`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import get_args

import numpy as np

from locfuse.types import NANOSECONDS, FloatArray
from papers.claims import Claim, Progress, claim_of, claims_of, consistent, share
from papers.gadau2022.kidnapping import kidnapping_claims
from papers.gadau2022.pictures import draw_pictures
from papers.gadau2022.recognition import recognition_claims
from papers.gadau2022.runs import Mistake, Run, microsimulation, nees_band, ray_simulation
from papers.gadau2022.world import (
    DISCS,
    DURATION_S,
    ENDLESS,
    LAYOUTS,
    PATHS,
    RAY_PATHS,
    SENSORS,
    SETTLED_S,
    SPEEDS,
    STEP_NS,
)

__all__ = ["draw_pictures", "gadau_claims"]

RIGHT = 5  # times as many right starts: of NEES, few seeds tell little

# How the paper's rule for discs is fused.
BY_RULE: dict[str, tuple[tuple[Mistake, ...], str]] = {
    "rule": ((), "right derivatives"),
    "rule_derivatives": (("derivatives",), "derivatives of Fig. 2"),
    "rule_both": (("derivatives", "surface"), "derivatives of Fig. 2 and ranges to the surface"),
}


def gadau_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return all rows."""
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(lambda name=name: _layout(name, seeds) for name in LAYOUTS),
        *(lambda name=name: _path(name, seeds) for name in PATHS),
        *(lambda name=name: _sensors(name, seeds) for name in SENSORS),
        lambda: _theirs(seeds),
        *(lambda key=key: _by_their_rule(key, max(seeds // 10, 2)) for key in BY_RULE),
        *(lambda name=name: _discs(name, seeds) for name in DISCS),
        lambda: kidnapping_claims(seeds),
        lambda: recognition_claims(seeds),
    ]  # fmt: skip
    return claims_of(parts, progress)


def _layout(name: str, seeds: int) -> Iterator[Claim]:
    required = name not in ("one", "two", "line")
    yield from _both_starts(f"gadau_{_id(name)}", name, name, "circle", seeds, required)


def _path(name: str, seeds: int) -> Iterator[Claim]:
    what = f"triangle, path {name}"
    yield from _both_starts(f"gadau_path_{name}", what, "triangle", name, seeds, True)


def _both_starts(
    key: str, what: str, layout: str, path: str, seeds: int, required: bool
) -> Iterator[Claim]:
    """Yield what becomes of starts that are 2 m and 60 degrees wrong, and of right ones."""
    runs = [microsimulation(layout, path, seed) for seed in range(seeds)]
    yield from _convergence(key, f"{what}, start 2 m and 60 degrees wrong: ", runs, seeds,
                            required)  # fmt: skip
    runs = [microsimulation(layout, path, seed, wrong=False) for seed in range(RIGHT * seeds)]
    yield from _accuracy(f"{key}_right", f"{what}, right start: ", runs, 0.0, True)


def _convergence(
    key: str, what: str, runs: list[Run], seeds: int, required: bool
) -> Iterator[Claim]:
    when = [run.converged_s() for run in runs]
    yield share(key, f"{what}converges", int(np.isfinite(when).sum()), seeds,
                0.99 if required else 0.0)  # fmt: skip
    yield claim_of(f"{key}_time", f"{what}after", "s", None,
                   np.minimum(when, DURATION_S), "-", lambda v: True)  # fmt: skip
    yield claim_of(f"{key}_error", f"{what}error at the end", "cm", None,
                   [100.0 * float(run.off_m[-1]) for run in runs], "-", lambda v: True)  # fmt: skip
    yield _nees(key, what, runs, required)


def _accuracy(
    key: str, what: str, runs: list[Run], from_s: float, required: bool
) -> Iterator[Claim]:
    first = round(from_s * NANOSECONDS) // STEP_NS
    yield claim_of(f"{key}_rmse", f"{what}position RMSE", "cm", None,
                   [100.0 * _rms(run.off_m[first:]) for run in runs], "-",
                   lambda v: True)  # fmt: skip
    yield claim_of(f"{key}_heading", f"{what}heading RMSE", "deg", None,
                   [np.rad2deg(_rms(run.off_rad[first:])) for run in runs], "-",
                   lambda v: True)  # fmt: skip
    yield _nees(key, what, runs, required)


def _id(name: str) -> str:
    return name.replace(",", "").replace(" ", "_")


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _sensors(name: str, seeds: int) -> Iterator[Claim]:
    """Compare GPS with the laser on the same drives, from both starts."""
    layout, sensors = SENSORS[name]
    for start in ("right", "wrong"):
        wrong = start == "wrong"
        runs = [microsimulation(layout, "circle", seed, wrong=wrong, sensors=sensors)
                for seed in range(seeds)]  # fmt: skip
        late = f" from {SETTLED_S:g} s on" if wrong else ""
        yield from _accuracy(f"gadau_by_{_id(name)}_{start}",
                             f"{name}, {start} start{late}: ", runs,
                             SETTLED_S if wrong else 0.0, not wrong)  # fmt: skip


def _theirs(seeds: int) -> Iterator[Claim]:
    """Show what the paper's mistakes do, from the right start."""
    names = {
        None: "ours",
        "derivatives": "with the derivatives of Fig. 2",
        "range_row": "with the range's row of Fig. 2 alone",
        "bearing_row": "with the bearing's row of Fig. 2 alone",
        "surface": "with ranges to the surface of discs",
    }
    for mistake in (None, *get_args(Mistake)):
        runs = [microsimulation("square, near", "circle", seed, wrong=False, mistake=mistake)
                for seed in range(seeds)]  # fmt: skip
        key, what = f"gadau_{mistake or 'right'}", f"right start, {names[mistake]}: "
        yield claim_of(key, f"{what}worst error", "m", None,
                       [float(min(run.off_m.max(), ENDLESS)) for run in runs], "-",
                       lambda v: True)  # fmt: skip
        yield _nees(key, what, runs, mistake is None)


def _by_their_rule(key: str, seeds: int) -> Iterator[Claim]:
    """Show what the paper's rule for discs costs among rays, without and with its mistakes."""
    mistakes, what = BY_RULE[key]
    for speed in SPEEDS:
        runs = [ray_simulation("5", speed, seed, by_rule=mistakes) for seed in range(seeds)]
        yield claim_of(f"gadau_{key}_{speed:g}",
                       f"5 discs by the rule of Fig. 3, {what}, {_how(speed)}: worst error", "m",
                       None, [float(min(run.off_m.max(), ENDLESS)) for run in runs], "-",
                       lambda v: True)  # fmt: skip


def _how(speed_mps: float) -> str:
    return "standing" if speed_mps == 0.0 else f"{speed_mps:g} m/s"


def _nees(key: str, what: str, runs: list[Run], required: bool) -> Claim:
    return consistent(key, what, [min(run.nees, ENDLESS) for run in runs], nees_band(len(runs)),
                      required)  # fmt: skip


def _discs(name: str, seeds: int) -> Iterator[Claim]:
    for speed in SPEEDS:
        yield from _among_rays(f"{name}_{speed:g}", f"{name} discs, 151 rays, {_how(speed)}",
                               [ray_simulation(name, speed, seed)
                                for seed in range(seeds)])  # fmt: skip
    for path in RAY_PATHS[1:]:
        yield from _among_rays(f"{name}_{path}", f"{name} discs, 151 rays, path {path}",
                               [ray_simulation(name, speed, seed, path)
                                for speed in SPEEDS[1:] for seed in range(seeds)])  # fmt: skip


def _among_rays(id: str, what: str, runs: list[Run]) -> Iterator[Claim]:
    worst = [100.0 * float(run.off_m.max()) for run in runs]
    rmse = [100.0 * _rms(run.off_m) for run in runs]
    yield claim_of(f"gadau_rays_{id}", f"{what}: RMSE", "cm", None, rmse, "<= 5",
                   lambda v: v <= 5.0)  # fmt: skip
    yield share(f"gadau_rays_{id}_all", f"{what}: drives with an RMSE of at most 5 cm",
                sum(v <= 5.0 for v in rmse), len(rmse), 1.0)  # fmt: skip
    yield claim_of(f"gadau_rays_{id}_worst", f"{what}: worst error", "cm", None, worst, "-",
                   lambda v: True)  # fmt: skip
    yield _nees(f"gadau_rays_{id}", f"{what}: ", runs, True)
