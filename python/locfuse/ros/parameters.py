# SPDX-License-Identifier: Apache-2.0
"""A run's configuration as the flat parameters of a ROS node: names with dots, values, bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from locfuse.config.base import meaning, options
from locfuse.config.load import load_config, parse_config
from locfuse.config.schema import RunConfig
from locfuse.types import ConfigError, nearest

# A node receives its messages: it has no log to read and none to simulate.
NO_PARAMETERS = ("log", "simulation")
LARGEST_INTEGER = 2**63 - 1  # of a parameter
LARGEST = 1.7976931348623157e308
SMALLEST = 2.2250738585072014e-308
_TYPES: Mapping[str, type] = {"bool": bool, "int": int, "float": float, "text": str}
_WORDS: Mapping[str, str] = {
    "bool": "true or false",
    "int": "a whole number",
    "float": "a number",
    "text": "text",
    "texts": "texts",
    "floats": "numbers",
    "yaml": "a list",
    "any": "one of several kinds",
}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a node.

    `name` joins keys of the configuration by dots. `kind` is ``bool``, ``int``, ``float``,
    ``text``, ``texts``, ``floats``, ``any`` where several will do, or ``yaml`` for what only YAML
    in a text can hold. `value` is None where the configuration says nothing, `low` and `high`, both
    allowed, without bound; `choices`, if any, are the only texts; `description` has the unit.
    """

    name: str
    kind: str
    value: Any
    low: float | None
    high: float | None
    description: str
    choices: tuple[str, ...] = ()

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value, infinite without bound."""
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return low, high

    @property
    def expected(self) -> str:
        """What is allowed, in words."""
        if self.choices:
            return " or ".join([*self.choices, *["another value"] * (self.kind == "any")])
        low, high = self.bounds
        at_least = f" from {low:g}" if low > -LARGEST else ""
        if 0.0 < low < SMALLEST:  # the next number after 0, which itself is not allowed
            at_least = " above 0"
        at_most = f" to {high:g}" if high < LARGEST_INTEGER else ""
        return _WORDS[self.kind] + at_least + at_most


def parameters(config: RunConfig) -> list[Parameter]:
    """Return every parameter that a node has, with the values of a configuration.

    They are in the order of the configuration. Those of a part that is not there, as of ``mcl``,
    have the value None, and so have those whose value is none.

    Examples
    --------
    >>> found = {p.name: p for p in parameters(RunConfig())}
    >>> found["estimator.range.gate"].value, found["estimator.range.gate"].high
    (0.999, 1.0)
    """
    return list(_of_model(RunConfig, config, ""))


def folder_of(path: str) -> Path:
    """Return the folder that the paths in a configuration are relative to; without one this one."""
    return Path(path).resolve().parent if path else Path.cwd()


def config_of(
    given: Mapping[str, Any], path: str | Path | None = None, origin: str = "parameters"
) -> RunConfig:
    """Return the configuration that parameters make, over that of a file.

    `given` has dotted names, as in ROS 2, or is nested, as in ROS 1; an empty text stands for none.
    The log or simulation of the file at `path` is left aside; errors name `origin`. Raises
    ConfigError if a name is unknown (names the nearest), a value not allowed, or the file wrong.

    Examples
    --------
    >>> config_of({"estimator.range.gate": 0.99}).estimator.range.gate
    0.99
    >>> config_of({"estimator.hold": 0.99})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    locfuse.types.ConfigError: parameters: estimator: unknown key 'hold'; did you mean ...
    """
    nested: dict[str, Any] = {}
    if path is not None:
        written = load_config(path).model_dump(mode="json", exclude_unset=True)
        nested = {key: value for key, value in written.items() if key not in NO_PARAMETERS}
    for path_of_keys, value in _leaves(given):
        if path_of_keys[0] in NO_PARAMETERS:
            name = ".".join(path_of_keys)
            raise ConfigError(f"{origin}: {name} is not for a node, which receives its messages")
        _put(nested, path_of_keys, _plain(value), origin)
    return parse_config(nested, origin)


def values_of(
    known: Sequence[Parameter], given: Mapping[str, Any], origin: str = "parameters"
) -> dict[str, Any]:
    """Return the values of the parameters of a small node by name.

    The `known` are of kinds ``bool``, ``int``, ``float`` and ``text``; their values hold where
    nothing is given. `origin` is named in errors. Raises ConfigError if a parameter is unknown
    (names the nearest one), or of another type or range.

    Examples
    --------
    >>> rate = Parameter("rate_hz", "float", 5.0, 0.1, 100.0, "messages per second")
    >>> values_of([rate], {"rate_hz": 7})
    {'rate_hz': 7.0}
    >>> values_of([rate], {"rte_hz": 7})
    Traceback (most recent call last):
    locfuse.types.ConfigError: parameters: unknown 'rte_hz'; did you mean 'rate_hz'?
    """
    values = {p.name: p.value for p in known}
    for name in given:
        if name not in values:
            raise ConfigError(f"{origin}: unknown {name!r}; {nearest(name, values)}")
    checked = {p.name: _checked(p, given[p.name], origin) for p in known if p.name in given}
    return values | checked


def _checked(parameter: Parameter, value: Any, origin: str) -> Any:
    if parameter.kind == "float" and type(value) is int:
        value = float(value)
    low, high = parameter.bounds
    good = type(value) is _TYPES[parameter.kind]
    if good and parameter.kind in ("int", "float"):
        good = math.isfinite(value) and low <= value <= high
    if good and parameter.choices:
        good = value in parameter.choices
    if not good:
        raise ConfigError(f"{origin}: {parameter.name} is {value!r}, expected {parameter.expected}")
    return value


def _leaves(
    given: Mapping[str, Any], parents: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the keys that lead to each value; only a name at the top may hold dots."""
    for name in sorted(given):
        path = (*parents, name) if parents else tuple(name.split("."))
        value = given[name]
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, path)
        else:
            yield path, value


def _put(nested: dict[str, Any], path: Sequence[str], value: Any, origin: str) -> None:
    *parents, last = path
    name = ".".join(path)
    model: Any = RunConfig
    for key in parents:
        below = nested.get(key)
        if below is None:
            below = nested[key] = {}
        if not isinstance(below, dict):
            raise ConfigError(f"{origin}: {name} is below {key}, which is {below!r}; set one")
        nested, model = below, _inside(model, key)
    field = getattr(model, "model_fields", {}).get(last)
    if field is not None and value == "" and NoneType in options(field.annotation):
        value = None
    if field is not None and isinstance(value, str) and _kind(field) == "yaml":
        try:
            value = yaml.safe_load(value)
        except yaml.YAMLError as error:
            what = getattr(error, "problem", None) or "it cannot be read"
            raise ConfigError(f"{origin}: {name}: is no YAML ({what})") from None
    if value == {} and isinstance(nested.get(last), dict):
        return
    nested[last] = value


def _plain(value: Any) -> Any:
    """Return arrays, of whatever kind a client library has them, as lists."""
    if isinstance(value, bool | int | float | str | Mapping) or value is None:
        return value
    return [item.item() if hasattr(item, "item") else item for item in value]


def _inside(model: Any, key: str) -> Any:
    field = getattr(model, "model_fields", {}).get(key)
    if field is None:
        return None
    return next((o for o in options(field.annotation) if _is_model(o)), None)


def _of_model(model: type[BaseModel], value: Any, prefix: str) -> Iterator[Parameter]:
    for key, field in model.model_fields.items():
        if not prefix and key in NO_PARAMETERS:
            continue
        inner = None if value is None else getattr(value, key)
        part = next((o for o in options(field.annotation) if _is_model(o)), None)
        if part is not None:
            yield from _of_model(part, inner, f"{prefix}{key}.")
        elif _mapping(field) is not None:
            yield from _of_mapping(model, key, field, inner or {}, prefix)
        else:
            yield _of_field(model, key, field, inner, prefix)


def _of_mapping(
    model: type[BaseModel], key: str, field: FieldInfo, value: Mapping[str, Any], prefix: str
) -> Iterator[Parameter]:
    """Yield the parameters of a mapping by name: as many as the configuration names."""
    _, inside = get_args(_mapping(field))
    for name, item in value.items():
        if _is_model(inside):
            yield from _of_model(inside, item, f"{prefix}{key}.{name}.")
        else:
            kind = {bool: "bool", int: "int", float: "float"}.get(type(item), "text")
            yield Parameter(
                f"{prefix}{key}.{name}", kind, item, None, None, _description(model, key)
            )


def _of_field(
    model: type[BaseModel], key: str, field: FieldInfo, value: Any, prefix: str
) -> Parameter:
    kind = _kind(field)
    low, high = _bounds(field, integer=kind == "int")
    if isinstance(value, tuple | list):
        value = list(value)
    if kind == "yaml" and value is not None:
        plain = [item.model_dump(mode="json") for item in value]
        value = yaml.safe_dump(plain, default_flow_style=True).strip()
    if kind == "int" and value is not None and value > LARGEST_INTEGER:
        raise ConfigError(f"{prefix}{key} is {value}; a parameter holds up to {LARGEST_INTEGER}")
    choices = tuple(c for o in options(field.annotation) if get_origin(o) is Literal
                    for c in get_args(o))  # fmt: skip
    return Parameter(prefix + key, kind, value, low, high, _description(model, key), choices)


def _description(model: type[BaseModel], key: str) -> str:
    text, unit = meaning(model, key)
    return f"{text} [{unit}]" if unit else text


def _is_model(option: Any) -> bool:
    return isinstance(option, type) and issubclass(option, BaseModel)


def _mapping(field: FieldInfo) -> Any:
    """Return the type of a mapping, None for anything else."""
    return next((o for o in options(field.annotation) if get_origin(o) is dict), None)


def _kind(field: FieldInfo) -> str:
    found = [o for o in options(field.annotation) if o is not NoneType]
    if len(found) != 1:
        return "any"
    (option,) = found
    if get_origin(option) is Literal:
        return "text"
    if get_origin(option) is dict:
        return "yaml"
    if get_origin(option) in (list, tuple):
        item = options(get_args(option)[0])[0]
        if _is_model(item):
            return "yaml"
        return "floats" if item is float else "texts"
    return {bool: "bool", int: "int", float: "float", str: "text"}[option]


def _bounds(field: FieldInfo, *, integer: bool) -> tuple[float | None, float | None]:
    """Return the least and the largest value; what is open in the schema ends just inside."""
    low: float | None = None
    high: float | None = None
    for bound in _constraints(field.annotation, field.metadata):
        if isinstance(bound, annotated_types.Ge):
            low = _number(bound.ge)
        elif isinstance(bound, annotated_types.Gt):
            low = _number(bound.gt) + 1 if integer else math.nextafter(_number(bound.gt), math.inf)
        elif isinstance(bound, annotated_types.Le):
            high = _number(bound.le)
        elif isinstance(bound, annotated_types.Lt):
            high = _number(bound.lt) - 1 if integer else math.nextafter(_number(bound.lt), 0.0)
    if integer and (low is not None or high is not None):
        low = max(-LARGEST_INTEGER, low if low is not None else -LARGEST_INTEGER)
        high = min(LARGEST_INTEGER, high if high is not None else LARGEST_INTEGER)
    elif low is not None or high is not None:
        low, high = (-LARGEST if low is None else low), (LARGEST if high is None else high)
    return low, high


def _number(bound: Any) -> float:
    return bound  # type: ignore[no-any-return]


def _constraints(annotation: Any, metadata: Any) -> Iterator[Any]:
    """Yield the bounds of a number, however deep unions and aliases hide them."""
    for item in metadata:
        if isinstance(item, FieldInfo):
            yield from item.metadata
        else:
            yield item
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        yield from _constraints(inner, more)
    elif get_origin(annotation) in (Union, UnionType):
        for member in get_args(annotation):
            yield from _constraints(member, ())
