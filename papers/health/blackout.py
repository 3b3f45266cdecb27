# SPDX-License-Identifier: Apache-2.0
"""A blackout of 20 s that ends with 25 wrong fixes: how much harm they do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from locfuse.run.run import run
from locfuse.types import NANOSECONDS, FloatArray, Log, StampArray
from papers.claims import Claim, claim_of
from papers.health.scenarios import Drive, config_of, drive_of, simulated

BEGIN_S, LASTS_S = 60.0, 20.0
RATE_HZ = 10.0
WRONG = 25
CONFIG = config_of(120.0, ranges=None, positions={"rate_hz": RATE_HZ, "sigma_xy_m": 0.3})
MORE_M, RECOVERED_S, SAME_M = 0.5, 3.0, 0.1  # allowed
WAYS = {"anywhere": "25 wrong fixes, 5 m off in any direction",
        "one place": "25 wrong fixes, 5 m off at one place"}  # fmt: skip
WRONG_M = 5.0


def blackout_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: how far beyond dead reckoning, and the error once it is over."""
    for way, what in WAYS.items():
        harm, after = zip(*(_harm(way, seed) for seed in range(seeds)), strict=True)
        key = f"trust_blackout_{way.replace(' ', '_')}"
        worst, latest = float(max(harm)), float(max(after))
        yield replace(claim_of(key, f"blackout, {what}: error beyond dead reckoning", "m", None,
                               np.array(harm), f"<= {MORE_M:g}, all seeds", lambda v: True),
                      met=worst <= MORE_M, note=f"worst {worst:.2f}")  # fmt: skip
        yield replace(claim_of(f"{key}_after", f"{what}: {RECOVERED_S:g} s later, beyond the run "
                               "without them", "m", None, np.array(after),
                               f"<= {SAME_M:g}, all seeds", lambda v: True),
                      met=latest <= SAME_M, note=f"worst {latest:.2f}")  # fmt: skip


def logs_of(way: str, seed: int) -> tuple[Log, Log, Log]:
    """Return a log with wrong fixes, the same without, and the same without fixes from then on."""
    log = simulated(CONFIG, seed)
    fixes = log["positions"]
    seconds = (fixes["stamp_ns"] - log["truth"]["stamp_ns"][0]) / NANOSECONDS
    seen = (seconds < BEGIN_S) | (seconds >= BEGIN_S + LASTS_S)
    burst = np.flatnonzero(seen & (seconds >= BEGIN_S))[:WRONG]
    rng = np.random.default_rng([seed, 3])
    angle = rng.uniform(-np.pi, np.pi, WRONG if way == "anywhere" else 1)
    wrong = {name: values.copy() for name, values in fixes.items()}
    wrong["x_m"][burst] += WRONG_M * np.cos(angle)
    wrong["y_m"][burst] += WRONG_M * np.sin(angle)
    kept = seen.copy()
    kept[burst] = False
    return tuple(
        replace(log, tables={**log.tables,
                             "positions": {name: values[rows] for name, values in table.items()}})
        for table, rows in ((wrong, seen), (fixes, kept), (fixes, seconds < BEGIN_S))
    )  # type: ignore[return-value]  # fmt: skip


def drives(way: str, seed: int) -> tuple[Drive, Drive, Drive]:
    """Drive with wrong fixes, without them, and by dead reckoning."""
    hurt, healthy, blind = (drive_of(run(CONFIG, log)) for log in logs_of(way, seed))
    return hurt, healthy, blind


def _harm(way: str, seed: int) -> tuple[float, float]:
    hurt, healthy, blind = drives(way, seed)
    over = BEGIN_S + LASTS_S + WRONG / RATE_HZ
    time = (hurt.health.stamp_ns - hurt.health.stamp_ns[0]) / NANOSECONDS
    during = (time >= BEGIN_S) & (time < over)
    at = hurt.health.stamp_ns[during]
    harm = hurt.distance[during] - _at(blind, at)
    later = time >= over + RECOVERED_S
    after = hurt.distance[later] - _at(healthy, hurt.health.stamp_ns[later])
    return float(harm.max()), float(after.max())


def _at(drive: Drive, stamps: StampArray) -> FloatArray:
    distance: FloatArray = np.interp(stamps, drive.health.stamp_ns, drive.distance)
    return distance
