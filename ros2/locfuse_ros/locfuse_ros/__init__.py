# SPDX-License-Identifier: Apache-2.0
"""Nodes of locfuse for ROS 2; code independent of ROS 2 is in the package locfuse."""
