# SPDX-License-Identifier: Apache-2.0
"""Fail on an include that points the wrong way between rooms, or that shows PCL or Ceres."""

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
    "replay": {"math", "geometry", "messages", "maps", "models", "filters", "estimators"},
}
INCLUDE = re.compile(r'^\s*#include\s+["<]([^">]+)[">]', re.MULTILINE)


def wrong_includes() -> list[str]:
    """Return one line per include that is not allowed."""
    wrong = []
    for path in sorted([*CPP.rglob("*.hpp"), *CPP.rglob("*.cpp")]):
        sources = CPP / "src"
        public = not path.is_relative_to(sources)
        relative = path.relative_to(CPP / "include/locfuse" if public else sources)
        room = relative.parts[0]
        if len(relative.parts) == 1:  # locfuse.hpp, error.hpp, time.hpp belong to no room
            continue
        for name in INCLUDE.findall(path.read_text()):
            if name.startswith(("pcl/", "ceres/")) and path.suffix == ".hpp":
                wrong.append(f"{path}: {name} in a public header")
            parts = name.split("/")
            if parts[0] != "locfuse" or len(parts) == 2:
                continue
            if parts[1] != room and parts[1] not in MAY_INCLUDE[room]:
                wrong.append(f"{path}: {room} must not include {parts[1]} ({name})")
    return wrong


if __name__ == "__main__":
    print("\n".join(found := wrong_includes()))
    sys.exit(1 if found else 0)
