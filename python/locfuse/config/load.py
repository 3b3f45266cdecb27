# SPDX-License-Identifier: Apache-2.0
"""From YAML text to a checked configuration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from locfuse.config.schema import RunConfig
from locfuse.types import YAML_ERRORS, ConfigError, nearest


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses a key given twice, where the first would be lost in silence."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [key.value for key, _ in node.value]
        for key, _ in node.value:
            if keys.count(key.value) > 1:
                problem = f"key {key.value!r} is given twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
        return super().construct_mapping(node, deep)


def load_config(path: str | Path) -> RunConfig:
    """Read a run's configuration.

    Parameters
    ----------
    path : path of a YAML file

    Raises
    ------
    ConfigError
        If the file cannot be read, is no YAML mapping, or a key or value is not allowed: names the
        key, the value and what is expected.
    """
    path = Path(path)
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})"
        ) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}, line {mark.line + 1}" if mark is not None else f"{path}"
        what = getattr(error, "problem", None) or " ".join(str(error).split())
        raise ConfigError(f"{where}: is no YAML ({what})") from None
    except YAML_ERRORS as error:
        raise ConfigError(f"{path}: is no YAML ({error})") from None
    if data is None:
        raise ConfigError(f"{path}: is empty; expected at least 'log' or 'simulation'")
    return parse_config(data, str(path))


def parse_config(data: Any, origin: str = "config") -> RunConfig:
    """Check what YAML said.

    Parameters
    ----------
    data : what a YAML file holds
    origin : str
        Named in errors.

    Raises
    ------
    ConfigError
        As `load_config`.

    Examples
    --------
    >>> parse_config({"estimator": {"gate_rnge": 0.99}})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    locfuse.types.ConfigError: config: estimator: unknown key 'gate_rnge'; did you mean ...
    """
    if not isinstance(data, dict):
        raise ConfigError(f"{origin}: holds {type(data).__name__}; expected keys and values")
    try:
        return RunConfig.model_validate(data)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        raise ConfigError("; ".join(_sentence(origin, e) for e in errors)) from None


_UNION_TAGS = ("folder", "dataset", "literal['truth']")


def _sentence(origin: str, error: Any) -> str:
    parts = [str(part) for part in error["loc"]]
    if parts[:1] == ["log"]:
        parts = ["log", *(part for part in parts[1:] if part not in _UNION_TAGS)]
    where = ": ".join([origin, ".".join(parts)]) if parts else origin
    got = error["input"]
    shown = got is None or isinstance(got, str | int | float | list)
    if isinstance(got, int) and got.bit_length() > 1024:  # of so many digits there may be no text
        shown = False
    value = f" (got {'nothing' if got is None else repr(got)})" if shown else ""
    return f"{where}: {_expected(error)}{value}"


def _expected(error: Any) -> str:
    """Return what was expected, in the words of a configuration."""
    kind, context = error["type"], error.get("ctx", {})
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return "expected keys and values"
    if kind == "list_type":
        return "expected a list"
    if kind == "too_short":
        return f"expected at least {context['min_length']}"
    if kind == "literal_error":
        return nearest(str(error["input"]), re.findall(r"'([^']*)'", context["expected"]))
    if kind == "union_tag_invalid":
        valid = re.findall(r"'([^']*)'", context["expected_tags"])
        return f"unknown {context['discriminator'].strip(chr(39))} {context['tag']!r}; " + nearest(
            context["tag"], valid
        )
    return str(error["msg"]).removeprefix("Value error, ")
