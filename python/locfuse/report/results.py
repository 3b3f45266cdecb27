# SPDX-License-Identifier: Apache-2.0
"""Writes the results of a run into a folder: tables, metrics, pictures and the report."""

from __future__ import annotations

import json
from pathlib import Path

import yaml

from locfuse.eval.errors import interpolate
from locfuse.eval.trust import sentence
from locfuse.io.result_tables import write_columns, write_estimate
from locfuse.io.tum import write_tum
from locfuse.io.whole import whole_folder
from locfuse.report.report import PICTURES, write_report
from locfuse.types import RunResult

# Of an earlier run, if this one has none.
OWNED = ("truth.tum", "health.csv", "watched.csv", "landmarks.csv", *PICTURES)


def write_results(result: RunResult, folder: str | Path) -> Path:
    """Write all results of a run.

    The folder is created if missing; files of the same name are replaced, all of them or none.
    Returns ``report.html``. Beside it: ``config.yaml`` (effective), ``estimate.tum``, ``truth.tum``
    (only with truth; interpolated to the estimate's stamps, the pairs that ``metrics.json``
    compares), ``estimate.csv`` (with covariance), ``outcomes.csv`` (one row per message),
    ``health.csv``, ``watched.csv`` (of poses that are watched), ``landmarks.csv`` (of an estimator
    that maps), ``metrics.json`` and, with matplotlib, the pictures.
    """
    with whole_folder(folder, OWNED) as stage:
        _write(result, stage)
        report = write_report(result, stage)
    return Path(folder) / report.name


def _write(result: RunResult, folder: Path) -> None:
    """Write all but the report and its pictures into an empty folder."""
    text = yaml.safe_dump(dict(result.config), sort_keys=False)
    (folder / "config.yaml").write_text(text, encoding="utf-8")
    trust = sentence(result.health) if result.health is not None and len(result.health) else ""
    write_tum(folder / "estimate.tum", result.estimate, trust)
    if result.truth is not None:
        at, _ = interpolate(result.truth, result.estimate.stamp_ns)
        if len(at) > 0:
            write_tum(folder / "truth.tum", at)
    write_estimate(folder / "estimate.csv", result.estimate, result.health, result.log.gps_origin)
    write_columns(folder / "outcomes.csv", result.outcomes)
    if result.health is not None:
        write_columns(folder / "health.csv", result.health)
    if result.watched is not None:
        write_columns(folder / "watched.csv", result.watched)
    if result.landmarks is not None:
        write_columns(folder / "landmarks.csv", result.landmarks)
    metrics = json.dumps(dict(result.metrics), indent=1, allow_nan=False)
    (folder / "metrics.json").write_text(metrics + "\n", encoding="utf-8")
