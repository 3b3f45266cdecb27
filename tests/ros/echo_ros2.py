# SPDX-License-Identifier: Apache-2.0
"""A node that answers odometry with a pose and does nothing else: what the middleware costs."""

from __future__ import annotations

from contextlib import suppress

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from locfuse_ros.qos import to_hear, to_tell
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Echo(Node):
    """Copies stamp and pose."""

    def __init__(self) -> None:
        super().__init__("echo")
        self._out = self.create_publisher(PoseWithCovarianceStamped, "locfuse/pose", to_tell(False))
        self.create_subscription(Odometry, "odom", self._on, to_hear(False, 100))

    def _on(self, message: Odometry) -> None:
        self._out.publish(PoseWithCovarianceStamped(header=message.header, pose=message.pose))


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Echo())
