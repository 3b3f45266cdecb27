# SPDX-License-Identifier: Apache-2.0
"""Where the ready configurations of a checkout are."""

from __future__ import annotations

from pathlib import Path


def example_configs() -> Path | None:
    """Return the folder of ready configurations, searched upwards from here and from the caller."""
    for start in (Path.cwd(), Path(__file__).resolve()):
        for folder in (start, *start.parents):
            candidate = folder / "examples" / "configs"
            if (candidate / "ekim_room.yaml").is_file():
                return candidate
    return None
