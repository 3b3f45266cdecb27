# SPDX-License-Identifier: Apache-2.0
"""Run every benchmark and print ours beside the peers': ratios of medians of one run."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "build" / "bench"
REPETITIONS = 15


@dataclass(frozen=True)
class Row:
    """One comparison: what was measured, and whether it is what was asked for."""

    what: str
    ours: str
    peer: str
    figure: float | None
    required: str
    met: bool | None


def main(cpp_benchmark: str) -> int:
    """Run, print the table, write results.json; 1 if a requirement is not met."""
    OUT.mkdir(parents=True, exist_ok=True)
    step_us, rmse_m = cpp(cpp_benchmark)
    seconds, info = python()
    rows = [*filter_rows(step_us), *python_rows(seconds, info), *evaluation_rows(seconds)]
    table = Table(title="Medians of one run", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("what", "ours", "peer", "figure", "required", "met"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for row in rows:
        figure = "-" if row.figure is None else f"{row.figure:,.4g}"
        met = {True: "yes", False: "NO", None: "-"}[row.met]
        table.add_row(escape(row.what), row.ours, row.peer, figure, row.required, met)
    console = Console(width=None if sys.stdout.isatty() else 120)
    console.print(table)
    agree = {**rmse_m, **{k: v["rmse_m"] for k, v in info.items() if "rmse_m" in v}}
    values = ", ".join(f"{name} {value:.4f}" for name, value in agree.items())
    console.print(f"RMSE in metres, to see that all did the same work: {values}", highlight=False)
    (OUT / "results.json").write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    return 1 if any(row.met is False for row in rows) else 0


def cpp(program: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return microseconds per step and RMSE of each C++ filter; repetitions take turns."""
    file = OUT / "cpp.json"
    subprocess.run(
        [program, f"--benchmark_repetitions={REPETITIONS}", "--benchmark_min_time=0.2",
         "--benchmark_enable_random_interleaving=true", "--benchmark_out_format=json",
         f"--benchmark_out={file}", "--benchmark_report_aggregates_only=false",
         "--benchmark_display_aggregates_only=true"],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    times: dict[str, list[float]] = {}
    rmse: dict[str, float] = {}
    for run in json.loads(file.read_text())["benchmarks"]:
        if run["run_type"] == "iteration":
            name = run["name"].split("/")[1]
            times.setdefault(name, []).append(1e6 / run["items_per_second"])
            rmse[name] = run["rmse_m"]
    return {name: statistics.median(values) for name, values in times.items()}, rmse


def python() -> tuple[dict[str, float], dict[str, Any]]:
    """Return median seconds and extra information of each Python benchmark that ran."""
    file = OUT / "python.json"
    subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-c", str(HERE / "pytest.ini"), "--rootdir",
         str(HERE), str(HERE / "python"), f"--benchmark-json={file}", "--benchmark-quiet"],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    runs = json.loads(file.read_text())["benchmarks"]
    return (
        {run["name"].removeprefix("test_"): run["stats"]["median"] for run in runs},
        {run["name"].removeprefix("test_"): run["extra_info"] for run in runs},
    )


def filter_rows(us: dict[str, float]) -> list[Row]:
    """Compare C++ filters: one prediction and five ranges on three states."""
    reference = us["reference_joseph"]
    rows = [
        _at_most("models + filter / Joseph reference", us["models_and_filter"], reference, 1.1),
        _at_most("PoseEkf::on / Joseph reference", us["pose_ekf_on"], reference, 2.0),
    ]
    if "orocos_bfl" not in us:
        return [*rows, Row("Orocos BFL / PoseEkf::on", "", "not installed", None, ">= 15", None)]
    ratio = us["orocos_bfl"] / us["pose_ekf_on"]
    return [*rows, Row("Orocos BFL / PoseEkf::on", f"{us['pose_ekf_on']:.3f} us",
                       f"{us['orocos_bfl']:.3f} us", ratio, ">= 15", ratio >= 15.0)]  # fmt: skip


def python_rows(seconds: dict[str, float], info: dict[str, Any]) -> list[Row]:
    """Compare the pose EKF from Python."""
    each = {name: seconds[name] / i["items"] for name, i in info.items() if "items" in i}
    rows = [
        _rate("Python, replay [messages/s]", each["replay"], 3e6),
        _rate("Python, replay recorded [messages/s]", each["replay_recorded"], 1e6),
        _rate("Python, columns to recorded poses [messages/s]", each["columns_to_poses"], 1e6),
    ]
    epoch_us = 1e6 * each["epoch_call"]
    rows.append(Row("Python, one call per epoch [us]", f"{epoch_us:.2f} us", "", epoch_us, "<= 3",
                    epoch_us <= 3.0))  # fmt: skip
    name = "filterpy / Python replay recorded"
    if "filterpy" not in each:
        return [*rows, Row(name, "", "not installed", None, ">= 150", None)]
    ours_us, peer_us = 1e6 * each["replay_recorded"], 1e6 * each["filterpy"]
    ratio = peer_us / ours_us
    return [*rows, Row(name, f"{ours_us:.3f} us", f"{peer_us:.1f} us", ratio, ">= 150",
                       ratio >= 150.0)]  # fmt: skip


def evaluation_rows(seconds: dict[str, float]) -> list[Row]:
    """Compare the evaluation of 100,000 poses; starting the interpreters is left out, then in."""
    ours = seconds["evaluation"]
    name = "evo / ours, 100,000 poses"
    if "evo_program" not in seconds:
        return [Row(name, f"{ours:.3f} s", "not installed", None, ">= 30", None)]
    evo = seconds["evo_program"] - seconds["evo_start"]
    whole = seconds["evo_program"] / seconds["evaluation_program"]
    return [
        Row(name, f"{ours:.3f} s", f"{evo:.2f} s", evo / ours, ">= 30", evo / ours >= 30.0),
        Row("the same, program to program", f"{seconds['evaluation_program']:.3f} s",
            f"{seconds['evo_program']:.2f} s", whole, "-", None),
    ]  # fmt: skip


def _at_most(what: str, ours: float, peer: float, limit: float) -> Row:
    ratio = ours / peer
    return Row(what, f"{ours:.3f} us", f"{peer:.3f} us", ratio, f"<= {limit:g}", ratio <= limit)


def _rate(what: str, seconds: float, least: float) -> Row:
    rate = 1.0 / seconds
    return Row(what, f"{1e6 * seconds:.3f} us", "", rate, f">= {least:,.0f}", rate >= least)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
