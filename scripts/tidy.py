# SPDX-License-Identifier: Apache-2.0
"""Check sources by clang-tidy, except those that have passed as they are.

Usage: tidy.py FOLDER_WITH_COMPILE_COMMANDS SOURCE ... A source that has passed is known by its
text, the text of everything it includes, and the settings of clang-tidy; see passed.py.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from passed import Passed, digest_of

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    """Check all, print what clang-tidy finds, and return 1 if it found something."""
    build, *sources = sys.argv[1:]
    commands = {
        str(Path(entry["file"]).relative_to(ROOT)): (
            shlex.split(entry["command"]),
            entry["directory"],
        )
        for entry in json.loads((Path(build) / "compile_commands.json").read_text())
        if Path(entry["file"]).is_relative_to(ROOT)
    }
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    settings = version + (ROOT / ".clang-tidy").read_bytes()
    passed = Passed("tidy")

    def digest(source: str) -> str:
        words, folder = commands[source]
        flags = " ".join(words).replace(str(ROOT), "").encode()
        return digest_of(settings + flags, included(words, folder))

    def check(source: str, mark: str) -> tuple[str, str]:
        done = subprocess.run(
            ["clang-tidy", "-p", build, "--quiet", "--extra-arg=-std=c++17", source],
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
        marks = dict(zip(sources, pool.map(digest, sources), strict=True))
        changed = {source: mark for source, mark in marks.items() if not passed.has(mark)}
        print(f"clang-tidy: {len(sources) - len(changed)} of {len(sources)} have passed before")
        running = {pool.submit(check, source, mark): source for source, mark in changed.items()}
        for count, done in enumerate(as_completed(running), 1):
            verdict, output = done.result()
            failed |= verdict != "ok"
            print(
                f"[{count}/{len(changed)}] {running[done]}: {verdict}\n{output}", end="", flush=True
            )
    return 1 if failed else 0


def included(words: list[str], folder: str) -> list[Path]:
    """Return a source and everything that it includes, with the system's headers."""
    compiler = words.index("-o") if "-o" in words else len(words)
    rule = subprocess.run(
        [*words[:compiler], "-M", words[-1]], cwd=folder, capture_output=True, text=True, check=True
    )
    return [Path(folder, word) for word in rule.stdout.split(":", 1)[1].split() if word != "\\"]


if __name__ == "__main__":
    sys.exit(main())
