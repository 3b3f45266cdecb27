# SPDX-License-Identifier: Apache-2.0
"""What celan2017 reports in Tables II and III and in words, and our rows about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from locfuse.eval.consistency import band
from locfuse.types import FloatArray, LogError, Trajectory, wrap_angle
from papers.celan2017.experiments import LOST_M, NEAR_M, SETUPS, Run, end_m, laps, longest_lost_s
from papers.celan2017.figure_eights import (
    FUSED,
    LATE_S,
    METHODS,
    NAMES,
    Ride,
    bound_of,
    errors_of,
    ride,
)
from papers.celan2017.methods import best_causal
from papers.celan2017.trolley import (
    ASKED,
    FILTER_NAMES,
    FOLDER,
    MEMORY,
    RATE_HZ,
    RATES_HZ,
    WAYS,
    Trolley,
    follow,
    headings,
    trolley,
)
from papers.claims import Claim, Paper, Progress, Statement, absent, claim_of, consistent, share
from papers.recorded import ready_claims


def _end(of: str) -> tuple[str, ...]:
    return tuple(f"celan_{of}_end{of_what}" for of_what in ("", "_x", "_y", "_heading"))


def _eight(of: str) -> tuple[str, ...]:
    return tuple(f"celan_eight_{of}_{axis}" for axis in "xy")


PAPER = Paper(
    "celan2017",
    "V. Celan, I. Stancic and J. Music, 2017: Ultra wideband assisted localization of "
    "semi-autonomous floor scrubber",
    "Three UWB tags on one body, and a switch that rescues a lost laser localizer.",
    seeds=20,
    quick_seeds=5,
    statements=(
        Statement(
            "V.A, Table II, Fig. 9", "a lap of 200 m by odometry",
            "ends 19 m off: it drifts considerably",
            _end("odometry"),
            lambda end, *rest: 9.0 <= end <= 38.0,
            "celan_laps",
            "taken as within twice and half of it",
        ),
        Statement(
            "V.A, Table II, Fig. 10", "by LiDAR and AMCL",
            "ends 0.78 m off: more accurate, the choice of primary localizer",
            _end("lidar"),
            lambda end, *rest: end <= 0.78,
            "celan_laps",
        ),
        Statement(
            "V.B, Fig. 11", "UWB against the LiDAR",
            "matches closely in range, but errs more behind walls",
            ("celan_covered_p95", "celan_covered_ranges_p95"),
            lambda without, always: always > without,
            "celan_radios",
            "taken as: UWB that always has a say, behind walls too, makes a lap worse",
        ),
        Statement(
            "V.B, Table II, Fig. 12", "half of the LiDAR covered",
            "ends 2.22 m off, and goes through a wall on the way",
            (*_end("covered"), "celan_covered_lost"),
            lambda end, x, y, heading, lost: end > 1.0,
            "celan_laps",
            "the particle filter here is not lost by it; a wet hall is what loses it (below)",
        ),
        Statement(
            "V.B, Table II, Fig. 13", "UWB put in where it is unsure",
            "ends 0.08 m off",
            _end("covered_switch"),
            lambda end, *rest: end <= 0.1,
            "celan_doubt",
        ),
        Statement(
            "V.B, Fig. 14", "uncertainty with the cover",
            "larger than without it",
            ("celan_covered_sigma_0", "celan_lidar_sigma_0"),
            lambda covered, lidar: covered > lidar,
            "celan_sigmas",
        ),
        Statement(
            "V.B, Fig. 14", "uncertainty ahead and to the side",
            "up to six times as large ahead (variance)",
            ("celan_covered_sigma_0", "celan_covered_sigma_1"),
            lambda ahead, aside: ahead > aside,
            "celan_sigmas",
        ),
        Statement(
            "V.C, Table III", "eights by odometry",
            "RMSE of 1.00 m in x, 3.19 m in y",
            _eight("odometry"),
            lambda x, y: y > x,
            "celan_eight",
            "worse along y; wheels here drift less in three minutes",
        ),
        Statement(
            "V.C, Table III", "eights by UWB",
            "1.10 m in x, 0.96 m in y",
            (*_eight("uwb"), *_eight("uwb_late")),
            lambda x, y, late_x, late_y: 0.5 <= x <= 2.2,
            "celan_eight",
            "taken as within twice and half of it; an RTLS that is 3 s late, as theirs seems to "
            "be, explains most of theirs",
        ),
        Statement(
            "V.C, Table III", "eights by the EKF of 12 states",
            "1.05 m in x, 0.91 m in y: better than UWB alone in both, odometry worst along y",
            (*_eight("triangle"), *_eight("uwb"), "celan_eight_triangle_better",
             "celan_eight_rigid_better"),
            lambda x, y, uwb_x, uwb_y, better, rigid: x < uwb_x and y < uwb_y,
            "celan_eight",
        ),
        Statement(
            "VI", "gain of the switch where the LiDAR is suboptimal",
            "up to 25 times in position",
            ("celan_switch_gain",),
            lambda gain: gain >= 25.0,
            "celan_doubt",
            "of laps that are lost without it, in a wet hall",
        ),
        Statement(
            "VI", "gain of the switch in heading",
            "twice as accurate (15.1 to 6.9 degrees)",
            ("celan_covered_end_heading", "celan_covered_switch_end_heading"),
            lambda without, with_: with_ <= 0.5 * without,
            remark="nothing to gain where half a LiDAR is enough",
        ),
    ),
    captions={
        "celan_laps": "A lap by six set-ups on the map, estimate and truth, with the error at the "
        "end: wheels alone drift away, a LiDAR does not, and in a wet hall half of one does.",
        "celan_radios": "A lap by LiDAR, and what UWB says in its reach: close in the room with "
        "the anchors, off behind walls.",
        "celan_doubt": "The end of a lap through a wet hall, in the room with the anchors: "
        "ellipses of two sigmas, and estimates before and after each injection.",
        "celan_sigmas": "Standard deviations ahead and to the side over a lap; grey: in the room "
        "with the anchors.",
        "celan_eight": "22 s of an eight: truth, wheels, UWB, and three filters.",
    },
)  # fmt: skip


READY = ("celan_triangle.yaml", "lias_triangle.yaml")


def celan_claims(seeds: int, progress: Progress, configs: Path | None = None) -> list[Claim]:
    """Return all rows: Table II, its laps, Table III, and a recorded trolley with three tags.

    Parameters
    ----------
    seeds : int
        Laps, and rides.
    progress : callable
        Receives (laps done, laps in all).
    configs : Path, optional
        Folder of the ready configurations: recordings lie beside the project.
    """
    runs = laps(seeds, progress)
    claims = [claim for name in SETUPS for claim in setup_claims(name, runs[name])]
    return [*claims, *switch_claims(runs), speed_claim(runs["lidar"]), *eight_claims(seeds),
            *trolley_claims(configs),
            *ready_claims(configs, *READY)]  # fmt: skip


# Table II: total [m], heading [deg]; x and y [m].
TABLE_II = {"odometry": (18.96, 38.68), "lidar": (0.78, 3.86), "covered": (2.22, 15.14),
         "covered_switch": (0.08, 6.92)}  # fmt: skip
TABLE_II_XY = {"odometry": (8.62, 16.89), "lidar": (-0.77, -0.08), "covered": (0.91, -2.03),
            "covered_switch": (0.08, 0.005)}  # fmt: skip
REQUIRED = {"lidar": (0.20, 2.0), "covered_switch": (0.10, 2.0)}
SWITCH_GAIN = 25.0  # by the switch, where LiDAR alone gets lost
LONGEST_S = 30.0  # lost after an injection
REAL_TIME = 100.0  # times that a replay is at least as fast
NEVER_LOST = ("lidar", "covered", "covered_switch", "lidar_switch")


NEAR = 0.95  # of the time where the anchors are
SWITCHED = ("covered_switch", "hall_switch")  # it has nothing to do in the first, all in the second


def setup_claims(name: str, runs: Sequence[Run]) -> Iterator[Claim]:
    """Yield the rows of one set-up."""
    key, what = f"celan_{name}", f"{SETUPS[name].text}: "
    ends = np.array([run.end for run in runs])
    total, heading = np.hypot(ends[:, 0], ends[:, 1]), np.abs(np.rad2deg(ends[:, 2]))
    theirs = TABLE_II.get(name, (None, None))
    bounds = REQUIRED.get(name)
    if name == "odometry":  # not better, not worse: a drift like theirs
        low, high = 0.5 * TABLE_II[name][0], 2.0 * TABLE_II[name][0]
        yield claim_of(f"{key}_end", f"{what}error at the end", "m", theirs[0], total,
                       f"{low:.0f}..{high:.0f}", lambda v: low <= v <= high)  # fmt: skip
        turn = 0.5 * TABLE_II[name][1], 2.0 * TABLE_II[name][1]
        yield claim_of(f"{key}_end_heading", f"{what}heading at the end", "deg", theirs[1], heading,
                       f"{turn[0]:.0f}..{turn[1]:.0f}",
                       lambda v: turn[0] <= v <= turn[1])  # fmt: skip
    else:
        yield _at_most(f"{key}_end", f"{what}error at the end", "m", theirs[0], total,
                       None if bounds is None else bounds[0])  # fmt: skip
        yield _at_most(f"{key}_end_heading", f"{what}heading at the end", "deg",
                       theirs[1], heading,
                       None if bounds is None else bounds[1])  # fmt: skip
    if name in TABLE_II:
        for axis, letter in enumerate("xy"):
            yield _at_most(f"{key}_end_{letter}", f"{what}|{letter}| at the end", "m",
                           abs(TABLE_II_XY[name][axis]), np.abs(ends[:, axis]))  # fmt: skip
    if name == "odometry":
        return
    yield _at_most(f"{key}_median", f"{what}median error of a lap", "m", None,
                   [float(np.median(run.off_m)) for run in runs])  # fmt: skip
    yield _at_most(f"{key}_p95", f"{what}95 % of a lap are within", "m", None,
                   [float(np.quantile(run.off_m, 0.95)) for run in runs])  # fmt: skip
    yield _at_most(f"{key}_map_p95", f"{what}95 % of a lap, on the bent map", "m", None,
                   [float(np.quantile(run.off_map_m, 0.95)) for run in runs])  # fmt: skip
    yield share(f"{key}_lost", f"{what}laps that are {LOST_M:g} m off at some time",
                sum(bool(run.off_m.max() > LOST_M) for run in runs), len(runs),
                0.0 if name in NEVER_LOST else None, at_most=True)  # fmt: skip
    near = [float(np.mean(run.off_m[run.in_room] <= NEAR_M)) for run in runs]
    asked = NEAR if name in SWITCHED else 0.0
    yield claim_of(f"{key}_room", f"{what}within {NEAR_M:g} m where the anchors are", "%", None,
                   100.0 * np.array(near), f">= {100.0 * asked:g}" if asked else "-",
                   lambda v: v >= 100.0 * asked)  # fmt: skip
    if SETUPS[name].uwb != "none":
        return
    for axis, side in enumerate(("ahead", "to the side")):
        yield _at_most(f"{key}_sigma_{axis}", f"{what}largest sigma {side}", "m", None,
                       [float(run.sigma_in_body[:, axis].max()) for run in runs])  # fmt: skip


def switch_claims(runs: Mapping[str, Sequence[Run]]) -> Iterator[Claim]:
    """Yield what the switch is good for, and how often it acts where it need not."""
    clean = sum(len(run.injections) for run in runs["lidar_switch"])
    laps_of = len(runs["lidar_switch"])
    yield share("celan_false_switches", "LiDAR, UWB by a switch: injections per lap", clean,
                laps_of, 0.1, at_most=True)  # fmt: skip
    for name in SWITCHED:
        what = f"{SETUPS[name].text}: "
        yield _at_most(f"celan_{name}_injections", f"{what}injections per lap", "1", None,
                       [float(len(run.injections)) for run in runs[name]])  # fmt: skip
        yield _at_most(f"celan_{name}_longest", f"{what}longest time lost after an injection", "s",
                       None, [longest_lost_s(run) for run in runs[name]])  # fmt: skip
        yield share(f"celan_{name}_lost_long", f"{what}laps lost for more than {LONGEST_S:g} s "
                    "after an injection",
                    sum(longest_lost_s(run) > LONGEST_S for run in runs[name]), laps_of, 0.0,
                    at_most=True)  # fmt: skip
    pairs = [tuple(map(end_m, pair))
             for pair in zip(runs["hall"], runs["hall_switch"], strict=True)]  # fmt: skip
    lost = [alone / switched for alone, switched in pairs if alone > LOST_M]
    yield share("celan_hall_lost_at_the_end", f"{SETUPS['hall'].text}: laps that end "
                f"{LOST_M:g} m off", len(lost), len(pairs), None)  # fmt: skip
    what = "those: error at the end, LiDAR alone / with the switch"
    if lost:
        yield claim_of("celan_switch_gain", what, "1", 25.0, lost, f">= {SWITCH_GAIN:g}",
                       lambda v: v >= SWITCH_GAIN)  # fmt: skip
    else:
        required = f">= {SWITCH_GAIN:g}"
        yield Claim("celan_switch_gain", what, "1", 25.0, None, None, None, required, None,
                    "no lap ends lost")  # fmt: skip


def speed_claim(runs: Sequence[Run]) -> Claim:
    """Return how many times faster than real time a lap replays."""
    return claim_of("celan_speed", "LiDAR: real time / replay", "1", None,
                    [run.duration_s / run.wall_s for run in runs], f">= {REAL_TIME:g}",
                    lambda v: v >= REAL_TIME)  # fmt: skip


def _at_most(
    id: str, claim: str, unit: str, paper: float | None, values: Iterable[float],
    limit: float | None = None,
) -> Claim:  # fmt: skip
    return claim_of(id, claim, unit, paper, values, "-" if limit is None else f"<= {limit:g}",
                    lambda v: limit is None or v <= limit)  # fmt: skip


# Table III, RMSE [m] along x and y: mean of both runs.
TABLE_III = {"odometry": (1.00, 3.19), "uwb": (1.10, 0.96), "triangle": (1.05, 0.91)}
RIGID_GAIN = 1.3  # of the rigid body over the 12 states


def eight_claims(seeds: int) -> Iterator[Claim]:
    """Yield the rows of Table III."""
    for late_s, when in ((0.0, ""), (LATE_S, f", UWB {LATE_S:g} s late")):
        rides = [ride(seed, late_s) for seed in range(seeds)]
        rmse = {}
        for name, method in METHODS.items():
            if late_s > 0.0 and name == "odometry":
                continue
            found = [method(of) for of in rides]
            off = [errors_of(of, one) for of, one in zip(rides, found, strict=True)]
            rmse[name] = np.array([np.sqrt(np.mean(one**2, axis=0)) for one in off])
            key = f"celan_eight_{name}" + ("_late" if late_s else "")
            what = f"eights, {NAMES[name]}{when}: "
            for axis, letter in enumerate("xy"):
                yield claim_of(f"{key}_{letter}", f"{what}RMSE of {letter}", "m",
                               TABLE_III[name][axis] if name in TABLE_III else None,
                               rmse[name][:, axis], "-", lambda v: True)  # fmt: skip
            yield claim_of(f"{key}_heading", f"{what}RMSE of the heading", "deg", None,
                           np.rad2deg(rmse[name][:, 2]), "-", lambda v: True)  # fmt: skip
            if late_s == 0.0 and name in FUSED:
                yield consistent(key, what, [_nees(one, e) for one, e in
                                             zip(found, off, strict=True)],
                                 band(3, seeds), name == "rigid")  # fmt: skip
        if late_s == 0.0:
            yield from _gains(rmse)
            yield from _bounds(rides, rmse)


def _gains(rmse: Mapping[str, FloatArray]) -> Iterator[Claim]:
    for name in FUSED:
        alone = np.minimum(rmse["odometry"], rmse["uwb"])[:, :2]
        better = np.all(rmse[name][:, :2] < alone, axis=1)
        yield share(f"celan_eight_{name}_better", f"eights, {NAMES[name]}: better in x and y "
                    "than either alone", int(better.sum()), len(better), 1.0)  # fmt: skip
    for name in ("triangle", "kindest"):
        for what, gain in _ratios(rmse[name], rmse["rigid"]):
            yield claim_of(f"celan_eight_{name}_gain_{what}", f"eights: RMSE of the {what}, "
                           f"{NAMES[name]} / PoseEkf", "1", None, gain, f">= {RIGID_GAIN:g}",
                           lambda v: v >= RIGID_GAIN)  # fmt: skip


def _bounds(rides: Sequence[Ride], rmse: Mapping[str, FloatArray]) -> Iterator[Claim]:
    """Yield how near any filter can come, and how far from it those two are."""
    bound = np.array([bound_of(of) for of in rides])
    for what, values, unit in (("x", bound[:, 0], "m"), ("y", bound[:, 1], "m"),
                               ("heading", np.rad2deg(bound[:, 2]), "deg")):  # fmt: skip
        yield claim_of(f"celan_eight_bound_{what}", f"eights, Cramer-Rao bound: {what}", unit, None,
                       values, "-", lambda v: True)  # fmt: skip
    for name in FUSED:
        for what, ratio in _ratios(rmse[name], bound):
            yield claim_of(f"celan_eight_{name}_over_bound_{what}", f"eights: RMSE of the {what}, "
                           f"{NAMES[name]} / bound", "1", None, ratio, "-",
                           lambda v: True)  # fmt: skip


def _ratios(rmse: FloatArray, other: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Yield how many times as large errors (n, 3) of the position and of the heading are."""
    yield "position", np.hypot(*rmse[:, :2].T) / np.hypot(*other[:, :2].T)
    yield "heading", rmse[:, 2] / other[:, 2]


def _nees(found: Trajectory, off: FloatArray) -> float:
    """Return that of the last pose."""
    assert found.covariance is not None
    return float(off[-1] @ np.linalg.solve(found.covariance[-1], off[-1]))


LIMIT_M, LIMIT_DEG = 0.10, 3.0


def trolley_claims(configs: Path | None) -> Iterator[Claim]:
    """Yield the rows of the recording, or one that says why there are none."""
    key, what = "celan_trolley", "trolley, recorded, "
    if configs is None:
        yield absent(key, f"{what}position RMSE", "no examples/configs here")
        return
    try:
        of = trolley((configs / FOLDER).resolve())
    except LogError as missing:
        yield absent(key, f"{what}position RMSE", str(missing), f"<= {LIMIT_M:g}")
        return
    yield from oracle_claims(of, key, what)
    for rate_hz in RATES_HZ:
        for given, by in WAYS:
            off, nees = follow(of, by, given, rate_hz)
            asked = rate_hz == 10 and (given, by) in ASKED
            row = f"{key}_{by}_{given}_{rate_hz}"
            text = f"{what}{given} at {rate_hz} Hz, {FILTER_NAMES[by]}: "
            rmse = float(np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1))))
            turn = float(np.rad2deg(np.sqrt(np.mean(wrap_angle(off[:, 2]) ** 2))))
            yield _row(row, f"{text}position RMSE", "m", rmse, LIMIT_M if asked else None)
            yield _row(f"{row}_heading", f"{text}heading RMSE", "deg", turn,
                       LIMIT_DEG if asked else None)  # fmt: skip
            yield _row(f"{row}_nees", f"{text}NEES of 3", "1", float(np.mean(nees)), None)


def oracle_claims(of: Trolley, key: str, what: str) -> Iterator[Claim]:
    """Yield what can be had of the heading with a constant for each link, whatever the filter."""
    truth, found = headings(of, RATE_HZ // 10)
    off = wrap_angle(found - truth)
    for id, text, value in (
        ("epochs", "rigid fit of each epoch", float(np.sqrt(np.mean(off**2)))),
        ("oracle", "the best causal linear filter of that, fitted to the truth",
         best_causal(truth + off, truth, MEMORY)),
    ):  # fmt: skip
        yield _row(f"{key}_{id}_heading", f"{what}ranges at 10 Hz, {text}: heading RMSE", "deg",
                   float(np.rad2deg(value)), None)  # fmt: skip


def _row(id: str, claim: str, unit: str, value: float, limit: float | None) -> Claim:
    return claim_of(id, claim, unit, None, [value], "-" if limit is None else f"<= {limit:g}",
                    lambda v: limit is None or v <= limit)  # fmt: skip
