# SPDX-License-Identifier: Apache-2.0
"""Base class of the configuration models, and the descriptions of their keys."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, model_validator

from locfuse.types import nearest, shown


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and never changes once made.

    `struct` is the C++ struct that has the defaults. `fixed` are constants of it that are no keys;
    with its own value one is left out.
    `renamed` has keys of before: the value that still loads, and what to write for any other.
    """

    struct: ClassVar[Any] = None
    fixed: ClassVar[Sequence[str]] = ()
    renamed: ClassVar[Mapping[str, tuple[Any, str]]] = {}

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            fixed = [key for key in data if key in cls.fixed]
            for key in fixed:
                constant = getattr(cls.struct, key)
                if isinstance(data[key], bool) or data[key] != constant:
                    raise ValueError(f"{key} is {shown(data[key])}, but is fixed at "
                                     f"{constant:g}; remove it")  # fmt: skip
            for key in (renamed := [key for key in data if key in cls.renamed]):
                if data[key] != cls.renamed[key][0]:
                    raise ValueError(f"{key} is no key any more; write {cls.renamed[key][1]}")
            data = {key: value for key, value in data.items() if key not in (*fixed, *renamed)}
            for key, value in data.items():
                if key not in cls.model_fields:
                    advice = nearest(str(key), cls.model_fields)
                    raise ValueError(f"unknown key {shown(key)}; {advice}")
                if isinstance(value, bool) and cls.model_fields[key].annotation is not bool:
                    # 'yes' would otherwise count as 1
                    raise ValueError(f"{key} is {value}, but it does not take yes or no")
        return data


def is_tag(model: type[BaseModel], key: str) -> bool:
    """Return whether a key only says which model of several it is: it has a single value."""
    annotation = model.model_fields[key].annotation
    return get_origin(annotation) is Literal and len(get_args(annotation)) == 1


def options(annotation: Any) -> list[Any]:
    """Return what a type may be: the members of a union, without what annotates them."""
    if get_origin(annotation) is Annotated:
        return options(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [option for member in get_args(annotation) for option in options(member)]
    return [annotation]


def description(model: type[BaseModel], key: str) -> tuple[str, str]:
    """Return the text of a key of the schema, in Markdown, and its unit; empty if it has none."""
    text = " ".join((model.model_fields[key].description or "").split())
    unit = re.search(r" \[([^\[\]]+)\]\.$", text)
    return (text, "") if unit is None else (text[: unit.start()] + ".", unit[1])


def plain_text(text: str) -> str:
    """Return a description without links and code quotes, in one line."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(text.split())).replace("`", "")


def changed_keys(model: BaseModel) -> dict[str, Any]:
    """Return what differs from the defaults, as YAML has it; it loads as the same model."""
    found: dict[str, Any] = {}
    for key, field in type(model).model_fields.items():
        value = getattr(model, key)
        default = None if field.is_required() else field.get_default(call_default_factory=True)
        if field.is_required() or is_tag(type(model), key) or value != default:
            found[key] = _changed(value)
    return found


def given_keys(model: BaseModel) -> dict[str, Any]:
    """Return what was given, as YAML has it, also where it is the default or an empty section."""
    written = model.model_dump(mode="json", exclude_unset=True)
    return {key: value for key, value in written.items() if value is not None}


def _changed(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return changed_keys(value)
    if isinstance(value, Mapping):
        return {key: _changed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_changed(item) for item in value]
    return value


def meaning(model: type[BaseModel], key: str) -> tuple[str, str]:
    """Return the description and the unit of a key, without links and code quotes.

    Examples
    --------
    >>> from locfuse.config.scenario import RangeSensor
    >>> meaning(RangeSensor, "rate_hz")
    ('Epochs per second.', 'Hz')
    """
    text, unit = description(model, key)
    return plain_text(text), unit
