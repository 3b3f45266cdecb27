# SPDX-License-Identifier: Apache-2.0
"""Check sources by clang-tidy, but for what has passed before, as it is.

Usage: tidy.py FOLDER_WITH_COMPILE_COMMANDS SOURCE ... What passed is remembered by its text, the
text of all it includes, and the checks.
"""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PASSED = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "locfuse-tidy"


def main() -> int:
    """Check all, say what clang-tidy finds, and return 1 if it found something."""
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
    checks = version + (ROOT / ".clang-tidy").read_bytes()
    PASSED.mkdir(parents=True, exist_ok=True)

    def passes(source: str) -> bool:
        words, folder = commands[source]
        flags = " ".join(words).replace(str(ROOT), "").encode()
        mark = PASSED / digest(checks + flags, included(words, folder))
        if mark.exists():
            return True
        done = subprocess.run(
            ["clang-tidy", "-p", build, "--quiet", "--extra-arg=-std=c++17", source],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # counts what it does not report
            text=True,
            check=False,
        )
        print(done.stdout, end="", flush=True)
        if done.returncode == 0:
            mark.touch()
        return done.returncode == 0

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return 0 if all(list(pool.map(passes, sources))) else 1


def included(words: list[str], folder: str) -> list[Path]:
    """Return a source and all that it includes, the system's headers, too."""
    compiler = words.index("-o") if "-o" in words else len(words)
    told = subprocess.run(
        [*words[:compiler], "-M", words[-1]], cwd=folder, capture_output=True, text=True, check=True
    )
    return [Path(folder, word) for word in told.stdout.split(":", 1)[1].split() if word != "\\"]


def digest(checks: bytes, files: list[Path]) -> str:
    """Return what stands for what is in these files, under these checks."""
    whole = hashlib.sha256(checks)
    for file in files:
        whole.update(file.read_bytes())
    return whole.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
