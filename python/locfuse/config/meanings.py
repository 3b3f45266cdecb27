# SPDX-License-Identifier: Apache-2.0
"""What each key of a configuration means, in the words of its documentation."""

from __future__ import annotations

from functools import cache
from importlib import resources

import yaml
from pydantic import BaseModel


def meaning(model: type[BaseModel], key: str) -> str:
    """Return what a key of a model means, with its unit in brackets; empty if nothing is known.

    Examples
    --------
    >>> from locfuse.config.scenario import RangeSensor
    >>> meaning(RangeSensor, "rate_hz")
    'ticks per second [Hz]'
    """
    return _meanings().get(f"{model.__name__}.{key}", "")


@cache
def _meanings() -> dict[str, str]:
    """Return the texts; docs/configuration.md says the same, a test compares."""
    text = resources.files("locfuse.config").joinpath("meanings.yaml").read_text("utf-8")
    found: dict[str, str] = yaml.safe_load(text)
    return found
