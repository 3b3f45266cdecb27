# SPDX-License-Identifier: Apache-2.0
"""wells: an EKF on cylinders that a laser sees; the paper's method beside ours.

The paper trusts the heading of the odometry and takes one beam a scan: the closest, plus the radius
of the cylinder (its eq. 8 to 14). Ours fits every arc, puts the cylinders of a scan together with
the map jointly, and estimates the heading.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from locfuse.eval.consistency import band
from locfuse.report.plot.style import save
from locfuse.types import FloatArray, wrap_angle
from papers.claims import Claim, Progress, claim_of, consistent
from papers.wells.laser import laser_claims
from papers.wells.plots import plot_paths
from papers.wells.runs import Paths, drive_both
from papers.wells.world import CYLINDERS, RADIUS_M

__all__ = ["draw_pictures", "drive_both", "wells_claims"]


def wells_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows: clean odometry, slipping wheels and a biased gyro, the laser alone."""
    claims: list[Claim] = []
    for done, spoilt in enumerate((False, True)):
        progress(done * seeds, 2 * seeds)
        drives = []
        for seed in range(seeds):
            drives.append(drive_both(seed, spoilt=spoilt))
            progress(done * seeds + seed + 1, 2 * seeds)
        claims += _rows(drives, spoilt)
    return [*claims, *laser_claims(seeds)]


def draw_pictures(folder: Path, seeds: int) -> list[Path]:
    """Draw the paths of the first drives, as Fig. 3 and 4 of the paper, and worse odometry."""
    del seeds  # two drives tell
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, spoilt in (("wells_clean", False), ("wells_spoilt", True)):
        paths.append(folder / f"{name}.png")
        drive = drive_both(0, spoilt=spoilt)
        save(plot_paths(CYLINDERS, RADIUS_M, drive.truth, {"laser alone": drive.laser,
             "the paper's": drive.paper[:, :2], "ours": drive.ours[:, :2]}), paths[-1])  # fmt: skip
    return paths


def _rows(drives: list[Paths], spoilt: bool) -> Iterator[Claim]:
    key = "wells_spoilt" if spoilt else "wells"
    what = "slip and gyro bias: " if spoilt else "clean odometry: "
    limit_cm, limit_deg = (2.0, 0.5) if spoilt else (1.0, 0.3)
    for row, when, least in (("", "", 0), ("_two", " with two cylinders in view", 2)):
        parts = [(d.ours[d.cylinders >= least], d.truth[d.cylinders >= least]) for d in drives]
        yield claim_of(f"{key}{row}", f"{what}position RMSE{when}", "cm", None,
                       [100.0 * _rmse(pose[:, :2], truth) for pose, truth in parts],
                       f"<= {limit_cm:g}", lambda v: v <= limit_cm)  # fmt: skip
        yield claim_of(f"{key}{row}_heading", f"{what}heading RMSE{when}", "deg", None,
                       [_heading_rmse(pose, truth) for pose, truth in parts],
                       f"<= {limit_deg:g}", lambda v: v <= limit_deg)  # fmt: skip
    yield claim_of(f"{key}_share", f"{what}scans with two cylinders in view", "%", None,
                   [100.0 * float(np.mean(d.cylinders >= 2)) for d in drives], "-",
                   lambda v: True)  # fmt: skip
    off = np.array([_off(d.ours[-1:], d.truth[-1:])[0] for d in drives])
    nees = [float(e @ np.linalg.solve(d.covariance[-1], e))
            for e, d in zip(off, drives, strict=True)]  # fmt: skip
    yield consistent(key, what, nees, band(3, len(drives)))
    for part, shown in (("laser alone", [d.laser for d in drives]),
                        ("EKF", [d.paper[:, :2] for d in drives])):  # fmt: skip
        rmse_cm = [100.0 * _rmse(p, d.truth) for p, d in zip(shown, drives, strict=True)]
        yield claim_of(f"{key}_paper_{part[:3].lower()}", f"{what}the paper's {part}, RMSE",
                       "cm", None, rmse_cm, "-", lambda v: True)  # fmt: skip
    for row, when, share in (("rmse", "", 1), ("first", " of the first quarter", 4)):
        parts = [(d.odometry[: len(d.truth) // share], d.truth[: len(d.truth) // share])
                 for d in drives]  # fmt: skip
        yield claim_of(f"{key}_odometry_{row}", f"{what}odometry alone, RMSE{when}", "cm", None,
                       [100.0 * _rmse(pose[:, :2], truth) for pose, truth in parts], "-",
                       lambda v: True)  # fmt: skip
    yield claim_of(f"{key}_odometry", f"{what}heading of the odometry, at the end", "deg", None,
                   [float(np.abs(np.rad2deg(_off(d.odometry[-1:], d.truth[-1:])[0, 2])))
                    for d in drives], "-", lambda v: True)  # fmt: skip


def _off(pose: FloatArray, truth: FloatArray) -> FloatArray:
    off = pose - truth
    off[:, 2] = wrap_angle(off[:, 2])
    return off


def _rmse(position: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(np.sum((position - truth[:, :2]) ** 2, axis=1))))


def _heading_rmse(pose: FloatArray, truth: FloatArray) -> float:
    return float(np.rad2deg(np.sqrt(np.mean(_off(pose, truth)[:, 2] ** 2))))
