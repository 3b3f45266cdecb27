# SPDX-License-Identifier: Apache-2.0
"""What every configuration model has in common."""

from __future__ import annotations

import difflib
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator


def nearest(name: str, valid: list[str]) -> str:
    """Return advice on a name that is not valid: the nearest one, or all there are."""
    close = difflib.get_close_matches(name, valid, n=1)
    return f"did you mean {close[0]!r}?" if close else f"expected one of: {', '.join(valid)}"


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and never changes once made."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    advice = nearest(str(key), list(cls.model_fields))
                    raise ValueError(f"unknown key {key!r}; {advice}")
        return data
