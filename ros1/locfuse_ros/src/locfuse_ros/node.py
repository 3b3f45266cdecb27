# SPDX-License-Identifier: Apache-2.0
"""Start and end of a node."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rospy

from locfuse.ros.parameters import Parameter
from locfuse.types import ConfigError, LogError


def run_node(
    name: str, declared: Sequence[Parameter], work: Callable[[Mapping[str, Any]], object]
) -> int:
    """Start a node and run its work with the given parameters.

    Returns
    -------
    int
        Exit status: 1 if it could not start, after logging why.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        print(f"{name} of locfuse_ros\nParameters:\n{parameters_text(declared)}")
        return 0
    rospy.init_node(name)
    try:
        work(given())
    except (ConfigError, LogError) as error:
        rospy.logfatal(str(error))
        return 1
    return 0


def given() -> Mapping[str, Any]:
    """Return the parameters of the node from the parameter server.

    Raises
    ------
    ConfigError
        If the name of the node is itself a value.
    """
    held = rospy.get_param("~", {})
    if not isinstance(held, Mapping):
        raise ConfigError(f"{rospy.get_name()} holds {held!r}; expected parameters below it")
    return held


def parameters_text(declared: Sequence[Parameter]) -> str:
    """Return the declared parameters as text, one per line."""
    names = [f"~{p.name.replace('.', '/')}" for p in declared]
    width = max(map(len, names))
    return "\n".join(
        f"  {name:<{width}}  {p.description} ({p.expected}; {_value(p)})"
        for name, p in zip(names, declared, strict=True)
    )


def _value(parameter: Parameter) -> str:
    return "no default" if parameter.value is None else f"default {parameter.value!r}"
