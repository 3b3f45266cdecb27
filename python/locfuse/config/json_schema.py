# SPDX-License-Identifier: Apache-2.0
"""The schema of configurations for editors: keys, choices, bounds, defaults and descriptions."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from locfuse.config.base import plain_text

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON schema of a model; its descriptions are plain text.

    What only code can check, such as one key that needs another, it does not say.

    Examples
    --------
    >>> from locfuse.config.schema import Range
    >>> json_schema(Range)["properties"]["sigma_m"]["description"]
    'Absolute part [m].'
    """
    found = _plain(model.model_json_schema())
    return {"$schema": DRAFT, **found}


def _plain(node: Any) -> Any:
    if isinstance(node, list):
        return [_plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    is_described = isinstance(node.get("description"), str)
    return {
        key: plain_text(value) if key == "description" and is_described else _plain(value)
        for key, value in node.items()
        if not (key == "title" and isinstance(value, str))
    }
