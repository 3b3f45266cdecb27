# SPDX-License-Identifier: Apache-2.0
"""How every node begins and ends."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rospy

from locfuse.types import ConfigError, LogError
from locfuse_ros.parameters import Parameter, read_parameters, told


def run_node(
    name: str, declared: Sequence[Parameter], work: Callable[[Mapping[str, Any]], object]
) -> int:
    """Start a node and do its work with the values of its parameters.

    Returns
    -------
    int
        Exit status: 1 if it could not start, having said why in a sentence.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        print(f"{name} of locfuse_ros\nParameters:\n{told(declared)}")
        return 0
    rospy.init_node(name)
    try:
        work(read_parameters(rospy.get_name(), declared, rospy.get_param("~", {})))
    except (ConfigError, LogError) as error:
        rospy.logfatal(str(error))
        return 1
    return 0
