# SPDX-License-Identifier: Apache-2.0
"""What wells reports (no table, but words and figures), and our rows about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from locfuse.eval.consistency import band
from locfuse.types import FloatArray, wrap_angle
from papers.claims import Claim, Paper, Progress, Statement, claim_of, consistent
from papers.wells.experiments import FINER, Paths, by_arc, by_beam, drive_both

PAPER = Paper(
    "wells",
    "J. Wells and O. Omotuyi: Laser based EKF localization on TurtleBot",
    "An EKF on cylinders that a laser sees; the paper trusts the heading of its odometry.",
    seeds=20,
    quick_seeds=5,
    statements=(
        Statement(
            "IV, Figs. 3 to 6", "its EKF against its laser alone",
            "the EKF is much more accurate",
            ("wells_paper_las", "wells_paper_ekf"),
            lambda laser, ekf: ekf < laser,
            "wells_clean",
        ),
        Statement(
            "V, Figs. 4 and 6", "its EKF against the truth",
            "a near perfect match (no figure)",
            ("wells_paper_ekf", "wells"),
            lambda ekf, ours: ekf <= 5.0,
            "wells_clean",
            "taken as within 5 cm; its heading is that of the odometry, which drifts",
        ),
        Statement(
            "V", "clean odometry against the laser",
            "odometry is nearer to the truth",
            ("wells_odometry_first", "wells_odometry_rmse", "wells_paper_las"),
            lambda first, whole, laser: first < laser,
            remark="of the first quarter of a drive, as theirs was short; it drifts past it later",
        ),
        Statement(
            "V", "with slip, the laser",
            "is then more reliable than the odometry",
            ("wells_spoilt_odometry_rmse", "wells_spoilt_paper_las", "wells_spoilt"),
            lambda odometry, laser, ours: laser < 0.5 * odometry,
            "wells_spoilt",
            "taken as half its error; one beam is turned by the heading of that odometry, ours "
            "estimates the heading",
        ),
        Statement(
            "V", "odometry over a long way",
            "errors add up with the distance; its tests were too short to show it",
            ("wells_odometry_first", "wells_odometry_rmse"),
            lambda first, whole: whole > 1.5 * first,
        ),
        Statement(
            "V", "why the laser is off: resolution",
            "beams a degree apart miss the closest point; finer ones would help",
            ("wells_laser_exact", "wells_laser_beam", "wells_laser_fine"),
            lambda exact, beam, fine: fine < 0.5 * beam,
            remark="taken as half the error; without noise the resolution costs what the first row "
            "says, with noise the closest of many beams is the one that errs most",
        ),
        Statement(
            "V", "why the laser is off: one beam",
            "the arc of several beams could improve it",
            ("wells_laser_beam", "wells_laser_arc"),
            lambda beam, arc: arc < beam,
        ),
        Statement(
            "VI", "heading from the laser",
            "takes several objects in view at once",
            ("wells_two_heading", "wells_heading"),
            lambda two, all_: two < all_,
            remark="best with two in view; between, gyro and single cylinders keep it",
        ),
        Statement(
            "VI", "where the heading is disturbed",
            "the paper's method depends on it; estimating it becomes a necessity",
            ("wells_spoilt_odometry", "wells_spoilt_paper_ekf", "wells_spoilt"),
            lambda turned, paper, ours: paper > 10.0 * ours,
            "wells_spoilt",
        ),
    ),
    captions={
        "wells_clean": "One drive among the four cylinders with clean wheels, and a metre of it: "
        "where the closest beam puts the robot, the paper's EKF, ours, and the truth.",
        "wells_spoilt": "The same drive with wheels that slip and a gyro that drifts: the paper's "
        "EKF is turned away with its odometry, ours stays on the truth.",
    },
)  # fmt: skip


def wells_claims(seeds: int, progress: Progress) -> list[Claim]:
    """Return the rows: clean odometry, slipping wheels and a biased gyro, the laser alone."""
    claims: list[Claim] = []
    for done, slip in enumerate((False, True)):
        progress(done * seeds, 2 * seeds)
        drives = []
        for seed in range(seeds):
            drives.append(drive_both(seed, slip=slip))
            progress(done * seeds + seed + 1, 2 * seeds)
        claims += _rows(drives, slip)
    return [*claims, *laser_claims(seeds)]


def _rows(drives: list[Paths], slip: bool) -> Iterator[Claim]:
    key = "wells_spoilt" if slip else "wells"
    what = "slip and gyro bias: " if slip else "clean odometry: "
    limit_cm, limit_deg = (2.0, 0.5) if slip else (1.0, 0.3)
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
