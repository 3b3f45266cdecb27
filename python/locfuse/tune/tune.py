# SPDX-License-Identifier: Apache-2.0
"""Noise and calibration of a configuration by maximum likelihood (docs/tune.md)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from locfuse.config.schema import RunConfig
from locfuse.run.run import load_log
from locfuse.tune.drive import drive_of, driven
from locfuse.tune.findings import comparisons, findings
from locfuse.tune.held_out import Outliers, held_out, margin_of, outliers
from locfuse.tune.judge import Judged, judged
from locfuse.tune.problem import Found, Problem
from locfuse.tune.quantity import Quantity, changes, quantities, short, with_values
from locfuse.tune.result import TuneResult
from locfuse.tune.spacing import SPACINGS_S, chosen, enough
from locfuse.types import ConfigError, Log

Progress = Callable[[int, int], None]

_OUTLIER_ROUNDS = 9
_LATENCY_OF_WHEELS = "estimator.odometry.latency_s"
_RARE = 0.005  # a share of outliers that any noise does with
_MANY = 0.03
_MOSTLY = 0.8
_SETTLED = 0.002  # share of the measurements that may still change sides


def tune(
    config: RunConfig,
    logs: Sequence[Log] = (),
    *,
    base: Path | None = None,
    progress: Progress | None = None,
) -> TuneResult:
    """Find the noise, latencies and scales with which the estimator predicts best.

    Parameters
    ----------
    config : RunConfig
        Where to begin; what a recording does not show stays as it is.
    logs : sequence of Log, optional
        Recordings of one robot; none: the log that the configuration names.
    base : Path, optional
        Folder that the configuration's paths are relative to.
    progress : callable, optional
        Called with (runs of the estimator done, runs expected).

    Raises
    ------
    ConfigError, LogError
        If the configuration or a log cannot be used as they are.

    Examples
    --------
    >>> from locfuse.config.load import parse_config
    >>> drive = {"path": {"shape": "waypoints"}, "poses": None,
    ...          "ranges": {"sigma_m": 0.1, "sigma_relative": 0}}
    >>> found = tune(parse_config({"simulation": drive}))
    >>> 0.08 < found["estimator.range.sigma_m"].value < 0.12
    True
    """
    _check(config)
    given = list(logs) or [load_log(config, base, config.seed)]
    drives = [drive_of(config, log) for log in given]
    problem = Problem(config, drives, progress)
    problem.check()
    found = _independent(problem, quantities(config, drives))
    answers = judged(problem, found)
    values = {a.quantity.key: a.value for a in answers if a.changes}
    problem.leave_outliers_out(values)
    left_out = outliers(problem, values)
    noises = _noises(problem, values, left_out)
    found_ones = [a.quantity for a in answers if a.word == "found"]
    ends = {a.quantity.key: a.value for a in answers if a.word == "at most"}
    predicted = held_out(problem, found_ones, values, {**ends, **noises})
    margin = margin_of(predicted)
    final: dict[str, float | str] = {**_not_negative(config, answers), **noises}
    final |= {a.quantity.key: margin * a.value for a in answers
              if a.changes and a.quantity.is_sigma}  # fmt: skip
    latest = max((float(v) for key, v in final.items() if key.endswith("latency_s")), default=0.0)
    if latest > 0.5 * config.history_s:  # what is later is not fused
        final["history_s"] = math.ceil(2.0 * latest)
    final = {key: short(value) for key, value in final.items()}
    tuned = with_values(config, final)
    drove = [(driven(config, drive), driven(tuned, drive)) for drive in drives]
    return TuneResult(
        quantities=tuple(answers),
        spacing_s=problem.spacing_s,
        outliers=left_out,
        held_out=predicted,
        driven=tuple(drove),
        findings=tuple(findings(problem.spacing_s, margin, answers, left_out, predicted)),
        comparisons=tuple(comparisons(drove)),
        changes=changes(final),
        config=tuned,
    )


def _check(config: RunConfig) -> None:
    for key, is_there in (("mcl without poses_hz, as particles have no such likelihood",
                           config.mcl and not config.mcl.poses_hz),
                          ("switched_off", config.switched_off),
                          ("watch_poses", config.watch_poses),
                          ("estimator.calibration.consider",
                           config.estimator.calibration.consider)):  # fmt: skip
        if is_there:
            raise ConfigError(f"tune does not go with {key}")


def _independent(problem: Problem, wanted: Sequence[Quantity]) -> Found:
    """Find all quantities by measurements so far apart that their errors are independent."""
    first = _without_outliers(problem, wanted)
    if not any(q.key.startswith("estimator.odometry.") for q in wanted):
        return first
    sigmas = [q for q in wanted if q.is_sigma]
    problem.fixed = {q.key: first.values[q.key] for q in wanted if not q.is_sigma}
    found, counts = {SPACINGS_S[0]: first}, {SPACINGS_S[0]: problem.spaced_count}
    values = first.values
    for spacing in SPACINGS_S[1:]:
        problem.space(spacing)
        if not enough(problem):
            break
        found[spacing] = _without_outliers(problem, sigmas, values)
        values, counts[spacing] = found[spacing].values, problem.spaced_count
    problem.fixed = {}
    best = chosen(problem, found, counts)
    problem.space(best)
    if best == SPACINGS_S[0]:
        problem.leave_outliers_out(first.values)
        return first
    return _without_outliers(problem, wanted, {**first.values, **found[best].values})


def _without_outliers(
    problem: Problem, wanted: Sequence[Quantity], begin: Mapping[str, float] | None = None
) -> Found:
    """Find quantities by the measurements that fit what is found; values to begin with."""
    problem.leave_outliers_out(begin or {})
    best, most, information = None, -math.inf, None
    for _ in range(_OUTLIER_ROUNDS):
        found = problem.find(wanted, begin, information)
        changed, score = problem.leave_outliers_out(found.values)
        if best is not None and score <= most:
            problem.leave_outliers_out(best.values)
            return best
        best, most = found, score
        if changed <= _SETTLED * problem.count:
            break
        begin, information = found.values, found.information
    assert best is not None
    return best


def _noises(
    problem: Problem, values: Mapping[str, float], left_out: Sequence[Outliers]
) -> dict[str, str]:
    """Return the noise of each source that predicts clearly better than that which is configured.

    Compared is what the estimator predicts with its gates, by the likelihood of a Gaussian.
    """
    estimator = problem.config.estimator
    if estimator.filter not in ("pose", "air"):
        return {}
    chosen: dict[str, str] = {}
    for one in left_out:
        section = {"ranges": "range", "positions": "position"}.get(one.source)
        if section is None or one.share < _RARE:
            continue
        key = f"estimator.{section}.noise"
        # With many outliers a Gaussian one is lost where its gate is as often wrong as right.
        shapes = ["student_t", "cauchy"]
        if one.share <= _MANY:
            shapes.append("gaussian")
        if one.source == "ranges" and one.too_long > _MOSTLY and estimator.kind == "pose":
            shapes.append("one_sided")
        now = getattr(estimator, section).noise
        scores = {}
        for noise in {*shapes, now}:
            tried = with_values(problem.config, {**values, **chosen, key: noise})
            scores[noise] = problem.score(tried)
        best = max(shapes, key=lambda noise: scores[noise])
        is_safe = now in shapes or now == "one_sided"
        if not is_safe or scores[best] > scores[now] + np.log(problem.count):
            chosen[key] = best
    return chosen


def _not_negative(config: RunConfig, answers: Sequence[Judged]) -> dict[str, float]:
    """Return the values that change; a latency below zero is one of odometry, more than of it."""
    values = {a.quantity.key: a.value for a in answers if a.changes}
    latencies = {a.quantity.key: values.get(a.quantity.key, a.quantity.now) for a in answers
                 if a.quantity.key.endswith(".latency_s")}  # fmt: skip
    early = min(latencies.values(), default=0.0)
    if early < 0.0:
        values |= {key: late - early for key, late in latencies.items()}
        values[_LATENCY_OF_WHEELS] = config.estimator.odometry.latency_s - early
    return values
