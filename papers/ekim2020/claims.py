# SPDX-License-Identifier: Apache-2.0
"""What ekim2020 reports, and our rows about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from locfuse import _core
from locfuse.eval.consistency import band
from locfuse.eval.errors import errors_against
from locfuse.run.messages import to_messages, truth_of
from locfuse.run.run import run
from locfuse.sim.scenario import simulate
from locfuse.types import FloatArray, Log, LogError
from papers.claims import Claim, Paper, Progress, Statement, absent, claim_of, share
from papers.ekim2020.experiments import (
    GazeboPowerUps,
    HeadingErrors,
    bad_starts,
    body_errors,
    final_rmse,
    gazebo_power_ups,
    heading_errors_of,
    planar_errors,
    pose_source_errors,
    range_residuals,
)
from papers.ekim2020.methods import (
    judged,
    linearized_at_truth,
    power_up_states,
    refined_errors,
    rmse_over_bound,
)
from papers.ekim2020.world import (
    LAYOUTS,
    PATHS,
    PUBLISHED_SRLS,
    RECORDINGS,
    SIGMA_M,
    TRIALS,
    recording,
    room_config,
    same_room,
    site_logs,
    trials,
)
from papers.recordings.reference_alignment import OFFICE_FRAMES, settled_truth
from papers.scores import rms
from papers.starts import drawn_start

_PATHS = ("circle", "eight", "square", "star", "waypoints")
_SIZES = ("2d_5", "2d_8", "3d_5", "3d_8")

PAPER = Paper(
    "ekim2020",
    "P. Oguz Ekim, 2020: Localization and initialization algorithms based on UWB, LiDAR and "
    "odometry",
    "A robot that is switched on anywhere finds itself by ranges and one scan, then an EKF fuses "
    "odometry, ranges and the poses of another localizer.",
    seeds=100,
    quick_seeds=12,
    statements=(
        Statement(
            "2.2.1, eq. 13", "start position from squared ranges",
            "SR-LS gives it, simply enough for a robot (no figure)",
            tuple(f"start_{size}_srls_bound" for size in _SIZES),
            lambda *over_bound: max(over_bound) <= 1.25,
            "start_bound",
            "at most a quarter above the Cramer-Rao bound; squares of ranges weigh far anchors "
            "more, which weights undo",
        ),
        Statement(
            "2.2.2, Table 1", "start heading from one scan",
            "the scan, turned in steps of 10 degrees, fits the map best at the robot's heading",
            ("start_search_paper", "start_gazebo_heading", "start_search_gain"),
            lambda search, ours, gain: search <= 5.0,
            "start_searches",
            "within half a step, and no finer than that",
        ),
        Statement(
            "2.3", "anchors that fail",
            "sensors may fail at random, and a wrong range has to be detected",
            ("start_culprit", "start_false_alarms"),
            lambda named, alarms: named >= 99.0 and alarms <= 2.6,
        ),
        Statement(
            "2.3, Fig. 2; abstract", "error of the EKF in simulation, several paths",
            "RMSE of 3 cm",
            tuple(f"room_{path}_rmse" for path in _PATHS),
            lambda *rmse: max(rmse) <= 3.0,
            "room_paths",
        ),
        Statement(
            "2.3, Fig. 2; abstract", "against AMCL alone",
            "6 cm, so almost twice as accurate",
            tuple(f"room_{path}_gain" for path in _PATHS),
            lambda *gain: min(gain) >= 2.0,
            "room_paths",
        ),
        Statement(
            "2.3, 3.1, Figs. 3 and 6a", "pose found on switching on",
            "scan and map fit almost perfectly after it (no figure)",
            ("start_gazebo_right", "start_gazebo_wrong", "start_gazebo_position_p95",
             "start_gazebo_heading_p95", "start_office"),
            lambda right, wrong, position, heading, office: (
                right >= 99.0 and wrong <= 0.2 and position <= 3.0 and heading <= 2.0
                and office >= 98.0),
            "start_ambiguous",
        ),
        Statement(
            "3.1, Fig. 7", "a start whose heading is 10 degrees wrong",
            "the robot ends in a totally wrong pose; with a good start it reaches the goal",
            ("start_bad_odometry", "start_bad_auto", "start_bad_filter"),
            lambda wrong, good, with_ranges: wrong > 10.0 * good,
            "start_bad",
            "by odometry alone; a filter that fuses ranges recovers",
        ),
        Statement(
            "3.2, Fig. 9", "when AMCL gives no pose",
            "the EKF continues to estimate the pose (no figure)",
            ("ieu_run3_rmse", "ieu_straight_rmse", "ieu_home_rmse", "office_rmse"),
            lambda *rmse: max(rmse[:3]) <= 0.03 and rmse[3] <= 0.15,
            remark="odometry and ranges alone: Gazebo runs of the paper's authors, a real office",
        ),
    ),
    captions={
        "room_paths": "One drive in the simulated room: truth, the poses of the localizer that "
        "stands for AMCL, and the EKF on all of them, ranges and wheels; beside it their errors.",
        "start_bound": "Error of three solvers of a position from ranges over the noise of a "
        "range, and the Cramer-Rao bound, which no unbiased one beats.",
        "start_ambiguous": "Switched on in the middle of a square room: left, the poses that fit "
        "one scan; right, the one that is left once the robot has moved.",
        "start_searches": "Heading error of the search in steps of ten degrees and of ours, over "
        "the power-ups of the Gazebo recordings.",
        "start_bad": "What a start with a wrong heading costs: by odometry alone, with "
        "ranges, and started from nothing.",
    },
)  # fmt: skip


def ekim2020_claims(seeds: int, progress: Progress, configs: Path | None = None) -> list[Claim]:
    """Return all rows; those of recordings need the folder of ready configurations."""
    total = len(PATHS) * seeds + len(RECORDINGS) + 1
    done = 0
    rmse: dict[str, list[float]] = {path: [] for path in PATHS}
    source: dict[str, list[float]] = {path: [] for path in PATHS}
    bound: dict[str, list[float]] = {path: [] for path in PATHS}
    nees: dict[str, list[float]] = {path: [] for path in PATHS}
    for path in PATHS:
        config = room_config(path)
        assert config.simulation is not None
        for seed in range(seeds):
            log = simulate(config.simulation, np.random.default_rng(seed))
            truth = truth_of(log)
            assert truth is not None
            messages = to_messages(log, config)
            start = drawn_start(config, truth, messages, seed)
            result = run(config, log, start=start)
            errors = errors_against(result.estimate, truth)
            assert errors.nees is not None
            rmse[path].append(rms(errors.position))
            nees[path].append(float(errors.nees[-1]))
            source[path].append(rms(pose_source_errors(log, truth)))
            bound[path].append(rms(linearized_at_truth(config, log, start)))
            done += 1
            progress(done, total)
    claims = []
    for path in PATHS:
        per_seed = np.array(rmse[path])
        claims += [
            claim_of(f"room_{path}_rmse", f"{path}: RMSE", "cm", 3.0,
                   100.0 * per_seed, "<= 2.6", lambda v: v <= 2.6),
            claim_of(f"room_{path}_gain", f"{path}: pose source / ours", "1", 2.0,
                   np.array(source[path]) / per_seed, ">= 2.3", lambda v: v >= 2.3),
            claim_of(f"room_{path}_bound", f"{path}: ours / bound", "1",
                   None, per_seed / np.array(bound[path]), "<= 1.05", lambda v: v <= 1.05),
            _nees_claim(path, nees[path]),
        ]  # fmt: skip
    for name, (file, of_dataset, limit) in RECORDINGS.items():
        claims.append(_recording_claim(name, file, of_dataset, limit, configs))
        done += 1
        progress(done, total)
    claims += power_up_claims(configs)
    progress(total, total)
    return claims


def _nees_claim(path: str, values: list[float]) -> Claim:
    """Mean over seeds, one independent value a seed, against its two-sided 95 % band."""
    low, high = band(3, len(values))
    mean = float(np.mean(values))
    spread = np.quantile(values, [0.05, 0.95])
    return Claim(f"room_{path}_nees", f"{path}: mean NEES", "1", None,
                 mean, float(spread[0]), float(spread[1]), f"{low:.2f}..{high:.2f}",
                 low <= mean <= high, "mean, not median: it is what the band is of")  # fmt: skip


def _recording_claim(
    name: str, file: str, of_dataset: str | None, limit: float, configs: Path | None
) -> Claim:
    """Run a ready configuration on its recording, where that is present."""
    required = f"<= {limit:g}"
    claim = f"{name}: RMSE"
    id_ = name.split(" (")[0].replace(" ", "_") + "_rmse"
    if configs is None:
        return absent(id_, claim, "no examples/configs here", required)
    try:
        result = run(*recording(configs, file, of_dataset))
    except LogError as error:
        return absent(id_, claim, str(error), required)
    value = float(result.metrics["position_rmse_m"])
    return Claim(id_, claim, "m", None, value, value, value, required, value <= limit)


def power_up_claims(configs: Path | None) -> list[Claim]:
    """Return the rows about a start from nothing; recordings need the ready configurations."""
    claims = list(simulated_claims())
    if configs is not None:
        for rows in (site_claims, gazebo_claims, office_claims, auto_claims):
            claims += rows(configs)
    return claims


def simulated_claims() -> Iterator[Claim]:
    """Return the rows that need no recording."""
    yield from _bound_claims()
    yield from _side_claims()
    yield from _culprit_claims()


def _bound_claims() -> Iterator[Claim]:
    for seed, (name, anchors) in enumerate(LAYOUTS.items(), start=100):
        drawn = trials(anchors, SIGMA_M, seed)
        key = name.lower().replace(", ", "_").replace(" anchors", "")
        dof = anchors.shape[1]
        half = 2.576 * np.sqrt(2.0 * dof / TRIALS)
        for solver, text, limit in (
            ("ceres", "Ceres", 1.01),
            ("srwls", "weighted SR-LS", 1.05),
            ("srls", "SR-LS", PUBLISHED_SRLS[name] * 1.03),
        ):
            ratio, nees = rmse_over_bound(drawn, SIGMA_M, solver)
            yield Claim(f"start_{key}_{solver}_bound", f"{name}: {text} RMSE / bound", "1", None,
                        ratio, ratio, ratio, f"<= {limit:.3g}", ratio <= limit,
                        f"{TRIALS} trials, seed {seed}")  # fmt: skip
            mean = float(nees.mean())
            low, high = (float(v) for v in np.quantile(nees, [0.05, 0.95]))
            yield Claim(f"start_{key}_{solver}_nees", f"{name}: {text} mean NEES", "1", None,
                        mean, low, high, f"{dof - half:.2f}..{dof + half:.2f}",
                        bool(abs(mean - dof) <= half),
                        "two-sided 99 % band of the mean")  # fmt: skip


def _side_claims() -> Iterator[Claim]:
    """Anchors in a line or a plane, exactly or to a millimetre: no wrong side without a word."""
    rng = np.random.default_rng(300)
    wrong = 0
    for _ in range(TRIALS):
        dimensions = int(rng.integers(2, 4))
        count = int(rng.integers(dimensions + 1, 9))
        anchors = rng.uniform(-5.0, 5.0, (count, dimensions))
        anchors[:, -1] = rng.choice([0.0, 1e-3]) * rng.standard_normal(count)
        turn = np.linalg.qr(rng.standard_normal((dimensions, dimensions)))[0]
        point = rng.uniform(-5.0, 5.0, dimensions)
        ranges = np.linalg.norm(anchors - point, axis=1) + 0.05 * rng.standard_normal(count)
        found = _core.locate(anchors @ turn.T, np.abs(ranges) + 1e-3, 0.05)
        if found.status == _core.PositionStatus.UNIQUE:
            assert found.position is not None
            assert found.covariance is not None
            across = turn[:, -1]
            error = across @ (found.position - turn @ point)
            wrong += abs(error) > 5.0 * np.sqrt(across @ found.covariance @ across)
    yield share(
        "start_wrong_side",
        "flat anchors: one position, and the wrong side",
        wrong,
        TRIALS,
        0.0,
        True,
    )


def _culprit_claims() -> Iterator[Claim]:
    rng = np.random.default_rng(301)
    named = alarms = 0
    count, stated = 5000, 0.01
    anchors = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [5, 0], [5, 10]], float)
    for _ in range(count):
        point = rng.uniform(0.0, 10.0, 2)
        clean = np.linalg.norm(anchors - point, axis=1) + 0.05 * rng.standard_normal(6)
        found = _core.locate(anchors, np.abs(clean), 0.05, false_alarm_probability=stated)
        alarms += found.culprit is not None
        worst = int(rng.integers(6))
        clean[worst] += 1.0
        culprit = _core.locate(anchors, np.abs(clean), 0.05).culprit
        named += culprit is not None and culprit.index == worst
    yield share("start_culprit", "one of 6 ranges 1 m long: named", named, count, 0.99)
    # Either of two tests may raise it, each at the stated rate; the margin is 3 sigma of the count.
    limit = 2.0 * stated + 3.0 * float(np.sqrt(2.0 * stated / count))
    yield share("start_false_alarms", "clean ranges: alarms, stated 1 to 2 %", alarms, count,
                limit, True)  # fmt: skip


def site_claims(configs: Path) -> Iterator[Claim]:
    """Tags at rest at surveyed places: median of the planar error over all epochs."""
    try:
        logs = list(site_logs(configs, "ghent", "ghent-iiot"))
    except LogError as error:
        yield absent("start_ghent", "Ghent hall, NLOS: 2D median", str(error))
    else:
        for loss, required in (("none", None), ("one_sided", 0.11)):
            errors = np.concatenate([planar_errors(log, tag, loss) for log in logs
                                     for tag in log.tags])  # fmt: skip
            yield _median(f"start_ghent_{loss}", f"Ghent hall, loss {loss}: 2D error", errors,
                          required)  # fmt: skip
    try:
        converted = site_logs(configs, "lias", "lias-planar")
        logs = [log for log in converted if np.ptp(log["truth"]["x_m"]) == 0.0]  # at rest
    except LogError as error:
        yield absent("start_lias", "LIAS poses at rest: 2D median", str(error))
        return
    raw, corrected, bodies = [], [], []
    for at, log in enumerate(logs):
        bodies.append(body_errors(log))
        others = [other for k, other in enumerate(logs) if k != at and same_room(other, log)]
        for tag in log.tags:
            raw.append(planar_errors(log, tag, "none"))
            offsets = np.nanmedian(
                np.vstack([range_residuals(other, tag) for other in others]), axis=0
            )
            corrected.append(planar_errors(log, tag, "none", offsets))
    yield _median("start_lias_raw", "LIAS poses at rest, raw: 2D error of a pose",
                  np.concatenate(bodies), 0.14, "middle of the three tags")  # fmt: skip
    yield _median("start_lias_tag", "the same, of a single tag", np.concatenate(raw), None)
    yield _median("start_lias_offset", "LIAS, one offset per link: 2D error",
                  np.concatenate(corrected), 0.08, "offsets from the other poses")  # fmt: skip


def _median(
    id: str, claim: str, errors: FloatArray, required: float | None, note: str = ""
) -> Claim:
    limit = np.inf if required is None else required
    text = "-" if required is None else f"<= {required:g}"
    return claim_of(id, claim, "m", None, errors, text, lambda v: v <= limit, note)


def gazebo_claims(configs: Path) -> Iterator[Claim]:
    try:
        found = gazebo_power_ups(configs)
    except LogError as error:
        yield absent("start_gazebo", "Gazebo power-ups", str(error))
        yield absent("start_search", "ten-degree search", str(error))
        return
    yield from _map_claims(found)
    yield from _search_claims(heading_errors_of(found))
    yield from bad_start_claims(configs)


def _map_claims(found: GazeboPowerUps) -> Iterator[Claim]:
    in_world, ready = found.in_world, found.in_world.ready
    count = len(ready)
    yield share("start_gazebo_right", "Gazebo power-ups: right, or among those left",
                int(in_world.fits.sum()), count, 0.99)  # fmt: skip
    yield share("start_gazebo_wrong", "Gazebo power-ups: ready and wrong",
                int((ready & ~in_world.fits).sum()), count, 0.002, True)  # fmt: skip
    yield share("start_gazebo_ready", "Gazebo power-ups: ready at once", int(ready.sum()), count,
                0.9)  # fmt: skip
    refined = np.concatenate([refined_errors(log) for log in found.logs])
    yield _p95("start_gazebo_position_p95", "Gazebo power-ups: refined position, 95 %", "cm",
               100.0 * refined, 3.0)  # fmt: skip
    on_the_map = np.rad2deg(found.on_map.heading_rad[ready])
    yield claim_of("start_gazebo_heading", "Gazebo power-ups: heading error", "deg", None,
                   on_the_map, "<= 0.5", lambda v: v <= 0.5)  # fmt: skip
    yield _p95("start_gazebo_heading_p95", "Gazebo power-ups: heading error, 95 %", "deg",
               on_the_map, 2.0)  # fmt: skip
    # The map is turned by 1.3 degrees and shifted by 4 cm in the world, which no match can see.
    yield claim_of("start_gazebo_heading_world", "the same in the world: heading error", "deg",
                   None, np.rad2deg(in_world.heading_rad[ready]), "-", lambda v: True)  # fmt: skip
    yield _p95("start_gazebo_position_world", "the same in the world: position, 95 %", "cm",
               100.0 * in_world.position_m[ready], np.inf)  # fmt: skip


def _search_claims(errors: HeadingErrors) -> Iterator[Claim]:
    """Compare the paper's search with ours."""
    paper, ours = np.rad2deg(errors.ten_degrees), np.rad2deg(errors.ours)
    yield claim_of("start_search_paper", "ten-degree search (Table 1): heading error", "deg", None,
                   paper, "-", lambda v: True)  # fmt: skip
    gain = float(np.median(paper) / np.median(ours))
    yield Claim("start_search_gain", "ten-degree search / ours", "1", None, gain, gain, gain,
                ">= 5", gain >= 5.0)  # fmt: skip


def _p95(id: str, claim: str, unit: str, values: FloatArray, limit: float) -> Claim:
    value = float(np.quantile(values, 0.95))
    required = f"<= {limit:g}" if np.isfinite(limit) else "-"
    return Claim(id, claim, unit, None, value, value, value, required, value <= limit)


def office_claims(configs: Path) -> Iterator[Claim]:
    try:
        config, log = recording(configs, "mrpt_office.yaml")
    except LogError as error:
        yield absent("start_office", "office power-ups", str(error))
        return
    log = _first_scans(log, OFFICE_FRAMES)
    states = power_up_states(log, config)
    stated = judged(states, log, 0.3, 3.0)
    matched = judged(states, settled_truth(log), 0.3, 3.0)
    for key, text, found, required in (
        ("", "office power-ups (real): right, or not ready", matched, 0.98),
        ("_stated", "the same against the reference as published", stated, None),
    ):
        good = found.fits | ~found.ready
        yield share(f"start_office{key}", text, int(good.sum()), len(good), required)
    yield share("start_office_ready", "office power-ups (real): ready at once",
                int(matched.ready.sum()), len(matched.ready), 0.5)  # fmt: skip


def _first_scans(log: Log, count: int) -> Log:
    scans = {name: values[:count] for name, values in log["scans"].items()}
    return replace(log, tables={**log.tables, "scans": scans})


def bad_start_claims(configs: Path) -> Iterator[Claim]:
    """Say what a bad start costs."""
    degrees, ends = bad_starts(configs)
    row = int(np.flatnonzero(degrees == 10.0)[0])
    for name, text in (("odometry", "told 10 deg wrong, odometry: error at the end"),
                       ("filter", "told 10 deg wrong, with ranges: error at the end"),
                       ("auto", "started from nothing: error at the end")):  # fmt: skip
        value = float(ends[name][row])
        limit = np.inf if name == "odometry" else 0.03
        yield Claim(f"start_bad_{name}", text, "m", None, value, value, value,
                    "-" if name == "odometry" else "<= 0.03", value <= limit,
                    "run3, 5 m of path; Figs. 6 and 7")  # fmt: skip


def auto_claims(configs: Path) -> Iterator[Claim]:
    """Whole runs, started from nothing and from the truth: RMSE over the second half."""
    for name, file, of_dataset in (
        ("ieu run3", "ieu_gazebo.yaml", "run3"),
        ("ieu straight", "ieu_gazebo.yaml", "straight"),
        ("office (real)", "mrpt_office.yaml", None),
    ):
        key = "start_auto_" + name.split(" (")[0].replace(" ", "_")
        text = f"{name}: final RMSE, from nothing / from truth"
        try:
            config, log = recording(configs, file, of_dataset)
        except LogError as error:
            yield absent(key, text, str(error))
            continue
        auto = run(config.model_copy(update={"start": "auto"}), log)
        known = run(config, log)
        assert auto.start is not None
        ratio = final_rmse(auto) / final_rmse(known)
        yield Claim(key, text, "1", None, ratio, ratio, ratio, "<= 1.05", ratio <= 1.05,
                    f"ready after {auto.start.seconds:.2f} s")  # fmt: skip
