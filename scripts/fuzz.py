# SPDX-License-Identifier: Apache-2.0
"""Run every fuzz target for some seconds of processor time, as many at once as there are cores.

Usage: fuzz.py FOLDER_OF_TARGETS [SECONDS [TARGET ...]]. What is new is kept in build/fuzz/corpus,
and an input that breaks something in build/fuzz/findings.
"""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build/fuzz"
FILES = ("config", "log", "map")
OPTIONS = (
    "-max_len=4096",
    "-len_control=0",
    "-timeout=30",
    "-rss_limit_mb=3000",
    "-print_final_stats=1",
    *(["-seed=1"] if os.environ.get("CI") else []),  # of the same state CI tells the same
)
ENVIRONMENT = {"UBSAN_OPTIONS": "print_stacktrace=1"}


@dataclass(frozen=True)
class Result:
    """What became of a target."""

    target: str
    runs: int
    inputs: int
    seconds: float  # of processor time
    failed: bool
    tail: str


def command(target: str, programs: Path) -> list[str]:
    """Return how a target is started."""
    if target in FILES:
        return [sys.executable, str(ROOT / "fuzz/fuzz_files.py"), target]
    return [str(programs / f"fuzz_{target}")]


def fuzz(target: str, programs: Path, seconds: int) -> Result:
    """Run one target on the committed corpus, and on what it found before.

    Where others use the machine it is run again, for what is left of its time.
    """
    found, findings = WORK / "corpus" / target, WORK / "findings"
    found.mkdir(parents=True, exist_ok=True)
    findings.mkdir(parents=True, exist_ok=True)
    log = WORK / f"{target}.log"
    result = Result(target, 0, 0, 0.0, False, "")
    while result.seconds < seconds and not result.failed:
        with log.open("w") as told:
            started = subprocess.Popen(
                [
                    *command(target, programs),
                    *OPTIONS,
                    f"-max_total_time={math.ceil(seconds - result.seconds)}",
                    f"-artifact_prefix={findings / target}-",
                    str(found),
                    str(ROOT / "fuzz/corpus" / target),
                ],
                env={**os.environ, **ENVIRONMENT},
                stdout=subprocess.DEVNULL,
                stderr=told,
            )
            _, status, used = os.wait4(started.pid, 0)
            started.returncode = os.waitstatus_to_exitcode(status)
        tail = log.read_text(errors="replace")
        runs = re.search(r"number_of_executed_units:\s*(\d+)|Done (\d+) (?:runs )?in", tail)
        result = Result(
            target,
            result.runs + (int(runs[1] or runs[2]) if runs else 0),
            len(list(found.iterdir())),
            result.seconds + used.ru_utime + used.ru_stime,
            started.returncode != 0,
            tail[-3000:],
        )
    return result


def main() -> int:
    """Print a line per target when it is done, and what broke."""
    programs = Path(sys.argv[1])
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 3600
    known = [path.stem.removeprefix("fuzz_") for path in sorted((ROOT / "fuzz").glob("fuzz_*.cpp"))]
    targets = sys.argv[3:] or [*known, *FILES]
    cores = os.cpu_count() or 1
    rounds = -(-len(targets) // cores)
    print(
        f"{len(targets)} targets, {seconds} s of processor time each, {cores} at once: "
        f"{rounds * seconds} s"
    )
    broken = 0
    with ThreadPoolExecutor(cores) as pool:
        for result in pool.map(lambda target: fuzz(target, programs, seconds), targets):
            verdict = "BROKEN" if result.failed else "ok"
            print(
                f"{result.target:16} {verdict:7} {result.seconds:5.0f} s, {result.runs:9} runs, "
                f"{result.inputs} new inputs",
                flush=True,
            )
            if result.failed:
                broken += 1
                print(result.tail)
    print(f"{broken} of {len(targets)} targets broke; findings are in {WORK / 'findings'}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
