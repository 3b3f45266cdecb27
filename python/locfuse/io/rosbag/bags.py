# SPDX-License-Identifier: Apache-2.0
"""Bags of either ROS: read as logs, and written from logs and runs."""

from __future__ import annotations

from locfuse.io.rosbag.bag_files import check_bag
from locfuse.io.rosbag.bag_reader import read_bag
from locfuse.io.rosbag.bag_stream import is_bag
from locfuse.io.rosbag.bag_writer import write_bag

__all__ = ["check_bag", "is_bag", "read_bag", "write_bag"]
