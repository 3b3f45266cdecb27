# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node: declared with type, range and meaning; others are refused."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.types import YAML_ERRORS, ConfigError, nearest

_KINDS: Mapping[type, str] = {
    str: "text",
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    dict: "keys and values, or YAML that says them",
}


@dataclass(frozen=True)
class Parameter:
    """What a node may be told: ``low`` and ``high`` bound numbers, ``choices`` texts."""

    name: str
    kind: type
    default: Any
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """What is expected, in words."""
        if self.choices:
            return " or ".join(self.choices)
        bounds = [f">= {self.low:g}"] * (self.low > -math.inf)
        bounds += [f"<= {self.high:g}"] * (self.high < math.inf)
        return " ".join([_KINDS[self.kind], *bounds])


def read_parameters(node: str, declared: Sequence[Parameter], given: object) -> dict[str, Any]:
    """Return the value of every declared parameter.

    Parameters
    ----------
    node : str
        Name of the node, for errors.
    declared : sequence of Parameter
    given : what the parameter server holds below that name

    Raises
    ------
    ConfigError
        If a parameter is not declared (names the nearest one), or has another type or range.

    Examples
    --------
    >>> rate = Parameter("rate", float, 5.0, "messages per second", low=0.1)
    >>> read_parameters("/uwb", [rate], {})
    {'rate': 5.0}
    >>> read_parameters("/uwb", [rate], {"rte": 10.0})
    Traceback (most recent call last):
    locfuse.types.ConfigError: unknown parameter /uwb/rte; did you mean 'rate'?
    """
    values = {p.name: p.default for p in declared}
    if not isinstance(given, Mapping):
        raise ConfigError(f"{node}: holds {given!r}; expected parameters")
    for name in given:
        if name not in values:
            raise ConfigError(f"unknown parameter {node}/{name}; {nearest(name, values)}")
    checked = {
        p.name: _checked(p, given[p.name], f"{node}/{p.name}") for p in declared if p.name in given
    }
    return values | checked


def _checked(parameter: Parameter, value: Any, where: str) -> Any:
    if parameter.kind is dict and isinstance(value, str):
        value = _yaml(value, where)
    if parameter.kind is float and type(value) is int:
        value = float(value)
    good = type(value) is parameter.kind
    if good and parameter.kind in (int, float):
        good = math.isfinite(value) and parameter.low <= value <= parameter.high
    if good and parameter.choices:
        good = value in parameter.choices
    if not good:
        raise ConfigError(f"parameter {where} is {value!r}; expected {parameter.allowed}")
    return value


def _yaml(text: str, where: str) -> Any:
    try:
        return yaml.safe_load(text) or {}
    except (yaml.YAMLError, *YAML_ERRORS) as error:
        raise ConfigError(f"parameter {where} is no YAML: {' '.join(str(error).split())}") from None


def configuration(path: str, overrides: Mapping[str, Any], node: str) -> RunConfig:
    """Return the configuration of a file, with some keys told otherwise.

    Parameters
    ----------
    path : str
        Of the YAML file; without one all is default.
    overrides : mapping
        Nested like the file; what it does not name stays.
    node : str
        Name of the node, for errors.

    Raises
    ------
    ConfigError
        As `locfuse.config.load.load_config`.
    """
    config = load_config(path) if path else RunConfig()
    if not overrides:
        return config
    said = config.model_dump(mode="json", exclude_unset=True)
    return parse_config(_merged(said, overrides), f"{path or 'defaults'} with {node}/overrides")


def _merged(below: Any, above: Any) -> Any:
    if not (isinstance(below, Mapping) and isinstance(above, Mapping)):
        return above
    return {**below, **{key: _merged(below.get(key), value) for key, value in above.items()}}


def base_of(path: str) -> Path:
    """Return the folder that the paths in a configuration are relative to."""
    return Path(path).resolve().parent if path else Path.cwd()


def told(declared: Sequence[Parameter]) -> str:
    """Return the declared parameters as text, one per line."""
    return "\n".join(
        f"  ~{p.name:<16} {p.meaning} ({p.allowed}; {p.default!r} unless told)" for p in declared
    )
