# SPDX-License-Identifier: Apache-2.0
"""What a form needs to know of a key of the schema: kind, choices, unit, meaning, text, value."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic import BaseModel

from locfuse.config.base import is_tag, meaning, options
from locfuse.types import YAML_ERRORS

_UNITS = ("_per_sqrt_rad", "_per_sqrt_m", "_per_sqrt_s", "_per_m", "_radps", "_mps", "_deg",
          "_rad", "_hz", "_m", "_s")  # fmt: skip


@dataclass(frozen=True)
class Field:
    """A key as a form shows it.

    Attributes
    ----------
    name : str
        The key.
    kind : str
        ``number``, ``text``, ``switch``, ``choice``, ``choices``, ``numbers``, ``section``, or
        ``yaml`` for what has no form of its own.
    label, unit, help : str
        Of people: the key without its unit, the unit, what it means.
    choices : tuple of str
    optional : bool
        Whether nothing is a value, too.
    model : type or None
        Of a section.
    """

    name: str
    kind: str
    label: str
    unit: str
    help: str
    choices: tuple[str, ...] = ()
    optional: bool = False
    model: type[BaseModel] | None = None


def fields_of(model: type[BaseModel]) -> list[Field]:
    """Return the keys of a model, except the tag that identifies it."""
    return [field_of(model, name) for name in model.model_fields if not is_tag(model, name)]


def field_of(model: type[BaseModel], name: str) -> Field:
    """Return a key of a model.

    Examples
    --------
    >>> from locfuse.config.scenario import RangeSensor
    >>> found = field_of(RangeSensor, "rate_hz")
    >>> found.kind, found.label, found.unit
    ('number', 'rate', 'Hz')
    """
    text, unit = meaning(model, name)
    every = options(model.model_fields[name].annotation)
    members = [member for member in every if member is not NoneType]
    kind, choices, section = _kind(members)
    return Field(name, kind, label_of(name), unit, text, choices,
                 len(members) < len(every), section)  # fmt: skip


def label_of(name: str) -> str:
    """Return a key in words, without the unit that it ends in."""
    ending = next((unit for unit in _UNITS if name.endswith(unit) and name != unit[1:]), "")
    return name.removesuffix(ending).replace("_", " ")


def _kind(members: list[Any]) -> tuple[str, tuple[str, ...], type[BaseModel] | None]:
    if len(members) != 1:
        return "yaml", (), None
    (member,) = members
    if isinstance(member, type) and issubclass(member, BaseModel):
        return "section", (), member
    if get_origin(member) is Literal:
        return "choice", get_args(member), None
    if get_origin(member) in (list, tuple):
        items = [option for item in get_args(member) for option in options(item)]
        if all(item is float for item in items):
            return "numbers", (), None
        if len(items) == 1 and get_origin(items[0]) is Literal:
            return "choices", get_args(items[0]), None
    return (
        {bool: "switch", int: "number", float: "number", str: "text"}.get(member, "yaml"),
        (),
        None,
    )


def shown(field: Field, value: Any) -> str:
    """Return a value as it stands in an input."""
    if value is None:
        return ""
    if field.kind == "numbers" and isinstance(value, list | tuple):
        return ", ".join(map(_number, value))
    if field.kind == "number":
        return _number(value)
    if field.kind == "yaml" and not isinstance(value, str):
        text = yaml.safe_dump(value, sort_keys=False, default_flow_style=None, width=60)
        return str(text).removesuffix("\n...\n").strip()
    return str(value)


def _number(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, int | float) else str(value)


def read(field: Field, text: str) -> Any:
    """Return the value that a text in an input means; a text that is none stays one."""
    text = text.strip()
    if not text and (field.optional or field.kind != "text"):
        return None
    if field.kind == "number":
        return _as_number(text)
    if field.kind == "numbers":
        return [_as_number(part.strip()) for part in text.strip("[]").split(",")]
    if field.kind == "yaml":
        try:
            return yaml.safe_load(text)
        except (yaml.YAMLError, *YAML_ERRORS):
            return text
    return text


def _as_number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
