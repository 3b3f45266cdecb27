# SPDX-License-Identifier: Apache-2.0
"""Fail on an include that points the wrong way between rooms, or that shows PCL or Ceres.

Checks public headers (`locfuse/ROOM/...`) and private ones (`ROOM/...` below cpp/src).
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

CPP = Path(__file__).resolve().parent.parent / "cpp"
MAY_INCLUDE = {
    "math": set(),
    "geometry": {"math"},
    "messages": {"math", "geometry"},
    "maps": {"math", "geometry", "messages"},
    "models": {"math", "geometry", "messages", "maps"},
    "frontends": {"math", "geometry", "messages", "maps"},
    "filters": {"math", "geometry"},
    "estimators": {"math", "geometry", "messages", "maps", "models", "frontends", "filters"},
}
MAY_INCLUDE["recovery"] = MAY_INCLUDE["estimators"] | {"estimators"}
MAY_INCLUDE["particles"] = MAY_INCLUDE["recovery"] | {"recovery"}
MAY_INCLUDE["smoothing"] = MAY_INCLUDE["estimators"] | {"estimators"}
MAY_INCLUDE["replay"] = MAY_INCLUDE["particles"] - {"frontends"} | {"particles", "smoothing"}
INCLUDE = re.compile(r'^\s*#\s*include\s+(["<])([^">]+)[">]', re.MULTILINE)


def room_of(quote: str, name: str) -> str | None:
    """Return the room that an included header belongs to, None for one of another library."""
    parts = name.split("/")
    if parts[0] == "locfuse":
        return parts[1] if len(parts) > 2 else None  # error.hpp, time.hpp belong to no room
    return parts[0] if quote == '"' and parts[0] in MAY_INCLUDE else None


def wrong_in(room: str, is_header: bool, text: str) -> list[str]:
    """Return what is wrong with the includes of one file of a room."""
    wrong = []
    for quote, name in INCLUDE.findall(text):
        if name.startswith(("pcl/", "ceres/")) and is_header:
            wrong.append(f"{name} in a header")
        other = room_of(quote, name)
        if other is not None and other != room and other not in MAY_INCLUDE[room]:
            wrong.append(f"{room} must not include {other} ({name})")
    return wrong


def wrong_includes() -> list[str]:
    """Return one line per include that is not allowed."""
    wrong = []
    for path in sorted([*CPP.rglob("*.hpp"), *CPP.rglob("*.cpp")]):
        sources = CPP / "src"
        public = not path.is_relative_to(sources)
        relative = path.relative_to(CPP / "include/locfuse" if public else sources)
        if len(relative.parts) == 1:  # locfuse.hpp, error.hpp, time.hpp belong to no room
            continue
        found = wrong_in(relative.parts[0], path.suffix == ".hpp", path.read_text())
        wrong += [f"{path}: {line}" for line in found]
    return wrong


def check_self() -> None:
    """Raise AssertionError unless wrong includes of each kind are found, and right ones are not."""
    for include in ('"estimators/recipe.hpp"', '"locfuse/replay/live.hpp"', '"maps/given.hpp"'):
        assert wrong_in("filters", False, f"#include {include}\n"), include
    assert wrong_in("frontends", True, "#include <ceres/ceres.h>\n")
    for include in ('"filters/gate.hpp"', '"locfuse/math/angle.hpp"', "<filters/other.hpp>"):
        assert not wrong_in("filters", True, f"#include {include}\n"), include


if __name__ == "__main__":
    check_self()
    print("\n".join(found := wrong_includes()))
    sys.exit(1 if found else 0)
