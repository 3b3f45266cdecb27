# SPDX-License-Identifier: Apache-2.0
"""What only a checkout of locfuse has: `papers`, with its experiments and data sets."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from locfuse.types import ConfigError


def checkout() -> Path | None:
    """Return the checkout around the working folder or this file; None if there is none."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / "papers" / "reproduce.py").is_file():
            return folder
    return None


def import_papers(module: str, needed_for: str) -> Any:
    """Import a module of `papers`. Raises ConfigError where there is no checkout."""
    root = checkout()
    if root is None:
        raise ConfigError(
            f"{needed_for} needs a checkout of locfuse, as papers/ is not installed; "
            "call it inside one"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return importlib.import_module(f"papers.{module}")
