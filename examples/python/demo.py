# SPDX-License-Identifier: Apache-2.0
"""Accuracy of each sensor alone and of all fused, on a simulated and a real drive."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from locfuse.config.load import load_config
from locfuse.config.schema import RunConfig
from locfuse.report.results import write_results
from locfuse.run.run import load_log, run
from locfuse.types import Log, LogError, RunResult

CONFIGS = Path(__file__).resolve().parent.parent / "configs"
OUT = Path("out/demo")
SEEDS = 20


def variant(config: RunConfig, use: list[str], **ranges: Any) -> RunConfig:
    """Return the configuration with other sources and other settings of ranges."""
    changed = config.estimator.model_copy(
        update={"range": config.estimator.range.model_copy(update=ranges)}
    )
    return config.model_copy(update={"use": use, "estimator": changed})


def rmse(config: RunConfig, log: Log) -> float:
    """Return the position RMSE in metres."""
    return float(run(config, log).metrics["position_rmse_m"])


def pose_source_rmse(result: RunResult) -> float:
    """Return the position RMSE of the simulated pose source alone, metres."""
    poses, truth = result.log["poses"], result.truth
    assert truth is not None
    row = np.searchsorted(truth.stamp_ns, poses["stamp_ns"])
    error = np.column_stack([poses["x_m"], poses["y_m"]]) - truth.position[row]
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def simulated(table: Table) -> Path:
    """Drive through the room of ekim2020, `SEEDS` times; report the first drive."""
    config = load_config(CONFIGS / "ekim_room.yaml")
    rows: dict[str, list[float]] = {"odometry alone": [], "pose source alone": [],
                                    "odometry + UWB": [], "odometry + UWB + poses": []}  # fmt: skip
    report: Path | None = None
    for seed in range(SEEDS):
        log = load_log(config, CONFIGS, seed)
        result = run(config, log)
        rows["odometry alone"].append(rmse(variant(config, ["odometry"]), log))
        rows["pose source alone"].append(pose_source_rmse(result))
        rows["odometry + UWB"].append(rmse(variant(config, ["odometry", "ranges"]), log))
        rows["odometry + UWB + poses"].append(float(result.metrics["position_rmse_m"]))
        if report is None:
            report = write_results(result, OUT / "room")
    for name, values in rows.items():
        paper = {"odometry + UWB + poses": "3 cm", "pose source alone": "6 cm"}.get(name, "")
        table.add_row("simulated room", name, f"{100 * float(np.median(values)):.1f} cm", paper)
    table.add_section()
    assert report is not None
    return report


def recorded(table: Table) -> Path:
    """Replay the office drive of Debian's package mrpt-common."""
    config = load_config(CONFIGS / "mrpt_office.yaml")
    log = load_log(config, CONFIGS, 0)
    result = run(config, log)
    without_gate = variant(config, ["odometry", "ranges"], noise="gaussian", gate=1.0)
    rows: dict[str, Any] = {
        "odometry alone": rmse(variant(config, ["odometry"]), log),
        "odometry + UWB, no outlier rejection": rmse(without_gate, log),
        "odometry + UWB": result.metrics["position_rmse_m"],
    }
    for name, value in rows.items():
        table.add_row("real office", name, f"{100 * value:.1f} cm", "")
    return write_results(result, OUT / "office")


def main() -> int:
    """Run both, print the comparison and the paths of the reports."""
    console = Console()
    table = Table(title=f"Position RMSE (simulated: median of seeds 0 to {SEEDS - 1})")
    for heading in ("drive", "fused", "RMSE", "paper"):
        table.add_column(heading, justify="right" if heading in ("RMSE", "paper") else "left")
    reports = [simulated(table)]
    try:
        reports.append(recorded(table))
    except LogError as error:
        console.print(f"The real drive is skipped: {error}")
    console.print(table)
    for report in reports:
        console.print(f"report: {report.resolve()}", soft_wrap=True, highlight=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
