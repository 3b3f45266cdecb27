# SPDX-License-Identifier: Apache-2.0
"""Table II beside ours, over seeds: how far off each set-up is at the end and along the lap."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache

import numpy as np

from locfuse.sim.sensors import seconds
from papers.celan2017.runs import SETUPS, Run, follow
from papers.celan2017.world import lap
from papers.claims import Claim, Progress, claim_of, share

# Table II: total [m], heading [deg]; x and y [m].
PAPER = {"odometry": (18.96, 38.68), "lidar": (0.78, 3.86), "covered": (2.22, 15.14),
         "covered_switch": (0.08, 6.92)}  # fmt: skip
PAPER_XY = {"odometry": (8.62, 16.89), "lidar": (-0.77, -0.08), "covered": (0.91, -2.03),
            "covered_switch": (0.08, 0.005)}  # fmt: skip
REQUIRED = {"lidar": (0.20, 2.0), "covered_switch": (0.10, 2.0)}
GAIN = 25.0  # by the switch, where LiDAR alone gets lost
LONGEST_S = 30.0  # lost after an injection
REAL_TIME = 100.0  # times that a replay is at least as fast
NEVER_LOST = ("lidar", "covered", "covered_switch", "lidar_switch")
NEAR_M, LOST_M = 0.5, 1.0
NEAR = 0.95  # of the time where the anchors are
SWITCHED = ("covered_switch", "hall_switch")  # it has nothing to do in the first, all in the second


@cache  # rows and pictures show the same runs
def runs_of(seed: int) -> dict[str, Run]:
    """Return the runs of all set-ups on the lap of a seed."""
    of = lap(seed)
    return {name: follow(of, setup, seed) for name, setup in SETUPS.items()}


def laps(seeds: int, progress: Progress = lambda done, total: None) -> dict[str, list[Run]]:
    """Return the runs of each set-up on the laps of seeds 0 to seeds - 1."""
    every = []
    for seed in range(seeds):
        every.append(runs_of(seed))
        progress(seed + 1, seeds)
    return {name: [runs[name] for runs in every] for name in SETUPS}


def setup_claims(name: str, runs: Sequence[Run]) -> Iterator[Claim]:
    """Yield the rows of one set-up."""
    key, what = f"celan_{name}", f"{SETUPS[name].text}: "
    ends = np.array([run.end for run in runs])
    total, heading = np.hypot(ends[:, 0], ends[:, 1]), np.abs(np.rad2deg(ends[:, 2]))
    theirs = PAPER.get(name, (None, None))
    bounds = REQUIRED.get(name)
    if name == "odometry":  # not better, not worse: a drift like theirs
        low, high = 0.5 * PAPER[name][0], 2.0 * PAPER[name][0]
        yield claim_of(f"{key}_end", f"{what}error at the end", "m", theirs[0], total,
                       f"{low:.0f}..{high:.0f}", lambda v: low <= v <= high)  # fmt: skip
        turn = 0.5 * PAPER[name][1], 2.0 * PAPER[name][1]
        yield claim_of(f"{key}_end_heading", f"{what}heading at the end", "deg", theirs[1], heading,
                       f"{turn[0]:.0f}..{turn[1]:.0f}",
                       lambda v: turn[0] <= v <= turn[1])  # fmt: skip
    else:
        yield _at_most(f"{key}_end", f"{what}error at the end", "m", theirs[0], total,
                       None if bounds is None else bounds[0])  # fmt: skip
        yield _at_most(f"{key}_end_heading", f"{what}heading at the end", "deg",
                       theirs[1], heading,
                       None if bounds is None else bounds[1])  # fmt: skip
    if name in PAPER:
        for axis, letter in enumerate("xy"):
            yield _at_most(f"{key}_end_{letter}", f"{what}|{letter}| at the end", "m",
                           abs(PAPER_XY[name][axis]), np.abs(ends[:, axis]))  # fmt: skip
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
        yield claim_of("celan_switch_gain", what, "1", 25.0, lost, f">= {GAIN:g}",
                       lambda v: v >= GAIN)  # fmt: skip
    else:
        yield Claim("celan_switch_gain", what, "1", 25.0, None, None, None, f">= {GAIN:g}", None,
                    "no lap ends lost")  # fmt: skip


def end_m(run: Run) -> float:
    """Return the error of position at the end."""
    return float(np.hypot(*run.end[:2]))


def longest_lost_s(run: Run) -> float:
    """Return the longest time without a pose within `LOST_M` that begins after an injection."""
    if not run.injections:
        return 0.0
    after = run.stamp_ns >= run.injections[0].stamp
    time_s = seconds(run.stamp_ns[after])
    found = np.flatnonzero(run.off_m[after] <= LOST_M)
    edges = np.concatenate([[time_s[0]], time_s[found], [time_s[-1]]])
    return float(np.diff(edges).max())


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
