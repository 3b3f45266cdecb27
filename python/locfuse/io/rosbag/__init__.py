# SPDX-License-Identifier: Apache-2.0
"""ROS 1 and ROS 2 bags: a log from a bag, and a bag from a log."""
