# SPDX-License-Identifier: Apache-2.0
"""A node that answers odometry with a pose, to measure the latency of the middleware."""

from __future__ import annotations

from contextlib import suppress

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from locfuse_ros.qos import publisher_qos, subscriber_qos
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Echo(Node):
    """Copies stamp and pose of odometry."""

    def __init__(self) -> None:
        super().__init__("echo")
        self._out = self.create_publisher(
            PoseWithCovarianceStamped, "locfuse/pose", publisher_qos(False)
        )
        self.create_subscription(Odometry, "odom", self._on, subscriber_qos(False, 100))

    def _on(self, message: Odometry) -> None:
        self._out.publish(PoseWithCovarianceStamped(header=message.header, pose=message.pose))


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Echo())
