# SPDX-License-Identifier: Apache-2.0
"""The rows of `locfuse reproduce trust`: alarms, protection levels, blackouts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from papers.claims import Claim, Progress, claim_of, claims_of, share
from papers.health.alarms import PATIENCE_S, Alarms, alarms_of, beyond, joined
from papers.health.blackout import blackout_claims
from papers.health.map_scenarios import ON_MAP, UNMODELLED_ON_MAP
from papers.health.scenarios import LIMIT_M, SCENARIOS, Drive, Scenario, drive, drive_in
from papers.health.solver_disagreement import solver_claims

RISKS = (1e-2, 1e-3)
# No filter can be right about noise that its settings leave out.
UNMODELLED = ("wheels slip, and nobody knows", UNMODELLED_ON_MAP)


def health_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return all rows: seeds 0 to seeds - 1 of every scenario."""
    sets: list[Alarms] = []
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(partial(_scenario, name, of, seeds) for name, of in SCENARIOS.items()),
        partial(_together, "trust", "all but that", SCENARIOS, seeds, sets),
        partial(blackout_claims, seeds),
        partial(solver_claims, seeds),
        *(partial(_scenario, name, of, seeds) for name, of in ON_MAP.items()),
        partial(_together, "trust_scans", "scans, all but that", ON_MAP, seeds, sets),
        lambda: _judged("trust_set", "both sets, all but that", joined(sets)),
    ]
    return claims_of(parts, progress)


def _scenario(name: str, scenario: Scenario, seeds: int) -> Iterator[Claim]:
    drives = [drive_in(scenario, seed, 0.01) for seed in range(seeds)]
    alarms, key = alarms_of(drives), f"trust_{name.replace(',', '').replace(' ', '_')}"
    yield Claim(f"{key}_false", f"{name}: false alarms in {alarms.hours:.1f} h", "1/h", None,
                *3 * (alarms.false_per_hour,), "-", True)  # fmt: skip
    if alarms.losses:
        yield from _losses(key, f"{name}: ", alarms)
    yield from _levels(key, f"{name}: ", drives, None)


def _losses(key: str, what: str, alarms: Alarms) -> Iterator[Claim]:
    yield share(f"{key}_missed", f"{what}more than {LIMIT_M:g} m off, not noticed within "
                f"{PATIENCE_S:g} s", alarms.missed, alarms.losses, 0.01, at_most=True)  # fmt: skip
    yield claim_of(f"{key}_delay", f"{what}noticed after", "s", None, alarms.delays_s, "<= 2",
                   lambda v: v <= 2.0)  # fmt: skip


def _levels(key: str, what: str, drives: Sequence[Drive], risk: float | None) -> Iterator[Claim]:
    broken, available = beyond(drives)
    worst = float(broken.max())
    axis = ("x", "y", "heading")[int(broken.argmax())]
    level = "0.01" if risk is None else f"{risk:g}"
    yield Claim(f"{key}_beyond_{level}", f"{what}beyond the protection level of risk {level}", "1",
                None, worst, float(broken.min()), worst,
                "-" if risk is None else f"<= {risk:g}", risk is None or worst <= risk,
                f"worst axis: {axis}; levels at {100 * available:.1f} % of the points")  # fmt: skip


def _together(
    key: str, what: str, scenarios: Mapping[str, Scenario], seeds: int, sets: list[Alarms]
) -> Iterator[Claim]:
    """Judge the drives of all scenarios whose noise is modelled, and add their alarms to `sets`."""
    modelled = [scenario for name, scenario in scenarios.items() if name not in UNMODELLED]
    drives = [drive_in(scenario, seed, 0.01) for scenario in modelled for seed in range(seeds)]
    sets.append(alarms_of(drives))
    yield from _judged(key, what, sets[-1])
    for risk in RISKS:
        of_risk = [drive_in(scenario, seed, risk) for scenario in modelled for seed in range(seeds)]
        yield from _levels(key, f"{what}: ", of_risk, risk)


def _judged(key: str, what: str, alarms: Alarms) -> Iterator[Claim]:
    yield from _losses(key, f"{what}: ", alarms)
    rate = alarms.false_per_hour
    yield Claim(f"{key}_false", f"{what}: false alarms in {alarms.hours:.1f} h", "1/h", None,
                rate, rate, rate, "<= 0.1", rate <= 0.1)  # fmt: skip


def pooled(seeds: int) -> list[Drive]:
    """Return the drives of all scenarios."""
    return [drive(name, seed) for name in SCENARIOS for seed in range(seeds)]
