# SPDX-License-Identifier: Apache-2.0
"""Change one operator at a time in the filters and models, and count which changes tests notice.

Usage: mutate.py [--count N] [--seed S] [--jobs N] [--out FILE] [--again FILE] [SOURCE ...]. With
`--again` only what survived in an earlier FILE is tried. Works on copies in build/mutation, of the
library up to the filters and of the tests of both rooms. A change that does not compile is not
counted; one that no test, sanitized as in CI, notices survives and is printed with its line, unless
scripts/mutants_explained.txt says why it makes no difference. The score is the share of those
noticed among all others.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
COPIES = ROOT / "build" / "mutation"
EXPLAINED = ROOT / "scripts" / "mutants_explained.txt"
TESTS = ("test_filters", "test_models")
ROOMS = (
    "cpp/src/filters",
    "cpp/include/locfuse/filters",
    "cpp/src/models",
    "cpp/include/locfuse/models",
)
LANES = "_lanes"  # the same kernels once more, chosen by the processor
TIMEOUT_S = 300.0

# An operator of an expression has spaces around it, unlike that of a template or pointer.
SWAPS = {
    " + ": " - ", " - ": " + ", " * ": " / ", " / ": " * ", " += ": " -= ", " -= ": " += ",
    " *= ": " /= ", " < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ", " == ": " != ",
    " != ": " == ", " && ": " || ", " || ": " && ", "true": "false", "false": "true",
    "std::min(": "std::max(", "std::max(": "std::min(", "std::sin(": "std::cos(",
    "std::cos(": "std::sin(", "std::sqrt(": "(", ".transpose()": "", "(!": "(", " -": " ",
    "0.5": "1.0", "2.0": "1.0",
}  # fmt: skip
SKIPPED = re.compile(
    r"^\s*(//|#|\*|static_assert|template|using |throw )|LOCFUSE_|noexcept\("
    r"|^\s+double \w+ = [^;]+;\s+///<"  # a default, which tests/python/config compares
)


class Mutant(NamedTuple):
    """One change: `before` at `column` of a line becomes `after`."""

    source: str
    line: int
    column: int
    before: str
    after: str


def mutants_of(source: str) -> list[Mutant]:
    """Return every change of a file that the table of swaps allows."""
    found = []
    for number, line in enumerate((ROOT / source).read_text().splitlines()):
        code = re.sub(r'"(\\.|[^"])*"', lambda match: " " * len(match.group()), line)
        code = code.split("//")[0]
        if SKIPPED.search(line):
            continue
        for before, after in SWAPS.items():
            for match in re.finditer(re.escape(before), code):
                if before == " -" and not re.match(r"[\w(]", code[match.end() : match.end() + 1]):
                    continue  # the minus of a sign only
                if before[0].isalnum() and re.match(
                    r"[\w.]", code[match.start() - 1 : match.start()]
                ):
                    continue  # within a longer name or number
                found.append(Mutant(source, number, match.start(), before, after))
    return found


def key_of(mutant: Mutant) -> str:
    """Return what names a change as long as its line is the same, wherever that stands."""
    line = (ROOT / mutant.source).read_text().splitlines()[mutant.line]
    end = mutant.column + len(mutant.before)
    changed = f"{line[: mutant.column]}[{mutant.before} => {mutant.after}]{line[end:]}"
    return f"{mutant.source}: {changed.strip()}"


def explained() -> dict[str, str]:
    """Return the reason for each change that makes no difference."""
    reasons: dict[str, str] = {}
    waiting: list[str] = []
    for line in EXPLAINED.read_text().splitlines():
        if line.startswith("  "):
            reasons.update(dict.fromkeys(waiting, line.strip()))
            waiting = []
        elif line and not line.startswith("#"):
            waiting.append(line)
    return reasons


class Copy:
    """A copy of the sources, built once, in which one change at a time is tried."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in ("cpp", "cmake", "tests/cpp"):
            shutil.rmtree(folder / part, ignore_errors=True)
            # As new, so that nothing is left of a change in whose middle it was stopped.
            shutil.copytree(ROOT / part, folder / part, copy_function=shutil.copy)
        shutil.copy(ROOT / "CMakeLists.txt", folder)
        library = folder / "cpp" / "CMakeLists.txt"
        above = re.compile(
            r"^ *src/(frontends|estimators|recovery|particles|replay)/\w+\.cpp\n", re.MULTILINE
        )
        library.write_text(above.sub("", library.read_text()))
        subprocess.run(
            ["cmake", "-S", folder, "-B", folder / "build", "-G", "Ninja",
             "-DCMAKE_BUILD_TYPE=Debug",
             "-DCMAKE_CXX_FLAGS_DEBUG=-O1 -g0 -D_GLIBCXX_ASSERTIONS -fsanitize=address",
             "-DLOCFUSE_BUILD_EXAMPLES=OFF", "-DLOCFUSE_UNITY_BUILD=OFF"],
            capture_output=True, check=True,
        )  # fmt: skip
        if not all(self.build(test) and self.passes(test) for test in TESTS):
            raise SystemExit("the tests of the unchanged sources do not build or pass")

    def build(self, test: str) -> bool:
        """Build a test; return whether it compiles."""
        folder = str(self.folder / "build")
        command = ["cmake", "--build", folder, "--target", test, "--parallel", "1"]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def passes(self, test: str) -> bool:
        """Return whether a test passes in time."""
        command = [
            str(self.folder / "build/tests/cpp" / test),
            "--gtest_fail_fast",
            "--gtest_brief=1",
        ]
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S, check=False)
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0

    def verdict_of(self, mutant: Mutant) -> str:
        """Return 'noticed', 'survived' or 'does not compile'."""
        path = self.folder / mutant.source
        text = path.read_text()
        lines = text.splitlines(keepends=True)
        line = lines[mutant.line]
        end = mutant.column + len(mutant.before)
        lines[mutant.line] = line[: mutant.column] + mutant.after + line[end:]
        path.write_text("".join(lines))
        own = "test_filters" if "/filters/" in mutant.source else "test_models"
        try:
            for test in sorted(TESTS, key=lambda name: name != own):
                if not self.build(test):
                    return "does not compile"
                if not self.passes(test):
                    return "noticed"
            return "survived"
        finally:
            path.write_text(text)


def main() -> int:
    """Draw changes, try each, and print those that survive and the score."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--again", type=Path)
    parser.add_argument("sources", nargs="*")
    chosen = parser.parse_args()
    sources = chosen.sources or sorted(
        str(path.relative_to(ROOT))
        for room in ROOMS
        for path in (ROOT / room).rglob("*.[ch]pp")
        if LANES not in path.name
    )
    every = [mutant for source in sources for mutant in mutants_of(source)]
    order = np.random.default_rng(chosen.seed).permutation(len(every))[: chosen.count]
    if chosen.again is not None:
        lines = chosen.again.read_text().splitlines()
        names = {line.split(": ", 2)[2] for line in lines if line.startswith("survived")}
        order = np.array([i for i, mutant in enumerate(every) if key_of(mutant) in names])
    copies: SimpleQueue[Copy] = SimpleQueue()
    for job in range(chosen.jobs):
        copies.put(Copy(COPIES / str(job)))
    reasons = explained()
    report: list[str] = []
    counts = {"noticed": 0, "survived": 0, "explained": 0, "does not compile": 0}

    def attempt(index: int) -> None:
        mutant = every[index]
        copy = copies.get()
        try:
            verdict = copy.verdict_of(mutant)
        finally:
            copies.put(copy)
        key = key_of(mutant)
        if verdict == "survived" and key in reasons:
            verdict = "explained"
        counts[verdict] += 1
        report.append(f"{verdict}: {mutant.line + 1}: {key}")
        print(report[-1], flush=True)
        if chosen.out is not None:
            chosen.out.write_text("\n".join(report) + "\n")

    with ThreadPoolExecutor(chosen.jobs) as pool:
        list(pool.map(attempt, order))
    tried = counts["noticed"] + counts["survived"]
    print(f"{len(every)} changes, {tried} count: {counts}; score {counts['noticed'] / tried:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
