# SPDX-License-Identifier: Apache-2.0
"""What gadau2022 reports (no table, but words and figures), and our rows about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_args

import numpy as np

from locfuse.types import NANOSECONDS, FloatArray
from papers.claims import Claim, Paper, Progress, Statement, claim_of, claims_of, consistent, share
from papers.gadau2022.experiments import (
    AFTER_S,
    BEFORE_S,
    FOUND_S,
    NOTICED_S,
    OFF_M,
    WORLDS,
    Kidnapping,
    Run,
    kidnap,
    microsimulation,
    nees_band,
    ray_simulation,
    recognized,
)
from papers.gadau2022.methods import Mistake
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
from papers.recorded import ready_claims

_PATHS = ("circle", "star", "square", "pentagon", "random")
_SPEEDS = ("0", "0.3", "1")

PAPER = Paper(
    "gadau2022",
    "A. Gadau and others, 2022: Aerial localization using the extended Kalman filter",
    "Ranges and bearings to landmarks, recognition, GPS, kidnapping; the authors' filter diverges "
    "where ours has to converge.",
    seeds=100,
    quick_seeds=12,
    statements=(
        Statement(
            "IV.A.1, Fig. 4", "GPS, right start, circle",
            "almost at once on the robot's way",
            ("gadau_by_GPS_right_rmse",),
            lambda rmse_cm: rmse_cm < 50.0,
            "gadau_sensors",
            "taken as nearer than a single fix, 50 cm per axis",
        ),
        Statement(
            "IV.A.1, Fig. 5", "GPS, wrong start",
            "approaches the robot's way in a short time",
            ("gadau_by_GPS_wrong_rmse", "gadau_by_GPS_right_rmse"),
            lambda wrong, right: wrong <= 1.5 * right,
            "gadau_sensors",
        ),
        Statement(
            "IV.A.2; V", "one landmark, wrong start",
            "too few: the prediction does not come to the real pose",
            ("gadau_one", "gadau_one_error"),
            lambda converges, error: converges < 50.0,
            "gadau_start",
        ),
        Statement(
            "IV.A.2", "two landmarks, wrong start",
            "better, but still too few",
            ("gadau_two", "gadau_two_time", "gadau_two_error"),
            lambda converges, after, error: converges < 50.0,
            "gadau_start",
            "ranges and bearings of two determine the pose",
        ),
        Statement(
            "IV.A.2; V", "three landmarks in a triangle, wrong start",
            "comes to the real pose after some time, with good accuracy",
            ("gadau_triangle", "gadau_triangle_time", "gadau_triangle_error"),
            lambda converges, after, error: converges >= 99.0,
            "gadau_start",
        ),
        Statement(
            "Abstract; V", "three landmarks: a triangle",
            "better than another arrangement of three",
            ("gadau_triangle_right_rmse", "gadau_line_right_rmse"),
            lambda triangle, line: triangle < 0.9 * line,
            remark="taken as a tenth better; bearings distinguish the sides of a line",
        ),
        Statement(
            "IV.A.2", "four landmarks in a square, near",
            "more accurate than three, and after a little time",
            ("gadau_square_near", "gadau_square_near_right_rmse", "gadau_triangle_right_rmse"),
            lambda converges, four, three: converges >= 99.0 and four < three,
            "gadau_start",
        ),
        Statement(
            "IV.A.2", "more than four landmarks, far away",
            "works, too",
            ("gadau_five_far", "gadau_five_far_error"),
            lambda converges, error: converges >= 99.0,
            "gadau_start",
        ),
        Statement(
            "V", "more than four landmarks",
            "hardly any difference any more",
            ("gadau_square_near_right_rmse", "gadau_five_far_right_rmse"),
            lambda four, five: abs(five - four) <= 0.1 * four,
        ),
        Statement(
            "IV.A.3; V", "circle, star, pentagon, random path",
            "works well on every path",
            tuple(f"gadau_path_{path}" for path in _PATHS),
            lambda *converges: min(converges) >= 99.0,
        ),
        Statement(
            "IV.A.3", "time until it comes to the real pose",
            "changes with the path",
            tuple(f"gadau_path_{path}_time" for path in _PATHS),
            lambda *after: max(after) > min(after),
            remark="by tenths of a second",
        ),
        Statement(
            "IV.A.4, Fig. 7; V", "carried off to another place",
            "a Gaussian stays certain of where it was: the EKF does not find itself again",
            ("gadau_kidnapped_triangle_named", "gadau_kidnapped_triangle_named_after",
             "gadau_kidnapped_triangle_alone", "gadau_kidnapped_triangle_found"),
            lambda named, after, alone, ours: named < 50.0,
            "gadau_kidnapped",
            "asked of the first row, a filter that knows which landmark is which and gates "
            "nothing, as theirs: large residuals pull it over; without names it is lost for good, "
            "unless it notices",
        ),
        Statement(
            "IV.B.1, Figs. 3, 8 and 9", "landmarks recognized by single rays",
            "seems to work fine",
            ("gadau_rule_found", "gadau_rule_right", "gadau_rule_found_off",
             "gadau_rule_right_off"),
            lambda found, right, found_off, right_off: found >= 95.0 and right >= 95.0,
            remark="asked of the true pose; of one that is 0.3 m off it misses every other disc",
        ),
        Statement(
            "IV.B.2, Figs. 10 and 11", "second simulator: driving",
            "the estimate leaves the robot, the faster the larger the speed",
            tuple(f"gadau_rule_both_{speed}" for speed in _SPEEDS)
            + tuple(f"gadau_rays_5_{speed}" for speed in _SPEEDS),
            lambda standing, slow, fast, *ours: standing < slow < fast,
            "gadau_rays",
            "with its Jacobian, its rule and ranges to the surface; ours does not",
        ),
        Statement(
            "IV.B.2, Fig. 12", "one or two landmarks in view",
            "the estimate leaves the robot faster",
            ("gadau_one_right_rmse", "gadau_two_right_rmse", "gadau_triangle_right_rmse"),
            lambda one, two, three: one > two > three,
        ),
        Statement(
            "IV.B.2, Fig. 13", "route across the map",
            "no big influence on accuracy",
            tuple(f"gadau_path_{path}_right_rmse" for path in _PATHS),
            lambda *rmse: max(rmse) <= 1.25 * min(rmse),
        ),
        Statement(
            "IV.B.2, Fig. 14", "second simulator: standing still",
            "the estimate leaves the robot all the same",
            ("gadau_rule_derivatives_0", "gadau_rays_5_0_worst"),
            lambda theirs_m, ours_cm: theirs_m > 0.2 and ours_cm < 5.0,
            "gadau_rays",
            "by its rule and its Jacobian, to decimetres and no further; ours does not",
        ),
        Statement(
            "IV.B.2", "why: discs with a large radius",
            "a possible reason",
            ("gadau_surface", "gadau_rule_derivatives_0", "gadau_rule_both_0", "gadau_derivatives"),
            lambda surface, without, with_, derivatives: with_ > 1.5 * without,
            "gadau_mistakes",
            "ranges to the surface cost a metre, but do not diverge; the Jacobian of Fig. 2 does",
        ),
        Statement(
            "IV.B.2", "more landmarks",
            "would improve it (a proposal)",
            tuple(f"gadau_rays_{discs}_{speed}" for speed in _SPEEDS for discs in (5, 8)),
            lambda *rmse: all(
                eight < five for five, eight in zip(rmse[::2], rmse[1::2], strict=True)
            ),
        ),
        Statement(
            "V", "GPS against the laser",
            "GPS gives the better estimate, as it measures the position itself",
            ("gadau_by_GPS_right_rmse", "gadau_by_laser_right_rmse",
             "gadau_by_GPS_as_good_as_the_laser_right_rmse",
             "gadau_by_laser_one_landmark_wrong_rmse"),
            lambda gps, laser, as_good, one: gps < laser,
            "gadau_sensors",
            "three landmarks beat even fixes as good and frequent as they are; with one landmark "
            "and a wrong start it is so",
        ),
    ),
    captions={
        "gadau_start": "Error of the position after a start that is 2 m and 60 degrees wrong, for "
        "each arrangement of landmarks: one alone does not determine the pose.",
        "gadau_sensors": "One drive on a circle by GPS and by laser on three landmarks: the floor, "
        "and the errors of position and heading.",
        "gadau_mistakes": "Errors from the right start among four landmarks: ours, with the "
        "Jacobian as the paper's Fig. 2 prints it, and with ranges to the surface of discs.",
        "gadau_kidnapped": "A robot that is carried off: a PoseEkf alone stays where it believed "
        "to be, RecoveringEkf notices, is lost for a moment, and finds itself.",
        "gadau_rays": "Second simulator, 151 rays on five discs: errors of position by the paper's "
        "rule, Jacobian and ranges to the surface, at three speeds, and ours.",
    },
)  # fmt: skip


RIGHT = 5  # times as many right starts: of NEES, few seeds show little

# How the paper's rule for discs is fused.
BY_RULE: dict[str, tuple[tuple[Mistake, ...], str]] = {
    "rule": ((), "right derivatives"),
    "rule_derivatives": (("derivatives",), "derivatives of Fig. 2"),
    "rule_both": (("derivatives", "surface"), "derivatives of Fig. 2 and ranges to the surface"),
}


READY = ("gadau_near.yaml", "gadau_gps.yaml", "gadau_discs.yaml")


def gadau_claims(seeds: int, progress: Progress, configs: Path | None = None) -> list[Claim]:
    """Return all rows; the folder is that of the ready configurations."""
    parts: list[Callable[[], Iterator[Claim]]] = [
        *(lambda name=name: _layout(name, seeds) for name in LAYOUTS),
        *(lambda name=name: _path(name, seeds) for name in PATHS),
        *(lambda name=name: _sensors(name, seeds) for name in SENSORS),
        lambda: _theirs(seeds),
        *(lambda key=key: _by_their_rule(key, max(seeds // 10, 2)) for key in BY_RULE),
        *(lambda name=name: _discs(name, seeds) for name in DISCS),
        lambda: kidnapping_claims(seeds),
        lambda: recognition_claims(seeds),
        lambda: ready_claims(configs, *READY),
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


def kidnapping_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: landmarks have no names."""
    for world, what in WORLDS.items():
        runs = [kidnap(world, seed, beside=world == "triangle") for seed in range(seeds)]
        key = f"gadau_kidnapped_{world}"
        noticed = np.array([run.noticed_s() for run in runs])
        found = np.array([run.found_s() for run in runs])
        found = found[~np.isnan(found)]
        yield share(key, f"kidnapped, {what}: noticed within {NOTICED_S:g} s",
                    int(np.sum(noticed <= NOTICED_S)), seeds, 0.99)  # fmt: skip
        yield claim_of(f"{key}_noticed", f"kidnapped, {what}: noticed after", "s", None,
                       np.minimum(noticed, AFTER_S), "-", lambda v: True)  # fmt: skip
        yield share(f"{key}_found", f"kidnapped, {what}: found within {FOUND_S:g} s of seeing 3",
                    int(np.sum(found <= FOUND_S)), len(found), 0.97)  # fmt: skip
        yield claim_of(f"{key}_found_after", f"kidnapped, {what}: found after", "s", None,
                       np.minimum(found, AFTER_S), "-", lambda v: True)  # fmt: skip
        hours = seeds * (BEFORE_S + AFTER_S) / 3600.0
        rate = sum(run.false_alarms() for run in runs) / hours
        yield Claim(f"{key}_false", f"{what}: false alarms in {hours:.1f} h", "1/h", None, rate,
                    rate, rate, "<= 1", rate <= 1.0)  # fmt: skip
        nees = [min(run.nees, ENDLESS) for run in runs if not np.isnan(run.nees)]
        yield consistent(key, f"kidnapped, {what}, found again: ", nees, nees_band(len(nees)))
        if world == "triangle":
            yield from _beside_claims(key, f"kidnapped, {what}", runs)


def _beside_claims(key: str, what: str, runs: list[Kidnapping]) -> Iterator[Claim]:
    """Yield whether a Kalman filter finds itself again that does not ask whether it is lost."""
    filters = {
        "alone": ("PoseEkf alone", [run.found_s(run.alone) for run in runs]),
        "named": ("PoseEkf alone, told which is which, no gate",
                  [run.found_s(run.named) for run in runs]),
    }  # fmt: skip
    for name, (text, found) in filters.items():
        yield share(f"{key}_{name}", f"{what}, {text}: found within {FOUND_S:g} s",
                    int(np.sum(np.array(found) <= FOUND_S)), len(runs), None)  # fmt: skip
        yield claim_of(f"{key}_{name}_after", f"{what}, {text}: found after", "s", None,
                       np.minimum(found, AFTER_S), "-", lambda v: True,
                       f"never counts as {AFTER_S:g}")  # fmt: skip


def recognition_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows: from the true pose, and from one that is predicted wrong."""
    for key, off_m, what in (("", 0.0, ""), ("_off", OFF_M, f", pose {OFF_M:g} m off")):
        seen = [recognized(discs, seed, off_m) for discs in DISCS for seed in range(seeds)]
        found, right = sum(one.found for one in seen), sum(one.right for one in seen)
        yield share(f"gadau_rule_found{key}", f"rule of Fig. 3{what}: of discs in view, recognized",
                    right, sum(one.in_view for one in seen), None)  # fmt: skip
        yield share(f"gadau_rule_right{key}", f"rule of Fig. 3{what}: of what it names, right",
                    right, found, None)  # fmt: skip
