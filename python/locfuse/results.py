# SPDX-License-Identifier: Apache-2.0
"""The folder that a run leaves behind: numbers for programs, a report for people."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import yaml

from locfuse.eval.errors import interpolate
from locfuse.io.csv_table import number_texts, stamp_texts, write_table
from locfuse.io.tum import write_tum
from locfuse.report import write_report
from locfuse.types import FloatArray, Health, Outcomes, RunResult, Trajectory


def write_results(result: RunResult, folder: str | Path) -> Path:
    """Write everything there is to know of a run.

    Parameters
    ----------
    result : RunResult
    folder : path
        Made if it is not there; files of the same name are replaced.

    Returns
    -------
    Path
        Of ``report.html``. Beside it: ``config.yaml`` (effective), ``estimate.tum``, ``truth.tum``
        (interpolated to the estimate's stamps, so any program compares the same pairs that
        ``metrics.json`` does; only with truth), ``estimate.csv`` (with covariance),
        ``outcomes.csv`` (one row per message), ``health.csv``,
        ``metrics.json`` and the pictures.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump(dict(result.config), sort_keys=False)
    (folder / "config.yaml").write_text(text, encoding="utf-8")
    write_tum(folder / "estimate.tum", result.estimate)
    (folder / "truth.tum").unlink(missing_ok=True)
    if result.truth is not None:
        at, _ = interpolate(result.truth, result.estimate.stamp_ns)
        if len(at) > 0:
            write_tum(folder / "truth.tum", at)
    write_estimate(folder / "estimate.csv", result.estimate)
    write_outcomes(folder / "outcomes.csv", result.outcomes)
    (folder / "health.csv").unlink(missing_ok=True)
    if result.health is not None:
        _write_health(folder / "health.csv", result.health)
    metrics = json.dumps(dict(result.metrics), indent=1, allow_nan=False)
    (folder / "metrics.json").write_text(metrics + "\n", encoding="utf-8")
    return write_report(result, folder)


def write_estimate(path: Path, estimate: Trajectory) -> None:
    """Write ``estimate.csv``: poses with their covariance, every bit of them."""
    assert estimate.heading is not None
    assert estimate.covariance is not None
    header = ["stamp_s", "x_m", "y_m", "heading_rad"]
    columns: list[FloatArray] = [estimate.position[:, 0], estimate.position[:, 1], estimate.heading]
    names = ("x", "y", "heading")
    for row in range(3):
        for column in range(row, 3):
            header.append(f"cov_{names[row]}_{names[column]}")
            columns.append(estimate.covariance[:, row, column])
    write_table(path, header, [stamp_texts(estimate.stamp_ns), *map(number_texts, columns)])


def _write_health(path: Path, health: Health) -> None:
    header = ["stamp_s", "state", "within", "wrong", "protection_x_m", "protection_y_m",
              "protection_heading_rad", "reason"]  # fmt: skip
    columns = [
        stamp_texts(health.stamp_ns),
        health.state.tolist(),
        number_texts(health.within),
        number_texts(health.wrong),
        *(number_texts(np.where(np.isfinite(level), level, np.nan))
          for level in health.protection.T),
        health.reason.tolist(),
    ]  # fmt: skip
    write_table(path, header, columns)


def write_outcomes(path: Path, outcomes: Outcomes) -> None:
    """Write ``outcomes.csv``: what became of each message, every bit of it."""
    header = ["stamp_s", "source", "tag", "anchor", "verdict", "nis", "dof", "log_likelihood",
              "residual", "reason"]  # fmt: skip
    columns = [
        stamp_texts(outcomes.stamp_ns),
        outcomes.source.tolist(),
        outcomes.tag.tolist(),
        outcomes.anchor.tolist(),
        outcomes.verdict.tolist(),
        number_texts(outcomes.nis),
        [str(dof) for dof in outcomes.dof.tolist()],
        number_texts(outcomes.log_likelihood),
        number_texts(outcomes.residual),
        outcomes.reason.tolist(),
    ]
    write_table(path, header, columns)
