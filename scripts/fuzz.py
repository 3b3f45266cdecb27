# SPDX-License-Identifier: Apache-2.0
"""Run every fuzz target for some seconds of processor time, as many at once as there are cores.

Usage: fuzz.py FOLDER_OF_TARGETS [SECONDS | keep [TARGET ...]]. What is new is kept in
build/fuzz/corpus, and an input that breaks something in build/fuzz/findings. `keep` writes those of
build/fuzz/corpus that are short and reach what others do not to fuzz/kept, where the next one
begins.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
import tarfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build/fuzz"
KEPT = ROOT / "fuzz/kept"
KEPT_BYTES = 256  # of an input
FILES = ("config", "log", "map", "bag")
IN_CI = bool(os.environ.get("CI"))  # of the same state it tells the same: no luck in what it finds
OPTIONS = (
    "-max_len=4096",
    "-len_control=0",
    "-timeout=30",
    "-rss_limit_mb=3000",
    "-print_final_stats=1",
    *(["-seed=1"] if IN_CI else []),
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


def begin(target: str, found: Path) -> None:
    """Make a folder of what was kept of a target; in CI an empty one."""
    found.mkdir(parents=True)
    kept = KEPT / f"{target}.tar.xz"
    if kept.exists() and not IN_CI:
        with tarfile.open(kept) as file:
            for member in file:
                data = file.extractfile(member)
                assert data is not None  # all are files
                (found / member.name).write_bytes(data.read())


def fuzz(target: str, programs: Path, seconds: int) -> Result:
    """Run one target on the committed corpus, and on what it found before.

    Where others use the machine it is run again, for what is left of its time.
    """
    found, findings = WORK / "corpus" / target, WORK / "findings"
    if not found.exists():
        begin(target, found)
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


def keep(target: str, programs: Path) -> int:
    """Write what was found and is short to `KEPT`, and return how many inputs that are."""
    chosen = found = WORK / "corpus" / target
    if target not in FILES:  # merging starts a program anew, which a script cannot be
        chosen = WORK / "chosen" / target
        shutil.rmtree(chosen, ignore_errors=True)
        chosen.mkdir(parents=True)
        subprocess.run(
            [
                *command(target, programs),
                "-merge=1",
                f"-max_len={KEPT_BYTES}",
                str(chosen),
                str(ROOT / "fuzz/corpus" / target),
                str(found),
            ],
            check=True,
            capture_output=True,
        )
    inputs = sorted(path for path in chosen.iterdir() if path.stat().st_size <= KEPT_BYTES)
    if not inputs:  # no bag is short
        return 0
    KEPT.mkdir(exist_ok=True)
    with tarfile.open(KEPT / f"{target}.tar.xz", "w:xz", preset=9) as file:
        for path in inputs:
            member = tarfile.TarInfo(path.name)
            member.size = path.stat().st_size
            with path.open("rb") as data:
                file.addfile(member, data)
    return len(inputs)


def main() -> int:
    """Print a line per target when it is done, and what broke."""
    programs = Path(sys.argv[1])
    known = [path.stem.removeprefix("fuzz_") for path in sorted((ROOT / "fuzz").glob("fuzz_*.cpp"))]
    targets = sys.argv[3:] or [*known, *FILES]
    if sys.argv[2:3] == ["keep"]:
        for target in targets:
            print(f"{target:16} {keep(target, programs):6} inputs", flush=True)
        return 0
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 3600
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
