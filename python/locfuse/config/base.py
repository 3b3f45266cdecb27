# SPDX-License-Identifier: Apache-2.0
"""Base class of the configuration models, and the descriptions of their keys."""

from __future__ import annotations

import re
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from locfuse.types import nearest, shown


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and never changes once made."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

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


def description(model: type[BaseModel], key: str) -> tuple[str, str]:
    """Return the text of a key of the schema, in Markdown, and its unit; empty if it has none."""
    text = " ".join((model.model_fields[key].description or "").split())
    unit = re.search(r" \[([^\[\]]+)\]\.$", text)
    return (text, "") if unit is None else (text[: unit.start()] + ".", unit[1])


def meaning(model: type[BaseModel], key: str) -> tuple[str, str]:
    """Return the description and the unit of a key, without links and code quotes.

    Examples
    --------
    >>> from locfuse.config.scenario import RangeSensor
    >>> meaning(RangeSensor, "rate_hz")
    ('Epochs per second.', 'Hz')
    """
    text, unit = description(model, key)
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text).replace("`", ""), unit
