# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node, declared with type, range and meaning; others are refused."""

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

# What every node of ROS 2 has, whoever wrote it.
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
    """Return what a node was told, and forget that it was declared so.

    The node must declare its parameters from what it is told, so that none is overlooked.
    """
    told = {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name not in OF_ROS and not name.startswith("qos_overrides.")
    }
    for name in told:
        node.undeclare_parameter(name)
    return told


def configure(node: Node) -> tuple[RunConfig, Path]:
    """Declare every key of a run's configuration; return it, and what its paths are relative to.

    Raises
    ------
    ConfigError
        If a parameter is unknown (names the nearest one) or has a value that is not allowed, or
        the file that ``config`` names is wrong.
    """
    told = given(node)
    path = told.pop("config", "")
    if not isinstance(path, str):
        raise ConfigError(f"parameters: config is {path!r}, expected the path of a YAML file")
    config = config_of(told, path or None)
    text = "path of the YAML of a run, below what other parameters say"
    declare(node, [Parameter("config", "text", path, None, None, text), *parameters(config)])
    return config, folder_of(path)


def options(node: Node, known: Sequence[Parameter]) -> dict[str, Any]:
    """Declare the parameters of a small node; return their values by name.

    Raises
    ------
    ConfigError
        As `configure`.
    """
    values = values_of(known, given(node))
    declare(node, [replace(p, value=values[p.name]) for p in known])
    return values


def declare(node: Node, known: Sequence[Parameter]) -> None:
    """Declare parameters as a node holds them: they say what is, and cannot be set on the way."""
    for parameter in known:
        descriptor = ParameterDescriptor(
            description=parameter.description,
            additional_constraints=" or ".join(parameter.choices),
            read_only=True,
            dynamic_typing=parameter.kind == "any",
        )
        _bound(descriptor, parameter)
        told = parameter.value
        if told is None and parameter.kind != "any":
            told = KINDS[parameter.kind]
        node.declare_parameter(parameter.name, told, descriptor, ignore_override=True)


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
