# SPDX-License-Identifier: Apache-2.0
"""Declaration of node parameters with type, range and description; others are rejected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from locfuse.config.schema import RunConfig
from locfuse.ros.parameters import Parameter, config_of, folder_of, parameters, values_of
from locfuse.types import ConfigError

# Parameters that every ROS 2 node has.
OF_ROS = ("use_sim_time", "start_type_description_service")
KINDS = {
    "bool": RosParameter.Type.BOOL,
    "int": RosParameter.Type.INTEGER,
    "float": RosParameter.Type.DOUBLE,
    "text": RosParameter.Type.STRING,
    "yaml": RosParameter.Type.STRING,
    "texts": RosParameter.Type.STRING_ARRAY,
    "floats": RosParameter.Type.DOUBLE_ARRAY,
}


def given(node: Node) -> dict[str, Any]:
    """Return the parameter overrides of a node and undeclare them.

    The node must be created with `automatically_declare_parameters_from_overrides`, so that none
    is missed.
    """
    overrides = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name not in OF_ROS and not name.startswith("qos_overrides.")
    }
    for name in overrides:
        node.undeclare_parameter(name)
    return overrides


def configure(node: Node) -> tuple[RunConfig, Path]:
    """Declare every key of a run's configuration; return it and the base of its paths.

    Raises
    ------
    ConfigError
        If a parameter is unknown (names the nearest one), a value is not allowed, or the file
        ``config`` is not valid.
    """
    overrides = given(node)
    path = overrides.pop("config", "")
    if not isinstance(path, str):
        raise ConfigError(f"parameters: config is {path!r}, expected the path of a YAML file")
    config = config_of(overrides, path or None)
    text = "path of the YAML of a run; other parameters override it"
    declare(node, [Parameter("config", "text", path, None, None, text), *parameters(config)])
    return config, folder_of(path)


def options(node: Node, known: Sequence[Parameter]) -> dict[str, Any]:
    """Declare the given parameters of a node; return their values by name.

    Raises
    ------
    ConfigError
        As `configure`.
    """
    values = values_of(known, given(node))
    declare(node, [replace(p, value=values[p.name]) for p in known])
    return values


def declare(node: Node, known: Sequence[Parameter]) -> None:
    """Declare parameters as read-only with their current values."""
    for parameter in known:
        descriptor = ParameterDescriptor(
            description=parameter.description,
            additional_constraints=" or ".join(parameter.choices),
            read_only=True,
            dynamic_typing=parameter.kind == "any",
        )
        _bound(descriptor, parameter)
        default = parameter.value
        if default is None and parameter.kind != "any":
            default = KINDS[parameter.kind]
        node.declare_parameter(parameter.name, default, descriptor, ignore_override=True)


def _bound(descriptor: ParameterDescriptor, parameter: Parameter) -> None:
    low, high = parameter.low, parameter.high
    if low is None or high is None:
        return
    if parameter.kind == "int":
        bounds = IntegerRange(from_value=int(low), to_value=int(high), step=0)
        descriptor.integer_range = [bounds]
    elif parameter.kind == "float":
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
        ]
