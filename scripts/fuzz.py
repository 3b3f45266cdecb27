# SPDX-License-Identifier: Apache-2.0
"""Run every fuzz target for some seconds of processor time, as many at once as there are cores.

Usage: fuzz.py FOLDER_OF_TARGETS [SECONDS | keep [TARGET ...]]. New inputs are kept in
build/fuzz/corpus, and an input that breaks something in build/fuzz/findings. `keep` writes the
short inputs of build/fuzz/corpus that reach code which others do not reach to fuzz/kept, where the
next run begins. In CI a target that has passed with the same program, corpus, seed and time is not
run again; see passed.py.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
import tarfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

from passed import Passed, digest_of

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build/fuzz"
KEPT = ROOT / "fuzz/kept"
DICTIONARY = ROOT / "fuzz/dictionary.py"
KEPT_BYTES = 256  # of an input
FILES = ("config", "log", "map", "bag")
IN_CI = bool(os.environ.get("CI"))  # where the same state gives the same result, by a fixed seed
HEARTBEAT_S = 10.0
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
    """The result of one target."""

    target: str
    runs: int
    inputs: int
    seconds: float  # of processor time
    failed: bool
    tail: str


def command(target: str, programs: Path) -> list[str]:
    """Return the command that starts a target."""
    if target in FILES:
        return [sys.executable, str(ROOT / "fuzz/fuzz_files.py"), target]
    return [str(programs / f"fuzz_{target}")]


def begin(target: str, found: Path) -> None:
    """Make the folder of a target's inputs from those kept; in CI an empty one."""
    found.mkdir(parents=True)
    kept = KEPT / f"{target}.tar.xz"
    if kept.exists() and not IN_CI:
        with tarfile.open(kept) as file:
            for member in file:
                data = file.extractfile(member)
                assert data is not None  # all are files
                (found / member.name).write_bytes(data.read())


def fuzz(target: str, programs: Path, seconds: int) -> Result:
    """Run one target on the committed corpus and on the inputs it found before.

    Where other programs use the machine it is run again, for the rest of its processor time.
    """
    found, findings = WORK / "corpus" / target, WORK / "findings"
    if not found.exists():
        begin(target, found)
    findings.mkdir(parents=True, exist_ok=True)
    log = WORK / f"{target}.log"
    dictionary = dictionary_option(target)
    result = Result(target, 0, 0, 0.0, False, "")
    while result.seconds < seconds and not result.failed:
        with log.open("w") as output:
            started = subprocess.Popen(
                [
                    *command(target, programs),
                    *OPTIONS,
                    *dictionary,
                    f"-max_total_time={math.ceil(seconds - result.seconds)}",
                    f"-artifact_prefix={findings / target}-",
                    str(found),
                    str(ROOT / "fuzz/corpus" / target),
                ],
                env={**os.environ, **ENVIRONMENT},
                stdout=subprocess.DEVNULL,
                stderr=output,
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


def dictionary_option(target: str) -> list[str]:
    """Write the dictionary of a target that reads files; return the option that names it."""
    if target not in FILES:
        return []
    file = WORK / f"{target}.dict"
    of_target = [sys.executable, str(DICTIONARY), target]
    file.write_bytes(subprocess.run(of_target, capture_output=True, check=True).stdout)
    return [f"-dict={file}"]


def keep(target: str, programs: Path) -> int:
    """Write the short inputs that were found to `KEPT`, and return their number."""
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


def state(target: str, programs: Path, seconds: int) -> str:
    """Return a digest of all that the result of a target in CI depends on."""
    files = sorted(path for path in (ROOT / "fuzz/corpus" / target).rglob("*") if path.is_file())
    settings = repr((target, seconds, OPTIONS, ENVIRONMENT, sys.version))
    if target in FILES:
        settings += repr(sorted(f"{package.name} {package.version}" for package in distributions()))
        files += [ROOT / "fuzz/fuzz_files.py", DICTIONARY]
        package = ROOT / "python/locfuse"
        files += sorted(
            path
            for path in package.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        )
        files += sorted(Path(sys.prefix).glob("lib/python*/site-packages/locfuse/_core*.so"))
    else:
        program = programs / f"fuzz_{target}"
        linked = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True)
        files += [program, *(Path(path) for path in re.findall(r"(/\S+) \(0x", linked.stdout))]
    return digest_of(settings.encode(), files)


def main() -> int:
    """Print a line per target when it is done, and the output of those that broke."""
    programs = Path(sys.argv[1])
    known = [path.stem.removeprefix("fuzz_") for path in sorted((ROOT / "fuzz").glob("fuzz_*.cpp"))]
    targets = sys.argv[3:] or [*known, *FILES]
    if sys.argv[2:3] == ["keep"]:
        for target in targets:
            print(f"{target:16} {keep(target, programs):6} inputs", flush=True)
        return 0
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 3600
    passed = Passed("fuzz")
    states = {target: state(target, programs, seconds) for target in targets} if IN_CI else {}
    unchanged = [target for target in states if passed.has(states[target])]
    if unchanged:
        print(f"passed before, as they are: {', '.join(unchanged)}")
    targets = [target for target in targets if target not in unchanged]
    cores = os.cpu_count() or 1
    rounds = -(-len(targets) // cores)
    print(
        f"{len(targets)} targets, {seconds} s of processor time each, {cores} at once: "
        f"{rounds * seconds} s",
        flush=True,
    )
    broken = 0
    running: set[str] = set()
    ended = threading.Event()
    began = time.monotonic()

    def run(target: str) -> Result:
        running.add(target)
        try:
            return fuzz(target, programs, seconds)
        finally:
            running.discard(target)

    def report() -> None:
        while not ended.wait(HEARTBEAT_S):
            elapsed = time.monotonic() - began
            print(f"  {elapsed:.0f} s: {', '.join(sorted(running.copy()))}", flush=True)

    threading.Thread(target=report, daemon=True).start()
    with ThreadPoolExecutor(cores) as pool:
        for result in pool.map(run, targets):
            verdict = "BROKEN" if result.failed else "ok"
            print(
                f"{result.target:16} {verdict:7} {result.seconds:5.0f} s, {result.runs:9} runs, "
                f"{result.inputs} new inputs",
                flush=True,
            )
            if result.failed:
                broken += 1
                print(result.tail)
            elif IN_CI:
                passed.add(states[result.target])
    ended.set()
    print(f"{broken} of {len(targets)} targets broke; findings are in {WORK / 'findings'}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
