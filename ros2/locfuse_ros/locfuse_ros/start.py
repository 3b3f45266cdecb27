# SPDX-License-Identifier: Apache-2.0
"""Start and end of a node."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.logging import get_logger
from rclpy.node import Node

from locfuse.types import ConfigError, LogError


def run(make: Callable[[], Node]) -> int:
    """Run a node until shutdown; return 1 if it cannot start, after logging why."""
    rclpy.init(args=sys.argv)
    try:
        rclpy.spin(make())
    except (ConfigError, LogError, LookupError) as error:
        get_logger("locfuse").fatal(str(error))
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0
