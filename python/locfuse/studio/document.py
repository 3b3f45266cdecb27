# SPDX-License-Identifier: Apache-2.0
"""A configuration as a document: nested keys and values, and which key is to blame for an error."""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml
from pydantic import BaseModel, ValidationError

from locfuse.config.load import expected
from locfuse.config.schema import RunConfig

Key: TypeAlias = tuple[str | int, ...]
Data: TypeAlias = dict[str, Any]

PATHS: tuple[Key, ...] = (("log",), ("log", "path"), ("simulation", "map", "file"),
                          ("ros", "world"))  # fmt: skip


@dataclass(frozen=True)
class Problem:
    """What is wrong, at which key (the empty one: the whole), in which line if from a text."""

    key: Key
    message: str
    line: int | None = None

    def __str__(self) -> str:
        where = f"line {self.line}: " if self.line is not None else ""
        return f"{where}{dotted(self.key)}: {self.message}" if self.key else where + self.message


class RefusedError(ValueError):
    """A document that is no configuration."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("; ".join(map(str, problems)))
        self.problems = tuple(problems)


def dotted(key: Key) -> str:
    """Return a key as people write it.

    Examples
    --------
    >>> dotted(("simulation", "faults", 0, "kind"))
    'simulation.faults.0.kind'
    """
    return ".".join(map(str, key))


def checked(data: Any) -> RunConfig:
    """Return the configuration that a document is.

    Raises RefusedError with each problem at the key that caused it, where the schema says which
    that is.
    """
    if not isinstance(data, dict):
        raise RefusedError([Problem((), f"holds {type(data).__name__}; expected keys and values")])
    try:
        return RunConfig.model_validate(data)
    except ValidationError as error:
        problems = [Problem(_blamed(data, found["loc"], found["type"]), expected(found))
                    for found in error.errors(include_url=False)]  # fmt: skip
        raise RefusedError(problems) from None


def _blamed(data: Any, loc: Sequence[str | int], kind: str) -> Key:
    """Return where an error is in the document: pydantic also names the members of unions."""
    key: list[str | int] = []
    node = data
    for place, part in enumerate(loc):
        inside = (isinstance(node, Mapping) and part in node) or (
            isinstance(node, Sequence) and not isinstance(node, str)
            and isinstance(part, int) and part < len(node)
        )  # fmt: skip
        if inside:
            key.append(part)
            node = node[part]
        elif kind == "missing" and place == len(loc) - 1:
            key.append(part)
    return tuple(key)


def value_at(data: Any, key: Key) -> Any:
    """Return what stands at a key, None if nothing does."""
    for part in key:
        if isinstance(data, BaseModel):
            data = getattr(data, str(part), None)
        elif isinstance(data, Mapping):
            data = data.get(part)
        elif isinstance(data, Sequence) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            return None
    return data


class Draft:
    """A copy of a document that is being changed; what defaults say is written out on the way.

    A part of a section says nothing of the rest of it, a part of a list or of names replaces the
    default: so lists and names are copied before something is set inside of them.
    """

    def __init__(self, data: Data, config: RunConfig) -> None:
        self.data: Data = copy.deepcopy(data)
        self._config = config

    def set(self, key: Key, value: Any) -> None:
        """Set a value."""
        node = self._parent(key)
        if isinstance(node, list) and key[-1] == len(node):
            node.append(value)
        else:
            node[key[-1]] = value

    def remove(self, key: Key) -> None:
        """Remove an item of a list, a name, or a key, which then is its default."""
        node = self._parent(key)
        if isinstance(node, list):
            node.pop(int(key[-1]))
        else:
            node.pop(key[-1], None)

    def get(self, key: Key) -> Any:
        """Return what the draft says of a key, or else the configuration that it is of."""
        found = value_at(self.data, key)
        return plain(value_at(self._config, key)) if found is None else found

    def _parent(self, key: Key) -> Any:
        node: Any = self.data
        for place, part in enumerate(key[:-1]):
            if isinstance(node, dict) and node.get(part) is None:
                default = value_at(self._config, key[: place + 1])
                node[part] = _section(default, in_list=isinstance(key[place + 1], int))
            node = node[part]
        return node


def _section(default: Any, *, in_list: bool) -> Any:
    if isinstance(default, BaseModel):  # the tag identifies the member of a union
        return {tag: getattr(default, tag) for tag in ("shape", "kind") if hasattr(default, tag)}
    if default is None:
        return [] if in_list else {}
    return plain(default)


def plain(value: Any) -> Any:
    """Return a value of a configuration as YAML has it."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_unset=True)
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def text_of(data: Data) -> str:
    """Return the YAML of a document, short things in one line."""
    return yaml.safe_dump(plain(data), sort_keys=False, allow_unicode=True,
                          default_flow_style=None, width=100)  # fmt: skip


def line_of(text: str, key: Key) -> int | None:
    """Return the line of a YAML text, counted from 1, in which a key stands, or its section."""
    try:
        node = yaml.compose(text, yaml.SafeLoader)
    except yaml.YAMLError:
        return None
    line = None
    for part in key:
        if isinstance(node, yaml.MappingNode):
            found = next(((k, v) for k, v in node.value if k.value == str(part)), None)
            if found is None:
                break
            line, node = found[0].start_mark.line + 1, found[1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int):
            if part >= len(node.value):
                break
            node = node.value[part]
            line = node.start_mark.line + 1
        else:
            break
    return line


def closest(data: Any, problem: Problem) -> Key:
    """Return the key that a problem is about, which rules over several keys name in words."""
    unknown = re.match(r"unknown key '(.+?)';", problem.message)
    word = unknown[1] if unknown else problem.message.split(" ", 1)[0]
    parts: list[str | int] = [int(p) if p.isdecimal() else p for p in word.split(".")]
    named = (*problem.key, *parts)
    return named if value_at(data, named) is not None else problem.key


def moved_to(data: Data, here: Path, there: Path) -> Data:
    """Return a document whose paths, relative to one folder, are relative to another."""
    moved = copy.deepcopy(data)
    for key in PATHS:
        file, parent = value_at(moved, key), value_at(moved, key[:-1])
        if isinstance(file, str) and isinstance(parent, dict) and not Path(file).is_absolute():
            parent[key[-1]] = os.path.relpath((here / file).resolve(), there.resolve())
    return moved
