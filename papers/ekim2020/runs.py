# SPDX-License-Identifier: Apache-2.0
"""Whole runs from a start that is right, wrong or not told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from locfuse.config.load import load_config
from locfuse.config.schema import Dataset, RunConfig
from locfuse.eval.errors import errors_against
from locfuse.run.messages import truth_of
from locfuse.run.run import load_log, run
from locfuse.types import FloatArray, Log, LogError, RunResult
from papers.claims import Claim, absent


def recording(configs: Path, file: str, of_dataset: str | None = None) -> tuple[RunConfig, Log]:
    """Return a ready configuration with its log.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    config = load_config(configs / file)
    if of_dataset is not None:
        assert isinstance(config.log, Dataset)
        dataset = config.log.model_copy(update={"run": of_dataset})
        config = config.model_copy(update={"log": dataset})
    return config, load_log(config, configs, config.seed)


def bad_starts(configs: Path) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return heading errors of a start [deg] and the position errors at the end of run3 [m].

    As in Figs. 6 and 7 a robot is told a wrong heading and believes it (to 2 degrees): what becomes
    of its odometry, and of the filter with ranges, if it never looks for another place; and of a
    start from nothing, which is not told.

    Raises
    ------
    LogError
        If the recording is not there.
    """
    config, log = recording(configs, "ieu_gazebo.yaml", "run3")
    truth = truth_of(log)
    assert truth is not None
    assert truth.heading is not None
    x, y = truth.position[0].tolist()
    degrees = np.array([0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 90.0, 180.0])
    ends: dict[str, list[float]] = {"odometry": [], "filter": [], "auto": []}
    nothing = run(config.model_copy(update={"start": "auto"}), log)
    for off in degrees:
        start = (x, y, float(np.rad2deg(truth.heading[0])) + float(off))
        told = config.model_copy(update={"start": start, "when_lost": "go_on"})
        blind = told.model_copy(update={"use": ["odometry"]})
        ends["odometry"].append(_last_error(run(blind, log)))
        ends["filter"].append(_last_error(run(told, log)))
        ends["auto"].append(_last_error(nothing))
    return degrees, {name: np.array(values) for name, values in ends.items()}


def _last_error(result: RunResult) -> float:
    assert result.truth is not None
    return float(np.hypot(*errors_against(result.estimate, result.truth).position[-1]))


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
        told = run(config, log)
        assert auto.start is not None
        ratio = _final_rmse(auto) / _final_rmse(told)
        yield Claim(key, text, "1", None, ratio, ratio, ratio, "<= 1.05", ratio <= 1.05,
                    f"ready after {auto.start.seconds:.2f} s")  # fmt: skip


def _final_rmse(result: RunResult) -> float:
    """Return the RMSE over the second half, when a start that was told exactly is forgotten."""
    assert result.truth is not None
    errors = errors_against(result.estimate, result.truth)
    later = errors.stamp_ns >= (errors.stamp_ns[0] + errors.stamp_ns[-1]) // 2
    return float(np.sqrt(np.mean(np.sum(errors.position[later] ** 2, axis=1))))
