# SPDX-License-Identifier: Apache-2.0
"""Run every benchmark and print ours beside the peers': medians of one run, and their ratios."""

from __future__ import annotations

import json
import platform
import statistics
import subprocess
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "build" / "bench"
REPETITIONS = 15
PEERS = ("filterpy", "evo")


@dataclass(frozen=True)
class Row:
    """One line of the table: `figure` is a ratio, a rate or a time and has to be as `required`."""

    what: str
    ours: str
    peer: str = ""
    figure: float | None = None
    unit: str = ""
    required: str = ""
    met: bool | None = None


@dataclass(frozen=True)
class Cpp:
    """Per filter, microseconds per step, heap allocations per message and RMSE in metres."""

    step_us: dict[str, float]
    allocations: dict[str, float]
    rmse_m: dict[str, float]
    compiler: str


@dataclass(frozen=True)
class Python:
    """Per benchmark, seconds per item (a message, an epoch or a whole run) and RMSE in metres."""

    seconds: dict[str, float]
    rmse_m: dict[str, float]


def main(cpp_benchmark: Path) -> int:
    """Run, print the table, write results.json; 1 if a requirement is not met."""
    OUT.mkdir(parents=True, exist_ok=True)
    cpp, python = run_cpp(cpp_benchmark), run_python()
    rows = [*cpp_rows(cpp), *python_rows(python), *evaluation_rows(python)]
    made_with = {"C++ benchmarks": cpp.compiler, "Python": platform.python_version()}
    made_with |= {name: found for name in PEERS if (found := _version(name)) is not None}
    rmse_m = {**cpp.rmse_m, **python.rmse_m}
    console = Console(width=None if sys.stdout.isatty() else 130, highlight=False)
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
    """Return the rows as they are printed."""
    table = Table(title="Medians of one run", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("what", "ours", "peer or reference", "ratio or rate", "required", "met"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for row in rows:
        figure = "" if row.figure is None else f"{_short(row.figure)} {row.unit}".rstrip()
        met = {True: "yes", False: "NO", None: ""}[row.met]
        table.add_row(escape(row.what), row.ours, row.peer, figure, row.required, met)
    return table


def run_cpp(program: Path) -> Cpp:
    """Run the C++ benchmarks; repetitions take turns, so that a disturbance hits all alike."""
    file = OUT / "cpp.json"
    _run(
        [program, f"--benchmark_repetitions={REPETITIONS}", "--benchmark_min_time=0.2",
         "--benchmark_enable_random_interleaving=true", f"--benchmark_out={file}"]
    )  # fmt: skip
    report = json.loads(file.read_text())
    times: dict[str, list[float]] = {}
    for run in report["benchmarks"]:
        if run["run_type"] == "iteration":
            times.setdefault(_filter(run), []).append(1e6 / run["items_per_second"])
    file = OUT / "allocations.json"
    counter = program.with_name("count_allocations")
    _run([counter, "--benchmark_min_time=0.001", f"--benchmark_out={file}"])
    counted = json.loads(file.read_text())["benchmarks"]
    return Cpp(
        {name: statistics.median(values) for name, values in times.items()},
        {_filter(run): run["allocations_per_message"] for run in counted},
        {_filter(run): run["rmse_m"] for run in counted},
        report["context"]["compiler"],
    )


def run_python() -> Python:
    """Run the Python benchmarks; those of peers that are not installed are missing."""
    file = OUT / "python.json"
    _run(
        [sys.executable, "-m", "pytest", "-q", "-c", HERE / "pytest.ini", "--rootdir", HERE,
         "-p", "no:cacheprovider", HERE / "python", f"--benchmark-json={file}"]
    )  # fmt: skip
    seconds: dict[str, float] = {}
    rmse_m: dict[str, float] = {}
    for run in json.loads(file.read_text())["benchmarks"]:
        name, info = run["name"].removeprefix("test_"), run["extra_info"]
        seconds[name] = run["stats"]["median"] / info.get("items", 1)
        if "rmse_m" in info:
            rmse_m[name] = info["rmse_m"]
    return Python(seconds, rmse_m)


def cpp_rows(cpp: Cpp) -> list[Row]:
    """Compare one prediction and five ranges on three states, called from C++."""
    us = cpp.step_us
    reference, ours = us["reference_joseph"], us["pose_ekf_on"]
    allocations = cpp.allocations["pose_ekf_on"]
    rows = [
        _at_most("C++, a step: models, filter / Joseph reference", us["models_and_filter"],
                 reference, 1.1),
        _at_most("C++, a step: PoseEkf::on / Joseph reference", ours, reference, 2.0),
    ]  # fmt: skip
    if "orocos_bfl" in us:
        rows.append(_faster("C++, a step: Orocos BFL / PoseEkf::on", ours, us["orocos_bfl"], 15.0))
    else:
        rows.append(_skipped("C++, a step: Orocos BFL / PoseEkf::on", "Orocos BFL", ours))
    peer = f"BFL {cpp.allocations['orocos_bfl']:.1f}" if "orocos_bfl" in us else ""
    rows.append(Row("C++, PoseEkf::on: heap allocations per message", f"{allocations:g}", peer,
                    allocations, "", "0", allocations == 0.0))  # fmt: skip
    return rows


def python_rows(python: Python) -> list[Row]:
    """Compare the pose EKF called from Python."""
    each = python.seconds
    epoch = each["epoch_call"]
    rows = [
        _rate("Python, a message: columns to last estimate", each["replay"], 3e6),
        _rate("Python, a message: columns to outcomes, estimates", each["replay_recorded"],
              1e6),
        Row("Python, one call per epoch: motion and 5 ranges", _time(epoch), "", 1e6 * epoch, "us",
            "<= 3", 1e6 * epoch <= 3.0),
    ]  # fmt: skip
    what = "Python, a message, recorded: filterpy / ours"
    ours = each["replay_short"]
    if "filterpy" not in each:
        return [*rows, _skipped(what, "filterpy", ours * 1e6)]
    return [*rows, _faster(what, 1e6 * ours, 1e6 * each["filterpy"], 150.0)]


def evaluation_rows(python: Python) -> list[Row]:
    """Compare reading, associating, aligning and scoring 100,000 poses.

    evo runs as a program only. What it needs for three poses, which is to start, is taken off.
    """
    s = python.seconds
    what = "100,000 poses: evo without its start / ours"
    if "evo_program" not in s:
        return [_skipped(what, "evo", s["evaluation"] * 1e6)]
    work = s["evo_program"] - s["evo_start"]
    return [
        _faster(what, 1e6 * s["evaluation"], 1e6 * work, 30.0),
        _plain("- evo_ape / locfuse evaluate, start included", s["evaluation_program"],
               s["evo_program"]),
        _plain("- the start of each: the same for three poses", s["evaluation_start"],
               s["evo_start"]),
    ]  # fmt: skip


def _at_most(what: str, ours_us: float, peer_us: float, limit: float) -> Row:
    ratio = ours_us / peer_us
    return Row(what, _time(1e-6 * ours_us), _time(1e-6 * peer_us), ratio, "x", f"<= {limit:g}",
               ratio <= limit)  # fmt: skip


def _faster(what: str, ours_us: float, peer_us: float, least: float) -> Row:
    ratio = peer_us / ours_us
    return Row(what, _time(1e-6 * ours_us), _time(1e-6 * peer_us), ratio, "x", f">= {least:g}",
               ratio >= least)  # fmt: skip


def _plain(what: str, ours: float, peer: float) -> Row:
    return Row(what, _time(ours), _time(peer), peer / ours, "x")


def _rate(what: str, seconds: float, least: float) -> Row:
    return Row(what, _time(seconds), "", 1.0 / seconds, "/s", f">= {least:,.0f}",
               1.0 / seconds >= least)  # fmt: skip


def _skipped(what: str, package: str, ours_us: float) -> Row:
    return Row(what, _time(1e-6 * ours_us), f"skipped: no {package}")


def _time(seconds: float) -> str:
    return f"{seconds:.3f} s" if seconds >= 0.01 else f"{_short(1e6 * seconds)} us"


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}"


def _filter(run: dict[str, Any]) -> str:
    return str(run["name"].split("/")[1])


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _run(command: list[str | Path]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        sys.exit(f"{command[0]} cannot be run: {error.strerror}")
    if done.returncode != 0:
        sys.exit(f"{done.stdout}{done.stderr}\n{command[0]} failed with status {done.returncode}")


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
