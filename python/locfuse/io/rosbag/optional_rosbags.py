# SPDX-License-Identifier: Apache-2.0
"""What bags need that is not always there."""

from __future__ import annotations

import importlib
from typing import Any

from locfuse.types import LogError


class NeedError(LogError):
    """A package is missing; the text names the extra that brings it."""


def need(module: str) -> Any:
    """Import a module of rosbags, or one that comes with it.

    Raises NeedError if it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise NeedError(f"bags need the package rosbags: pip install 'locfuse[bags]' "
                        f"(there is no module {error.name})") from error  # fmt: skip
