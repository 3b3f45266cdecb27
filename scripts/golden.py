# SPDX-License-Identifier: Apache-2.0
"""Runs the golden runs anew and keeps what comes out: ``./dev golden``.

Each configuration in ``tests/golden`` has a capsule beside it, whose log stays what it was recorded
as; without a capsule, or with one that this version cannot read, it is simulated.
"""

from __future__ import annotations

from pathlib import Path

from locfuse.config.load import load_config
from locfuse.run.capsule import (
    Capsule,
    differences,
    make_capsule,
    read_capsule,
    write_capsule,
)
from locfuse.types import ConfigError

GOLDEN = Path(__file__).resolve().parent.parent / "tests" / "golden"


def main() -> None:
    """Write every capsule and say which has another result, and from where on."""
    for source in sorted(GOLDEN.glob("*.yaml")):
        path = source.with_suffix(".zip")
        old = _capsule_at(path)
        new = make_capsule(load_config(source), None if old is None else old.log)
        write_capsule(new, path)
        print(f"{source.stem}: {'recorded' if old is None else _change(old, new)}")


def _capsule_at(path: Path) -> Capsule | None:
    try:
        return read_capsule(path) if path.exists() else None
    except ConfigError:  # a key went
        return None


def _change(old: Capsule, new: Capsule) -> str:
    found = differences(old.result, new.result)
    if not found:
        return "the same"
    return "; ".join(f"{d.file}: {d.lines} lines, from line {d.line}, {', '.join(d.was)}"
                     for d in found)  # fmt: skip


if __name__ == "__main__":
    main()
