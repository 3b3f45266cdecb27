# SPDX-License-Identifier: Apache-2.0
"""Check sources by clang-tidy, except those that have passed as they are.

Usage: tidy.py FOLDER_WITH_COMPILE_COMMANDS SOURCE ... Sources of one room with the same flags are
checked as one, which goes through their headers once: so no two of them may define the same name.
Benchmarks, which are programs, are checked each by itself.
What has passed is known by its text, the text of everything it includes, and the settings of
clang-tidy; see passed.py.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from passed import Passed, digest_of

ROOT = Path(__file__).resolve().parent.parent
MAX_TOGETHER = 10


@dataclass(frozen=True)
class Batch:
    """Sources that are checked as one file, and how that is compiled."""

    file: Path
    sources: list[Path]
    flags: tuple[str, ...]

    def write(self) -> None:
        """Write the file, which includes them."""
        self.file.write_text(
            "".join(f'#include "{source}"  // NOLINT\n' for source in self.sources)
        )

    @property
    def name(self) -> str:
        """What is printed of it."""
        first = self.sources[0].relative_to(ROOT)
        return str(first) if len(self.sources) == 1 else f"{len(self.sources)} from {first} on"


def batches_of(build: Path, sources: list[Path]) -> list[Batch]:
    """Return sources by room and flags, the largest batches first."""
    programs = ROOT / "benchmarks"
    grouped: defaultdict[tuple[Path, tuple[str, ...]], set[Path]] = defaultdict(set)
    for entry in json.loads((build / "compile_commands.json").read_text()):
        source = Path(entry["file"])
        if source in sources:
            command = shlex.split(entry["command"])
            room = source if programs in source.parents else source.parent
            grouped[room, tuple(command[1 : command.index("-o")])].add(source)
    batches: list[Batch] = []
    for (_, flags), files in grouped.items():
        parts = -(-len(files) // MAX_TOGETHER)
        for part in range(parts):
            file = build / f"tidy_{len(batches)}.cpp"
            batches.append(Batch(file.resolve(), sorted(files)[part::parts], flags))
    return sorted(batches, key=lambda batch: -len(batch.sources))


def main() -> int:
    """Check all, print what clang-tidy finds, and return 1 if it found something."""
    build = Path(sys.argv[1])
    sources = [ROOT / name for name in sys.argv[2:]]
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    settings = version + (ROOT / ".clang-tidy").read_bytes()
    passed = Passed("tidy")
    batches = batches_of(build, sources)
    missing = set(sources) - {source for batch in batches for source in batch.sources}
    if missing:
        sys.exit(f"not in {build}/compile_commands.json: {sorted(map(str, missing))}")

    def digest(batch: Batch) -> str:
        batch.write()
        flags = " ".join(batch.flags).replace(str(ROOT), "").encode()
        return digest_of(settings + flags, included(batch))

    def check(batch: Batch, mark: str) -> tuple[str, str]:
        done = subprocess.run(
            ["clang-tidy", "--quiet", batch.file, "--", *batch.flags, "-std=c++17"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # counts what it does not report
            text=True,
            check=False,
        )
        if done.returncode == 0:
            passed.add(mark)
        return ("ok" if done.returncode == 0 else "FAILED"), done.stdout

    failed = False
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        marks = list(pool.map(digest, batches))
        changed = [
            (batch, mark)
            for batch, mark in zip(batches, marks, strict=True)
            if not passed.has(mark)
        ]
        print(f"clang-tidy: {len(batches) - len(changed)} of {len(batches)} have passed before")
        running = {pool.submit(check, batch, mark): batch for batch, mark in changed}
        for count, done in enumerate(as_completed(running), 1):
            verdict, output = done.result()
            failed |= verdict != "ok"
            print(
                f"[{count}/{len(changed)}] {running[done].name}: {verdict}\n{output}",
                end="",
                flush=True,
            )
    return 1 if failed else 0


def included(batch: Batch) -> list[Path]:
    """Return the sources of a batch and everything that they include, with the system's headers."""
    rule = subprocess.run(
        ["c++", *batch.flags, "-M", batch.file], capture_output=True, text=True, check=True
    )
    files = rule.stdout.split(":", 1)[1].split()
    return [Path(word) for word in files if word not in ("\\", str(batch.file))]


if __name__ == "__main__":
    sys.exit(main())
