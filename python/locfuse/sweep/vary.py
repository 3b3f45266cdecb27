# SPDX-License-Identifier: Apache-2.0
"""Varied keys of a configuration, and their values in each trial."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel

from locfuse.config.load import parse_config
from locfuse.config.schema import RunConfig
from locfuse.types import YAML_ERRORS, ConfigError, nearest

Values = str | Sequence[Any]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})(?::(\d*)(log)?)?")
_DRAWS = 0x7661_7279  # separates draws of varied keys from those of the simulation


@dataclass(frozen=True)
class Axis:
    """A key that varies.

    `key` is a dotted path into the configuration. `values` of a list or grid are taken in turn by
    the trials; empty if values are drawn. `low` and `high` limit the drawn values, or a grid; NaN
    for a list. `log`: uniform in the logarithm. `whole`: whole numbers only, both ends included.
    """

    key: str
    values: tuple[Any, ...] = ()
    low: float = math.nan
    high: float = math.nan
    log: bool = False
    whole: bool = False

    @property
    def kind(self) -> str:
        """Type of the column of its values: ``int64``, ``float64`` or ``string``."""
        if not self.values:
            return "int64" if self.whole else "float64"
        if all(type(value) is int for value in self.values):
            return "int64"
        return "float64" if all(type(v) in (int, float) for v in self.values) else "string"

    @property
    def ends(self) -> tuple[int | float, int | float]:
        """Smallest and largest drawn value."""
        return (int(self.low), int(self.high)) if self.whole else (self.low, self.high)

    def cell(self, value: Any) -> int | float | str:
        """Return a value as stored in the table."""
        if self.kind != "string":
            return int(value) if self.kind == "int64" else float(value)
        return value if isinstance(value, str) else json.dumps(value)

    def draw(self, seed: int, trial: int, place: int) -> int | float:
        """Return the value that a trial draws; `place` is the index of the axis."""
        sequence = np.random.SeedSequence([seed, _DRAWS], spawn_key=(trial, place))
        return self._between(float(np.random.default_rng(sequence).random()))

    def _between(self, share: float) -> int | float:
        low, high = self.low, self.high
        if self.whole and not self.values:  # so that both ends are as probable as the rest
            low, high = low - 0.5, high + 0.5
        if self.log:
            low = max(low, 0.5 * self.low)
            value = low * math.exp(share * math.log(high / low))
        else:
            value = low + share * (high - low)
        value = min(max(value, self.low), self.high)
        return round(value) if self.whole else value


def axes_of(config: RunConfig, vary: Mapping[str, Values]) -> tuple[Axis, ...]:
    """Return the varied keys with their values.

    `vary` gives for each dotted path a sequence of values, or a text: ``a,b,c`` as in YAML,
    ``LOW..HIGH`` drawn uniformly, ``LOW..HIGH:log`` drawn uniformly in the logarithm,
    ``LOW..HIGH:N`` a grid of N values, ``LOW..HIGH:Nlog`` one in equal ratios. Raises ConfigError
    if there is no such key, or its values cannot be read.

    Examples
    --------
    >>> config = parse_config({"simulation": {}})
    >>> axes_of(config, {"simulation.duration_s": "10..30:3"})[0].values
    (10.0, 20.0, 30.0)
    """
    return tuple(_axis(config, key, values) for key, values in vary.items())


def _axis(config: RunConfig, key: str, values: Values) -> Axis:
    if key == "seed":
        raise ConfigError("seed cannot be varied: trial k has the seed of the configuration plus k")
    now = _parents(config, key)[-1]
    if not isinstance(values, str):
        given = tuple(_read(key, value) for value in values)
        if not given:
            raise ConfigError(f"{key}: no value is given; expected at least one")
        return Axis(key, given)
    found = _RANGE.fullmatch(values.strip())
    if found is None:
        return Axis(key, _listed(key, values))
    low, high = float(found[1]), float(found[2])
    ends_whole = re.fullmatch(r"[-+]?\d+\.\.[-+]?\d+", f"{found[1]}..{found[2]}") is not None
    whole = ends_whole and type(now) in (int, type(None))
    points, log = found[3], found[4] is not None
    if not low < high:
        raise ConfigError(f"{key}={values}: expected LOW < HIGH")
    if log and low <= 0.0:
        raise ConfigError(f"{key}={values}: a logarithm needs LOW > 0")
    axis = Axis(key, (), low, high, log, whole)
    if not points:
        if found[3] is not None and not log:
            raise ConfigError(f"{key}={values}: expected a number of values or 'log' after ':'")
        return axis
    if not 2 <= int(points) <= 100_000:
        raise ConfigError(f"{key}={values}: a grid of {points} values; expected 2 to 100000")
    grid = Axis(key, (0,), low, high, log, whole)
    steps = np.linspace(0.0, 1.0, int(points)).tolist()
    return Axis(key, tuple(dict.fromkeys(grid._between(s) for s in steps)), low, high, log, whole)


def _read(key: str, value: Any) -> Any:
    """Return a value as JSON has it; numpy numbers become plain ones."""
    value = value.item() if isinstance(value, np.generic) else _plain(value)
    try:
        return json.loads(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError):
        raise ConfigError(
            f"{key}: the value {value!r} is not allowed in a configuration; expected "
            "numbers, texts, lists or mappings"
        ) from None


def _listed(key: str, text: str) -> tuple[Any, ...]:
    try:
        given = yaml.safe_load(f"[{text}]")
    except (yaml.YAMLError, *YAML_ERRORS):
        raise ConfigError(
            f"{key}={text}: cannot be read; expected LOW..HIGH or values such as a,b,c"
        ) from None
    if not isinstance(given, list) or not given:
        raise ConfigError(f"{key}={text}: no value is given; expected LOW..HIGH or a,b,c")
    return tuple(_read(key, value) for value in given)


def as_written(config: RunConfig) -> dict[str, Any]:
    """Return a configuration as in a file, without defaults if it stays the same."""
    short: dict[str, Any] = config.model_dump(mode="json", exclude_unset=True)
    try:
        if parse_config(short) == config:
            return short
    except ConfigError:
        pass
    return config.model_dump(mode="json")


def with_values(
    config: RunConfig, data: dict[str, Any], axes: Sequence[Axis], values: Sequence[Any]
) -> RunConfig:
    """Return a configuration with other values.

    `data` is `config` `as_written`; `values` has one for each axis. Raises ConfigError, with key,
    value and what is expected, if a value is not allowed.
    """
    changed = json.loads(json.dumps(data))
    for axis, value in zip(axes, values, strict=True):
        _set(config, changed, axis.key, value)
    said = ", ".join(f"{a.key}={a.cell(v)}" for a, v in zip(axes, values, strict=True))
    return parse_config(changed, f"with {said}" if said else "config")


def _parents(config: RunConfig, key: str) -> list[Any]:
    """Return the nodes along a path, from the configuration to the value."""
    parts = key.split(".")
    found: list[Any] = [config]
    for place, part in enumerate(parts):
        node: Any = found[-1]
        where = f"{'.'.join(parts[:place])}: " if place else ""
        if isinstance(node, BaseModel):
            if part not in type(node).model_fields and place < len(parts) - 1:
                raise ConfigError(f"{key}: {where}{_unknown(part, type(node).model_fields)}")
            found.append(getattr(node, part, None))
        elif isinstance(node, dict):
            if part not in node:
                raise ConfigError(f"{key}: {where}{_unknown(part, node)}")
            found.append(node[part])
        elif isinstance(node, list | tuple):
            if not (part.isdecimal() and int(part) < len(node)):
                known = f"expected 0 to {len(node) - 1}" if node else "it is empty"
                raise ConfigError(f"{key}: {where}no place {part!r}; {known}")
            found.append(node[int(part)])
        elif node is None:
            raise ConfigError(f"{key}: {where}is not set in the configuration; set it there first")
        else:
            raise ConfigError(f"{key}: {where}is {node!r}, in which there is no {part!r}")
    return found


def _unknown(part: str, known: Any) -> str:
    if not known:
        return f"unknown key {part!r}; it is empty"
    return f"unknown key {part!r}; {nearest(part, known)}"


def _set(config: RunConfig, data: dict[str, Any], key: str, value: Any) -> None:
    """Set a value; parents that have their defaults are written out on the way."""
    parts = key.split(".")
    node: Any = data
    for part, inside in zip(parts[:-1], _parents(config, key)[1:-1], strict=True):
        place: Any = int(part) if isinstance(node, list) else part
        if isinstance(node, dict) and place not in node:
            # A part of a model leaves its other keys alone; a part of a dict or list replaces them.
            node[place] = {} if isinstance(inside, BaseModel) else _plain(inside)
        node = node[place]
    node[int(parts[-1]) if isinstance(node, list) else parts[-1]] = value


def _plain(value: Any) -> Any:
    """Return a dict or a list of a configuration as JSON has it."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list | tuple) else value
