# SPDX-License-Identifier: Apache-2.0
"""The rows of `locfuse reproduce trust`: alarms, protection levels, blackouts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from locfuse.claims import Claim, Progress, claim_of, claims_of, share
from locfuse.trust.blackout import blackout_claims
from locfuse.trust.scenarios import LIMIT_M, SCENARIOS, Drive, drive
from locfuse.trust.scores import PATIENCE_S, Alarms, alarms_of, beyond

RISKS = (1e-2, 1e-3)
UNTOLD = "wheels slip, and nobody knows"  # no filter can be right about noise that it is not told


def trust_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return all rows: seeds 0 to seeds - 1 of every scenario."""
    parts = [partial(_scenario, name, seeds) for name in SCENARIOS]
    return claims_of([*parts, partial(_together, seeds), partial(blackout_claims, seeds)], progress)


def _scenario(name: str, seeds: int) -> Iterator[Claim]:
    drives = [drive(name, seed) for seed in range(seeds)]
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
    told = "0.01" if risk is None else f"{risk:g}"
    yield Claim(f"{key}_beyond_{told}", f"{what}beyond the protection level of risk {told}", "1",
                None, worst, float(broken.min()), worst,
                "-" if risk is None else f"<= {risk:g}", risk is None or worst <= risk,
                f"worst axis: {axis}; levels at {100 * available:.1f} % of the points")  # fmt: skip


def _together(seeds: int) -> Iterator[Claim]:
    told = [name for name in SCENARIOS if name != UNTOLD]
    drives = [drive(name, seed) for name in told for seed in range(seeds)]
    alarms = alarms_of(drives)
    yield from _losses("trust", "all but that: ", alarms)
    rate = alarms.false_per_hour
    yield Claim("trust_false", f"all but that: false alarms in {alarms.hours:.1f} h", "1/h", None,
                rate, rate, rate, "<= 0.1", rate <= 0.1)  # fmt: skip
    for risk in RISKS:
        of_risk = [drive(name, seed, risk) for name in told for seed in range(seeds)]
        yield from _levels("trust", "all but that: ", of_risk, risk)


def pooled(seeds: int) -> list[Drive]:
    """Return the drives of all scenarios."""
    return [drive(name, seed) for name in SCENARIOS for seed in range(seeds)]
