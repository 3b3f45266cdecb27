# SPDX-License-Identifier: Apache-2.0
"""From YAML text to a checked configuration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from locfuse.config.safe_yaml import StrictYamlLoader
from locfuse.config.schema import RunConfig
from locfuse.types import YAML_ERRORS, ConfigError, nearest, shown, words

MAX_SENTENCES = 20


class _Loader(StrictYamlLoader):
    """Safe YAML that refuses a key given twice, where the first would be lost in silence."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        given = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in given:
                    self.refuse(f"key {shown(key.value)} is given twice", key)
                given.add(key.value)
        return node


class YamlError(ConfigError):
    """A text is not valid YAML; `line`, counted from 1, is where, if that is known."""

    def __init__(self, text: str, line: int | None) -> None:
        super().__init__(text)
        self.line = line


def load_config(path: str | Path) -> RunConfig:
    """Read a run's configuration.

    Parameters
    ----------
    path : path of a YAML file

    Raises
    ------
    ConfigError
        If the file cannot be read, is not a YAML mapping, or a key or value is not allowed. The
        text names the key, the value and what is expected.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})"
        ) from None
    return parse_config(read_yaml(text, str(path)), str(path))


def read_yaml(text: str, origin: str = "config") -> Any:
    """Parse a YAML text; `origin` is named in errors.

    Raises YamlError where the text is not valid YAML, gives a key twice, or is empty.
    """
    try:
        data = yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        where = origin if line is None else f"{origin}, line {line}"
        what = getattr(error, "problem", None) or words(error)
        raise YamlError(f"{where}: is not valid YAML ({what})", line) from None
    except YAML_ERRORS as error:
        raise YamlError(f"{origin}: is not valid YAML ({error})", None) from None
    if data is None:
        raise YamlError(f"{origin}: is empty; expected at least 'log' or 'simulation'", None)
    return data


def parse_config(data: Any, origin: str = "config") -> RunConfig:
    """Check parsed YAML against the schema.

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
    >>> parse_config({"estimator": {"hold": 0.99}})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    locfuse.types.ConfigError: config: estimator: unknown key 'hold'; did you mean ...
    """
    if not isinstance(data, dict):
        raise ConfigError(f"{origin}: holds {type(data).__name__}; expected keys and values")
    try:
        return RunConfig.model_validate(data)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        sentences = [_sentence(origin, e) for e in errors[:MAX_SENTENCES]]
        if len(errors) > MAX_SENTENCES:
            sentences.append(f"and {len(errors) - MAX_SENTENCES} more")
        raise ConfigError("; ".join(sentences)) from None


_UNION_TAGS = ("folder", "dataset", "literal['truth']")


def _sentence(origin: str, error: Any) -> str:
    parts = [str(part) for part in error["loc"]]
    if parts[:1] == ["log"]:
        parts = ["log", *(part for part in parts[1:] if part not in _UNION_TAGS)]
    where = ": ".join([origin, ".".join(parts)]) if parts else origin
    got = error["input"]
    is_shown = got is None or isinstance(got, str | int | float | list)
    value = f" (got {'nothing' if got is None else shown(got)})" if is_shown else ""
    return f"{where}: {expected(error)}{value}"


# By pydantic's kind of an error; the rest keep its text, or have ours below.
_EXPECTED = {
    **dict.fromkeys(("model_type", "dict_type", "model_attributes_type"),
                    "expected keys and values"),
    **dict.fromkeys(("list_type", "tuple_type"), "expected a list"),
    **dict.fromkeys(("int_type", "int_parsing", "int_parsing_size", "int_from_float"),
                    "expected a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "expected a number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "expected true or false"),
    **dict.fromkeys(("string_type", "path_type"), "expected a text"),
    "finite_number": "expected a finite number",
    "greater_than": "expected a number greater than {gt:g}",
    "greater_than_equal": "expected at least {ge:g}",
    "less_than": "expected a number less than {lt:g}",
    "less_than_equal": "expected at most {le:g}",
    "too_short": "expected at least {min_length}",
    "string_too_short": "expected a text",
    "missing": "is missing",
}  # fmt: skip


def expected(error: Any) -> str:
    """Return what an error of pydantic expected, in the words of a configuration."""
    kind, context = error["type"], error.get("ctx", {})
    if kind in _EXPECTED:
        return _EXPECTED[kind].format(**context)
    if kind == "too_long":
        most = "" if context["field_type"] == "Tuple" else "at most "
        return (
            f"expected {most}{context['max_length']} values, there are {context['actual_length']}"
        )
    if kind == "literal_error":
        got = error["input"]
        name = got if isinstance(got, str) else shown(got)
        return nearest(name, re.findall(r"'([^']*)'", context["expected"]))
    if kind == "union_tag_invalid":
        valid = re.findall(r"'([^']*)'", context["expected_tags"])
        what = f"unknown {context['discriminator'].strip(chr(39))} {shown(context['tag'])}"
        return f"{what}; {nearest(context['tag'], valid)}"
    return str(error["msg"]).removeprefix("Value error, ")
