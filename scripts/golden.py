# SPDX-License-Identifier: Apache-2.0
"""Regenerates the golden runs: ``./dev golden``.

Each configuration in ``tests/golden`` has a capsule next to it, whose recorded log is kept. Without
a capsule, or with one that this version cannot read, the log is simulated.
"""

from __future__ import annotations

from pathlib import Path

from locfuse.config.load import load_config
from locfuse.run.capsule import Capsule, differences, make_capsule, read_capsule, write_capsule
from locfuse.types import ConfigError

GOLDEN = Path(__file__).resolve().parent.parent / "tests" / "golden"


def main() -> None:
    """Write every capsule and print which results changed, and from which line on."""
    for source in sorted(GOLDEN.glob("*.yaml")):
        path = source.with_suffix(".zip")
        old = _capsule_at(path)
        new = make_capsule(load_config(source), None if old is None else old.log)
        write_capsule(new, path)
        print(f"{source.stem}: {'recorded' if old is None else _change(old, new)}")


def _capsule_at(path: Path) -> Capsule | None:
    try:
        return read_capsule(path) if path.exists() else None
    except ConfigError:  # a key was removed
        return None


def _change(old: Capsule, new: Capsule) -> str:
    found = differences(old.result, new.result)
    if not found:
        return "the same"
    return "; ".join(f"{d.file}: {d.lines} lines, from line {d.line}, {', '.join(d.was)}"
                     for d in found)  # fmt: skip


if __name__ == "__main__":
    main()
