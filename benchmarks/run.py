# SPDX-License-Identifier: Apache-2.0
"""Run all benchmarks and print medians of locfuse and its peers with their ratios."""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TextColumn
from rich.table import Table

from rows import Measured, Row, all_rows, short

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "build" / "bench"
REPETITIONS = 15
PEERS = ("filterpy", "evo", "gtsam", "scipy", "small_gicp", "stonesoup", "rosbags")
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


def main(programs: Path) -> int:
    """Run, print the table, write results.json; 1 if a requirement is not met."""
    OUT.mkdir(parents=True, exist_ok=True)
    measured, context = Measured(), dict[str, str]()
    console = Console(width=None if sys.stdout.isatty() else 130, highlight=False)
    with Progress(TextColumn("{task.description}"), console=Console(stderr=True)) as progress:
        task = progress.add_task("")
        for name in ("pose_ekf", "multilateration", "scan_matcher", "maps", "mcl", "cylinders",
                     "landmarks", "tags", "inertial"):  # fmt: skip
            progress.update(task, description=f"running bench_{name}, minutes")
            context = run_cpp(measured, programs / f"bench_{name}") | context
        progress.update(task, description="running the portable kernels and counting allocations")
        run_cpp(measured, programs / "bench_multilateration", "plane_batch", "portable/")
        run_cpp(measured, programs / "bench_scan_matcher", "lookup", "portable/")
        run_cpp(measured, programs / "bench_mcl", "step", "portable/")
        count_allocations(measured, programs / "count_allocations")
        progress.update(task, description="running the Python benchmarks, minutes")
        run_python(measured)
    rows = all_rows(measured)
    made_with = {"C++ benchmarks": context["compiler"], "Python": platform.python_version()}
    made_with |= {name: found for name in PEERS if (found := _version(name)) is not None}
    rmse_m = {name: c["rmse_m"] for name, c in measured.counted.items() if "rmse_m" in c}
    console.print(table_of(rows))
    for title, values in (
        ("Made with", made_with),
        ("Same work? RMSE in metres", {name: f"{value:.4f}" for name, value in rmse_m.items()}),
    ):
        console.print(escape(f"{title}: " + ", ".join(f"{k} {v}" for k, v in values.items())))
    results = {"rows": [asdict(row) for row in rows], "made_with": made_with, "rmse_m": rmse_m}
    (OUT / "results.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 1 if any(row.met is False for row in rows) else 0


def table_of(rows: list[Row]) -> Table:
    """Return the rows as a table for printing."""
    table = Table(title="Medians of one run", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("what", "ours", "peer or reference", "ratio or rate", "required", "met"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for row in rows:
        figure = "" if row.figure is None else f"{short(row.figure)} {row.unit}".rstrip()
        met = {True: "yes", False: "NO", None: ""}[row.met]
        table.add_row(escape(row.what), row.ours, row.peer, figure, row.required, met)
    return table


def run_cpp(measured: Measured, program: Path, only: str = "", prefix: str = "") -> dict[str, str]:
    """Run C++ benchmarks; repetitions are interleaved, so that a disturbance affects all equally.

    With a prefix, only the portable kernels are used. Returns the context of the build.
    """
    file = OUT / f"{prefix.rstrip('/')}{program.name}.json"
    _run(
        [program, f"--benchmark_repetitions={REPETITIONS}", "--benchmark_min_time=0.2",
         "--benchmark_enable_random_interleaving=true", f"--benchmark_filter={only or '.'}",
         f"--benchmark_out={file}"],
        {"LOCFUSE_PORTABLE": "1"} if prefix else {},
    )  # fmt: skip
    report = json.loads(file.read_text())
    seconds: dict[str, list[float]] = {}
    for run in report["benchmarks"]:
        if run["run_type"] == "iteration":
            name = prefix + run["run_name"]
            rate = run.get("items_per_second")
            each = 1.0 / rate if rate else run["real_time"] * UNITS[run["time_unit"]]
            seconds.setdefault(name, []).append(each)
            measured.counted[name] = _counted(run)
    measured.seconds |= {name: statistics.median(values) for name, values in seconds.items()}
    return dict(report["context"])


def count_allocations(measured: Measured, program: Path) -> None:
    """Run the program that counts heap allocations."""
    file = OUT / "allocations.json"
    _run([program, "--benchmark_min_time=0.001", f"--benchmark_out={file}"])
    for run in json.loads(file.read_text())["benchmarks"]:
        measured.counted[run["run_name"]] = _counted(run)


def run_python(measured: Measured) -> None:
    """Run the Python benchmarks; peers that are not installed are skipped."""
    file = OUT / "python.json"
    _run(
        [sys.executable, "-m", "pytest", "-q", "-c", HERE / "pytest.ini", "--rootdir", HERE,
         "-p", "no:cacheprovider", HERE / "python", f"--benchmark-json={file}"]
    )  # fmt: skip
    for run in json.loads(file.read_text())["benchmarks"]:
        name, info = run["name"].removeprefix("test_"), run["extra_info"]
        measured.seconds[name] = run["stats"]["median"] / info.get("items", 1)
        measured.counted[name] = _counted(info)


def _counted(run: dict[str, Any]) -> dict[str, float]:
    known = ("allocations_per_message", "rmse_m", "right", "wrong", "peak_mb", "seconds_driven",
             "ranges")  # fmt: skip
    return {name: run[name] for name in known if name in run}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _run(command: list[str | Path], environment: dict[str, str] | None = None) -> None:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, env={**os.environ, **(environment or {})}
        )
    except OSError as error:
        sys.exit(f"{command[0]} cannot be run: {error.strerror}")
    if done.returncode != 0:
        sys.exit(f"{done.stdout}{done.stderr}\n{command[0]} failed with status {done.returncode}")


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
