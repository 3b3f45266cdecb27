# SPDX-License-Identifier: Apache-2.0
"""Consistency as a gate: NEES by group of states and NIS by source of every estimator."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import count
from math import comb

from locfuse.eval.consistency import PROBABILITY, band
from papers.claims import Claim, Progress, claims_of
from papers.consistency.air_and_tag_estimators import OTHERS
from papers.consistency.planar_estimators import FLOOR, mcl
from papers.consistency.sample import Sample, Squared

SCENARIOS: Mapping[str, Callable[[int, float], Sample]] = {**FLOOR, **OTHERS}
MCL_BAND = (2.0 / 3.0, 4.0 / 3.0)  # of NEES per component; results/consistency.md says why


@dataclass(frozen=True)
class Figure:
    """A mean over seeds.

    Attributes
    ----------
    what : str
        Such as ``NEES of heading`` or ``NIS of ranges``.
    mean : float
        Per component: 1 of a consistent filter.
    components : int
        How many independent ones it is the mean of.
    """

    what: str
    mean: float
    components: int

    def inside(self, probability: float) -> bool:
        """Return whether it is inside the two-sided band."""
        low, high = band(1, self.components, probability)
        return low <= self.mean <= high


def figures(
    scenario: Callable[[int, float], Sample], seeds: int, factor: float = 1.0
) -> list[Figure]:
    """Return the figures of a scenario over seeds 0 to seeds - 1.

    Parameters
    ----------
    scenario : callable
        One of `SCENARIOS`.
    seeds : int
    factor : float
        The filter uses the true sigmas times this: below 1 it is overconfident, above conservative.
    """
    sums: dict[str, Squared] = {}
    for seed in range(seeds):
        sample = scenario(seed, factor)
        for kind, found in (("NEES", sample.nees), ("NIS", sample.nis)):
            for name, (squared, components) in found.items():
                total, so_far = sums.get(f"{kind} of {name}", (0.0, 0))
                sums[f"{kind} of {name}"] = (total + squared, so_far + components)
    return [Figure(what, float(total) / n, n) for what, (total, n) in sums.items()]


@cache
def each_probability() -> float:
    """Return the probability of each band that makes it 95 % for all figures together.

    Bonferroni's: what is outside is shared out evenly, whatever depends on what.
    """
    family = sum(len(figures(scenario, 1)) for scenario in SCENARIOS.values())
    return 1.0 - (1.0 - PROBABILITY) / family


def max_outside(family: int) -> int:
    """Return how many of a family are outside of their own 95 % band at most, with 99.9 %."""
    outside = 1.0 - PROBABILITY
    below = 0.0
    for k in count():
        below += comb(family, k) * outside**k * PROBABILITY ** (family - k)
        if below >= 0.999:
            return k
    raise AssertionError


def consistency_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return a row for each figure, and one for how many are outside of their own 95 % band."""
    outside: list[bool] = []
    parts = [partial(_gated, name, scenario, seeds, outside)
             for name, scenario in SCENARIOS.items()]  # fmt: skip
    claims = claims_of([*parts, partial(_not_gated, seeds)], progress)
    what = f"figures of {len(outside)} outside of their own 95 % band"
    n, most = float(sum(outside)), max_outside(len(outside))
    claims.append(Claim("outside", what, "1", None, n, n, n, f"<= {most}", n <= most))
    return claims


def _gated(
    name: str, scenario: Callable[[int, float], Sample], seeds: int, outside: list[bool]
) -> Iterator[Claim]:
    for figure in figures(scenario, seeds):
        low, high = band(1, figure.components, each_probability())
        outside.append(not figure.inside(PROBABILITY))
        yield _row(name, figure, f"{low:.3f}..{high:.3f}", low <= figure.mean <= high)


def _not_gated(seeds: int) -> Iterator[Claim]:
    """Return rows that the family of bands does not cover."""
    low, high = MCL_BAND
    for figure in figures(mcl, seeds):
        gated = figure.what == "NEES of all"
        required = f"{low:.3f}..{high:.3f}" if gated else "-"
        yield _row("Mcl: rooms", figure, required, not gated or low <= figure.mean <= high)


def _row(name: str, figure: Figure, required: str, met: bool) -> Claim:
    low, high = band(1, figure.components)
    what = f"{name}: {figure.what}"
    return Claim(what.lower().replace(":", "").replace(",", "").replace(" ", "_"), what, "1", None,
                 figure.mean, figure.mean, figure.mean, required, met,
                 f"{figure.components} components, 95 % band {low:.3f}..{high:.3f}")  # fmt: skip
