# SPDX-License-Identifier: Apache-2.0
"""What every configuration model has in common."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from locfuse.types import nearest, shown


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and never changes once made."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key, value in data.items():
                if key not in cls.model_fields:
                    advice = nearest(str(key), cls.model_fields)
                    raise ValueError(f"unknown key {shown(key)}; {advice}")
                if isinstance(value, bool) and cls.model_fields[key].annotation is not bool:
                    # 'yes' would otherwise count as 1
                    raise ValueError(f"{key} is {value}, but it does not take yes or no")
        return data
