# SPDX-License-Identifier: Apache-2.0
"""Change one operator at a time in the filters and models, and count which changes tests notice.

Usage: mutate.py [--count N] [--seed S] [--out FILE] [SOURCE ...]. Works on a copy, build/mutation.
A change that does not compile is not counted; one that no test notices survives and is printed with
its line. The score is the share of those noticed.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
COPY = ROOT / "build" / "mutation"
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
SKIPPED = re.compile(r"^\s*(//|#|\*|static_assert|template|using |throw )|LOCFUSE_|noexcept\(")


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


def build() -> bool:
    """Build the tests of the copy."""
    done = subprocess.run(
        ["cmake", "--build", COPY / "build", "--target", *TESTS], capture_output=True, check=False
    )
    return done.returncode == 0


def notices() -> bool:
    """Return whether a test of the copy fails, or does not end."""
    for test in TESTS:
        command = [str(COPY / "build/tests/cpp" / test), "--gtest_fail_fast", "--gtest_brief=1"]
        try:
            done = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S, check=False)
        except subprocess.TimeoutExpired:
            return True
        if done.returncode != 0:
            return True
    return False


def verdict_of(mutant: Mutant) -> str:
    """Return 'noticed', 'survived' or 'does not compile'."""
    path = COPY / mutant.source
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    line = lines[mutant.line]
    end = mutant.column + len(mutant.before)
    lines[mutant.line] = line[: mutant.column] + mutant.after + line[end:]
    path.write_text("".join(lines))
    try:
        if not build():
            return "does not compile"
        return "noticed" if notices() else "survived"
    finally:
        path.write_text(text)


def main() -> int:
    """Draw changes, try each, and print those that survive and the score."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
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
    for folder in ("cpp", "cmake", "tests/cpp"):
        shutil.copytree(ROOT / folder, COPY / folder, dirs_exist_ok=True)
    shutil.copy(ROOT / "CMakeLists.txt", COPY)
    subprocess.run(
        ["cmake", "-S", COPY, "-B", COPY / "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug",
         "-DCMAKE_CXX_FLAGS_DEBUG=-O1 -g0", "-DLOCFUSE_BUILD_EXAMPLES=OFF"],
        capture_output=True, check=True,
    )  # fmt: skip
    if not build() or notices():
        sys.exit("the tests of the unchanged sources do not build or pass")
    counts = {"noticed": 0, "survived": 0, "does not compile": 0}
    report = []
    for index in order:
        mutant = every[index]
        verdict = verdict_of(mutant)
        counts[verdict] += 1
        source = (ROOT / mutant.source).read_text().splitlines()[mutant.line].strip()
        report.append(
            f"{verdict}: {mutant.source}:{mutant.line + 1}: {mutant.before!r} -> {mutant.after!r} "
            f"in: {source}"
        )
        print(report[-1], flush=True)
        if chosen.out is not None:
            chosen.out.write_text("\n".join(report) + "\n")
    tried = counts["noticed"] + counts["survived"]
    print(f"{len(every)} changes, {tried} tried: {counts}; score {counts['noticed'] / tried:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
