# SPDX-License-Identifier: Apache-2.0
"""Whether pictures can be drawn: matplotlib is the extra `plots`."""

from __future__ import annotations

from importlib import import_module

from locfuse.types import ConfigError

INSTALL = "pip install 'locfuse[plots]'"
NO_PICTURES = f"no pictures without matplotlib; to add them: {INSTALL}"


class MissingMatplotlibError(ConfigError, ImportError):
    """An import that needs matplotlib; also a ConfigError, which commands print as one sentence."""


def has_matplotlib() -> bool:
    """Return whether matplotlib can be imported."""
    try:
        import_module("matplotlib")
    except ModuleNotFoundError:
        return False
    return True


def require_matplotlib() -> None:
    """Raise MissingMatplotlibError, naming the extra to install, if there is no matplotlib."""
    if not has_matplotlib():
        raise MissingMatplotlibError(f"drawing needs the package matplotlib: {INSTALL}")
