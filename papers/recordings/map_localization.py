# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo localization on recordings and simulated floors: rows for results/accuracy.md."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from locfuse import _core
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.eval.errors import errors_against
from locfuse.eval.relations import relation_errors, relation_metrics
from locfuse.run.mcl import Localization, localize, with_poses_of
from locfuse.run.messages import truth_of
from locfuse.run.run import run
from locfuse.sim.scenario import simulate
from locfuse.types import NANOSECONDS, FloatArray, Log, LogError, Trajectory
from papers.claims import Claim, Progress, absent, claim_of, claims_of, share
from papers.recorded import load_recording
from papers.recordings.reference_alignment import moved_truth, settled_truth
from papers.scores import rms

# Of a wheeled robot of which nothing else is known; the same for every recording.
WHEELS = {
    "sigma_longitudinal_per_sqrt_m": 0.1,
    "sigma_lateral_per_sqrt_m": 0.05,
    "sigma_heading_per_sqrt_m": 0.05,
    "sigma_heading_per_sqrt_rad": 0.1,
}
SIMULATED_WHEELS = {
    "sigma_longitudinal_per_sqrt_m": 0.03,
    "sigma_lateral_per_sqrt_m": 0.0,
    "sigma_heading_per_sqrt_m": 0.02,
    "sigma_heading_per_sqrt_rad": 0.03,
}
RATE_HZ = 2.0  # of poses of the particles
AISLE_M = 2.0  # of travel after which the aisle must be the right one
RECORDINGS = {  # dataset, folder, run, position [m] and heading [deg] required
    "Wean Hall 1": ("wean_hall", "wean-hall", "robotdata1", 0.12, 1.5),
    "Wean Hall 3": ("wean_hall", "wean-hall", "robotdata3", 0.12, 1.5),
    "TurtleBot 4": ("turtlebot4_mac", "turtlebot4-mac", None, 0.05, None),
    "office": ("mrpt_office", "mrpt-uwb-lidar", None, 0.10, None),
    "Gazebo run3": ("ieu_gazebo", "ieu-gazebo-uwb-lidar", "run3", 0.03, 0.7),
    "Gazebo straight": ("ieu_gazebo", "ieu-gazebo-uwb-lidar", "straight", 0.03, 0.7),
}
# References that lie elsewhere than the map, moved onto it without any of our localizers.
ON_ITS_MAP: dict[str, Callable[[Log], Log]] = {
    "office": settled_truth,
    "Gazebo run3": moved_truth,
    "Gazebo straight": moved_truth,
}
SIMILAR_CORRIDORS = (
    "Wean Hall 1",
    "Wean Hall 3",
)  # its corridors: what counts from nothing is which
STARTS = 40  # over the first 70 % of a recording
TRAVEL_M = 10.0
KIDNAPPINGS = 5  # per seed: one in twenty may fail
NEAR_M, NEAR_RAD = 0.5, 0.35


def map_claims(seeds: int, progress: Progress, configs: Path | None) -> list[Claim]:
    """Repeat every run; rows of recordings that are not there say so.

    Parameters
    ----------
    configs : Path or None
        Folder of the ready configurations: recordings lie beside the project.
    seeds : int
        Runs per row of tracking and simulation.
    progress : callable
        Receives (parts done, parts in all).
    """
    parts: list[Callable[[], Iterator[Claim]]] = [
        lambda: _simulated(seeds),
        lambda: _kidnapped(KIDNAPPINGS * seeds),
        lambda: _aisles(seeds),
        *([] if configs is None else _recorded_parts(configs, seeds)),
    ]
    return claims_of(parts, progress)


def _recorded_parts(configs: Path, seeds: int) -> list[Callable[[], Iterator[Claim]]]:
    return [
        *(lambda name=name: _tracked(configs, name, seeds) for name in RECORDINGS),
        *(lambda name=name: _found(configs, name)
          for name in (*SIMILAR_CORRIDORS, "TurtleBot 4", "office")),
        lambda: _intel(configs),
        *(lambda name=name: _fused(configs, name, seeds) for name in ("Gazebo run3",
                                                                      "Gazebo straight")),
    ]  # fmt: skip


def recorded(configs: Path, name: str, **keys: Any) -> tuple[RunConfig, Log]:
    """Return a configuration with ``mcl`` for one of `RECORDINGS`, and its log.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    dataset, folder, of_dataset, _, _ = RECORDINGS[name]
    sections = {
        "name": name,
        "start_sigma": {"xy_m": 0.2, "heading_deg": 5.7},
        "use": ["odometry"],
        "estimator": {"odometry": WHEELS},
        "mcl": {"min_particles": 1000, "max_particles": 1000},
    }
    return load_recording(configs, dataset, folder, of_dataset, **sections | keys)


def drawn(log: Log, seed: int) -> _core.PoseEstimate:
    """Return the first pose of the truth, off by a draw from 20 cm and 5.7 degrees."""
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    sigma = np.array([0.2, 0.2, 0.1])
    stamps = [int(table["stamp_ns"][0]) for table in (log["odometry"], log["scans"], log["truth"])]
    off = sigma * np.random.default_rng(seed).standard_normal(3)
    x, y = (truth.position[0] + off[:2]).tolist()
    pose = _core.Pose2(x, y, _core.wrap_angle(float(truth.heading[0] + off[2])))
    return _core.PoseEstimate(max(stamps), pose, np.diag(sigma**2))


def _rmse(estimate: Trajectory, truth: Trajectory) -> tuple[float, float]:
    """Return RMSE of position [m] and heading [deg] after the first twentieth of the run."""
    errors = errors_against(estimate, truth)
    assert errors.heading is not None
    return _settled_rms(errors.position), float(np.rad2deg(_settled_rms(errors.heading[:, None])))


def _settled_rms(errors: FloatArray) -> float:
    """Return the root of the mean square of rows, without their first twentieth."""
    return rms(errors[len(errors) // 20 :])


def _tracked(configs: Path, name: str, seeds: int) -> Iterator[Claim]:
    """Compare with the reference as published, and where it lies elsewhere with it on the map."""
    _, _, _, limit, limit_deg = RECORDINGS[name]
    key, what = name.replace(" ", "_").lower(), f"{name}, tracked: "
    try:
        config, log = recorded(configs, name)
    except LogError as error:
        yield absent(f"map_{key}", f"{what}position RMSE", str(error), f"<= {limit:g}")
        return
    runs = [
        localize(config.model_copy(update={"seed": seed}), log, start=drawn(log, seed)).estimate
        for seed in range(seeds)
    ]
    yield from _errors_of(runs, log, f"map_{key}", what, limit, limit_deg)
    if name in ON_ITS_MAP:
        on_map = ON_ITS_MAP[name](log)
        what = f"{name}, tracked, on its map: "
        yield from _errors_of(runs, on_map, f"map_{key}_on_map", what, limit, limit_deg)


def _errors_of(
    runs: Sequence[Trajectory],
    log: Log,
    key: str,
    what: str,
    limit_m: float,
    limit_deg: float | None,
) -> Iterator[Claim]:
    truth = truth_of(log)
    assert truth is not None
    found = np.array([_rmse(estimate, truth) for estimate in runs])
    yield claim_of(key, f"{what}position RMSE", "m", None, found[:, 0], f"<= {limit_m:g}",
                   lambda v: v <= limit_m)  # fmt: skip
    most = np.inf if limit_deg is None else limit_deg
    yield claim_of(f"{key}_heading", f"{what}heading RMSE", "deg", None, found[:, 1],
                   "-" if limit_deg is None else f"<= {limit_deg:g}",
                   lambda v: v <= most)  # fmt: skip


def excerpt(log: Log, when: Callable[[NDArray[np.int64]], NDArray[np.bool_]], *names: str) -> Log:
    """Return a log with the rows that `when` keeps of some tables, or of all that have stamps."""
    tables = dict(log.tables)
    for name in names or [name for name, table in tables.items() if "stamp_ns" in table]:
        rows = when(tables[name]["stamp_ns"])
        tables[name] = {key: column[rows] for key, column in tables[name].items()}
    return replace(log, tables=tables)


def _outside(span: tuple[int, int], stamp: NDArray[np.int64]) -> NDArray[np.bool_]:
    return (stamp < span[0]) | (stamp >= span[1])


def right(estimate: Trajectory, truth: Trajectory) -> tuple[NDArray[np.bool_], FloatArray]:
    """Return where the place is right, and how far the robot had gone [m], where truth is known."""
    errors = errors_against(estimate, truth)
    assert errors.heading is not None
    at = np.column_stack([np.interp(errors.stamp_ns, truth.stamp_ns, truth.position[:, i])
                          for i in (0, 1)])  # fmt: skip
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))])
    near = np.hypot(*errors.position.T) < NEAR_M
    return near & (np.abs(errors.heading) < NEAR_RAD), gone


def _found(configs: Path, name: str) -> Iterator[Claim]:
    key, what = name.replace(" ", "_").lower(), f"{name}, from nothing: "
    try:
        mcl = {"min_particles": 500, "max_particles": 20_000}
        config, log = recorded(configs, name, start="auto", mcl=mcl)
    except LogError as error:
        yield absent(f"map_{key}_found", f"{what}right after 10 m", str(error), ">= 95")
        return
    truth = truth_of(ON_ITS_MAP[name](log) if name in ON_ITS_MAP else log)
    assert truth is not None
    begin, end = int(log["scans"]["stamp_ns"][0]), int(log["scans"]["stamp_ns"][-1])
    runs, rmse = [], []
    for start in range(STARTS):
        first = begin + round(0.7 * (end - begin) * start / (STARTS - 1))
        rest = excerpt(log, partial(operator.le, first))
        of = localize(config.model_copy(update={"seed": start}), rest)
        runs.append(_start_of_run(of, truth))
        rmse.append(_rmse_once_ready(of, truth))
    at_travel, at_end, wrong = np.array(runs).T
    yield share(f"map_{key}_found", f"{what}right after 10 m", int(at_travel.sum()), STARTS, 0.95)
    yield share(f"map_{key}_end", f"{what}right at the end", int(at_end.sum()), STARTS, 0.95)
    yield share(f"map_{key}_wrong", f"{what}ready and wrong on the way", int(wrong.sum()), STARTS,
                0.05, at_most=True)  # fmt: skip
    if name not in SIMILAR_CORRIDORS:
        _, _, _, limit, _ = RECORDINGS[name]
        known = np.array([value for value in rmse if value is not None])
        yield claim_of(f"map_{key}_ready", f"{what}position RMSE once ready ({len(known)} are)",
                       "m", None, known, f"<= {limit:g}", lambda v: v <= limit)  # fmt: skip


def _rmse_once_ready(of: Localization, truth: Trajectory) -> float | None:
    """Return the RMSE of position [m] from where it is first called ready; None where it never is.

    As of a run from a known start, without the first twentieth.
    """
    errors = errors_against(of.estimate, truth)
    ready = of.ready[errors.row]
    if not ready.any():
        return None
    return _settled_rms(errors.position[ready.argmax() :])


def _start_of_run(of: Localization, truth: Trajectory) -> tuple[bool, bool, bool]:
    """Return whether it is right after 10 m, right at the end, and ever ready and wrong."""
    good, gone = right(of.estimate, truth)
    row = min(int(np.searchsorted(gone, TRAVEL_M)), len(good) - 1)
    ready = of.ready[errors_against(of.estimate, truth).row]
    return bool(good[row]), bool(good[-1]), bool(np.any(ready & ~good))


def _intel(configs: Path) -> Iterator[Claim]:
    """Score relations of the `Mcl` alone, and of the pose EKF with its poses and the wheels."""
    what = "Intel lab on its map"
    mcl = {"min_particles": 1000, "max_particles": 1000, "poses_hz": RATE_HZ}
    try:
        config, log = load_recording(
            configs, "intel_lab", "intel-lab", "test", name="intel", use=["odometry", "poses"],
            estimator={"odometry": WHEELS}, mcl=mcl)  # fmt: skip
    except LogError as error:
        yield absent("map_intel", f"{what}: short relations", str(error), "<= 0.045")
        return
    for key, how, estimate, most in (
        ("intel", "", localize(config, log).estimate, None),
        ("intel_fused", ", with wheels in the EKF", run(config, log).estimate, 0.045),
    ):
        short = relation_metrics(relation_errors(estimate, log["relations"]))["short"]
        for kind, unit in (("translation", "m"), ("rotation", "deg")):
            value = float(short[f"{kind}_mean_{unit}"])
            limit = most if unit == "m" else None
            yield Claim(f"map_{key}_{unit}", f"{what}{how}: short relations, {kind}", unit, None,
                        value, value, value, "-" if limit is None else f"<= {limit:g}",
                        limit is None or value <= limit)  # fmt: skip


def _fused(configs: Path, name: str, seeds: int) -> Iterator[Claim]:
    """Poses at 2 Hz of our own MCL, UWB ranges and odometry in the pose EKF, as in ekim2020.

    The noise of ranges and wheels is that of the recording's notes.
    """
    key, what = name.replace(" ", "_").lower(), f"{name}, MCL at 2 Hz"
    mcl = {"min_particles": 1000, "max_particles": 1000, "poses_hz": RATE_HZ}
    try:
        config, log = recorded(configs, name, mcl=mcl, use=["odometry", "ranges", "poses"])
    except LogError as error:
        yield absent(f"map_{key}_fused", f"{what} alone / with UWB and wheels", str(error), ">= 2")
        return
    noted = load_config(configs / "ieu_gazebo.yaml").estimator
    fusing = config.model_copy(update={"estimator": noted, "mcl": None})
    truth = truth_of(log)
    assert truth is not None
    gains = []
    for seed in range(seeds):
        of_seed = config.model_copy(update={"seed": seed})
        alone = localize(of_seed, log, start=drawn(log, seed))
        with_poses = with_poses_of(alone, log, RATE_HZ)
        fused = run(fusing, with_poses, start=drawn(log, seed)).estimate
        gains.append((_rmse(alone.estimate, truth)[0], _rmse(fused, truth)[0]))
    alone_m, fused_m = np.array(gains).T
    yield claim_of(f"map_{key}_fused_rmse", f"{what}, UWB and wheels: RMSE", "m", None, fused_m,
                   "-", lambda v: True)  # fmt: skip
    yield claim_of(f"map_{key}_fused", f"{what} alone / with UWB and wheels", "1", None,
                   alone_m / fused_m, ">= 2", lambda v: v >= 2.0)  # fmt: skip


def simulated(seed: int, **keys: Any) -> tuple[RunConfig, Log]:
    """Return a floor of rooms, 20 x 14 m in cells of 5 cm, a drive of a minute, and its log."""
    config = parse_config(
        {
            "simulation": {
                "room_m": [20, 14],
                "duration_s": 60,
                "map": {"generate": "rooms", "seed": seed},
                "path": {"shape": "roam", "speed_mps": 0.4},
                "ranges": None,
                "poses": None,
                "laser": {"range_max_m": 12.0, "sigma_m": 0.02},
            },
            "seed": seed,
            "start_sigma": {"xy_m": 0.2, "heading_deg": 5.7},
            "estimator": {"odometry": SIMULATED_WHEELS},
            "mcl": keys,
        }
    )
    assert config.simulation is not None
    return config, simulate(config.simulation, np.random.default_rng(seed))


def warehouse(seed: int, *, ranges: bool) -> tuple[RunConfig, Log]:
    """Return a warehouse of similar aisles, 30 x 24 m, searched from nothing, and its log.

    The laser sees 6 m; eight UWB anchors hang along the walls.
    """
    places = [(0, 0), (15, 0), (30, 0), (30, 12), (30, 24), (15, 24), (0, 24), (0, 12)]
    config = parse_config(
        {
            "simulation": {
                "room_m": [30, 24],
                "duration_s": 60,
                "map": {"generate": "warehouse", "seed": seed},
                "path": {"shape": "roam", "speed_mps": 0.5},
                "anchors": {f"A{i}": [*place, 3.0] for i, place in enumerate(places)},
                "tags": {"tag": [0, 0, 0.5]},
                "ranges": {"sigma_m": 0.1, "sigma_relative": 0.0} if ranges else None,
                "poses": None,
                "laser": {"range_max_m": 6.0, "sigma_m": 0.02},
            },
            "seed": seed,
            "start": "auto",
            "estimator": {"odometry": SIMULATED_WHEELS},
            "mcl": {"max_particles": 20_000},
        }
    )
    assert config.simulation is not None
    return config, simulate(config.simulation, np.random.default_rng(seed))


def _aisles(seeds: int) -> Iterator[Claim]:
    """Find the aisle among similar ones: with ranges at once; without, never ready and wrong."""
    at_travel, wrong, found = [], [], []
    for seed in range(seeds):
        for ranges in (True, False):
            config, log = warehouse(seed, ranges=ranges)
            truth = truth_of(log)
            assert truth is not None
            of = localize(config, log)
            good, gone = right(of.estimate, truth)
            ready = of.ready[errors_against(of.estimate, truth).row]
            if ranges:
                at_travel.append(bool(good[int(np.searchsorted(gone, AISLE_M))]))
            else:
                wrong.append(bool(np.any(ready & ~good)))
                found.append(bool(good[-1]))
    what = "warehouse, from nothing"
    yield share("map_warehouse_uwb", f"{what}, with UWB: right after 2 m", sum(at_travel), seeds,
                0.98)  # fmt: skip
    yield share("map_warehouse_wrong", f"{what}, without: ready and wrong", sum(wrong), seeds, 0.05,
                at_most=True)  # fmt: skip
    yield share("map_warehouse_end", f"{what}, without: right at the end", sum(found), seeds, 0.0)


def _simulated(seeds: int) -> Iterator[Claim]:
    """Track on the map that the world was made of: no errors of the map, so `sigma_map_*` are 0."""
    found, nees = [], []
    for seed in range(seeds):
        config, log = simulated(seed, min_particles=1000, max_particles=1000, beams=180,
                                independent_beams=30.0, sigma_map_m=0.0, sigma_map_rad=0.0,
                                spacing_m=0.05)  # fmt: skip
        truth = truth_of(log)
        assert truth is not None
        estimate = localize(config, log, start=drawn(log, seed)).estimate
        found.append(_rmse(estimate, truth))
        values = errors_against(estimate, truth).nees
        assert values is not None
        nees.append(float(np.mean(values[len(values) // 20 :])))
    position, heading = np.array(found).T
    yield claim_of("map_rooms", "rooms, tracked: position RMSE", "cm", None, 100.0 * position,
                   "<= 2", lambda v: v <= 2.0)  # fmt: skip
    yield claim_of("map_rooms_heading", "rooms, tracked: heading RMSE", "deg", None, heading,
                   "<= 0.3", lambda v: v <= 0.3)  # fmt: skip
    yield claim_of("map_rooms_nees", "rooms, tracked: NEES of 3", "1", None, np.array(nees),
                   "2..4", lambda v: 2.0 <= v <= 4.0)  # fmt: skip


def _kidnapped(seeds: int) -> Iterator[Claim]:
    """Carry the robot 17 seconds of its drive ahead, without a word from wheels or laser."""
    back = 0
    for seed in range(seeds):
        config, log = simulated(seed)
        truth = truth_of(log)
        assert truth is not None
        begin = int(log["scans"]["stamp_ns"][0])
        cut = begin + 15 * NANOSECONDS, begin + 32 * NANOSECONDS
        carried = excerpt(log, partial(_outside, cut), "odometry", "scans")
        odometry = carried["odometry"]
        first = int(np.searchsorted(odometry["stamp_ns"], cut[1]))
        for key in ("dx_m", "dy_m", "dheading_rad"):
            odometry[key][first] = 0.0
        of = localize(config, carried, start=drawn(log, seed))
        good, _ = right(of.estimate, truth)
        stamp = errors_against(of.estimate, truth).stamp_ns
        tenth = np.abs(stamp - (cut[1] + 10 * NANOSECONDS)) < NANOSECONDS
        back += int(np.mean(good[tenth]) > 0.5)
    yield share("map_kidnapped", "rooms, carried away: found again in 10 s", back, seeds, 0.95)
