# SPDX-License-Identifier: Apache-2.0
"""Bags of either ROS: read as logs, and written from logs and runs."""

from __future__ import annotations

from locfuse.ros.bag_files import check_bag
from locfuse.ros.bag_reader import read_bag
from locfuse.ros.bag_writer import write_bag
from locfuse.ros.storage import is_bag

__all__ = ["check_bag", "is_bag", "read_bag", "write_bag"]
