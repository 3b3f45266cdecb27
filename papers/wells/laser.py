# SPDX-License-Identifier: Apache-2.0
"""Where the laser alone puts a robot whose heading is known: by one beam, or by the whole arc.

The paper holds its resolution of a degree, and the one beam that stands for a cylinder, to be why
its laser is far off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from locfuse import _core
from locfuse.types import NANOSECONDS, FloatArray
from papers.claims import Claim, claim_of
from papers.wells.world import BEAMS, CYLINDERS, RADIUS_M, detector, random_drive, scan_of

EVERY_NS = NANOSECONDS  # between two scans that are looked at
FINER = 10  # times as many beams
Centre = tuple[float, float]  # range and bearing


def laser_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: errors of the position where the heading is the true one."""
    kinds: dict[str, tuple[str, Callable[[int], float]]] = {
        "exact": ("closest beam of 1 degree, without noise", lambda s: by_beam(s, noisy=False)),
        "beam": ("closest beam of 1 degree", by_beam),
        "fine": (f"closest beam of {1.0 / FINER:g} degree", lambda s: by_beam(s, FINER)),
        "arc": ("arc fitted, 1 degree", by_arc),
    }
    for key, (what, error_m) in kinds.items():
        yield claim_of(f"wells_laser_{key}", f"laser alone, true heading, {what}: RMSE", "cm", None,
                       [100.0 * error_m(seed) for seed in range(seeds)], "-",
                       lambda v: True)  # fmt: skip


def by_beam(seed: int, times: int = 1, *, noisy: bool = True) -> float:
    """Return the RMSE [m] by the closest beam and the radius, with so many times 360 beams."""

    def centre(pose: FloatArray, rng: np.random.Generator) -> Centre | None:
        scan = scan_of(pose, 0, rng if noisy else None, times)
        if not np.isfinite(np.asarray(scan.ranges)).any():
            return None
        seen = _core.closest_beam(scan, 0, BEAMS * times - 1, RADIUS_M)
        return seen.range, seen.bearing

    return _rmse(seed, centre)


def by_arc(seed: int) -> float:
    """Return the RMSE [m] by the closest of the cylinders that are fitted to all their beams."""
    finder = detector()

    def centre(pose: FloatArray, rng: np.random.Generator) -> Centre | None:
        found = finder.detect(scan_of(pose, 0, rng))
        if not found:
            return None
        closest = min(found, key=lambda one: one.range)
        return closest.range, closest.bearing

    return _rmse(seed, centre)


def _rmse(seed: int, centre: Callable[[FloatArray, np.random.Generator], Centre | None]) -> float:
    """Drive as `drive_both` of that seed does; the cylinder seen is the one nearest to there."""
    rng = np.random.default_rng(seed)
    drive = random_drive(rng)
    off = []
    for pose in drive.pose_at(np.arange(0.0, drive.start[-1], EVERY_NS / NANOSECONDS)):
        seen = centre(pose, rng)
        if seen is None:
            continue
        angle = pose[2] + seen[1]
        at = pose[:2] + seen[0] * np.array([np.cos(angle), np.sin(angle)])
        off.append(np.hypot(*(CYLINDERS - at).T).min())
    return float(np.sqrt(np.mean(np.square(off))))
